"""Makes tiny.safetensors, plain.safetensors and their logits by PyTorch.

    pip install torch numpy safetensors && python make.py

PointNet as yanx27/Pointnet_Pointnet2_pytorch defines `pointnet_cls`, under its
key names, narrow and with random weights: `tiny` with both T-Nets, `plain`
without them, one layer more and a ReLU before the pooling.
"""

import torch
from safetensors.torch import save_file
from torch import nn

SIZES = [1, 2, 3, 5, 7, 8, 12, 13, 16, 17, 31, 47, 48, 49, 64, 100, 128, 129, 255]
SIZES += [511, 1000, 1024, 1055, 1056, 1057, 2048, 3001, 4095, 4096]


def cloud(n):
    """Points by rule, every coordinate exact in f32: [1, 3, n]."""
    i = torch.arange(n)
    axis = lambda a, b, m: ((i * a + b) % m).float() / (m / 2) - 1
    return torch.stack([axis(73, 11, 1024), axis(149, 5, 2048), axis(331, 77, 512)])[None]


class Mlp(nn.Module):
    """Layers conv1... and bn1...; the last without ReLU if `linear`."""

    def __init__(self, widths, linear=False):
        super().__init__()
        self.linear = linear
        self.n = len(widths) - 1
        for i in range(self.n):
            self.add_module(f"conv{i + 1}", nn.Conv1d(widths[i], widths[i + 1], 1))
            self.add_module(f"bn{i + 1}", nn.BatchNorm1d(widths[i + 1]))

    def layer(self, i, x):
        x = getattr(self, f"bn{i}")(getattr(self, f"conv{i}")(x))
        return x if self.linear and i == self.n else torch.relu(x)


class TNet(Mlp):
    def __init__(self, k, widths, hidden):
        super().__init__([k] + widths)
        self.k, self.hidden = k, len(hidden)
        sizes = [widths[-1]] + hidden + [k * k]
        for i in range(len(sizes) - 1):
            self.add_module(f"fc{i + 1}", nn.Linear(sizes[i], sizes[i + 1]))
            if i < self.hidden:
                self.add_module(f"bn{self.n + i + 1}", nn.BatchNorm1d(sizes[i + 1]))

    def forward(self, x):
        for i in range(1, self.n + 1):
            x = self.layer(i, x)
        x = x.max(2).values
        for i in range(1, self.hidden + 1):
            x = torch.relu(getattr(self, f"bn{self.n + i}")(getattr(self, f"fc{i}")(x)))
        x = getattr(self, f"fc{self.hidden + 1}")(x)
        return x.view(-1, self.k, self.k) + torch.eye(self.k)


class Features(Mlp):
    def __init__(self, widths, t_nets, linear):
        super().__init__(widths, linear)
        if t_nets:
            self.stn = TNet(3, [8, 16, 24], [20, 12])
            self.fstn = TNet(widths[1], [16, 16, 32], [24, 16])
        self.t_nets = t_nets

    def forward(self, x):
        if self.t_nets:
            x = (x.transpose(2, 1) @ self.stn(x)).transpose(2, 1)
        x = self.layer(1, x)
        if self.t_nets:
            x = (x.transpose(2, 1) @ self.fstn(x)).transpose(2, 1)
        for i in range(2, self.n + 1):
            x = self.layer(i, x)
        return x.max(2).values


class PointNet(nn.Module):
    def __init__(self, widths, head, t_nets, linear):
        super().__init__()
        self.feat = Features(widths, t_nets, linear)
        self.n = len(head)
        sizes = [widths[-1]] + head
        for i in range(self.n):
            self.add_module(f"fc{i + 1}", nn.Linear(sizes[i], sizes[i + 1]))
            if i + 1 < self.n:
                self.add_module(f"bn{i + 1}", nn.BatchNorm1d(sizes[i + 1]))

    def forward(self, x):
        x = self.feat(x)
        for i in range(1, self.n):
            x = torch.relu(getattr(self, f"bn{i}")(getattr(self, f"fc{i}")(x)))
        return getattr(self, f"fc{self.n}")(x)


def randomise(model):
    """Batch norms that do something, weights of a trained network's size."""
    for module in model.modules():
        if isinstance(module, nn.BatchNorm1d):
            module.running_mean.normal_(0, 0.1)
            module.running_var.uniform_(0.5, 1.5)
            nn.init.uniform_(module.weight, 0.8, 1.2)
            nn.init.normal_(module.bias, 0, 0.1)


def make(name, model, metadata):
    randomise(model)
    model.eval()
    tensors = {k: v for k, v in model.state_dict().items() if not k.endswith("num_batches_tracked")}
    metadata |= {"trained": "false", "classes": '["bowl", "cup", "lamp", "sofa", "vase"]'}
    save_file(tensors, f"{name}.safetensors", metadata | {"provenance": "make.py, random weights"})
    with torch.no_grad():
        logits = torch.cat([model(cloud(n)) for n in SIZES])
    save_file({"logits": logits, "sizes": torch.tensor(SIZES).float()}, f"{name}_logits.safetensors")


torch.manual_seed(3)
make("tiny", PointNet([3, 8, 24, 40], [32, 16, 5], True, True), {"normalization": "none"})
make("plain", PointNet([3, 12, 20, 36, 70], [16, 5], False, False),
     {"normalization": "none", "pooled": "relu"})
