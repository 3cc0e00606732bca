"""Compares the speed of Edgepuck's classifier with that of other engines, on one thread.

    pip install -r xtask/lab/peers/infer/requirements.txt ./python
    python xtask/lab/peers/infer/compare.py --points 16,64,256,1024,4096

All classify the same clouds with the same PointNet, whose weights are random, in turns. An engine that does not start
is skipped with a message; an engine whose answer is wrong is not timed.
"""

import argparse
import json
import statistics
import sys
import time
from collections import deque
from pathlib import Path

import numpy
import pointnet
import turns
from engines import Edgepuck, Ncnn, OnnxRuntime, OpenVino
from models import prepare

# The arithmetic of each engine, and what starts it.
ENGINES = {
    "edgepuck": ("f32", lambda folder: Edgepuck(folder, "f32")),
    "onnxruntime": ("f32", OnnxRuntime),
    "openvino": ("f32", OpenVino),
    "ncnn": ("f32", Ncnn),
    "openvino-bf16": ("half", lambda folder: OpenVino(folder, precision="bf16")),
    "ncnn-f16": ("half", lambda folder: Ncnn(folder, storage="f16")),
    "ncnn-bf16": ("half", lambda folder: Ncnn(folder, storage="bf16")),
    "edgepuck-i8": ("i8", lambda folder: Edgepuck(folder, "i8")),
    "onnxruntime-i8": ("i8", lambda folder: OnnxRuntime(folder, suffix="-i8")),
    "openvino-i8": ("i8", lambda folder: OpenVino(folder, suffix="-i8")),
    "ncnn-i8": ("i8", lambda folder: Ncnn(folder, suffix="-i8")),
}
POINTS = "16,32,64,128,256,512,1024,2048,4096"
# Engines sum in different orders; over this model's layers that gives log-probabilities that differ by some 1e-6.
F32_TOLERANCE = 1e-4
# A share of the range of the log-probabilities: not a verdict on the accuracy of a reduced arithmetic, which the tables
# show, but on whether an engine ran this model at all.
REDUCED_TOLERANCE = 0.25
# How long a turn should last: long against a scheduler's slice, short against what disturbs a machine for a while.
TURN_S = 0.04
REPEATS = (3, 40)
# Threads of the engine that ran last may still spin; ncnn's do for 20 ms.
PAUSE_S = 0.03


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", default=POINTS, help=f"sizes of the clouds [default: {POINTS}]")
    parser.add_argument("--rounds", type=int, default=9, help="turns of each engine at each size [default: 9]")
    parser.add_argument("--engines", default=",".join(ENGINES), help="names of engines [default: all]")
    parser.add_argument("--work", type=Path, default="target/peers/infer", help="folder of the models")
    parser.add_argument("--json", type=Path, help="write all figures, with every repeat, to this file")
    args = parser.parse_args()
    sizes = [int(word) for word in args.points.split(",")]
    layers, cloud = prepare(args.work, max(sizes))
    machine = turns.machine()
    engines = start(args.engines.split(","), args.work)
    entries = [entry for n in sizes for entry in compare(engines, layers, cloud[:n], args.rounds)]
    print(f"One PointNet by points, one thread of {machine['cpu']}; {versions(engines)}\n")
    for clock in ("cpu_s", "wall_s"):
        print(times(entries, sizes, clock))
        print(ratios(entries, sizes, clock))
    if args.json:
        report = {"machine": machine, "versions": {n: e.version for n, e in engines.items()}, "classifying": entries}
        args.json.write_text(json.dumps(report) + "\n")


def start(names, folder):
    engines = {}
    for name in names:
        try:
            engines[name] = ENGINES[name][1](folder)
        except Exception as error:  # Packages report what is missing in many ways.
            print(f"skipped {name}: {error}", file=sys.stderr)
    return engines


