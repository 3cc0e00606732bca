"""What the network finds in scenes, as a packed set for `edgepuck train`: the points of each object that it sees, with the class
of the object that is there, or `other`.

    python crops.py BIRDSEYE.pt OUT.npz SCENES.npz...

A second network that is trained on it tells the detector's mistakes from its objects, because it has seen those very mistakes.
Beside them are the points about true objects, off their centres, which the network may have missed.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from grid import NAMES
from network import BirdsEye
from numpy import ndarray
from numpy.random import Generator
from peaks import claimed, objects, within
from train import Scenes

CLASSES = [*NAMES, "other"]
OTHER = len(NAMES)
LEAST_SCORE, FEWEST_POINTS = 0.04, 15
# A crop is an object's if it has these shares of the object's points and of its own.
COVER, SHARE = 0.5, 0.5
# Crops of a sweep that are `other`, at most.
MOST_OTHERS = 60


def found(net: BirdsEye, points: ndarray, boxes: ndarray, rng: Generator) -> Iterator[tuple[ndarray, int, float]]:
    """The points of a crop, its class, and the score of the network."""
    true = [within(points, int(of), x, y, length, width, yaw) for of, x, y, length, width, yaw, _, _ in boxes]
    sizes = [int(own.sum()) for own in true]
    seen = objects(net, points, LEAST_SCORE)
    others = 0
    for one, crop in zip(seen, claimed(points, seen), strict=True):
        if len(crop) < FEWEST_POINTS:
            continue
        shared = np.array([own[crop].sum() for own in true] or [0])
        best = int(shared.argmax())
        is_own = len(true) > 0 and shared[best] >= SHARE * len(crop) and shared[best] >= COVER * sizes[best]
        of = int(boxes[best, 0]) if is_own else OTHER
        others += of == OTHER
        if of != OTHER or others <= MOST_OTHERS:
            yield points[crop], of, one[0]
    for (of, x, y, length, width, yaw, _, _), size in zip(boxes, sizes, strict=True):
        if size < FEWEST_POINTS or rng.random() < (0.7 if of == 0 else 0.3):
            continue
        off = rng.normal(0, 0.12 if of in (1, 2) else 0.3, 2)
        shape = np.array([length, width]) * rng.uniform(0.9, 1.2, 2)
        crop = np.flatnonzero(within(points, int(of), x + off[0], y + off[1], *shape, yaw + rng.normal(0, 0.1)))
        if len(crop) >= FEWEST_POINTS:
            yield points[crop], int(of), 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--sweeps", type=int, default=40, help="sweeps of each file")
    asked = parser.parse_args()
    net = BirdsEye()
    net.load_state_dict(torch.load(asked.checkpoint, map_location="cpu")["mean"])
    net.eval()
    rows: dict[str, list] = {key: [] for key in ("points", "labels", "names", "ids", "sensor", "range_m", "height_m", "score")}
    offsets = [0]
    for file in asked.scenes:
        scenes, rng = Scenes(file), np.random.default_rng(int(file.stem))
        for number in range(0, len(scenes), max(1, len(scenes) // asked.sweeps)):
            for crop, of, score in found(net, *scenes.sweep(number), rng):
                name = f"{file.stem}-{number}"
                row = (crop[:, :3], of, f"{CLASSES[of]}_{len(offsets)}", f"{name}#{len(offsets)}", "simulated",
                       np.hypot(*crop[:, :2].mean(0)), crop[:, 2].min(), score)
                for key, value in zip(rows, row, strict=True):
                    rows[key].append(value)
                offsets.append(offsets[-1] + len(crop))
        print(file, np.bincount(rows["labels"], minlength=len(CLASSES)), flush=True)
    table = {key: np.concatenate(values) if key == "points" else np.array(values) for key, values in rows.items()}
    for key in ("range_m", "height_m", "score"):
        table[key] = table[key].astype(np.float32)
    np.savez(asked.out, offsets=np.array(offsets, np.int64), classes=np.array(CLASSES), **table)


if __name__ == "__main__":
    main()
