"""The stubs of the compiled module say what it has, and the package's types agree."""

import importlib.util
import pkgutil
import subprocess
import sys

import pytest

import edgepuck


def test_stubs_are_those_of_the_module() -> None:
    pytest.importorskip("mypy")
    run("mypy.stubtest", "edgepuck._edgepuck")


def test_the_package_is_typed() -> None:
    pytest.importorskip("mypy")
    modules = {module.name for module in pkgutil.iter_modules(edgepuck.__path__)}
    # Modules with the name of the package that they need.
    for needed in ("torch", "onnx", "mujoco", "gymnasium"):
        if importlib.util.find_spec(needed) is None:
            modules -= {needed, {"torch": "_checkpoint", "onnx": "_onnx_graph"}.get(needed)}
    run("mypy", "--strict", *(f"--module=edgepuck.{module}" for module in sorted(modules)))


def run(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