def compare(engines, layers, cloud, rounds):
    """An entry for each engine that classifies `cloud` rightly, in `rounds` of one turn each."""
    n = len(cloud)
    print(f"{n} points", file=sys.stderr)
    truth = pointnet.log_probabilities(layers, cloud)
    entries = deque()
    for name, engine in engines.items():
        arithmetic = ENGINES[name][0]
        allowed = F32_TOLERANCE if arithmetic == "f32" else REDUCED_TOLERANCE * numpy.ptp(truth)
        try:
            engine.load(cloud)
            error = float(numpy.abs(engine.answer(engine.run()) - truth).max())
            # A NaN is within no tolerance.
            if not error <= allowed:
                raise ValueError(f"its answer is off by {error:.1e}, more than {allowed:.1e}")
            least_s = min(cost["wall_s"] for cost in turns.timed(engine.run, REPEATS[0]))
        except Exception as error:
            print(f"left out {name} at {n} points: {error}", file=sys.stderr)
            continue
        entry = {"engine": name, "arithmetic": arithmetic, "points": n, "error": error, "costs": []}
        entries.append((engine, min(max(int(TURN_S / least_s), REPEATS[0]), REPEATS[1]), entry))
    for _ in range(rounds):
        for engine, repeats, entry in entries:
            time.sleep(PAUSE_S)
            entry["costs"] += turns.timed(engine.run, repeats)
        # Everyone begins in turn.
        entries.rotate(-1)
    return sorted((entry for *_, entry in entries), key=lambda entry: list(ENGINES).index(entry["engine"]))


def median_ms(entry, clock):
    return statistics.median(cost[clock] for cost in entry["costs"]) * 1e3


def fastest_rival(entries, n, arithmetic, clock):
    """The entry of the fastest engine of another project at `n` points, or None."""
    rivals = [e for e in entries if e["points"] == n and e["arithmetic"] == arithmetic and not is_ours(e)]
    return min(rivals, key=lambda entry: median_ms(entry, clock), default=None)


def is_ours(entry):
    return entry["engine"].startswith("edgepuck")


def times(entries, sizes, clock):
    """A table of milliseconds, with a star at the fastest rival of each arithmetic."""
    rows = []
    for name, (arithmetic, _) in ENGINES.items():
        own = {entry["points"]: entry for entry in entries if entry["engine"] == name}
        if own:
            best = {n: fastest_rival(entries, n, arithmetic, clock) is own.get(n, entries) for n in sizes}
            cells = [f"{median_ms(own[n], clock):.3g}{'*' * best[n]}" if n in own else "-" for n in sizes]
            rows.append([name, arithmetic, f"{max(entry['error'] for entry in own.values()):.0e}", *cells])
    words = {"cpu_s": "CPU time, all threads", "wall_s": "the wall clock"}[clock]
    return table(f"ms, median of {words}; * the fastest rival", ["engine", "arithmetic", "error", *sizes], rows)


def ratios(entries, sizes, clock):
    """How many times as fast each engine of ours is as the fastest rival in f32, and in its own arithmetic."""
    rows = []
    for name, own_arithmetic in (("edgepuck", "f32"), ("edgepuck-i8", "i8")):
        for arithmetic in dict.fromkeys(("f32", own_arithmetic)):
            cells = []
            for n in sizes:
                own = [entry for entry in entries if entry["engine"] == name and entry["points"] == n]
                rival = fastest_rival(entries, n, arithmetic, clock)
                is_known = own and rival
                cells.append(f"{median_ms(rival, clock) / median_ms(own[0], clock):.2f}" if is_known else "-")
            rows.append([name, arithmetic, *cells])
    return table("times as fast as the fastest rival", ["engine", "in", *sizes], rows)


def versions(engines):
    projects = {name.split("-")[0]: engine.version for name, engine in engines.items()}
    return ", ".join(f"{name} {version}" for name, version in projects.items())


def table(title, heading, rows):
    """A table in Markdown."""
    lines = [heading, ["---"] * len(heading), *rows]
    return f"{title}\n\n" + "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


if __name__ == "__main__":
    main()
