"""Every processor gives the bytes of scans that x86-64 gives, and nearly its logits.

`UPDATE_GOLDEN=1 cargo xtask test` on x86-64 rewrites the file that has them.
"""

import hashlib
import json
import os
import platform
from pathlib import Path

import numpy as np
import pytest

import edgepuck as ep

GOLDEN = Path(__file__).parent / "golden/x86_64.json"

# How far logits may lie from x86-64's, as a fraction of the largest. Each kernel adds up in an
# order of its own, which is worth some 80 roundings of f32. In i8, an activation between two of its
# 127 steps may become either, which is worth a step.
TOLERANCES = {"f32": 1e-5, "i8": 1 / 127}


@pytest.fixture(scope="module")
def computed(shapes: Path) -> dict[str, dict]:
    """What an x86-64 would write into the golden file."""
    lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*ep.box((1, 2, 0.5)), normalize="unit-sphere")
    effects = {"weather": {"rain_mm_h": 25}, "footprint": {"samples": 7}, "returns": "dual"}
    scan = lidar.scan(mesh, distance=3, elevation=20, noise=0.01, seed=7)
    scene = ep.Scenes("yard", seed=3)[0]
    arrays = {
        "scan": scan.positions,
        "effects": lidar.scan(mesh, effects=effects).positions,
        "dataset": ep.Dataset(shapes, "vlp32c", views=2, points=128, noise=0.01, seed=1).batch(range(8))[0],
        "scene": scene.scan.positions,
        "clusters": scene.cluster,
        "segment": ep.segment(scene.scan),
    }
    logits = {
        f"{model} {precision}": ep.Classifier(model, precision=precision)(scan).logits.tolist()
        for model in ["edge-64", "street-128"]
        for precision in TOLERANCES
    }
    digests = {name: hashlib.sha256(array.tobytes()).hexdigest() for name, array in arrays.items()}
    return {"sha256": digests, "logits": logits}


@pytest.fixture(scope="module")
def golden(computed: dict[str, dict]) -> dict[str, dict]:
    if "UPDATE_GOLDEN" in os.environ and platform.machine() == "x86_64":
        GOLDEN.write_text(json.dumps(computed, indent=1) + "\n")
    return json.loads(GOLDEN.read_text())


def test_scans_have_the_bytes_of_x86_64(computed: dict[str, dict], golden: dict[str, dict]) -> None:
    assert computed["sha256"] == golden["sha256"]


def test_logits_are_those_of_x86_64(computed: dict[str, dict], golden: dict[str, dict]) -> None:
    assert computed["logits"].keys() == golden["logits"].keys()
    for name, expected in golden["logits"].items():
        tolerance = TOLERANCES[name.split()[1]] * np.abs(expected).max()
        found = computed["logits"][name]
        np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance, err_msg=name)
