"""Trains `edgepuck.torch.SetNetwork` on a GPU, and writes a model file for infer-cpu.

    pip install ./python torch cupy-cuda13x
    python set_network.py train.npz --out set-64.safetensors

`train.npz` is a packed set of clouds, of up to 1,024 points each. The network and the recipe are those of
assets/recipes/set-64.toml, but for two things: dropped points move onto another point instead of going, and no clouds
choose the best epoch: all are trained on, and the last epoch counts. One step is captured as a CUDA graph and
replayed. Runs of one seed differ in rounding, since a GPU adds gradients in any order.
"""

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import cupy
import numpy as np
import torch
import torch.nn.functional as F
from edgepuck.torch import SetNetwork, export, farthest, winners
from torch import Tensor

# Points of a cloud that the kernels have room for.
MOST_POINTS = 1024

KERNELS = r"""
// A block of 256 threads for each cloud of at most 1,024 points; `picked` begins with the point that is farthest from the mean.
extern "C" __global__ void farthest(const float* points, int n, int m, int* picked) {
    const float* p = points + (size_t)blockIdx.x * n * 3;
    __shared__ unsigned long long best[2][8];
    __shared__ float sum[3][8];
    int t = threadIdx.x, lane = t & 31, warp = t >> 5;
    float x[4], y[4], z[4], nearest[4], s[3] = {0, 0, 0};
    for (int k = 0; k < 4; k++) {
        int i = t + 256 * k;
        x[k] = y[k] = z[k] = 0;
        nearest[k] = 1e30f;
        if (i < n) {
            x[k] = p[3*i]; y[k] = p[3*i+1]; z[k] = p[3*i+2];
            s[0] += x[k]; s[1] += y[k]; s[2] += z[k];
        }
    }
    for (int a = 0; a < 3; a++) {
        float v = s[a];
        for (int o = 16; o; o >>= 1) v += __shfl_down_sync(~0u, v, o);
        if (!lane) sum[a][warp] = v;
    }
    __syncthreads();
    float c[3];
    for (int a = 0; a < 3; a++) {
        c[a] = 0;
        for (int w = 0; w < 8; w++) c[a] += sum[a][w];
        c[a] /= n;
    }
    for (int j = -1; j < m; j++) {
        // The distance's bits in the high half, and the index inverted in the low one: the first of equals wins.
        unsigned long long key = 0;
        for (int k = 0; k < 4; k++) {
            int i = t + 256 * k;
            if (i >= n) continue;
            float v = (x[k]-c[0])*(x[k]-c[0]) + (y[k]-c[1])*(y[k]-c[1]) + (z[k]-c[2])*(z[k]-c[2]);
            if (j >= 0) v = nearest[k] = fminf(nearest[k], v);
            unsigned long long own = ((unsigned long long)__float_as_uint(v) << 32) | (unsigned)(~i);
            key = own > key ? own : key;
        }
        for (int o = 16; o; o >>= 1) {
            unsigned long long other = __shfl_down_sync(~0u, key, o);
            key = other > key ? other : key;
        }
        int b = j & 1;
        if (!lane) best[b][warp] = key;
        __syncthreads();
        key = best[b][0];
        for (int w = 1; w < 8; w++) key = best[b][w] > key ? best[b][w] : key;
        int pick = ~(unsigned)key;
        if (j + 1 >= m) break;
        if (t == 0) picked[blockIdx.x * m + j + 1] = pick;
        c[0] = p[3*pick]; c[1] = p[3*pick+1]; c[2] = p[3*pick+2];
    }
}

// A block for each centre, a thread for each channel; at most 1,024 points in a cloud.
extern "C" __global__ void winners(const float* points, const float* centres, const float* u, const float* weights,
        int n, int m, int channels, float squared_radius, float per_radius, int* out) {
    __shared__ int near[1024];
    __shared__ int count;
    size_t cloud = blockIdx.x / m;
    const float* p = points + cloud * n * 3;
    const float* c = centres + (size_t)blockIdx.x * 3;
    if (threadIdx.x == 0) count = 0;
    __syncthreads();
    for (int i = threadIdx.x; i < n; i += blockDim.x) {
        float dx = p[3*i]-c[0], dy = p[3*i+1]-c[1], dz = p[3*i+2]-c[2];
        if (dx*dx + dy*dy + dz*dz <= squared_radius) near[atomicAdd(&count, 1)] = i;
    }
    __syncthreads();
    for (int channel = threadIdx.x; channel < channels; channel += blockDim.x) {
        const float* w = weights + 4 * channel;
        float most = -3.4e38f;
        int winner = 0;
        for (int k = 0; k < count; k++) {
            int i = near[k];
            float v = w[0] * u[(cloud * n + i) * channels + channel]
                + per_radius * (w[1]*p[3*i] + w[2]*p[3*i+1] + w[3]*p[3*i+2]);
            // The list is in any order: the first of equals wins.
            if (v > most || (v == most && i < winner)) { most = v; winner = i; }
        }
        out[(size_t)blockIdx.x * channels + channel] = winner;
    }
}
"""


