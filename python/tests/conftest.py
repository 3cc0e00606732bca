"""What all tests share: built-in meshes, and the program."""

import subprocess
import sys
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
