"""PyTorch's PointNet on identical weights and clouds, against infer-cpu.

Once with random weights and batch norms of its own, which go to infer-cpu by
torch.save and `cargo xtask import-weights`; once with bundled weights. Run by
`cargo xtask test --peers all`; see xtask/src/test/peers.rs.
"""

import json

from peer import OUT, ROOT, edgepuck, infer, skipped_if_missing

with skipped_if_missing():
    import numpy
    import torch
    from safetensors.torch import load_file
    from torch import nn

# Of the largest logit, or of 1 where that is less: see onnx_runtime.py.
TOLERANCE = 1e-5

SIZES = [1, 2, 17, 64, 255, 1024, 2000]

BASELINE = [64, 128, 1024]


def norm(width, has_norms):
    return nn.BatchNorm1d(width) if has_norms else nn.Identity()


class TNet(nn.Module):
    """Predicts a k x k matrix; layers are named as yanx27's STN3d and STNkd are."""

    def __init__(self, k, norms):
        super().__init__()
        self.k = k
        self.conv1, self.bn1 = nn.Conv1d(k, 64, 1), norm(64, norms)
        self.conv2, self.bn2 = nn.Conv1d(64, 128, 1), norm(128, norms)
        self.conv3, self.bn3 = nn.Conv1d(128, 1024, 1), norm(1024, norms)
        self.fc1, self.bn4 = nn.Linear(1024, 512), norm(512, norms)
        self.fc2, self.bn5 = nn.Linear(512, 256), norm(256, norms)
        self.fc3 = nn.Linear(256, k * k)

    def forward(self, x):
        x = torch.relu(self.bn1(self.conv1(x)))
        x = torch.relu(self.bn2(self.conv2(x)))
        x = torch.relu(self.bn3(self.conv3(x)))
        x = torch.amax(x, 2)
        x = torch.relu(self.bn4(self.fc1(x)))
        x = torch.relu(self.bn5(self.fc2(x)))
        return self.fc3(x).view(-1, self.k, self.k) + torch.eye(self.k, dtype=x.dtype)


class Trunk(nn.Module):
    """From [batch, 3, n] to pooled features: PointNetEncoder, of any widths."""

    def __init__(self, widths, t_nets, norms):
        super().__init__()
        self.stn = TNet(3, norms) if t_nets else None
        self.fstn = TNet(widths[0], norms) if t_nets else None
        self.n = len(widths)
        for i, (inputs, outputs) in enumerate(zip([3, *widths], widths), 1):
            self.add_module(f"conv{i}", nn.Conv1d(inputs, outputs, 1))
            self.add_module(f"bn{i}", norm(outputs, norms))

    def layer(self, i, x):
        return getattr(self, f"bn{i}")(getattr(self, f"conv{i}")(x))

    def forward(self, x):
        if self.stn:
            x = torch.bmm(x.transpose(2, 1), self.stn(x)).transpose(2, 1)
        x = torch.relu(self.layer(1, x))
        if self.fstn:
            x = torch.bmm(x.transpose(2, 1), self.fstn(x)).transpose(2, 1)
        for i in range(2, self.n):
            x = torch.relu(self.layer(i, x))
        return torch.amax(self.layer(self.n, x), 2)


class PointNet(nn.Module):
    """From [batch, 3, n] to logits [batch, classes]."""

    def __init__(self, widths, t_nets, norms, classes=40):
        super().__init__()
        self.feat = Trunk(widths, t_nets, norms)
        self.fc1, self.bn1 = nn.Linear(widths[-1], 512), norm(512, norms)
        self.fc2, self.bn2 = nn.Linear(512, 256), norm(256, norms)
        self.fc3 = nn.Linear(256, classes)

    def forward(self, x):
        x = self.feat(x)
        x = torch.relu(self.bn1(self.fc1(x)))
        x = torch.relu(self.bn2(self.fc2(x)))
        return self.fc3(x)


def main():
    torch.manual_seed(5)
    random = torch.Generator().manual_seed(5)
    clouds = [cloud(n, random) for n in SIZES]
    files = [OUT / f"cloud{n}.npy" for n in SIZES]
    for file, points in zip(files, clouds):
        numpy.save(file, points.numpy())
    for t_nets, widths in ((True, BASELINE), (False, [48, 64, 96, 200])):
        compare("random, batch norms" + ", T-Nets" * t_nets, *untrained(widths, t_nets, random),
                clouds, files)
    name, widths = "shapes-rotational-64", [64, 64, 128, 256, 1024]
    file = ROOT / f"assets/weights/{name}.safetensors"
    network = PointNet(widths, t_nets=False, norms=False, classes=10)
    compare(name, bundled(file, network), file, clouds, files)
    print(f"torch {torch.__version__}: all agree")


def cloud(n, random):
    """Points in a ball, the farthest at 1."""
    points = torch.randn(n, 3, generator=random)
    return points / points.norm(dim=1).max()


def untrained(widths, t_nets, random):
    """A network whose batch norms have seen something, and what we imported of it."""
    model = PointNet(widths, t_nets, norms=True)
    for layer in model.modules():
        if isinstance(layer, nn.BatchNorm1d):
            layer.running_mean.normal_(0, 0.1, generator=random)
            layer.running_var.uniform_(0.5, 2, generator=random)
            nn.init.uniform_(layer.weight, 0.5, 1.5)
            nn.init.normal_(layer.bias, 0, 0.1)
    name = f"random{len(widths)}"
    checkpoint, file = OUT / f"{name}.pth", OUT / f"{name}.safetensors"
    torch.save({"model_state_dict": model.state_dict()}, checkpoint)
    edgepuck("import-weights", checkpoint, "--overwrite", "--out", file)
    return model, file


def bundled(file, model):
    """Folded weights, one matrix a layer that all points share."""
    tensors = {
        key: value.float()[:, :, None] if ".conv" in key and value.ndim == 2 else value.float()
        for key, value in load_file(file).items()
    }
    model.load_state_dict(tensors, strict=True)
    return model


def compare(name, model, file, clouds, files):
    model.eval()
    worst = 0.0
    for points, ours in zip(clouds, logits(file, files)):
        with torch.inference_mode():
            theirs = model(points.T[None])[0].double().numpy()
        apart = numpy.abs(ours - theirs).max() / max(1.0, numpy.abs(theirs).max())
        assert apart <= TOLERANCE, f"{name}, {len(points)} points: {apart:.2e} apart"
        worst = max(worst, apart)
    print(f"  {name}: logits within {worst:.1e} of the largest")


def logits(model, files):
    done = infer("classify", "--json", "--model", model, "--normalize", "none", "--sampler", "all",
                 *files)
    return [numpy.array(json.loads(line)["logits"]) for line in done.stdout.splitlines()]


main()
