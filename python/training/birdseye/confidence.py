"""How sure a detection is: the weights of the network's logit and of that of the model that is asked, fitted for each class.

    python confidence.py BIRDSEYE.pt FRAME.npz... --scenes SCENES.npz... --out confidence.json

Logistic regression on candidates as `detect` has them, in labelled sweeps of real sensors (those of xtask/lab/peers/by_class.py). First it
leaves out one source of sweeps after the other, and prints what the others' weights find in it, by the least confidence; then it
fits the weights to all. For classes of which the sweeps show too few, boxes in SCENES, on which the network was not trained, are added.
"""

import argparse
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import edgepuck as ep
import numpy as np
import torch
from grid import CELL_M, NAMES, REACH_M, points_of
from network import BirdsEye
from numpy import ndarray
from peaks import box_at, may_be, objects, scores, within
from safetensors import safe_open
from scipy.optimize import minimize
from train import Scenes

ROOT = Path(__file__).resolve().parents[3]
WEIGHTS = ROOT / "assets/weights"
sys.path.append(str(ROOT / "xtask/lab/peers"))
import by_class

# As `detect` has them: which boxes and clusters are asked about, the widest clusters of each class and the cells about their
# middles, the gap between parts, and how near to 0 or 1 a probability counts.
LEAST_OF_BOX, LEAST_OF_CLUSTER, FEWEST_POINTS = 0.05, 0.03, 20
CLUSTERS = [(0, 7.0, 4), (1, 2.0, 2), (2, 2.8, 2)]
PERSON, GAP_M, HIGHEST_M, NEAREST = 1, 0.12, 4.0, 1e-4
# What the network does not tell apart.
HEAVY = ["truck", "bus"]
# The classes that labelled sweeps have too few of, and the sweeps of each file of scenes.
RARE, SWEEPS = {"truck"}, 40
# The weights are held to 0 so strongly: a few candidates decide nothing.
RIDGE = 0.5


@dataclass
class Candidate:
    source: str
    frame: str
    of: int
    is_cluster: bool
    logits: tuple[float, float]
    points: ndarray
    # The labelled object that it is, whether it is right, and whether that is known.
    object: int | None = None
    is_known: bool = True
    confidence: float = 0.0


class Asked:
    """The model that is asked about points."""

    def __init__(self, model: Path) -> None:
        with safe_open(model, "numpy") as file:
            self.temperature = float(file.metadata()["temperature"])
        self.net = ep.Classifier(model)
        of = [HEAVY if name in HEAVY else [name] for name in NAMES]
        self.of = [[self.net.classes.index(name) for name in names] for names in of]

    def logits(self, points: ndarray, ground_z: float) -> list[float]:
        """Of the probability that points are of each class of the network."""
        given = np.asarray(self.net(np.ascontiguousarray(points, np.float32), ground_z=ground_z).logits, float)
        all_of = np.exp((given - given.max()) / self.temperature)
        return [logit(all_of[own].sum() / all_of.sum()) for own in self.of]


def logit(probability: Any) -> float:
    probability = np.clip(probability, NEAREST, 1 - NEAREST)
    return float(np.log(probability / (1 - probability)))


