"""Trains networks of reproduce.py: yanx27's `pointnet_cls` with both T-Nets, by the recipe of its plan.

A name is that of a network behind random or farthest points, such as random-64, farthest-48 or
on-static-packed-static-clean. The networks of a call are trained side by side, each on its own clouds, all of
ModelNet40 or all of scans; the largest count of points must be a multiple of each other one.

Unlike Edgepuck's training, which has no T-Nets: matrix products use TF32, layers before a norm have no bias, and the
epoch is chosen among as many looks at the held clouds as the recipe has epochs for scans, too, where a small set of
scans has more epochs.
For validation, too, farthest points are those of a random half or more of the cloud.
"""

import json
import time
from pathlib import Path

import clouds as packed
import numpy as np
import torch
from clouds import uniform, varied
from pointnet_cls import PointNet, norm_of, sizes
from recipe import Plan, Recipe, read_plan
from safetensors.torch import save_file
from steps import DEVICE, Steps
from torch import Tensor
from torch.nn import functional

# The weight of how far the features' matrix is from orthogonal, that of the baseline.
ORTHOGONALITY = 0.001


class Member:
    """One of the networks that are trained side by side."""

    def __init__(self, name: str, clouds: Path, scans: Path, plan: Plan) -> None:
        self.name = name
        kind, _, rest = name.partition("-")
        if kind not in ("random", "farthest", "on"):
            raise SystemExit(f"{name}: expected random-N, farthest-N or on-SET")
        self.sampler = "fps" if kind == "farthest" else "random"
        self.is_scanned = kind == "on"
        if self.is_scanned:
            files = {"-".join(p.relative_to(scans).parts): p for p in scans.glob("**/*-train.npz")}
            if f"{rest}-train.npz" not in files:
                raise SystemExit(f"{name}: expected one of the sets in {scans}: {', '.join(sorted(files))}")
            self.path, self.n = files[f"{rest}-train.npz"], plan.mesh_points
        else:
            self.path, self.n = clouds / "train.npz", int(rest)


