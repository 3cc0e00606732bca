"""Networks to train in PyTorch, and model files of their weights and of other checkpoints."""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from . import _arguments, _checkpoint, _model_file


class PointNet(nn.Module):
    """PointNet without T-Nets (Qi et al., CVPR 2017), for clouds of shape [batch, n, 3].

    The names of layers are those of yanx27's `pointnet_cls`, which `import_weights` reads.

    Args:
        n_classes: The number of classes.
        widths: The widths of the layers that all points share. The last layer is max-pooled.
        head: The widths of the dense layers between the pooling and the logits.
        dropout: The probability of dropout after the last hidden layer.
    """

    def __init__(
        self,
        n_classes: int,
        widths: Sequence[int] = (64, 64, 128, 256, 1024),
        head: tuple[int, int] = (512, 256),
        dropout: float = 0.4,
    ) -> None:
        super().__init__()
        self.feat = nn.Module()
        self.n_layers = len(widths)
        for i, (inputs, outputs) in enumerate(zip((3, *widths), widths, strict=False), 1):
            self.feat.add_module(f"conv{i}", nn.Conv1d(inputs, outputs, 1))
            self.feat.add_module(f"bn{i}", nn.BatchNorm1d(outputs))
        self.fc1, self.bn1 = nn.Linear(widths[-1], head[0]), nn.BatchNorm1d(head[0])
        self.fc2, self.bn2 = nn.Linear(head[0], head[1]), nn.BatchNorm1d(head[1])
        self.fc3 = nn.Linear(head[1], n_classes)
        self.dropout = nn.Dropout(dropout)

    def forward(self, clouds: Tensor) -> Tensor:
        """The logits, [batch, n_classes], of `clouds`, [batch, n, 3]."""
        x = clouds.transpose(1, 2)
        for i in range(1, self.n_layers + 1):
            x = self.feat.get_submodule(f"bn{i}")(self.feat.get_submodule(f"conv{i}")(x))
            x = torch.relu(x) if i < self.n_layers else torch.amax(x, 2)
        x = torch.relu(self.bn1(self.fc1(x)))
        x = torch.relu(self.bn2(self.dropout(self.fc2(x))))
        logits: Tensor = self.fc3(x)
        return logits


