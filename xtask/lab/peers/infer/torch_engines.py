"""PyTorch on yanx27's `pointnet_cls`: as its repository runs it, and compiled."""

import numpy
import pointnet
import torch
from safetensors.torch import load_file
from torch.nn import functional


class Eager(torch.nn.Module):
    """Layer by layer, batch norms apart."""

    def __init__(self, model_file):
        super().__init__()
        self.tensors = load_file(model_file)

    def norm(self, x, key):
        names = ("running_mean", "running_var", "weight", "bias")
        return functional.batch_norm(x, *(self.tensors[f"{key}.{name}"] for name in names))

    def shared(self, x, key, norm):
        weights, bias = self.tensors[f"{key}.weight"], self.tensors[f"{key}.bias"]
        return self.norm(functional.conv1d(x, weights, bias), norm)

    def dense(self, x, key):
        return functional.linear(x, self.tensors[f"{key}.weight"], self.tensors[f"{key}.bias"])

    def t_net(self, x, key, side):
        for conv, norm in (("conv1", "bn1"), ("conv2", "bn2"), ("conv3", "bn3")):
            x = functional.relu(self.shared(x, f"{key}.{conv}", f"{key}.{norm}"))
        x = torch.max(x, 2)[0]
        for fc, norm in (("fc1", "bn4"), ("fc2", "bn5")):
            x = functional.relu(self.norm(self.dense(x, f"{key}.{fc}"), f"{key}.{norm}"))
        x = self.dense(x, f"{key}.fc3") + torch.eye(side).ravel()
        return x.view(-1, side, side)

    def forward(self, x):
        x = torch.bmm(x.transpose(2, 1), self.t_net(x, "feat.stn", 3)).transpose(2, 1)
        x = functional.relu(self.shared(x, "feat.conv1", "feat.bn1"))
        x = torch.bmm(x.transpose(2, 1), self.t_net(x, "feat.fstn", 64)).transpose(2, 1)
        x = functional.relu(self.shared(x, "feat.conv2", "feat.bn2"))
        x = torch.max(self.shared(x, "feat.conv3", "feat.bn3"), 2)[0]
        for fc, norm in (("fc1", "bn1"), ("fc2", "bn2")):
            x = functional.relu(self.norm(self.dense(x, fc), norm))
        return functional.log_softmax(self.dense(x, "fc3"), -1)


class Folded(torch.nn.Module):
    """The same with batch norms folded."""

    def __init__(self, model_file):
        super().__init__()
        layers = pointnet.layers(model_file)
        for key, (weights, bias) in layers.items():
            self.register_buffer(f"{key}.w".replace(".", "_"), torch.from_numpy(weights))
            self.register_buffer(f"{key}.b".replace(".", "_"), torch.from_numpy(bias))

    def parameters_of(self, key):
        name = key.replace(".", "_")
        return getattr(self, f"{name}_w"), getattr(self, f"{name}_b")

    def shared(self, x, key):
        weights, bias = self.parameters_of(key)
        return functional.conv1d(x, weights[:, :, None], bias)

    def dense(self, x, key):
        return functional.linear(x, *self.parameters_of(key))

    def t_net(self, x, key, side):
        for conv in ("conv1", "conv2", "conv3"):
            x = functional.relu(self.shared(x, f"{key}.{conv}"))
        x = torch.amax(x, 2)
        for fc in ("fc1", "fc2"):
            x = functional.relu(self.dense(x, f"{key}.{fc}"))
        return self.dense(x, f"{key}.fc3").view(-1, side, side)

    def forward(self, x):
        x = torch.bmm(self.t_net(x, "feat.stn", 3).transpose(2, 1), x)
        x = functional.relu(self.shared(x, "feat.conv1"))
        x = torch.bmm(self.t_net(x, "feat.fstn", 64).transpose(2, 1), x)
        x = functional.relu(self.shared(x, "feat.conv2"))
        x = torch.amax(self.shared(x, "feat.conv3"), 2)
        for fc in ("fc1", "fc2"):
            x = functional.relu(self.dense(x, fc))
        return functional.log_softmax(self.dense(x, "fc3"), -1)


class Torch:
    version = torch.__version__

    def __init__(self, module):
        self.module = module

    def load(self, points, threads):
        torch.set_num_threads(threads)
        self.x = torch.from_numpy(numpy.ascontiguousarray(points.T[None]))
        # TorchScript settles for a size over its first runs.
        self.run()
        self.run()

    def run(self):
        with torch.inference_mode():
            return self.module(self.x)

    def answer(self, logp):
        return logp[0].tolist()


def torchscript(model_file):
    example = torch.zeros(1, 3, 64)
    traced = torch.jit.trace(Folded(model_file).eval(), example)
    return Torch(torch.jit.optimize_for_inference(torch.jit.freeze(traced)))


ENGINES = {
    "torch": lambda model_file: Torch(Eager(model_file).eval()),
    "torchscript": torchscript,
}
