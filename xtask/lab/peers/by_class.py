"""What `detect` finds in labelled sweeps of real sensors, by class: all classes, with what it takes for each of them.

    python xtask/lab/peers/by_class.py FRAME.npz... [--min-confidence 0.5] [--precision i8]

It needs the package edgepuck and NumPy. A frame holds `xyz_mm`, `boxes` (centre, length, width, height, yaw), and `classes`
(of KITTI or Argoverse 2) or `cls` (1 car, 2 person, 3 two-wheeler, 4 truck, 5 bus, 6 not judged), and as JSON in `meta` the
sensor and the half angle within which it is labelled. The rules: an object of 30
points or more within 40 m is found if a detection of its class holds half of its points that are not ground, and is
half made of its points; a false alarm is a detection half of which is in no labelled box of its class.
"""

import argparse
import json
from collections import Counter, defaultdict
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import edgepuck as ep
import numpy as np

CLASSES = ["car", "person", "two-wheeler", "truck", "bus"]
LABELS = {
    "car": "car", "van": "car", "regular_vehicle": "car", "pedestrian": "person", "person_sitting": "person",
    "truck": "truck", "box_truck": "truck", "truck_cab": "truck", "large_vehicle": "truck", "bus": "bus",
    "school_bus": "bus", "cyclist": "two-wheeler", "bicyclist": "two-wheeler", "bicycle": "two-wheeler",
    "motorcycle": "two-wheeler", "motorcyclist": "two-wheeler",
}
# Where the sensors of Argoverse 2's car stand, the mean of both, metres. Fitted so that each laser draws a cone, to two sweeps
# of one log, which agree within a millimetre; other cars may differ.
ARGOVERSE2_M = np.array([1.347, 0.003, 1.583])


def read(file):
    """Points, rings, boxes, their classes, the half angle that is labelled, and the sensor of a frame."""
    with np.load(file, allow_pickle=False) as frame:
        points, boxes = frame["xyz_mm"] / 1000, frame["boxes"].astype(float)
        about = json.loads(str(frame["meta"])) if "meta" in frame else {}
        rings = frame["laser"] if "laser" in frame else None
        if "cls" in frame:
            names = [[None, *CLASSES, "not judged"][number] for number in frame["cls"]]
        else:
            names = [LABELS.get(str(name).lower()) for name in frame["classes"]]
    if rings is not None:
        points, boxes[:, :3] = points - ARGOVERSE2_M, boxes[:, :3] - ARGOVERSE2_M
    half = about.get("view_half_deg", 40.7 if rings is None else 180)
    sensor = about.get("sensor", "HDL-64E" if rings is None else "VLP-32C").split(" (")[0]
    source = about.get("source", "KITTI" if rings is None else "Argoverse 2")
    return points, rings, boxes, names, np.radians(half), f"{source}, {sensor}"


def inside(points, box, margin_m=0.0):
    off, (sin, cos) = points - box[:3], (np.sin(box[6]), np.cos(box[6]))
    along = np.stack([off[:, 0] * cos + off[:, 1] * sin, off[:, 1] * cos - off[:, 0] * sin, off[:, 2]], 1)
    return (np.abs(along) <= box[3:6] / 2 + margin_m).all(1)


@dataclass
class Outcome:
    """An object that is asked for and found or missed, or a detection that is right or false."""

    kind: str
    label: str
    points: np.ndarray
    # For a false detection: to what its points belong.
    truth: str = ""
    confidence: float | None = None


def outcomes(sweep, least, precision="f32"):
    """What `detect` finds and misses in a sweep of `read`."""
    points, rings, boxes, names, half, _ = sweep
    cloud = points.astype(np.float32)
    found = ep.detect(cloud, rings=rings, min_confidence=least, precision=precision)
    is_ground = ep.segment(cloud, rings=rings) == -1
    is_judged = lambda at: np.hypot(*at[:2]) <= 40 and abs(np.arctan2(at[1], at[0])) <= half
    for box, name in zip(boxes, names):
        own = inside(points, box)
        if name in CLASSES and is_judged(box) and own.sum() >= 30:
            standing = (own & ~is_ground).sum()
            holds = lambda one: (own & ~is_ground)[one.indices].sum() >= max(1, standing / 2)
            within = lambda one: inside(points[one.indices], box, 0.3).mean() >= 0.5
            is_found = any(one.label == name and holds(one) and within(one) for one in found)
            yield Outcome("found" if is_found else "missed", name, np.flatnonzero(own))
    for one in filter(lambda one: is_judged(one.centre), found):
        held = [name for box, name in zip(boxes, names) if inside(points[one.indices], box, 0.3).mean() >= 0.5]
        if one.label in held:
            yield Outcome("right", one.label, one.indices, confidence=one.confidence)
        elif "not judged" not in held:
            truth = next(filter(None, held), "nothing labelled" if not held else "another label")
            yield Outcome("false", one.label, one.indices, truth, one.confidence)


def judge(file, least, tally, precision="f32"):
    """Counts the outcomes of a sweep in `tally[sensor, class]`; gives the sensor."""
    sweep = read(file)
    for one in outcomes(sweep, least, precision):
        counted = tally[sweep[-1], one.label]
        counted[one.kind] += 1
        counted["asked"] += one.kind in ("found", "missed")
        if one.kind == "false":
            counted["in truth", one.truth] += 1
    return sweep[-1]


def interval(right, asked):
    """Wilson's interval of 95 %, in percent."""
    z, share = 1.96, right / asked
    middle, half = share + z * z / (2 * asked), z * sqrt(share * (1 - share) / asked + z * z / (4 * asked * asked))
    return f"{100 * (middle - half) / (1 + z * z / asked):.0f} to {100 * (middle + half) / (1 + z * z / asked):.0f}"


def main():
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("frames", type=Path, nargs="+")
    flags.add_argument("--min-confidence", type=float, default=0.5)
    flags.add_argument("--precision", choices=["f32", "i8"], default="f32")
    asked = flags.parse_args()
    tally = defaultdict(Counter)
    frames = Counter(judge(file, asked.min_confidence, tally, asked.precision) for file in asked.frames)
    for (sensor, name), one in list(tally.items()):
        tally["all", name].update(one)
    frames["all"] = frames.total()
    print("| frames | class | found | 95 % interval, % | right detections | false ones | a frame | which are |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for sensor, n in frames.items():
        for name in CLASSES:
            if one := tally.get((sensor, name)):
                share = f"{one['found']} of {one['asked']}"
                span = interval(one["found"], one["asked"]) if one["asked"] else ""
                truth = ", ".join(f"{count} {key[1]}" for key, count in one.most_common() if isinstance(key, tuple))
                print(f"| {sensor} ({n}) | {name} | {share} | {span} | {one['right']} | {one['false']} | "
                      f"{one['false'] / n:.2f} | {truth} |")


if __name__ == "__main__":
    main()
