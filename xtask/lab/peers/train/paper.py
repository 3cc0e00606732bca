"""PyTorch training networks of `cargo xtask reproduce` on a GPU, by the same
recipe: yanx27's `pointnet_cls`, 200 epochs, batches of 24, Adam at 0.001.

paper.py CLOUDS SCANS OUT NAME...

CLOUDS is a folder with ModelNet40's train.npz, SCANS is `reproduce`'s folder
`data`, and OUT its folder `models`, in which `reproduce` uses the networks that it
finds. A NAME is that of a network behind random or farthest points, such as
random-64, farthest-48 or on-static-packed-static-clean. The networks of a call are
trained side by side, each on its own clouds, all of ModelNet40 or all of scans; the
largest count of points must be a multiple of each other one.

Unlike Edgepuck's training: matrix products use TF32, layers before a norm have no
bias, and the epoch is chosen among 200 looks at the held tenth for scans, too, where
a small set of scans has more epochs. For validation, too, farthest points are those
of a random half or more of the cloud.
"""

import json
import re
import sys
import time
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save_file
from torch.nn import functional

BATCH, EPOCHS, VALIDATION, SEED = 24, 200, 0.1, 0
# `mesh_points` and `mesh_steps` of assets/reproduce/paper.toml.
SCANNED_POINTS, SCANNED_STEPS = 128, 18000
RATE, EVERY, FACTOR, DECAY = 1e-3, 20, 0.7, 1e-4
DROP, SCALE, SHIFT, DROPOUT, ORTHOGONALITY = 0.875, (0.8, 1.25), 0.1, 0.4, 0.001
DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")


def texts(values):
    return [v.decode() if isinstance(v, bytes) else str(v) for v in values]


class Data:
    """The clouds of a network in the unit sphere: those to learn from, and a held tenth."""

    def __init__(self, path):
        file = np.load(path)
        is_short = "points_i16" in file
        points = file["points_i16"] / np.float32(32767) if is_short else file["points"]
        points = points - points.mean(1, keepdims=True, dtype=np.float64).astype(np.float32)
        self.points = points / np.linalg.norm(points, axis=2).max(1)[:, None, None]
        self.labels, self.classes = file["labels"], texts(file["classes"])
        self.learnt, self.held = self.split(texts(file["names"]))

    def split(self, names):
        """All views of a mesh are on the same side; each class gives its share."""
        draws = np.random.default_rng(SEED)
        held = np.zeros(len(names), bool)
        bare = np.array([re.sub(r"_v\d+$", "", name) for name in names])
        for label in range(len(self.classes)):
            meshes = draws.permutation(np.unique(bare[self.labels == label]))
            chosen = meshes[: round(len(meshes) * VALIDATION)]
            held |= (self.labels == label) & np.isin(bare, chosen)
        return np.flatnonzero(~held), np.flatnonzero(held)


class Member:
    """One of the networks that are trained side by side."""

    def __init__(self, name, clouds, scans):
        self.name = name
        kind, rest = name.split("-", 1)
        kinds = ("random", "farthest", "on")
        assert kind in kinds, f"{name}: expected random-N, farthest-N or on-SET"
        self.sampler = "fps" if kind == "farthest" else "random"
        self.is_scanned = kind == "on"
        if self.is_scanned:
            files = {"-".join(p.relative_to(scans).parts): p for p in scans.glob("**/*-train.npz")}
            path, self.n = files[f"{rest}-train.npz"], SCANNED_POINTS
        else:
            path, self.n = clouds / "train.npz", int(rest)
        self.path = path


