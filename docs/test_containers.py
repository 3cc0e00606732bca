"""hadolint on the files of containers: no builder of images is needed."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("file", ["Dockerfile", "infer-cpu/Containerfile"])
def test_hadolint_has_nothing_to_say(file):
    if shutil.which("hadolint") is None:
        pytest.skip("hadolint is not installed")
    done = subprocess.run(["hadolint", ROOT / file], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