@dataclass
class Recipe:
    """What assets/recipes/set-64.toml says."""

    epochs: int
    batch: int = 64
    rate: float = 2e-3
    l2: float = 1e-4
    warm_up: int = 2
    last: float = 0.01
    smoothing: float = 0.1
    average: float = 0.999
    cut_mix: float = 0.5
    drop: float = 0.1
    jitter: float = 0.005
    scale: tuple[float, float] = (0.8, 1.25)
    stretch: float = 0.2
    shift: float = 0.2


class Kernels:
    """The two kernels, in place of the functions of the same names in `edgepuck.torch`."""

    def __init__(self) -> None:
        self.by_name = {name: cupy.RawKernel(KERNELS, name) for name in ("farthest", "winners")}

    def launch(self, name: str, grid: int, block: int, *arguments: object) -> None:
        values = [a.data_ptr() if isinstance(a, Tensor) else a for a in arguments]
        with cupy.cuda.ExternalStream(torch.cuda.current_stream().cuda_stream):
            self.by_name[name]((grid,), (block,), tuple(values))

    def farthest(self, points: Tensor, n: int) -> Tensor:
        batch, m, _ = points.shape
        picked = torch.empty(batch, n, dtype=torch.int32, device=points.device)
        self.launch("farthest", batch, 256, points.contiguous(), np.int32(m), np.int32(n), picked)
        return picked.long()

    def winners(self, u: Tensor, points: Tensor, centres: Tensor, weight: Tensor, radius: float) -> Tensor:
        (batch, m, channels), n = u.shape, centres.shape[1]
        found = torch.empty(batch, n, channels, dtype=torch.int32, device=u.device)
        arrays = [a.contiguous() for a in (points, centres, u, weight)]
        sizes = [np.int32(size) for size in (m, n, channels)]
        radii = [np.float32(radius**2), np.float32(1 / radius)]
        self.launch("winners", batch * n, min(max(channels, 64), 256), *arrays, *sizes, *radii, found)
        return found.long()

    def check(self, clouds: Tensor) -> None:
        """Compares the kernels with the functions that they replace."""
        u, weight = torch.randn(*clouds.shape[:2], 64, device=clouds.device), torch.randn(64, 4, device=clouds.device)
        picked = farthest(clouds, 256)
        centres = ordered(clouds, picked)
        pairs = [
            (self.farthest(clouds, 256), picked),
            (self.winners(u, clouds, centres, weight, 0.2), winners(u, clouds, centres, weight, 0.2)),
        ]
        for found, expected in pairs:
            # Points at the border of a neighborhood may be rounded to either side.
            equal = (found == expected).float().mean().item()
            if equal < 0.999:
                raise SystemExit(f"the kernels are wrong on this GPU: {100 * equal:.2f} % of their indices are right")


def uniform(shape: tuple[int, ...], low: float, high: float, device: torch.device) -> Tensor:
    return torch.rand(shape, device=device) * (high - low) + low


