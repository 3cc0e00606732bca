"""The talk between `cargo xtask bench infer` and one engine: lines of text in,
a JSON object a line out.

First, unasked, {"version": V}. Then, to each request:

load SIZE SETTING  {}  makes ready for clouds of SIZE points; SETTING is the
                       number of threads, or of points to keep
answer             {"answer": [...]}  what one run computes
time REPEATS       {"wall_ns": [...], "cpu_ns": [...]}  of each run, CPU time
                       of all threads; some runs before them are not counted

What goes wrong is {"error": CAUSE}. An engine has load(size, setting), run(),
and answer(), which takes what run returned.
"""

import gc
import json
import os
import sys
import time

# Caches, branch predictors and thread pools of an engine that had to wait.
UNCOUNTED = 3

# Of each way that an engine has of doing its work.
TRIALS = 7


def serve(start):
    """Answers requests to the engine that `start` gives, with its version."""
    # Libraries write to standard output too.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def say(message):
        print(json.dumps(message), file=out, flush=True)

    try:
        engine, version = start()
    except Exception as error:
        say({"error": f"{type(error).__name__}: {error}"})
        return
    say({"version": version})
    for line in sys.stdin:
        try:
            say(answer(engine, line.split()))
        except Exception as error:
            say({"error": f"{type(error).__name__}: {error}"})


def answer(engine, words):
    match words:
        case ["load", size, setting]:
            engine.load(int(size), int(setting))
            return {}
        case ["answer"]:
            return {"answer": [float(x) for x in engine.answer(engine.run())]}
        case ["time", repeats]:
            return timed(engine.run, int(repeats))
    raise ValueError(f"no such request: {' '.join(words)}")


def timed(run, repeats):
    for _ in range(UNCOUNTED):
        run()
    wall_ns, cpu_ns = [], []
    gc.disable()
    for _ in range(repeats):
        wall, cpu = time.perf_counter_ns(), time.process_time_ns()
        run()
        wall_ns.append(time.perf_counter_ns() - wall)
        cpu_ns.append(time.process_time_ns() - cpu)
    gc.enable()
    return {"wall_ns": wall_ns, "cpu_ns": cpu_ns}


def fastest(ways):
    """That one of some callables which took least time in its best trial."""

    def least_ns(run):
        return min(timed(run, TRIALS)["wall_ns"])

    return min(ways, key=least_ns)