def candidates(net: BirdsEye, asked: Asked, points: ndarray, rings: ndarray | None) -> Iterator[tuple[int, bool, tuple[float, float], ndarray]]:
    """Class, whether it is a cluster, both logits, and the indices of the points, of each."""
    labels = ep.segment(points.astype(np.float32), rings=rings, min_points=FEWEST_POINTS)
    table, used = points_of(points, labels)
    seen_by, places = table.astype(np.float32), np.flatnonzero(used)
    seen_by[:, :3] /= 100
    over = np.full(len(points), np.nan)
    over[places] = seen_by[:, 2]
    output, score = scores(net, seen_by)
    for one, of, x, y, length, width, _, yaw in objects(output, score, LEAST_OF_BOX):
        crop = places[within(seen_by, of, x, y, length, width, yaw)]
        if len(crop) >= FEWEST_POINTS:
            yield of, False, (logit(one), asked.logits(points[crop], float(np.median(points[crop, 2] - over[crop])))[of]), crop
    standing = np.flatnonzero(used & (labels != -1) & (over < HIGHEST_M))
    parts = ep.segment(points[standing].astype(np.float32), radius=GAP_M, min_points=FEWEST_POINTS)
    for number, is_part in [(labels, False), (parts, True)]:
        for cluster in range(number.max() + 1):
            crop = standing[number == cluster] if is_part else np.flatnonzero((number == cluster) & used)
            if len(crop) < FEWEST_POINTS:
                continue
            low, high = points[crop, :2].min(0), points[crop, :2].max(0)
            i, j = (((low + high) / 2 + REACH_M) / CELL_M).astype(int)
            told = None
            for of, widest, reach in CLUSTERS:
                about = score[of, max(0, i - reach) : i + reach + 1, max(0, j - reach) : j + reach + 1]
                is_asked = np.hypot(*(high - low)) <= widest and (of == PERSON or not is_part)
                if not is_asked or about.size == 0 or about.max() < LEAST_OF_CLUSTER:
                    continue
                row, column = np.unravel_index(about.argmax(), about.shape)
                x, y, length, width, _, yaw = box_at(output, max(0, i - reach) + row, max(0, j - reach) + column)
                if may_be(x, y, length, width, yaw):
                    told = told or asked.logits(points[crop], float(np.median(points[crop, 2] - over[crop])))
                    yield of, True, (logit(about.max()), told[of]), crop


def judged(file: Path, net: BirdsEye, asked: Asked, wanted: Counter) -> Iterator[Candidate]:
    """The candidates of a frame, and which labelled objects they are; adds the number of those to `wanted`."""
    points, rings, boxes, names, half, source = by_class.read(file)
    names = ["truck" if name == "bus" else name for name in names]
    is_ground = ep.segment(points.astype(np.float32), rings=rings) == -1
    is_judged = lambda at: np.hypot(*at[:2]) <= 40 and abs(np.arctan2(at[1], at[0])) <= half
    own = {}
    for number, (box, name) in enumerate(zip(boxes, names, strict=True)):
        within_box = by_class.inside(points, box)
        if name in NAMES and is_judged(box) and within_box.sum() >= 30:
            own[number] = within_box & ~is_ground
            wanted[source, name] += 1
    for of, is_cluster, logits, crop in candidates(net, asked, points, rings):
        one, cloud = Candidate(source, str(file), of, is_cluster, logits, crop), points[crop]
        held = [n for n, box in enumerate(boxes) if by_class.inside(cloud, box, 0.3).mean() >= 0.5]
        right = [n for n in held if names[n] == NAMES[of]]
        found = [n for n in right if n in own and own[n][crop].sum() >= max(1, own[n].sum() / 2)]
        one.object = found[0] if found else None
        middle = (cloud[:, :2].min(0) + cloud[:, :2].max(0)) / 2
        one.is_known = is_judged(middle) and (bool(found) or not right and not any(names[n] is None for n in held))
        yield one


