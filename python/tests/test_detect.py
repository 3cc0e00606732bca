"""`detect` finds the same objects in each precision."""

import numpy as np
import pytest

import edgepuck as ep

# A truck or a bus: the bird's-eye network does not tell them apart.
CLASSES = {"car": 0.95, "person": 0.8, "two-wheeler": 0.9, "heavy": 0.75}


def named(one: ep.Detection) -> str:
    return "heavy" if one.label in ("truck", "bus") else one.label


@pytest.fixture(scope="module")
def streets() -> list[list[list[ep.Detection]]]:
    """What f32 and int8 find in simulated streets."""
    scans = [ep.Scenes("street", seed=seed)[0].scan for seed in range(12)]
    return [[ep.detect(scan, precision=precision) for precision in ("f32", "i8")] for scan in scans]


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("of", [0, 1], ids=["f32", "i8"])
def test_what_a_precision_finds_the_other_finds(streets: list[list[list[ep.Detection]]], name: str, of: int) -> None:
    """But for objects near the least confidence. Ranges that round what cells with little say to 0 lost seven trucks of eight."""
    n_same, n_all = 0, 0
    for found in streets:
        for one in found[of]:
            near = (two for two in found[1 - of] if np.hypot(*(np.array(one.centre) - two.centre)[:2]) < 1.5)
            n_all += named(one) == name
            n_same += named(one) == name and any(named(two) == name for two in near)
    assert n_all >= 10
    assert n_same >= CLASSES[name] * n_all, f"{n_same} of {n_all}"
