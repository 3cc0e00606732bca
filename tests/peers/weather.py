"""LISA's rain and snow against `edgepuck corrupt --rain` on the same clouds.

LISA is a program that others may run but that we may not ship (GPL-3). Clone
https://github.com/velatkilic/LISA, and name its folder in EDGEPUCK_LISA. Its packages are old: the script
makes an environment for them beside its output. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import math
import os
import sys
import venv
from pathlib import Path

from peer import OUT, edgepuck, run, skip, skipped_if_missing

with skipped_if_missing():
    import numpy

LISA = os.environ.get("EDGEPUCK_LISA")
if not LISA:
    skip("EDGEPUCK_LISA names no clone (see the script)")

LISA_PACKAGES = ["numpy==1.26.4", "scipy==1.13.1", "PyMieScatt==1.8.1.1"]
# 3 mrad; 90 % at 200 m; from 1.5 m: LISA's defaults.
LISA_SENSOR = """
name = "lisa"
range = { min_m = 1.5, max_m = 200.0 }
detection = { reflectivity = 0.9, range_m = 200.0 }
footprint = { divergence_deg = [0.17188733853924697, 0.17188733853924697], separation_m = 1.0 }
[uniform]
azimuth_from_deg = 0.0
azimuth_to_deg = 1.0
azimuth_steps = 2
elevation_from_deg = 0.0
elevation_to_deg = 1.0
elevation_steps = 2
rpm = 600.0
"""

# Runs in LISA's own environment.
ASK_LISA = """
import json, sys
import numpy as np
import atmos_models
np.random.seed(1)
kind, rate, n = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
model = atmos_models.LISA(atm_model=kind)
for range_m, reflectivity in json.loads(sys.argv[4]):
    cloud = np.tile([range_m, 0.0, 0.0, reflectivity], (n, 1))
    labels = model.augment(cloud, rate)[:, 4]
    print("counts", *[int((labels == label).sum()) for label in (0, 1, 2)])
"""

CASES = [(10.0, 0.1), (30.0, 0.1), (30.0, 0.5), (60.0, 0.1), (100.0, 0.5)]
WEATHERS = [("rain", 10.0), ("rain", 50.0), ("rain", 100.0), ("snow", 1.0), ("snow", 10.0)]
N_LISAS, N_OURS = 20_000, 100_000


def edgepuck_weather(cloud, flags, sensor):
    """Positions, intensities and media of `cloud` [n, 4] in the weather of `flags`."""
    (OUT / "sensor.toml").write_text(sensor)
    numpy.savez(OUT / "clear.npz", positions=cloud[:, :3].astype(numpy.float32),
                intensity=cloud[:, 3:].astype(numpy.float32))
    edgepuck("corrupt", OUT / "clear.npz", "--overwrite", "--out", OUT / "weather.npz", "--sensor", OUT / "sensor.toml", *flags)
    told = numpy.load(OUT / "weather.npz")
    return told["positions"].astype(float), told["intensity"][:, 0].astype(float), told["medium"][:, 0]


def lisa():
    """Of points at one range, as many are lost, scattered and kept as LISA says."""
    python = OUT.parent / "lisa-venv/bin/python3"
    if not python.exists():
        venv.create(python.parents[1], with_pip=True)
        run(python, "-m", "pip", "install", "-q", *LISA_PACKAGES)
    for kind, rate in WEATHERS:
        answer = run(python, "-c", ASK_LISA, kind, rate, N_LISAS, json.dumps(CASES),
                     cwd=Path(LISA) / "python_old", env={**os.environ, "PYTHONPATH": "."}).stdout
        counts = [line.split()[1:] for line in answer.splitlines() if line.startswith("counts")]
        for (range_m, reflectivity), theirs in zip(CASES, counts, strict=True):
            cloud = numpy.tile([range_m, 0.0, 0.0, reflectivity], (N_OURS, 1))
            _, _, media = edgepuck_weather(cloud, [f"--{kind}", rate], LISA_SENSOR)
            ours = [N_OURS - len(media), (media > 0).sum(), (media == 0).sum()]
            for label, a, b in zip(["lost", "scattered", "kept"], map(int, theirs), ours, strict=True):
                p, q = a / N_LISAS, b / N_OURS
                both = (a + b) / (N_LISAS + N_OURS)
                sigma = math.sqrt(both * (1 - both) * (1 / N_LISAS + 1 / N_OURS))
                print(f"{kind} {rate} mm/h, {range_m} m, {reflectivity}: {label} {q:.4f}, LISA {p:.4f}, "
                      f"standard deviation {sigma:.4f}")
                # Of 75 comparisons the farthest may be 4 of them; LISA's extinction is Mie's.
                assert abs(p - q) <= 4 * sigma + 2e-4


lisa()