def orders(members, data, first, steps):
    """The clouds of each step, `[steps, K, BATCH]`: epoch after epoch."""
    columns = []
    for k, member in enumerate(members):
        draws = np.random.default_rng((SEED, k + 1))
        learnt = data[member.path].learnt + first[member.path]
        whole = len(learnt) // BATCH * BATCH
        epochs = -(-steps * BATCH // whole)
        stream = np.concatenate([draws.permutation(learnt)[:whole] for _ in range(epochs)])
        columns.append(stream[: steps * BATCH].reshape(steps, 1, BATCH))
    return torch.from_numpy(np.concatenate(columns, 1))


def shapes(n_classes):
    """The linear layers by name: inputs, outputs, and the name of their norm."""
    layers = {}
    for prefix, side in (("feat.stn", 3), ("feat.fstn", 64)):
        widths = (side, 64, 128, 1024)
        for i in (1, 2, 3):
            layers[f"{prefix}.conv{i}"] = (widths[i - 1], widths[i], f"{prefix}.bn{i}")
        layers[f"{prefix}.fc1"] = (1024, 512, f"{prefix}.bn4")
        layers[f"{prefix}.fc2"] = (512, 256, f"{prefix}.bn5")
        layers[f"{prefix}.fc3"] = (256, side * side, None)
    for i, pair in enumerate(((3, 64), (64, 128), (128, 1024)), 1):
        layers[f"feat.conv{i}"] = (*pair, f"feat.bn{i}")
    layers |= {"fc1": (1024, 512, "bn1"), "fc2": (512, 256, "bn2"), "fc3": (256, n_classes, None)}
    return layers


class Nets:
    """K networks, whose values lie as `[K, channels, rows]`."""

    def __init__(self, k, n_classes):
        self.k, self.p, self.running = k, {}, {}
        for name, (inputs, outputs, norm) in shapes(n_classes).items():
            limit = inputs**-0.5
            draw = lambda *shape: torch.empty(k, *shape, device=DEVICE).uniform_(-limit, limit)
            self.p[f"{name}.weight"] = draw(outputs, inputs)
            # A norm removes the bias, unless dropout lies between: its gradient is
            # rounding, which Adam would scale up.
            if norm is None or name == "fc2":
                self.p[f"{name}.bias"] = draw(outputs, 1)
            if norm is not None:
                self.p[f"{norm}.weight"] = torch.ones(k * outputs, device=DEVICE)
                self.p[f"{norm}.bias"] = torch.zeros(k * outputs, device=DEVICE)
                self.running[f"{norm}.running_mean"] = torch.zeros(k * outputs, device=DEVICE)
                self.running[f"{norm}.running_var"] = torch.ones(k * outputs, device=DEVICE)
        for value in self.p.values():
            value.requires_grad_()

    def linear(self, x, key):
        bias = self.p.get(f"{key}.bias")
        weight = self.p[f"{key}.weight"]
        return torch.bmm(weight, x) if bias is None else torch.baddbmm(bias, weight, x)

    def norm(self, x, key, training):
        flat = x.reshape(1, -1, x.shape[2])
        y = functional.batch_norm(
            flat, self.running[f"{key}.running_mean"], self.running[f"{key}.running_var"],
            self.p[f"{key}.weight"], self.p[f"{key}.bias"], training=training,
        )
        return y.view(x.shape)

    def hidden(self, x, linear, norm, training):
        return functional.relu(self.norm(self.linear(x, linear), norm, training))

    def pooled(self, x, clouds):
        return x.view(self.k, -1, clouds, x.shape[2] // clouds).amax(3)

    def t_net(self, x, key, side, clouds, training):
        for i in (1, 2, 3):
            x = self.hidden(x, f"{key}.conv{i}", f"{key}.bn{i}", training)
        x = self.pooled(x, clouds)
        for i in (1, 2):
            x = self.hidden(x, f"{key}.fc{i}", f"{key}.bn{i + 3}", training)
        x = self.linear(x, f"{key}.fc3").transpose(1, 2).reshape(self.k * clouds, side, side)
        return x + torch.eye(side, device=DEVICE)

    def turned(self, x, turn, clouds):
        k, side, rows = x.shape
        x = x.view(k, side, clouds, rows // clouds)
        x = x.permute(0, 2, 1, 3).reshape(k * clouds, side, -1)
        x = torch.bmm(turn.transpose(1, 2), x)
        return x.view(k, clouds, side, -1).permute(0, 2, 1, 3).reshape(k, side, rows)

    def logits(self, x, clouds, training):
        """Of `x` `[K, 3, clouds * points]`: `[K, clouds, classes]`, and the feature transforms."""
        x = self.turned(x, self.t_net(x, "feat.stn", 3, clouds, training), clouds)
        x = self.hidden(x, "feat.conv1", "feat.bn1", training)
        turn = self.t_net(x, "feat.fstn", 64, clouds, training)
        x = self.turned(x, turn, clouds)
        x = self.hidden(x, "feat.conv2", "feat.bn2", training)
        x = self.norm(self.linear(x, "feat.conv3"), "feat.bn3", training)
        x = self.hidden(self.pooled(x, clouds), "fc1", "bn1", training)
        x = functional.dropout(self.linear(x, "fc2"), DROPOUT, training)
        x = functional.relu(self.norm(x, "bn2", training))
        return self.linear(x, "fc3").transpose(1, 2), turn

    def loss(self, x, labels):
        """The sum of the networks' losses, whose gradients do not mix."""
        logits, turn = self.logits(x, labels.shape[1], True)
        costs = functional.cross_entropy(logits.flatten(0, 1), labels.flatten(), reduction="none")
        error = torch.bmm(turn, turn.transpose(1, 2)) - torch.eye(64, device=DEVICE)
        norms = torch.linalg.norm(error, dim=(1, 2))
        return (costs.sum() + ORTHOGONALITY * norms.sum()) / labels.shape[1]

    def member(self, k):
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


def farthest(points, is_drawn, n):
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

    def __init__(self, members):
        self.members, self.n = members, max(m.n for m in members)
        # Fewer points are repeated, which changes neither a maximum nor the mean and
        # the variance of a batch; the running variance changes by at most 0.3 %.
        assert all(self.n % m.n == 0 for m in members), "expected points that divide the most"
        self.repeat = torch.stack([torch.arange(self.n) % m.n for m in members]).to(DEVICE)

    def draw(self, clouds):
        k, b, p, _ = clouds.shape
        order = torch.rand(k, b, p, device=DEVICE).argsort(2)
        mixed = clouds.gather(2, order[..., None].expand(-1, -1, -1, 3))
        some = mixed[:, :, : self.n].clone()
        for i, member in enumerate(self.members):
            if member.sampler == "fps":
                most = torch.empty(b, 1, device=DEVICE).uniform_(0.5 * p, p).floor()
                places = farthest(mixed[i], torch.arange(p, device=DEVICE) < most, member.n)
                some[i, :, : member.n] = mixed[i].gather(1, places[..., None].expand(-1, -1, 3))
        return some.gather(2, self.repeat[:, None, :, None].expand(-1, b, -1, 3))

    def augmented(self, points):
        k, b, n, _ = points.shape
        chance = DROP * torch.rand(k, b, 1, device=DEVICE)
        drawn = torch.rand(k, b, n, device=DEVICE)
        drawn = drawn.gather(2, self.repeat[:, None].expand(-1, b, -1))
        points = torch.where((drawn > chance)[..., None], points, points[:, :, :1])
        scale = torch.empty(k, b, 1, 1, device=DEVICE).uniform_(*SCALE)
        return points * scale + torch.empty(k, b, 1, 3, device=DEVICE).uniform_(-SHIFT, SHIFT)


class Training:
    def __init__(self, members):
        self.members, k = members, len(members)
        self.data = {m.path: Data(m.path) for m in members}
        first, at = {}, 0
        for path, own in self.data.items():
            first[path], at = at, at + len(own.points)
        whole = [d.points for d in self.data.values()]
        self.points = torch.from_numpy(np.concatenate(whole)).float().to(DEVICE)
        labels = np.concatenate([d.labels for d in self.data.values()])
        self.labels = torch.from_numpy(labels.astype(np.int64)).to(DEVICE)
        self.classes = next(iter(self.data.values())).classes
        same = all(d.classes == self.classes for d in self.data.values())
        assert same, "expected the same classes"
        self.held = [torch.from_numpy(self.data[m.path].held + first[m.path]) for m in members]
        is_scanned = members[0].is_scanned
        assert all(m.is_scanned == is_scanned for m in members), "expected scans alone, or none"
        learnt = len(self.data[members[0].path].learnt)
        # `mesh_steps` also counts the held tenth.
        self.per_epoch = SCANNED_STEPS // EPOCHS * 9 // 10 if is_scanned else learnt // BATCH
        self.orders = orders(members, self.data, first, self.per_epoch * EPOCHS)
        torch.manual_seed(SEED)
        self.sampler, self.nets = Sampler(members), Nets(k, len(self.classes))
        self.rate = torch.tensor(RATE, device=DEVICE)
        self.adam = torch.optim.Adam(
            self.nets.p.values(), lr=self.rate, weight_decay=DECAY,
            capturable=DEVICE.type == "cuda", fused=DEVICE.type == "cuda",
        )
        self.chosen = torch.zeros(k, BATCH, dtype=torch.long, device=DEVICE)
        self.total = torch.zeros((), device=DEVICE)
        self.best, self.tensors = [-1.0] * k, [None] * k

    def rows(self, points):
        k, b, n, _ = points.shape
        return points.reshape(k, b * n, 3).transpose(1, 2).contiguous()

    def step(self):
        points = self.sampler.augmented(self.sampler.draw(self.points[self.chosen]))
        loss = self.nets.loss(self.rows(points), self.labels[self.chosen])
        loss.backward()
        self.adam.step()
        self.adam.zero_grad(set_to_none=False)
        self.total += loss.detach()

    def captured(self):
        """A step as a CUDA graph, after three steps whose effect is undone."""
        if DEVICE.type != "cuda":
            return self.step
        values = [*self.nets.p.values(), *self.nets.running.values(), self.total]
        before = [v.detach().clone() for v in values]
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                self.step()
        torch.cuda.current_stream().wait_stream(side)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self.step()
        with torch.no_grad():
            for value, old in zip(values, before):
                value.copy_(old)
            for state in self.adam.state.values():
                for value in state.values():
                    value.zero_()
        return graph.replay

    @torch.no_grad()
    def validate(self):
        """The accuracy of each network on its own clouds, points chosen anew."""
        right = np.zeros(len(self.members))
        most = max(len(h) for h in self.held)
        size = 4 * BATCH
        for at in range(0, most, size):
            own = [h[torch.arange(at, at + size) % len(h)] for h in self.held]
            chosen = torch.stack(own).to(DEVICE)
            points = self.sampler.draw(self.points[chosen])
            found = self.nets.logits(self.rows(points), size, False)[0].argmax(2)
            hits = (found == self.labels[chosen]).cpu().numpy()
            for k, held in enumerate(self.held):
                right[k] += hits[k, : max(0, min(size, len(held) - at))].sum()
        return [r / len(h) for r, h in zip(right, self.held)]

    def run(self):
        begun, step = time.time(), self.captured()
        for epoch in range(EPOCHS):
            self.rate.fill_(RATE * FACTOR ** ((epoch + 1) // EVERY))
            order = self.orders[epoch * self.per_epoch : (epoch + 1) * self.per_epoch].to(DEVICE)
            self.total.zero_()
            for i in range(self.per_epoch):
                self.chosen.copy_(order[i])
                step()
            shares = self.validate()
            for k, share in enumerate(shares):
                if share > self.best[k]:
                    self.best[k], self.tensors[k] = share, self.nets.member(k)
            if epoch % 10 == 9 or epoch == 0:
                loss = float(self.total) / self.per_epoch / len(self.members)
                found = " ".join(f"{m.name} {s:.2%}" for m, s in zip(self.members, shares))
                at = f"epoch {epoch + 1}: {time.time() - begun:.0f} s, loss {loss:.4f}"
                print(f"{at}; validation {found}", flush=True)

    def write(self, out):
        for member, tensors, best in zip(self.members, self.tensors, self.best):
            card = {
                "classes": json.dumps(self.classes), "normalization": "unit-sphere",
                "points": str(member.n),
                "sampler": member.sampler, "pooled": "linear", "trained": "true",
                "training_set": member.name,
                "provenance": f"PyTorch {torch.__version__}, seed {SEED}, validation {best:.2%}",
            }
            begun = out / f"{member.name}.begun"
            save_file(tensors, begun, card)
            begun.rename(out / f"{member.name}.safetensors")


def main():
    clouds, scans, out = map(Path, sys.argv[1:4])
    out.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[4:]:
        there = [p for p in (out / f"{name}.safetensors", out / f"{name}.run") if p.exists()]
        if there:
            sys.exit(f"error: {there[0]} exists already: choose another OUT")
    torch.backends.cuda.matmul.allow_tf32 = True
    # Its batch norm is not made for one cloud of many channels.
    torch.backends.cudnn.enabled = False
    training = Training([Member(name, clouds, scans) for name in sys.argv[4:]])
    training.run()
    training.write(out)


main()
