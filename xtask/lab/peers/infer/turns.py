"""What comparisons share: the clocks, and the machine."""

import gc
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

# Caches, branch predictors and thread pools of an engine that had to wait.
UNCOUNTED = 3

# Of each way that an engine has of doing its work.
TRIALS = 7


def timed(run, repeats):
    """The cost of each of some runs: seconds of the wall clock, and of CPU time of all threads."""
    for _ in range(UNCOUNTED):
        run()
    costs = []
    gc.disable()
    for _ in range(repeats):
        wall, cpu = time.perf_counter_ns(), time.process_time_ns()
        run()
        wall, cpu = time.perf_counter_ns() - wall, time.process_time_ns() - cpu
        costs.append({"wall_s": wall * 1e-9, "cpu_s": cpu * 1e-9})
    gc.enable()
    return costs


def fastest(ways):
    """That one of some callables which took least time in its best trial."""

    def least_s(run):
        return min(cost["wall_s"] for cost in timed(run, TRIALS))

    return min(ways, key=least_s)


def machine():
    """What a record states of the machine, and of the run."""
    here = Path(__file__).parent
    found = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=here, capture_output=True, text=True)
    return {
        "unix_time_s": int(time.time()),
        "command": sys.argv[1:],
        "commit": found.stdout.strip() or None,
        "cpu": processor(),
        "threads": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}".lower(),
        "load_average": os.getloadavg(),
    }


def processor():
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(": ")[1] for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