def ordered(points: Tensor, order: Tensor) -> Tensor:
    return points.gather(1, order[:, :, None].expand(-1, -1, 3))


def by_distance(points: Tensor, centre: Tensor) -> Tensor:
    return ordered(points, (points - centre).square().sum(2).argsort(1))


def augmented(clouds: Tensor, others: Tensor, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The clouds as train/src/augment.rs would vary them, and the share of each that `others` replaced."""
    (batch, n, _), device = clouds.shape, clouds.device
    every = torch.arange(batch, device=device)
    centre = clouds[every, torch.randint(0, n, (batch,), device=device)][:, None]
    is_mixed = torch.rand(batch, device=device) < recipe.cut_mix
    replaced = (torch.rand(batch, device=device) * n).floor() * is_mixed
    is_replaced = torch.arange(n, device=device) < replaced[:, None]
    clouds = torch.where(is_replaced[:, :, None], by_distance(others, centre), by_distance(clouds, centre))
    # A copy of a point changes no maximum; it moves the mean that chooses the first centre a little.
    stays = torch.rand(batch, n, device=device) > torch.rand(batch, 1, device=device) * recipe.drop
    clouds = torch.where(stays[:, :, None], clouds, clouds[:, -1:])
    clouds = clouds + (recipe.jitter * torch.randn_like(clouds)).clamp(-0.05, 0.05)
    scale = uniform((batch, 1, 1), *recipe.scale, device)
    scale = scale * uniform((batch, 1, 3), 1 - recipe.stretch, 1 + recipe.stretch, device)
    return clouds * scale + uniform((batch, 1, 3), -recipe.shift, recipe.shift, device), replaced / n


class Training:
    """A network in training, and the running means of its weights."""

    def __init__(self, network: SetNetwork, mean: SetNetwork, clouds: Tensor, labels: Tensor, recipe: Recipe) -> None:
        self.network, self.mean, self.recipe = network.train(), mean.eval(), recipe
        mean.load_state_dict(network.state_dict())
        self.clouds, self.labels = clouds, labels
        pairs = zip(mean.state_dict().values(), network.state_dict().values(), strict=True)
        self.averages, self.values = zip(*[pair for pair in pairs if pair[0].is_floating_point()], strict=True)
        self.n_steps = len(clouds) // recipe.batch
        device = clouds.device
        self.order = torch.arange(len(clouds), device=device)
        self.at, self.step_number = (torch.zeros((), dtype=kind, device=device) for kind in (torch.long, torch.float))
        self.rate, self.loss = torch.tensor(recipe.rate, device=device), torch.zeros((), device=device)
        self.adam = torch.optim.Adam(
            network.parameters(), lr=self.rate, weight_decay=recipe.l2, capturable=True, fused=True
        )

    def capture(self) -> torch.cuda.CUDAGraph:
        """Returns a graph of one step. The network is as before."""
        weights = {name: value.clone() for name, value in self.network.state_dict().items()}
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self.at.zero_()
                self.step()
        torch.cuda.synchronize()
        self.adam.zero_grad(set_to_none=True)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self.step()
        for network in (self.network, self.mean):
            network.load_state_dict(weights)
        for state in self.adam.state.values():
            for value in state.values():
                value.zero_()
        self.step_number.zero_()
        return graph

    def step(self) -> None:
        recipe, device = self.recipe, self.clouds.device
        with torch.no_grad():
            own = self.order[self.at * recipe.batch + torch.arange(recipe.batch, device=device)]
            other = torch.randint(0, len(self.clouds), (recipe.batch,), device=device)
            clouds, share = augmented(self.clouds[own], self.clouds[other], recipe)
            n_classes = self.network.get_submodule(f"fc{self.network.n_dense}").out_features
            one_hot = [F.one_hot(self.labels[i], n_classes) for i in (own, other)]
            targets = torch.lerp(one_hot[0].float(), one_hot[1].float(), share[:, None])
            targets = targets * (1 - recipe.smoothing) + recipe.smoothing / n_classes
        loss = -(targets * F.log_softmax(self.network(clouds), 1)).sum(1).mean()
        self.adam.zero_grad(set_to_none=True)
        loss.backward()
        with torch.no_grad():
            self.rate.copy_(self.scheduled())
            self.adam.step()
            self.step_number += 1
            self.at += 1
            share = torch.clamp(10 / (self.step_number + 9), min=1 - recipe.average)
            change = torch._foreach_sub(self.values, self.averages)
            torch._foreach_mul_(change, share)
            torch._foreach_add_(self.averages, change)
            self.loss.copy_(loss)

    def scheduled(self) -> Tensor:
        """The rate: linear while it warms up, then a cosine."""
        recipe = self.recipe
        warm, total = recipe.warm_up * self.n_steps, recipe.epochs * self.n_steps
        rising = torch.clamp((self.step_number + 1) / warm, max=1)
        done = torch.clamp((self.step_number - warm) / max(total - warm, 1), 0, 1)
        return recipe.rate * rising * (recipe.last + (1 - recipe.last) * (1 + torch.cos(math.pi * done)) / 2)

    def run(self) -> None:
        graph = self.capture()
        for epoch in range(self.recipe.epochs):
            self.order.copy_(torch.randperm(len(self.clouds), device=self.clouds.device))
            self.at.zero_()
            for _ in range(self.n_steps):
                graph.replay()
            if epoch == 0 or (epoch + 1) % 10 == 0:
                print(f"epoch {epoch + 1}: loss {self.loss.item():.3f}", flush=True)


@torch.no_grad()
def accuracy(network: SetNetwork, clouds: Tensor, labels: Tensor) -> float:
    found = torch.cat([network(some).argmax(1) for some in clouds.split(256)])
    return (found == labels).float().mean().item()


def read(path: Path) -> tuple[Tensor, Tensor, list[str]]:
    """The clouds of a packed set in the unit sphere, their labels, and the classes."""
    with np.load(path) as file:
        points = file["points_i16"] if "points_i16" in file else file["points"]
        if points.ndim != 3 or points.shape[1] > MOST_POINTS:
            raise SystemExit(f"{path}: expected points [clouds, at most {MOST_POINTS}, 3], found {list(points.shape)}")
        clouds = torch.from_numpy(points.astype(np.float32)).cuda()
        labels = torch.from_numpy(file["labels"].astype(np.int64)).cuda()
        classes = [name.decode() if isinstance(name, bytes) else str(name) for name in file["classes"]]
    clouds = clouds - clouds.mean(1, keepdim=True)
    return clouds / clouds.norm(dim=2).amax(1)[:, None, None], labels, classes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="packed NPZ file of clouds")
    parser.add_argument("--out", type=Path, required=True, help="model file to write")
    parser.add_argument("--epochs", type=int, default=160)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--held", type=int, choices=range(10), help="the tenth of the clouds to keep back and test on")
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    torch.backends.cuda.matmul.allow_tf32 = True
    clouds, labels, classes = read(args.data)
    is_held = torch.zeros(len(clouds), dtype=torch.bool)
    if args.held is not None:
        is_held[np.random.default_rng(7).permutation(len(clouds))[args.held :: 10]] = True
    held = is_held.cuda()
    recipe = Recipe(args.epochs)
    if (~is_held).sum() < recipe.batch:
        raise SystemExit(f"{args.data}: expected {recipe.batch} clouds to train on or more, found {(~is_held).sum()}")
    networks = [SetNetwork(len(classes)).cuda() for _ in range(2)]
    kernels = Kernels()
    kernels.check(clouds[:4])
    for network in networks:
        network.farthest, network.winners = kernels.farthest, kernels.winners
    training = Training(*networks, clouds[~held], labels[~held], recipe)
    training.run()
    if args.held is not None:
        print(f"{100 * accuracy(training.mean, clouds[held], labels[held]):.2f} % of the clouds that were kept back")
    export(training.mean, args.out, classes=classes, training_set=args.data.name, calibrate=args.data, half=True)


if __name__ == "__main__":
    main()
