"""Street scenes for a bird's-eye network: recipes of `edgepuck gen-scenes` that are drawn at random, and their sweeps packed.

    python scenes.py OUT --recipes 24 --sweeps 250 --seed 1

writes OUT/NNN.npz for each recipe, and goes on where it stopped. A recipe is `street` with more or fewer objects of each kind
(people between parked cars, rows of bicycles, pavement cafés), with sensors of 16 to 128 rings drawn at random beside the
built-in ones, 0.3 to 2.8 m above the ground. `--leave-out pandar64,hdl64e` keeps built-in sensors away, to be judged on.
"""

import argparse
import json
import shutil
import subprocess
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import edgepuck as ep
import numpy as np
from grid import CLASSES, points_of
from numpy.random import Generator

STREET = Path(__file__).resolve().parents[3] / "assets/scenes/street.toml"
BUILT_IN = ["hdl64e", "vlp32c", "hdl32e", "vls128", "os0-128", "os1-128", "xt32", "rs-lidar-32", "pandar64", "vlp16", "qt64", "helios-5515"]

# Of streets that are fuller than `street`: kind, class, count, place, distances, gaps, reflectivity.
FULLER: list[tuple[str, str, int, str, list[float], list[float], list[float]]] = [
    ("bicycle", "two-wheeler", 14, "parked", [2.5, 40], [0.05, 0.5], [0.05, 0.4]),
    ("bicycle", "two-wheeler", 8, "line", [2.5, 35], [0.05, 1], [0.05, 0.4]),
    ("motorcycle", "two-wheeler", 6, "parked", [2.5, 40], [0.1, 0.8], [0.05, 0.4]),
    ("cyclist", "two-wheeler", 4, "pavement", [2.5, 35], [0.3, 2], [0.1, 0.7]),
    ("motorcyclist", "two-wheeler", 3, "anywhere", [3, 35], [0.3, 2], [0.1, 0.7]),
    ("person", "person", 10, "parked", [2, 40], [0.3, 2], [0.2, 0.8]),
    ("person", "person", 10, "line", [2, 40], [0.2, 4], [0.2, 0.8]),
    ("person", "person", 16, "pavement", [2, 40], [0.02, 0.5], [0.2, 0.8]),
    ("person", "person", 4, "road", [3, 40], [0.3, 3], [0.2, 0.8]),
    ("truck", "truck", 3, "parked", [5, 50], [0.5, 3], [0.05, 0.85]),
    ("bus", "bus", 2, "parked", [5, 50], [0.5, 3], [0.05, 0.85]),
    ("chair", "clutter", 10, "pavement", [2.5, 30], [0.1, 0.6], [0.1, 0.6]),
    ("table", "clutter", 6, "pavement", [2.5, 30], [0.2, 1], [0.1, 0.6]),
    ("cabinet", "clutter", 5, "line", [2.5, 40], [0.1, 4], [0.1, 0.6]),
    ("shelf", "clutter", 4, "line", [2.5, 40], [0.1, 3], [0.1, 0.6]),
    ("bin", "clutter", 8, "line", [2.5, 40], [0.05, 1], [0.05, 0.6]),
    ("clutter", "clutter", 8, "line", [2.5, 40], [0.1, 2], [0.05, 0.85]),
    ("traffic-cone", "clutter", 6, "road", [2.5, 40], [1, 4], [0.4, 0.8]),
    ("barrier", "wall", 4, "line", [3, 45], [0, 1], [0.24, 0.85]),
    ("trunk", "tree", 10, "line", [3, 45], [2, 8], [0.2, 0.3]),
    ("tree", "tree", 8, "line", [3, 50], [1, 6], [0.3, 0.6]),
    ("pole", "pole", 10, "line", [2.5, 45], [0.8, 4], [0.1, 0.4]),
    ("lamp-post", "pole", 6, "anywhere", [3, 45], [1, 4], [0.1, 0.4]),
    ("traffic-sign", "sign", 6, "line", [3, 40], [1, 8], [0.5, 0.9]),
    ("house-front", "building", 10, "line", [4, 60], [0, 2], [0.24, 0.85]),
    ("wall", "wall", 5, "front", [4, 60], [0, 2], [0.24, 0.85]),
    ("fence", "fence", 6, "front", [3, 50], [0, 2], [0.2, 0.5]),
]


