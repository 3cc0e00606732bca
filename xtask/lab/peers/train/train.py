"""PyTorch training yanx27's `pointnet_cls`, for `cargo xtask bench train`; the
protocol is that of infer/turns.py, where SIZE is points and SETTING is clouds.

train.py ENGINE MODEL.safetensors FOLDER

FOLDER holds cloud.safetensors: cloud i of a batch of clouds of N points is its
`points` from i N on. The label of cloud i is i modulo the number of classes. A
run is one step: forward, backward, Adam. An answer is the loss of the first
step from MODEL's weights, and of the second.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "infer"))

import torch
import turns
from safetensors.torch import load_file
from torch.nn import functional

BUFFERS = ("running_mean", "running_var", "num_batches_tracked")


class Net:
    """The layers of `pointnet_cls` in training mode, dropout left out."""

    def __init__(self, tensors):
        self.t = {
            name: tensor.clone().requires_grad_(not name.endswith(BUFFERS))
            for name, tensor in tensors.items()
        }

    def parameters(self):
        return [tensor for tensor in self.t.values() if tensor.requires_grad]

    def norm(self, x, key):
        t = self.t
        return functional.batch_norm(
            x, t[f"{key}.running_mean"], t[f"{key}.running_var"],
            t[f"{key}.weight"], t[f"{key}.bias"], training=True,
        )

    def shared(self, x, key, norm):
        weight = self.t[f"{key}.weight"]
        weight = weight if weight.dim() == 3 else weight[:, :, None]
        return self.norm(functional.conv1d(x, weight, self.t[f"{key}.bias"]), norm)

    def dense(self, x, key):
        return functional.linear(x, self.t[f"{key}.weight"], self.t[f"{key}.bias"])

    def t_net(self, x, key, side):
        for conv, norm in (("conv1", "bn1"), ("conv2", "bn2"), ("conv3", "bn3")):
            x = functional.relu(self.shared(x, f"{key}.{conv}", f"{key}.{norm}"))
        x = torch.max(x, 2)[0]
        for fc, norm in (("fc1", "bn4"), ("fc2", "bn5")):
            x = functional.relu(self.norm(self.dense(x, f"{key}.{fc}"), f"{key}.{norm}"))
        x = self.dense(x, f"{key}.fc3") + torch.eye(side).ravel()
        return x.view(-1, side, side)

    def loss(self, x, labels):
        x = torch.bmm(x.transpose(2, 1), self.t_net(x, "feat.stn", 3)).transpose(2, 1)
        x = functional.relu(self.shared(x, "feat.conv1", "feat.bn1"))
        turn = self.t_net(x, "feat.fstn", 64)
        x = torch.bmm(x.transpose(2, 1), turn).transpose(2, 1)
        x = functional.relu(self.shared(x, "feat.conv2", "feat.bn2"))
        x = torch.max(self.shared(x, "feat.conv3", "feat.bn3"), 2)[0]
        for fc, norm in (("fc1", "bn1"), ("fc2", "bn2")):
            x = functional.relu(self.norm(self.dense(x, fc), norm))
        loss = functional.nll_loss(functional.log_softmax(self.dense(x, "fc3"), -1), labels)
        error = torch.bmm(turn, turn.transpose(2, 1)) - torch.eye(64)
        return loss + 0.001 * torch.mean(torch.norm(error, dim=(1, 2)))


class Training:
    def __init__(self, model, folder):
        self.tensors = load_file(model)
        self.points = load_file(Path(folder) / "cloud.safetensors")["points"]
        torch.set_num_threads(len(os.sched_getaffinity(0)))

    def begin(self):
        self.net = Net(self.tensors)
        self.optimizer = torch.optim.Adam(
            self.net.parameters(), lr=1e-3, betas=(0.9, 0.999), eps=1e-8, weight_decay=1e-4
        )

    def load(self, points, clouds):
        x = self.points[: points * clouds].view(clouds, points, 3)
        self.x = x.transpose(2, 1).contiguous()
        n_classes = self.tensors["fc3.weight"].shape[0]
        self.labels = torch.arange(clouds) % n_classes
        self.begin()

    def run(self):
        self.optimizer.zero_grad()
        loss = self.net.loss(self.x, self.labels)
        loss.backward()
        self.optimizer.step()
        return loss

    def answer(self, _):
        self.begin()
        losses = [float(self.run().detach()) for _ in range(2)]
        return losses


turns.serve(lambda: (Training(sys.argv[2], sys.argv[3]), torch.__version__))
