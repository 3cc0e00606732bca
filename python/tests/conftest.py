"""What all tests share: built-in meshes, the program, and readers of its files."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
ASSETS = ROOT / "assets"
# Data beside the checkout, on some machines.
SHARED = ROOT.parent / "shared/data"


def edgepuck(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the program that the package brings."""
    command = [sys.executable, "-m", "edgepuck", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    return done


def logits(model: Path, files: list[Path], *flags: object) -> list[np.ndarray]:
    """The logits that a model gives to clouds in files, as they are."""
    words = ["--json", "--allow-untrained", "--model", model, "--normalize", "none"]
    done = edgepuck("classify", *words, *flags, *files)
    return [np.array(json.loads(line)["logits"]) for line in done.stdout.splitlines()]


def read_safetensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The tensors of a file in f32, by name, and its metadata."""
    raw = path.read_bytes()
    size = int.from_bytes(raw[:8], "little")
    header, body = json.loads(raw[8 : 8 + size]), raw[8 + size :]
    metadata = header.pop("__metadata__", {})
    kinds = {"F32": "<f4", "F16": "<f2"}
    values = {
        name: np.frombuffer(body[slice(*of["data_offsets"])], kinds[of["dtype"]]).astype(np.float32)
        for name, of in header.items()
        if of["dtype"] in kinds
    }
    return {name: value.reshape(header[name]["shape"]) for name, value in values.items()}, metadata


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
    edgepuck("gen-dataset", "--save-meshes", folder, "--train", 3, "--test", 1)
    return folder


@pytest.fixture(scope="session")
def cube() -> tuple[np.ndarray, np.ndarray]:
    import edgepuck as ep

    return ep.box((1.0, 1.0, 1.0))