def toml(value: Any) -> str:
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def document(table: dict[str, Any]) -> str:
    return "".join(f"{key} = {toml(value)}\n" for key, value in table.items())


def sensor(rng: Generator, name: str) -> dict[str, Any]:
    """A rotating sensor of 16 to 128 rings, spaced evenly or closer about the horizon."""
    n = int(rng.choice([16, 20, 24, 32, 32, 40, 40, 48, 64, 64, 80, 96, 128]))
    top, bottom = rng.uniform(1.5, 22), -rng.uniform(13, 32)
    steps = np.linspace(-1, 1, n)
    power = rng.choice([1.0, rng.uniform(1, 2.2)])
    steps = np.sign(steps) * np.abs(steps) ** power
    elevations = np.where(steps > 0, steps * top, -steps * bottom) + rng.normal(0, 0.03, n)
    step_deg = rng.uniform(0.09, 0.4) if n <= 64 else rng.uniform(0.17, 0.4)
    sequence_us = step_deg / 360 * 1e5
    skew = rng.uniform(-4, 4, 4) if rng.random() < 0.4 else np.zeros(4)
    beams = [
        {"azimuth_offset_deg": round(float(skew[i % 4]), 3), "elevation_deg": round(float(e), 3),
         "firing_us": round(float(sequence_us * 0.9 * i / n), 3)}
        for i, e in enumerate(elevations)
    ]
    return {
        "name": name, "description": "drawn at random", "sources": ["drawn at random"],
        "range": {"min_m": round(rng.uniform(0.3, 1.0), 2), "max_m": round(rng.uniform(70, 200), 1)},
        "noise": {"typical_sigma_m": 0.02},
        "rotating": {"rpm": 600.0, "sequence_us": round(sequence_us, 4), "beam": beams},
    }


def recipe(rng: Generator, folder: Path, built_in: list[str]) -> Path:
    """Draws a recipe and its sensors into `folder`."""
    folder.mkdir(parents=True)
    drawn = tomllib.loads(STREET.read_text())
    objects = drawn.pop("object")
    # How full the street is, and of what: each entry by a factor of its own.
    full = rng.choice([0.6, 1.0, 1.5, 2.2])
    for entry in objects:
        entry["count"][1] = round(entry["count"][1] * full * rng.uniform(0.4, 1.6))
    for kind, of, most, place, distance, gap, reflectivity in FULLER:
        if rng.random() < 0.5:
            count = [0, round(most * full * rng.uniform(0.3, 1.3))]
            objects.append({"kind": kind, "class": of, "count": count, "place": place, "distance_m": distance,
                            "gap_m": gap, "reflectivity": reflectivity})
    # What stands first has its place; otherwise cars leave none beside them.
    rng.shuffle(objects)
    drawn["mount"]["height_m"] = [0.3, 1.2] if rng.random() < 0.25 else [1.2, 2.8]
    drawn["mount"]["tilt_deg"] = [0, float(rng.choice([1, 2, 4]))]
    drawn["ground"]["slope_deg"] = [0, float(rng.choice([2, 4, 7]))]
    drawn["ground"]["roughness_m"] = [0, float(rng.choice([0.01, 0.02, 0.04]))]
    drawn["variants"] = 64
    sensors = []
    for number in range(10):
        name = str(rng.choice(built_in)) if number < 4 else f"drawn-{number}"
        if number >= 4:
            profile = sensor(rng, name)
            name = f"{name}.toml"
            parts = {key: profile.pop(key) for key in ("range", "noise", "rotating")}
            tables = "".join(f"[{key}]\n{document(table)}" for key, table in parts.items())
            (folder / name).write_text(document(profile) + tables)
        effects = {"noise": {"sigma_m": round(rng.uniform(0.004, 0.03), 4)},
                   "dropout": {"probability": round(rng.uniform(0.0, 0.12), 3)}}
        sensors.append({"profile": name, "effects": effects})
    tables = {key: drawn.pop(key) for key in ("ground", "mount")}
    drawn.pop("sensor")
    text = document(drawn) + "".join(f"[{key}]\n{document(table)}" for key, table in tables.items())
    for key, entries in (("sensor", sensors), ("object", objects)):
        text += "".join(f"[[{key}]]\n{document(entry)}" for entry in entries)
    path = folder / "street.toml"
    path.write_text(text)
    return path