class SetNetwork(nn.Module):
    """A network of separable set abstractions (Qian et al. 2021, "ASSANet"), for clouds of shape [batch, n, 3].

    Layers that all points share come first. Each level then takes the maximum over the neighborhood of each of its
    centres, which are farthest points, and applies more shared layers to it. The maximum and the mean over the last
    level's centres go to dense layers. Names and arithmetic are those of infer-cpu.

    Args:
        n_classes: The number of classes.
        widths: The widths of the layers before the first level.
        levels: The number of centres, the radius, and the widths of the layers of each level.
        head: The widths of the hidden dense layers.
        dropout: The probability of dropout in the last hidden layer.

    A cloud needs as many different points as the first level has centres: repeated centres would count twice in the
    mean. `farthest` and `winners` may be replaced by kernels with the same results.

    Raises:
        ValueError: A level has more centres than the one before it.
    """

    def __init__(
        self,
        n_classes: int,
        widths: Sequence[int] = (64, 128),
        levels: Sequence[tuple[int, float, Sequence[int]]] = ((256, 0.2, (256, 256)), (64, 0.4, (512, 512, 1024))),
        head: Sequence[int] = (256,),
        dropout: float = 0.4,
    ) -> None:
        super().__init__()
        if any(fewer[0] > more[0] for more, fewer in zip(levels, levels[1:], strict=False)):
            raise ValueError(f"expected no more centres than in the level before, found {[n for n, _, _ in levels]}")
        self.levels, self.dropout = tuple(levels), dropout
        self.farthest, self.winners = farthest, winners
        self.feat = _shared(3, widths)
        width = widths[-1]
        for number, (_, _, after) in enumerate(levels, 1):
            level = _shared(width, after, first=2)
            level.add_module("conv1", nn.Linear(4, width))
            level.add_module("bn1", nn.BatchNorm1d(width))
            with torch.no_grad():
                level.conv1.weight[:, 0] = 1.0
            self.add_module(f"sa{number}", level)
            width = after[-1]
        dense = (2 * width, *head, n_classes)
        self.n_dense = len(dense) - 1
        for i, (inputs, outputs) in enumerate(zip(dense, dense[1:], strict=False), 1):
            self.add_module(f"fc{i}", nn.Linear(inputs, outputs))
            if i < self.n_dense:
                self.add_module(f"bn{i}", nn.BatchNorm1d(outputs))

    def forward(self, clouds: Tensor) -> Tensor:
        """The logits, [batch, n_classes], of `clouds`, [batch, n, 3]."""
        points, features = clouds, _apply(self.feat, clouds)
        # The first of farthest points are farthest points of fewer: each level's centres begin the last one's.
        chosen = _rows(clouds, self.farthest(clouds, self.levels[0][0]))
        for number, (n_centres, radius, _) in enumerate(self.levels, 1):
            level = self.get_submodule(f"sa{number}")
            centres = chosen[:, :n_centres]
            features = _apply(level, self._pooled(level, features, points, centres, radius), first=2)
            points = centres
        x = torch.cat([torch.amax(features, 1), torch.mean(features, 1)], 1)
        for i in range(1, self.n_dense):
            x = self.get_submodule(f"fc{i}")(x)
            if i + 1 == self.n_dense:
                x = nn.functional.dropout(x, self.dropout, self.training)
            x = torch.relu(self.get_submodule(f"bn{i}")(x))
        logits: Tensor = self.get_submodule(f"fc{self.n_dense}")(x)
        return logits

    def _pooled(self, level: nn.Module, u: Tensor, points: Tensor, centres: Tensor, radius: float) -> Tensor:
        """relu(norm(max over the neighbors q of each centre p of (a u_q + v (q - p) / radius + b)))."""
        linear, norm = level.get_submodule("conv1"), level.get_submodule("bn1")
        with torch.no_grad():
            # A norm of negative scale turns the order round: its largest output is of the smallest input.
            weight = torch.where(norm.weight < 0, -1.0, 1.0)[:, None] * linear.weight
            winner = self.winners(u, points, centres, weight, radius)
        batch, n, channels = winner.shape
        where = winner.reshape(batch, n * channels)
        offset = (_rows(points, where).reshape(batch, n, channels, 3) - centres[:, :, None]) / radius
        z = linear.weight[:, 0] * u.gather(1, winner) + (offset * linear.weight[:, 1:]).sum(3) + linear.bias
        pooled: Tensor = torch.relu(norm(z.reshape(batch * n, channels))).reshape(batch, n, channels)
        return pooled


def farthest(points: Tensor, n: int) -> Tensor:
    """The indices, [batch, n], of farthest points of `points`, [batch, m, 3]: first the one farthest from the mean."""
    every = torch.arange(len(points), device=points.device)
    pick = (points - points.mean(1, keepdim=True)).square().sum(2).argmax(1)
    picked, nearest = [pick], torch.full(points.shape[:2], torch.inf, device=points.device)
    for _ in range(n - 1):
        nearest = torch.minimum(nearest, (points - points[every, pick][:, None]).square().sum(2))
        pick = nearest.argmax(1)
        picked.append(pick)
    return torch.stack(picked, 1)


def winners(u: Tensor, points: Tensor, centres: Tensor, weight: Tensor, radius: float) -> Tensor:
    """For each centre p and channel c, the point q within `radius` whose a_c u_qc + v_c q / radius is largest.

    Args:
        u: The features of the points, [batch, m, channels].
        points: Their coordinates, [batch, m, 3].
        centres: The coordinates of the centres, [batch, n, 3].
        weight: a and v of each channel, [channels, 4].
        radius: The radius of the neighborhoods.

    Returns:
        The indices of the points, [batch, n, channels].
    """
    products = weight[:, 0] * u + points @ weight[:, 1:].T / radius
    is_far = torch.cdist(centres, points, compute_mode="donot_use_mm_for_euclid_dist") > radius
    # One cloud at a time: [n, m, channels] is large.
    found = [torch.where(far[:, :, None], -torch.inf, own).argmax(1) for far, own in zip(is_far, products, strict=False)]
    return torch.stack(found)