def simulated(file: Path, net: BirdsEye, asked: Asked) -> Iterator[Candidate]:
    """The boxes of rare classes in packed scenes."""
    scenes = Scenes(file)
    for number in range(0, len(scenes), max(1, len(scenes) // SWEEPS)):
        points, boxes = scenes.sweep(number)
        true = [(NAMES[int(of)], within(points, int(of), *place)) for of, *place, _, _ in boxes]
        for one, of, x, y, length, width, _, yaw in objects(*scores(net, points), LEAST_OF_BOX):
            crop = np.flatnonzero(within(points, of, x, y, length, width, yaw))
            if NAMES[of] in RARE and len(crop) >= FEWEST_POINTS:
                shared = [(own[crop].sum(), own.sum()) for name, own in true if name == NAMES[of]]
                is_right = any(2 * n >= max(len(crop), of_all) for n, of_all in shared)
                logits = logit(one), asked.logits(points[crop, :3], 0.0)[of]
                yield Candidate("simulated", str(file), of, False, logits, crop, 0 if is_right else None)


def fitted(rows: ndarray, is_right: ndarray) -> list[float]:
    """A bias and two weights, neither of which is negative."""
    rows = np.column_stack([np.ones(len(rows)), rows])

    def loss(weights: ndarray) -> float:
        total = rows @ weights
        return (np.logaddexp(0, total) - is_right * total).sum() + RIDGE * (weights[1:] ** 2).sum()

    fit = minimize(loss, np.array([0.0, 0.4, 0.4]), bounds=[(None, None), (0, None), (0, None)])
    return [round(float(value), 4) for value in fit.x]


def weights_of(all_of: list[Candidate]) -> dict[str, list[list[float]]]:
    weights: dict[str, list[list[float]]] = {}
    for of, name in enumerate(NAMES):
        for is_cluster in (False, True):
            own = [one for one in all_of if one.of == of and one.is_cluster == is_cluster and one.is_known]
            is_right = np.array([one.object is not None for one in own], float)
            # Clusters of a class are optional, boxes are not.
            if own and is_right.any() or not is_cluster:
                weights.setdefault(name, []).append(fitted(np.array([one.logits for one in own]).reshape(-1, 2), is_right))
    return weights


def tell(weights: dict[str, list[list[float]]], all_of: list[Candidate]) -> None:
    """Writes the confidence of each candidate."""
    for one in all_of:
        of_class = weights[NAMES[one.of]]
        if one.is_cluster < len(of_class):
            bias, *own = of_class[one.is_cluster]
            one.confidence = float(1 / (1 + np.exp(-bias - np.dot(own, one.logits))))


def chosen(all_of: list[Candidate], least: float) -> list[Candidate]:
    """Those of a frame that are sure enough: a point belongs to the surest."""
    kept: list[Candidate] = []
    taken: set[int] = set()
    for one in sorted((one for one in all_of if one.confidence >= least), key=lambda one: -one.confidence):
        free = [point for point in one.points.tolist() if point not in taken]
        if len(free) >= max(FEWEST_POINTS, len(one.points) / 2):
            taken.update(free)
            kept.append(one)
    return kept


def table(all_of: list[Candidate], wanted: Counter, n_frames: int) -> None:
    """Found and false a frame by class and least confidence, and how often the confidence is right."""
    by_frame = defaultdict(list)
    for one in all_of:
        by_frame[one.frame].append(one)
    for least in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7):
        kept = [one for frame in by_frame.values() for one in chosen(frame, least)]
        row = []
        for of, name in enumerate(NAMES):
            found = {(one.frame, one.object) for one in kept if one.of == of and one.object is not None}
            false = sum(one.of == of and one.object is None and one.is_known for one in kept)
            row.append(f"{name} {len(found)} of {sum(n for (_, own), n in wanted.items() if own == name)}, {false / n_frames:.2f}")
        print(f"{least:.1f}: {'; '.join(row)}", flush=True)
    for low in (0.1, 0.3, 0.5, 0.7, 0.9):
        kept = [one for frame in by_frame.values() for one in chosen(frame, 0.1)]
        own = [one for one in kept if low <= one.confidence < low + 0.2 and one.is_known]
        if own:
            print(f"{low:.1f} to {low + 0.2:.1f}: {np.mean([one.object is not None for one in own]):.2f} of {len(own)} are right")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("frames", type=Path, nargs="+")
    parser.add_argument("--asked", type=Path, default=WEIGHTS / "street-128.safetensors")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenes", type=Path, nargs="+", required=True)
    flags = parser.parse_args()
    net, asked = BirdsEye(), Asked(flags.asked)
    net.load_state_dict(torch.load(flags.checkpoint, map_location="cpu")["mean"])
    net.eval()
    wanted: Counter = Counter()
    all_of = [one for file in flags.frames for one in judged(file, net, asked, wanted)]
    of_scenes = [one for file in flags.scenes for one in simulated(file, net, asked)]
    for source in sorted({one.source for one in all_of}):
        rest = [one for one in all_of if one.source != source]
        tell(weights_of(rest + of_scenes), [one for one in all_of if one.source == source])
    table(all_of, wanted, len(flags.frames))
    weights = weights_of(all_of + of_scenes)
    flags.out.write_text(json.dumps(weights) + "\n")
    print(weights)


if __name__ == "__main__":
    main()