def packed(sweep: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """The points of a sweep as `points_of` has them, and its objects: class, x, y, length, width, yaw, height, and points
    that are not ground."""
    with np.load(sweep) as saved:
        points, rings, number = saved["positions"], saved["ring"][:, 0], saved["object"][:, 0]
    about = json.loads(sweep.with_suffix(".json").read_text())
    labels = ep.segment(points.astype(np.float32), rings=rings)
    if (labels == -1).sum() < 100:
        return None
    seen = np.bincount(number[labels != -1].astype(int), minlength=10**5)
    pose = about["sensor_pose"]
    x, y, z, w = pose["quaternion_xyzw"]
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    boxes = []
    for one in about["objects"]:
        if one["class"] in CLASSES:
            place = turn.T @ (np.array(one["position_m"]) - pose["position_m"])
            length, width, height = one["size_m"]
            boxes.append([CLASSES[one["class"]], *place[:2], length, width, np.radians(one["yaw_deg"]) - yaw,
                          height, seen[one["object"]]])
    return points_of(points, labels)[0], np.array(boxes, np.float32).reshape(-1, 8)


def make(number: int, out: Path, n_sweeps: int, seed: int, built_in: list[str]) -> str:
    """Makes the sweeps of a recipe, and packs them."""
    file = out / f"{number:03}.npz"
    if file.exists():
        return f"{file} is there"
    ep.set_num_threads(1)
    folder = out / f"{number:03}"
    shutil.rmtree(folder, ignore_errors=True)
    path = recipe(np.random.default_rng([seed, number]), folder / "recipe", built_in)
    n = str(n_sweeps)
    command = ["edgepuck", "gen-scenes", path, "--sweeps", n, "--save", n, "--seed", str(number), "--out", folder / "sweeps"]
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    sweeps = [one for one in map(packed, sorted((folder / "sweeps").rglob("[0-9]*.npz"))) if one]
    points, boxes = zip(*sweeps, strict=True)
    ends = [np.cumsum([0, *map(len, parts)]) for parts in (points, boxes)]
    np.savez(out / f"{number:03}.part.npz", points=np.concatenate(points), ends=ends[0], boxes=np.concatenate(boxes), box_ends=ends[1])
    (out / f"{number:03}.part.npz").rename(file)
    shutil.rmtree(folder)
    return f"{file}: {len(sweeps)} sweeps, {len(np.concatenate(boxes))} objects"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--recipes", type=int, default=24)
    parser.add_argument("--sweeps", type=int, default=250, help="sweeps of each recipe")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--leave-out", default="", help="built-in sensors not to use")
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    built_in = [name for name in BUILT_IN if name not in asked.leave_out.split(",")]
    with ProcessPoolExecutor(asked.processes) as pool:
        todo = [pool.submit(make, n, asked.out, asked.sweeps, asked.seed, built_in) for n in range(asked.recipes)]
        for one in todo:
            print(one.result(), flush=True)


if __name__ == "__main__":
    main()
