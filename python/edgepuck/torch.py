"""A PointNet to train in PyTorch, and its export to `infer-cpu`. Only this module imports PyTorch."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from . import _edgepuck


class PointNet(nn.Module):
    """PointNet without T-Nets (Qi et al., CVPR 2017), for clouds of shape [batch, n, 3].

    The names of layers are those of yanx27's `pointnet_cls`, which `edgepuck import-weights` reads.

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


def export(
    model: PointNet,
    path: str | os.PathLike[str],
    *,
    classes: Sequence[str],
    sampler: str = "fps",
    points: int = 64,
    training_set: str | None = None,
) -> None:
    """Write a model file for `edgepuck.Classifier` and `infer-cpu`.

    Args:
        model: The network.
        path: The file, `.safetensors`.
        classes: The names of the classes in the order of the logits.
        sampler: The sampler of points: all, random, fps, voxel or cpl.
        points: The number of points that the sampler chooses.
        training_set: The name of the training set.

    Raises:
        Error: The file cannot be written, or the numbers of classes and logits differ.
    """
    with tempfile.TemporaryDirectory() as folder:
        checkpoint, names = Path(folder, "model.pth"), Path(folder, "classes.txt")
        state = {name: value.cpu() for name, value in model.state_dict().items()}
        torch.save({"model_state_dict": state}, checkpoint)
        names.write_text("\n".join(classes) + "\n")
        words = ["import-weights", checkpoint, f"--out={os.fspath(path)}", f"--classes={names}"]
        words += [f"--sampler={sampler}", f"--points={points}", "--provenance=edgepuck.torch.export"]
        words += [f"--training-set={training_set}"] if training_set else []
        _edgepuck.run(["edgepuck", *map(str, words)])
