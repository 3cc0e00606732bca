"""Trains the bird's-eye network on packed scenes of scenes.py. Goes on from OUT if that is a checkpoint.

    python train.py OUT.pt SCENES/*.npz --steps 12000

On a processor in bf16, on a GPU if there is one.
"""

import argparse
import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from grid import CELL_M, REACH_M, raster
from network import N_BOX, N_CLASSES, BirdsEye
from numpy.random import Generator
from paste import Cutouts, covered, pasted
from torch import Tensor
from torch.nn import functional as F

N = 192  # The cells of a patch along one side.
SPREAD = (3.0, 1.0, 1.2, 4.0)  # Of the heat of a class, cells.
DRAWN = np.array([1.0, 2.5, 2.0, 2.0])  # How often a patch is drawn about an object of a class.
# Objects of fewer points that are not ground are neither asked for nor forbidden.
FEWEST_POINTS = 10


class Scenes:
    def __init__(self, file: Path) -> None:
        with np.load(file) as saved:
            self.points, self.ends, self.boxes, self.box_ends = (saved[key] for key in ("points", "ends", "boxes", "box_ends"))
        self.cutouts = Cutouts()

    def cut(self) -> None:
        """Cuts out the persons and the two-wheelers."""
        for number in range(len(self)):
            self.cutouts.add(*self.sweep(number))

    def __len__(self) -> int:
        return len(self.ends) - 1

    def sweep(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Points in metres, and boxes."""
        points = self.points[self.ends[number] : self.ends[number + 1]].astype(np.float32)
        points[:, :3] /= 100
        return points, self.boxes[self.box_ends[number] : self.box_ends[number + 1]].copy()


def varied(points: np.ndarray, boxes: np.ndarray, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """The sweep thinned, noisy, without a sector, turned, mirrored and scaled."""
    if rng.random() < 0.5:
        points = points[rng.random(len(points)) < rng.uniform(0.3, 1)]
    if rng.random() < 0.2:
        from_rad, wide_rad = rng.uniform(-np.pi, np.pi), rng.uniform(0.02, 0.4)
        points = points[(np.arctan2(points[:, 1], points[:, 0]) - from_rad) % (2 * np.pi) > wide_rad]
    points[:, :2] += rng.normal(0, rng.uniform(0, 0.03), (len(points), 2))
    points[:, 2] += rng.normal(0, 0.02, len(points)) + rng.normal(0, 0.06)
    angle, side, scale = rng.uniform(0, 2 * np.pi), rng.choice([-1, 1]), rng.uniform(0.93, 1.07)
    turn = scale * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]], np.float32)
    points[:, 1] *= side
    boxes[:, [2, 5]] *= side
    points[:, :2] = points[:, :2] @ turn
    points[:, 2] *= rng.uniform(0.95, 1.05)
    boxes[:, 1:3] = boxes[:, 1:3] @ turn
    boxes[:, 5] += angle
    boxes[:, 3:5] *= scale
    return points, boxes


def corner(boxes: np.ndarray, rng: Generator) -> np.ndarray:
    """Where a patch begins: about an object, or anywhere."""
    middle = rng.uniform(-25, 25, 2)
    good = np.flatnonzero((boxes[:, 7] >= 20) & (np.hypot(boxes[:, 1], boxes[:, 2]) < REACH_M))
    if len(good) and rng.random() < 0.8:
        often = DRAWN[boxes[good, 0].astype(int)]
        middle = boxes[rng.choice(good, p=often / often.sum()), 1:3] + rng.uniform(-14, 14, 2)
    return np.floor(middle / 0.4) * 0.4 - N * CELL_M / 2


def targets(boxes: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The heat, the boxes, where these count, and which cells are left out."""
    heat, box = np.zeros((N_CLASSES, N, N), np.float32), np.zeros((N_BOX, N, N), np.float32)
    counts = np.zeros((N, N), np.float32)
    middle = (np.arange(N) + 0.5) * CELL_M
    left_out = (np.hypot((begin[0] + middle)[:, None], begin[1] + middle) > REACH_M + 1).astype(np.float32)
    for of, x, y, length, width, yaw, height, seen in boxes:
        (u, v), of = (np.array([x, y]) - begin) / CELL_M, int(of)
        if not (-16 < u < N + 16 and -16 < v < N + 16):
            continue

        def window(radius: float, u: float = u, v: float = v) -> tuple[slice, slice, np.ndarray]:
            """The cells about the object, and the squares of their distances."""
            low_u, low_v = max(0, int(u - radius)), max(0, int(v - radius))
            rows, columns = slice(low_u, max(0, int(u + radius) + 1)), slice(low_v, max(0, int(v + radius) + 1))
            along, across = np.arange(N)[rows] + 0.5, np.arange(N)[columns] + 0.5
            return rows, columns, (along[:, None] - u) ** 2 + (across - v) ** 2

        if seen < FEWEST_POINTS:
            radius = max(length, width) / (2 * CELL_M) + 1
            rows, columns, square = window(radius)
            if seen > 0:
                left_out[rows, columns] = np.maximum(left_out[rows, columns], square < radius**2)
            continue
        i, j = int(np.floor(u)), int(np.floor(v))
        rows, columns, square = window(4 * SPREAD[of], i + 0.5, j + 0.5)
        heat[of, rows, columns] = np.maximum(heat[of, rows, columns], np.exp(-square / (2 * SPREAD[of] ** 2)))
        reach = 2 if of in (0, 3) else 1
        for a in range(max(0, i - reach), min(N, i + reach + 1)):
            for b in range(max(0, j - reach), min(N, j + reach + 1)):
                sizes = np.log([length, width, height])
                box[:, a, b] = u - a - 0.5, v - b - 0.5, *sizes, np.cos(2 * yaw), np.sin(2 * yaw)
                counts[a, b] = 1
    return heat, box, counts, left_out


class Patches(torch.utils.data.IterableDataset):
    """For ever: patches of sweeps with their targets."""

    def __init__(self, files: list[Path], seed: int) -> None:
        self.files, self.seed = files, seed

    def __iter__(self) -> Iterator[tuple[np.ndarray, ...]]:
        worker = torch.utils.data.get_worker_info()
        rng = np.random.default_rng([self.seed, worker.id if worker else 0])
        scenes = [Scenes(file) for file in self.files]
        for one in scenes:
            one.cut()
        share = np.array([len(one) for one in scenes]) / sum(map(len, scenes))
        while True:
            one = scenes[rng.choice(len(scenes), p=share)]
            points, boxes = pasted(*one.sweep(rng.integers(len(one))), one.cutouts, rng)
            points, boxes = varied(covered(points, rng), boxes, rng)
            begin = corner(boxes, rng)
            yield raster(points, *begin, N).astype(np.float16), *targets(boxes, begin)


def heat_loss(output: Tensor, heat: Tensor, left_out: Tensor) -> Tensor:
    """CenterNet's focal loss of the heat (Zhou et al. 2019)."""
    score = torch.sigmoid(output[:, :N_CLASSES].float()).clamp(1e-4, 1 - 1e-4)
    peak = heat.eq(1).float()
    found = peak * (1 - score) ** 2 * score.log()
    none = (1 - peak) * (1 - left_out)[:, None] * (1 - heat) ** 4 * score**2 * (1 - score).log()
    return -(found + none).sum() / peak.sum().clamp(min=1)


def box_loss(output: Tensor, box: Tensor, counts: Tensor) -> Tensor:
    """The mean error of the boxes about the centres of objects."""
    at = counts.nonzero(as_tuple=True)
    off = (output[at[0], N_CLASSES:, at[1], at[2]].float() - box[at[0], :, at[1], at[2]]).abs()
    return (off * torch.tensor([1, 1, 0.4, 0.4, 0.4, 0.4, 0.4], device=off.device)).sum() / max(1, len(off))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=12000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--start", type=Path, help="weights to begin with, of another training")
    asked = parser.parse_args()
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.manual_seed(asked.seed)
    heat_loss_of = torch.compile(heat_loss)
    net, mean = (BirdsEye().to(device, memory_format=torch.channels_last) for _ in range(2))
    mean.load_state_dict(net.state_dict())
    adam = torch.optim.AdamW(net.parameters(), asked.rate, weight_decay=1e-2)
    step = 0
    if asked.start and not asked.out.exists():
        for part in (net, mean):
            part.load_state_dict(torch.load(asked.start, map_location=device)["mean"])
    if asked.out.exists():
        saved = torch.load(asked.out, map_location=device)
        step = saved["step"]
        for part, state in ((net, "net"), (mean, "mean"), (adam, "adam")):
            part.load_state_dict(saved[state])
    compiled = torch.compile(net)
    patches = Patches(asked.scenes, 1000 * asked.seed + step)
    batches = iter(torch.utils.data.DataLoader(patches, asked.batch, num_workers=asked.workers))
    began, first, losses = time.time(), step, []
    while step < asked.steps:
        for group in adam.param_groups:
            group["lr"] = asked.rate * min(1, (step + 1) / 100) * max(0.01, math.cos(math.pi / 2 * step / asked.steps))
        image, heat, box, counts, left_out = (part.to(device) for part in next(batches))
        with torch.autocast(device.type, torch.bfloat16):
            output = compiled(image.float().contiguous(memory_format=torch.channels_last))
        loss = heat_loss_of(output, heat, left_out) + box_loss(output, box, counts)
        adam.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 10)
        adam.step()
        step += 1
        losses.append(loss.item())
        keep = min(0.999, step / (step + 10))
        with torch.no_grad():
            for average, value in zip(mean.state_dict().values(), net.state_dict().values(), strict=True):
                average.copy_(torch.lerp(value, average, keep) if average.dtype.is_floating_point else value)
        if step % 200 == 0 or step == asked.steps:
            print(f"step {step}, loss {np.mean(losses):.3f}, {(step - first) / (time.time() - began):.2f} steps/s", flush=True)
            losses.clear()
            part = asked.out.with_suffix(".part")
            torch.save({"step": step, "net": net.state_dict(), "mean": mean.state_dict(), "adam": adam.state_dict()}, part)
            part.rename(asked.out)


if __name__ == "__main__":
    main()
