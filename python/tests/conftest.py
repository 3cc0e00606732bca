"""What all tests share: built-in meshes, and the program."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

ASSETS = Path(__file__).parents[2] / "assets"


def edgepuck(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the program that the package brings."""
    command = [sys.executable, "-m", "edgepuck", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    return done


def all_around() -> "ep.Sensor":
    """A sensor of 120 x 61 even directions, at any range."""
    import edgepuck as ep

    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder, "all-around.toml")
        profile.write_text(
            'name = "all-around"\n[range]\nmax_m = 1e6\n[uniform]\nazimuth_from_deg = -180\nazimuth_to_deg = 177\n'
            "azimuth_steps = 120\nelevation_from_deg = -90\nelevation_to_deg = 90\nelevation_steps = 61\n"
        )
        return ep.Sensor(profile)


@pytest.fixture(scope="session")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of built-in meshes, three to train with and one to test with of each class."""
    folder = tmp_path_factory.mktemp("shapes")
    edgepuck("gen-shapes", "--out", folder, "--train", 3, "--test", 1)
    return folder


@pytest.fixture(scope="session")
def cube() -> tuple[np.ndarray, np.ndarray]:
    import edgepuck as ep

    return ep.box((1.0, 1.0, 1.0))