def _shared(inputs: int, widths: Sequence[int], first: int = 1) -> nn.Module:
    """The layers `conv{i}` and `bn{i}` of these `widths`, numbered from `first`."""
    layers = nn.Module()
    for i, outputs in enumerate(widths, first):
        layers.add_module(f"conv{i}", nn.Linear(inputs, outputs))
        layers.add_module(f"bn{i}", nn.BatchNorm1d(outputs))
        inputs = outputs
    return layers


def _apply(layers: nn.Module, x: Tensor, first: int = 1) -> Tensor:
    """The layers from number `first` on, applied to `x`, [batch, n, channels], each followed by a ReLU."""
    rows = x.reshape(-1, x.shape[2])
    for i in range(first, len(layers._modules) // 2 + 1):
        rows = torch.relu(layers.get_submodule(f"bn{i}")(layers.get_submodule(f"conv{i}")(rows)))
    return rows.reshape(x.shape[0], x.shape[1], -1)


def _rows(x: Tensor, indices: Tensor) -> Tensor:
    """The rows `indices`, [batch, n], of `x`, [batch, m, channels]."""
    return x.gather(1, indices[:, :, None].expand(-1, -1, x.shape[2]))


def export(
    model: PointNet | SetNetwork,
    path: str | os.PathLike[str],
    *,
    classes: Sequence[str],
    sampler: str | None = None,
    points: int | None = None,
    training_set: str | None = None,
    calibrate: str | os.PathLike[str] | None = None,
    half: bool = False,
) -> None:
    """Write a model file for `edgepuck.Classifier` and `infer-cpu`. An existing file is replaced.

    Args:
        model: The network, also one that `torch.compile` or `DataParallel` wraps.
        path: The file, `.safetensors`.
        classes: The names of the classes in the order of the logits, all different.
        sampler: The sampler of points: all, random, fps or cpl. The default is fps, or random for a
            `SetNetwork`, which chooses its own farthest points.
        points: The number of points that the sampler chooses. The default is 64, or 1,024 for a `SetNetwork`.
        training_set: The name of the training set.
        calibrate: A packed NPZ file of clouds that the network was trained on, to measure the ranges that int8 needs.
        half: Fold the batch norms into the layers before them, and write f16: half the size, about the same answers.

    Raises:
        Error: The file cannot be written, its name has another extension, the numbers of classes and logits
            differ, or a value is out of its limits.
    """
    _arguments.check_extension(path, ".safetensors")
    network = _unwrapped(model)
    state = _folded(network) if half else {name: value.float() for name, value in network.state_dict().items()}
    state = _checkpoint.unwrapped(state)
    tensors = {name: value.cpu().numpy() for name, value in state.items() if not name.endswith("num_batches_tracked")}
    _model_file.check_classes(classes, tensors)
    is_sets = isinstance(network, SetNetwork)
    points = (1024 if is_sets else 64) if points is None else _arguments.whole("points", points, 1, 2**32)
    sampler = ("random" if is_sets else "fps") if sampler is None else sampler
    card = {"classes": json.dumps(list(classes)), "sampler": sampler, "points": str(points)}
    card["provenance"] = "edgepuck.torch.export"
    if training_set is not None:
        card["training_set"] = training_set
    if isinstance(network, SetNetwork):
        card["abstractions"] = json.dumps([(n, radius) for n, radius, _ in network.levels])
    _model_file.write(path, tensors, card, calibrate=calibrate, source="model")


def import_weights(
    checkpoint: str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    classes: Sequence[str] | None = None,
    sampler: str | None = None,
    points: int | None = None,
    layers: Mapping[str, str] | None = None,
    card: Mapping[str, str] | None = None,
    calibrate: str | os.PathLike[str] | None = None,
) -> None:
    """Write a model file of the weights in a PyTorch checkpoint. An existing file is replaced.

    The layers have the names of the repositories yanx27 (`pointnet_cls`), fxia22 or 3dcertify, or those that `layers`
    states. The weights may be in `state_dict` or `model_state_dict` beside an optimiser's, of a network in
    `DataParallel` or of `torch.compile`, and in f16, bf16, f32 or f64. If all are in f16, so are the model's. No code of the checkpoint is
    executed.

    Args:
        checkpoint: A file that `torch.save` wrote, in the format of zip archives or that before PyTorch 1.6.
        path: The model file, `.safetensors`.
        classes: The names of the classes in the order of the logits. The default is ModelNet40's for 40 logits.
        sampler: The sampler in training: all, random, fps or cpl. The default is the repository's.
        points: The number of points that the sampler chose. The default is the repository's.
        layers: Our name of each layer by its name in the checkpoint, such as `{"encoder.{i}": "feat.conv{i}"}`, where
            `{i}` is any number. Trunks are named `feat.conv1`, `feat.bn1`, ..., T-Nets `feat.stn.conv1` and
            `feat.fstn.conv1`, and heads `fc1`, `bn1`, ....
        card: More of what the model file says of the network, by its keys: `normalization` (unit-sphere or none),
            `pooled` (relu if a ReLU precedes the pooling, or linear), `fps_start` (first or farthest), `training_set`,
            `accuracy`, `provenance` and others. The default provenance is the checkpoint's name and SHA-256.
        calibrate: A packed NPZ file of clouds that the network was trained on, to measure the ranges that int8 needs.

    Raises:
        Error: The checkpoint cannot be read, has other layers, or makes no network; a value is out of its limits; or
            the file cannot be written.
    """
    _arguments.check_extension(path, ".safetensors")
    read = _checkpoint.read(checkpoint)
    names, theirs = read.named(layers)
    tensors = {name: tensor.numpy() for name, tensor in read.values(theirs).items()}
    stated = dict(names.card)
    if sampler is not None and sampler != stated.get("sampler"):
        stated = {key: value for key, value in stated.items() if key not in ("points", "fps_start")}
        stated["sampler"] = sampler
    if points is not None:
        stated["points"] = str(_arguments.whole("points", points, 1, 2**32))
    if classes is not None:
        _model_file.check_classes(classes, tensors)
    elif len(names.classes) == _model_file.n_logits(tensors):
        classes = names.classes
    else:
        n = _model_file.n_logits(tensors)
        warnings.warn(f"{read.path}: {n} classes without names: the argument classes names them", stacklevel=2)
    if classes is not None:
        stated["classes"] = json.dumps(list(classes), ensure_ascii=False)
    if read.accuracy is not None:
        stated["accuracy"] = read.accuracy
    digest = hashlib.sha256(Path(checkpoint).read_bytes()).hexdigest()
    stated["provenance"] = f"{Path(checkpoint).name}, SHA-256 {digest}"
    stated |= card or {}
    _model_file.write(path, tensors, stated, calibrate=calibrate, source=read.path, their_names=theirs)


def _unwrapped(model: nn.Module) -> nn.Module:
    """The network that `torch.compile` or `torch.nn.DataParallel` wraps."""
    while True:
        inner = getattr(model, "_orig_mod", None) or (isinstance(model, nn.DataParallel) and model.module)
        if not isinstance(inner, nn.Module):
            return model
        model = inner


def _folded(model: nn.Module) -> dict[str, Tensor]:
    """The weights in f16, with batch norms folded into the layers of the same number before them."""
    layers, folded = {name.replace("_orig_mod.", ""): layer for name, layer in model.named_modules()}, {}
    for name, layer in layers.items():
        if not isinstance(layer, nn.Linear | nn.Conv1d):
            continue
        norm = layers.get(re.sub(r"(conv|fc)(\d+)$", r"bn\2", name))
        weight, bias = layer.weight.detach().double(), layer.bias.detach().double()
        if isinstance(norm, nn.BatchNorm1d):
            scale = norm.weight.detach().double() / torch.sqrt(norm.running_var.double() + norm.eps)
            weight = weight * scale.reshape(-1, *[1] * (weight.ndim - 1))
            bias = (bias - norm.running_mean.double()) * scale + norm.bias.detach().double()
        folded[f"{name}.weight"], folded[f"{name}.bias"] = weight.half().cpu(), bias.half().cpu()
    return folded
