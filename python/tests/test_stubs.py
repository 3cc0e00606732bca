"""The stubs of the compiled module say what it has, and the package's types agree."""

import subprocess
import sys

import pytest


def test_stubs_are_those_of_the_module() -> None:
    pytest.importorskip("mypy")
    run("mypy.stubtest", "edgepuck._edgepuck")


def test_the_package_is_typed() -> None:
    pytest.importorskip("mypy")
    run("mypy", "--strict", "--package", "edgepuck")


def run(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