class Networks(PointNet):
    """K networks, whose values lie as `[K, channels, clouds * points]`."""

    def __init__(self, k: int, n_classes: int, dropout: float) -> None:
        self.k, self.dropout, self.p, self.running = k, dropout, {}, {}
        for name, (inputs, outputs) in sizes(n_classes).items():
            limit, norm = inputs**-0.5, norm_of(name)
            self.p[f"{name}.weight"] = uniform((k, outputs, inputs), -limit, limit, DEVICE)
            # A norm removes the bias, unless dropout lies between: its gradient is rounding, which Adam would scale up.
            if norm is None or name == "fc2":
                self.p[f"{name}.bias"] = uniform((k, outputs, 1), -limit, limit, DEVICE)
            if norm is not None:
                self.p[f"{norm}.weight"] = torch.ones(k * outputs, device=DEVICE)
                self.p[f"{norm}.bias"] = torch.zeros(k * outputs, device=DEVICE)
                self.running[f"{norm}.running_mean"] = torch.zeros(k * outputs, device=DEVICE)
                self.running[f"{norm}.running_var"] = torch.ones(k * outputs, device=DEVICE)
        for value in self.p.values():
            value.requires_grad_()

    def run(self, points: Tensor, training: bool) -> tuple[Tensor, Tensor]:
        """The logits of `[K, B, N, 3]`, `[K, B, classes]`, and the matrices of the features."""
        k, self.n_clouds, n, _ = points.shape
        self.training = training
        rows = points.reshape(k, self.n_clouds * n, 3).transpose(1, 2).contiguous()
        logits, matrix = self.logits(rows)
        return logits.transpose(1, 2), matrix

    def linear(self, layer: str, x: Tensor) -> Tensor:
        bias, weight = self.p.get(f"{layer}.bias"), self.p[f"{layer}.weight"]
        x = torch.bmm(weight, x) if bias is None else torch.baddbmm(bias, weight, x)
        return functional.dropout(x, self.dropout, self.training) if layer == "fc2" else x

    def norm(self, name: str, x: Tensor) -> Tensor:
        running = (self.running[f"{name}.running_{part}"] for part in ("mean", "var"))
        learnt = (self.p[f"{name}.{part}"] for part in ("weight", "bias"))
        flat = x.reshape(1, -1, x.shape[2])
        return functional.batch_norm(flat, *running, *learnt, training=self.training).view(x.shape)

    def relu(self, x: Tensor) -> Tensor:
        return functional.relu(x)

    def pooled(self, x: Tensor, name: str) -> Tensor:
        return x.view(self.k, -1, self.n_clouds, x.shape[2] // self.n_clouds).amax(3)

    def matrix(self, x: Tensor, side: int, key: str) -> Tensor:
        x = x.transpose(1, 2).reshape(self.k * self.n_clouds, side, side)
        return x + torch.eye(side, device=DEVICE)

    def turned(self, x: Tensor, matrix: Tensor, side: int, name: str) -> Tensor:
        k, n_clouds, rows = self.k, self.n_clouds, x.shape[2]
        x = x.view(k, side, n_clouds, rows // n_clouds)
        x = x.permute(0, 2, 1, 3).reshape(k * n_clouds, side, -1)
        x = torch.bmm(matrix.transpose(1, 2), x)
        return x.view(k, n_clouds, side, -1).permute(0, 2, 1, 3).reshape(k, side, rows)

    def member(self, k: int) -> dict[str, Tensor]:
        """The tensors of network `k` as yanx27 names them."""
        tensors = {}
        for name, value in (self.p | self.running).items():
            own = value.detach()[k] if value.dim() > 1 else value.detach().view(self.k, -1)[k]
            own = own.flatten() if name.endswith("bias") else own
            tensors[name] = own.to("cpu", torch.float32).contiguous().clone()
        for name, value in list(tensors.items()):
            layer, part = name.rsplit(".", 1)
            if part == "weight" and value.dim() == 2 and f"{layer}.bias" not in tensors:
                tensors[f"{layer}.bias"] = torch.zeros(value.shape[0])
        return tensors


def farthest(points: Tensor, is_drawn: Tensor, n: int) -> Tensor:
    """The places of `n` farthest points of each `[P, 3]` among those drawn, the first first."""
    least = torch.where(is_drawn, torch.inf, -1.0)
    pick = torch.zeros(len(points), 1, dtype=torch.long, device=DEVICE)
    picks = [pick]
    for _ in range(n - 1):
        centre = points.gather(1, pick[..., None].expand(-1, -1, 3))
        least = torch.minimum(least, ((points - centre) ** 2).sum(2))
        pick = least.argmax(1, keepdim=True)
        picks.append(pick)
    return torch.cat(picks, 1)


class Sampler:
    """Chooses the points of K batches of clouds: `[K, B, P, 3]` -> `[K, B, N, 3]`."""

    def __init__(self, members: list[Member]) -> None:
        self.members, self.n = members, max(member.n for member in members)
        # Fewer points are repeated, which changes neither a maximum nor the mean and
        # the variance of a batch; the running variance changes by at most 0.3 %.
        if any(self.n % member.n for member in members):
            raise SystemExit(f"expected counts of points that divide {self.n}")
        self.repeat = torch.stack([torch.arange(self.n) % member.n for member in members]).to(DEVICE)

    def draw(self, clouds: Tensor) -> Tensor:
        k, b, p, _ = clouds.shape
        order = torch.rand(k, b, p, device=DEVICE).argsort(2)
        mixed = clouds.gather(2, order[..., None].expand(-1, -1, -1, 3))
        some = mixed[:, :, : self.n].clone()
        for i, member in enumerate(self.members):
            if member.sampler == "fps":
                most = uniform((b, 1), 0.5 * p, p, DEVICE).floor()
                places = farthest(mixed[i], torch.arange(p, device=DEVICE) < most, member.n)
                some[i, :, : member.n] = mixed[i].gather(1, places[..., None].expand(-1, -1, 3))
        return some.gather(2, self.repeat[:, None, :, None].expand(-1, b, -1, 3))

    def dropped(self, points: Tensor, drop: float) -> Tensor:
        k, b, n, _ = points.shape
        chance = drop * torch.rand(k, b, 1, device=DEVICE)
        drawn = torch.rand(k, b, n, device=DEVICE)
        drawn = drawn.gather(2, self.repeat[:, None].expand(-1, b, -1))
        return torch.where((drawn > chance)[..., None], points, points[:, :, :1])


class Training:
    """Networks that are trained side by side."""

    def __init__(self, members: list[Member], plan: Plan) -> None:
        self.members, self.recipe, k = members, plan.recipe, len(members)
        sets = {member.path: packed.read(member.path) for member in members}
        self.classes = sets[members[0].path].classes
        if any(own.classes != self.classes for own in sets.values()):
            raise SystemExit("expected the same classes in all sets")
        is_scanned = members[0].is_scanned
        if any(member.is_scanned != is_scanned for member in members):
            raise SystemExit("expected scans alone, or none")
        learnt, held, at = {}, {}, 0
        for path, own in sets.items():
            is_held = packed.held_meshes(own, self.recipe.validation, self.recipe.seed)
            learnt[path], held[path] = (np.flatnonzero(one) + at for one in (~is_held, is_held))
            at += len(own.points)
        self.points, self.labels = (
            torch.from_numpy(np.concatenate([getattr(own, name) for own in sets.values()])).to(DEVICE)
            for name in ("points", "labels")
        )
        self.held = [torch.from_numpy(held[member.path]) for member in members]
        # `mesh_steps` also counts the held clouds.
        self.per_epoch = len(learnt[members[0].path]) // self.recipe.batch
        if is_scanned:
            self.per_epoch = plan.mesh_steps // self.recipe.epochs * 9 // 10
        self.orders = orders([learnt[member.path] for member in members], self.recipe, self.per_epoch)
        torch.manual_seed(self.recipe.seed)
        self.sampler, self.nets = Sampler(members), Networks(k, len(self.classes), self.recipe.dropout)
        self.total = torch.zeros((), device=DEVICE)
        parameters, batch = self.nets.p.values(), (k, self.recipe.batch)
        self.steps = Steps(parameters, self.recipe, self.per_epoch, batch, self.loss, self.add)
        self.steps.capture([*parameters, *self.nets.running.values(), self.total])
        self.best, self.tensors = [-1.0] * k, [None] * k

    def loss(self, chosen: Tensor) -> Tensor:
        """The sum of the networks' losses, whose gradients do not mix."""
        recipe = self.recipe
        points = self.sampler.dropped(self.sampler.draw(self.points[chosen]), recipe.augment.drop)
        logits, matrix = self.nets.run(varied(points, recipe.augment), True)
        logits, labels, smoothing = logits.flatten(0, 1), self.labels[chosen].flatten(), recipe.label_smoothing
        costs = functional.cross_entropy(logits, labels, reduction="none", label_smoothing=smoothing)
        error = torch.bmm(matrix, matrix.transpose(1, 2)) - torch.eye(64, device=DEVICE)
        norms = torch.linalg.norm(error, dim=(1, 2))
        return (costs.sum() + ORTHOGONALITY * norms.sum()) / recipe.batch

    def add(self, loss: Tensor) -> None:
        self.total += loss

    @torch.no_grad()
    def validate(self) -> list[float]:
        """The accuracy of each network on its own clouds, points chosen anew."""
        right = np.zeros(len(self.members))
        most = max(len(held) for held in self.held)
        size = 4 * self.recipe.batch
        for at in range(0, most, size):
            own = [held[torch.arange(at, at + size) % len(held)] for held in self.held]
            chosen = torch.stack(own).to(DEVICE)
            found = self.nets.run(self.sampler.draw(self.points[chosen]), False)[0].argmax(2)
            hits = (found == self.labels[chosen]).cpu().numpy()
            for k, held in enumerate(self.held):
                right[k] += hits[k, : max(0, min(size, len(held) - at))].sum()
        return [r / len(held) for r, held in zip(right, self.held, strict=True)]

    def run(self) -> None:
        begun, n = time.time(), self.per_epoch
        for epoch in range(self.recipe.epochs):
            self.total.zero_()
            self.steps.epoch(epoch, self.orders[epoch * n : (epoch + 1) * n].to(DEVICE))
            shares = self.validate()
            for k, share in enumerate(shares):
                if share > self.best[k]:
                    self.best[k], self.tensors[k] = share, self.nets.member(k)
            if epoch % 10 == 9 or epoch == 0:
                loss = float(self.total) / n / len(self.members)
                found = " ".join(f"{m.name} {s:.2%}" for m, s in zip(self.members, shares, strict=True))
                at = f"epoch {epoch + 1}: {time.time() - begun:.0f} s, loss {loss:.4f}"
                print(f"{at}; validation {found}", flush=True)

    def write(self, out: Path) -> None:
        for member, tensors, best in zip(self.members, self.tensors, self.best, strict=True):
            card = {
                "classes": json.dumps(self.classes), "normalization": "unit-sphere",
                "points": str(member.n),
                "sampler": member.sampler, "pooled": "linear", "trained": "true",
                "training_set": member.name,
                "provenance": f"PyTorch {torch.__version__}, seed {self.recipe.seed}, validation {best:.2%}",
            }
            begun = out / f"{member.name}.begun"
            save_file(tensors, begun, card)
            begun.rename(out / f"{member.name}.safetensors")


def orders(learnt: list[np.ndarray], recipe: Recipe, per_epoch: int) -> Tensor:
    """The clouds of each step, `[steps, K, batch]`: epoch after epoch of each network's own."""
    columns, batch, steps = [], recipe.batch, per_epoch * recipe.epochs
    for k, own in enumerate(learnt):
        draws = np.random.default_rng((recipe.seed, k + 1))
        whole = len(own) // batch * batch
        epochs = -(-steps * batch // whole)
        stream = np.concatenate([draws.permutation(own)[:whole] for _ in range(epochs)])
        columns.append(stream[: steps * batch].reshape(steps, 1, batch))
    return torch.from_numpy(np.concatenate(columns, 1))


def train(clouds: Path, scans: Path, out: Path, names: list[str], path: Path) -> None:
    """Trains the networks called `names` by the plan at `path`, and writes their model files into `out`."""
    plan = read_plan(path)
    if plan.recipe.average > 0 or plan.recipe.augment.cut_mix > 0:
        raise SystemExit(f"{path}: average, cut_mix: expected 0, because these networks are trained without them")
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        there = [p for p in (out / f"{name}.safetensors", out / f"{name}.run") if p.exists()]
        if there:
            raise SystemExit(f"error: {there[0]} exists already: choose another OUT")
    # Its batch norm is not made for one cloud of many channels.
    torch.backends.cudnn.enabled = False
    training = Training([Member(name, clouds, scans, plan) for name in names], plan)
    training.run()
    training.write(out)
