"""The script in python/training writes networks that learnt, by recipes that it understands."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, read_safetensors

import edgepuck as ep

pytest.importorskip("torch")
TRAINING = ROOT / "python/training"


def train(*words: object) -> str:
    # The script's modules are beside it, where Python does not look if this variable of the tests is set.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    command = [sys.executable, TRAINING / "train.py", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def clouds(path: Path, n: int, n_points: int) -> None:
    """Writes a packed set of balls and rods."""
    draws = np.random.default_rng(n)
    labels = np.arange(n) % 2
    points = draws.normal(size=(n, n_points, 3)) * np.where(labels, 0.1, 1.0)[:, None, None] ** [0, 1, 1]
    points = (points / np.abs(points).max((1, 2), keepdims=True) / 2).astype(np.float32)
    names = np.array([f"{kind}_{i // 2}" for i, kind in enumerate(labels)], "S")
    np.savez(path, points=points, labels=labels, classes=np.array(["ball", "rod"], "S"), names=names)


def recipe(path: Path, out: Path, **changes: object) -> Path:
    """Writes the recipe at `path` with other values of these keys."""
    lines = path.read_text().splitlines()
    for key, value in changes.items():
        (at,) = [i for i, line in enumerate(lines) if line.startswith(f"{key} =")]
        lines[at] = f"{key} = {value}"
    out.write_text("\n".join(lines))
    return out


def test_set_network_is_trained_and_written(tmp_path: Path) -> None:
    clouds(tmp_path / "some.npz", 9, 256)
    own = recipe(TRAINING / "set-64.toml", tmp_path / "own.toml", epochs=1, batch=8)
    out = tmp_path / "set.safetensors"
    found = train("set-64", tmp_path / "some.npz", "--out", out, "--recipe", own, "--held", 0)
    assert "epoch 1: loss" in found
    assert "% of the clouds that were kept back" in found
    _, card = read_safetensors(out)
    assert json.loads(card["classes"]) == ["ball", "rod"]
    assert json.loads(card["abstractions"]) == [[256, 0.2], [64, 0.4]]
    classify = ep.Classifier(out)
    assert classify(np.load(tmp_path / "some.npz")["points"][0]).label in ("ball", "rod")


def test_mixed_clouds_have_the_labels_of_their_parts() -> None:
    code = """
import torch
from set_training import mixed_labels
print(mixed_labels(torch.tensor([0]), torch.tensor([2]), torch.tensor([0.25]), 3).tolist())
"""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, env=environment, cwd=TRAINING)
    assert json.loads(done.stdout) == [[0.75, 0, 0.25]], done.stderr


def test_networks_of_a_plan_learn_side_by_side(tmp_path: Path) -> None:
    pytest.importorskip("safetensors")
    clouds(tmp_path / "train.npz", 20, 32)
    plan = recipe(ROOT / "assets/reproduce/paper.toml", tmp_path / "plan.toml", epochs=10, batch=9)
    out = tmp_path / "models"
    found = train("paper", tmp_path, tmp_path, out, "random-16", "farthest-16", "--plan", plan)
    losses = [float(loss) for loss in re.findall(r"loss ([\d.]+);", found)]
    assert len(losses) == 2
    assert losses[1] < 0.8 * losses[0], found
    cloud = np.load(tmp_path / "train.npz")["points"][0]
    for name, sampler in (("random-16", "random"), ("farthest-16", "fps")):
        _, card = read_safetensors(out / f"{name}.safetensors")
        assert (card["training_set"], card["sampler"], card["points"]) == (name, sampler, "16")
        assert ep.Classifier(out / f"{name}.safetensors")(cloud).label in ("ball", "rod")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ("nothing = 1\n", "expected the keys epochs, batch,"),
        ("[augment]\ndrop = 0.5\n", "expected the key `epochs`, found none"),
        ("epochs = \n", "Invalid value"),
    ],
)
def test_other_recipes_are_refused(
    changed: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(TRAINING)
    from recipe import read_recipe

    (tmp_path / "own.toml").write_text(changed)
    with pytest.raises(SystemExit) as caught:
        read_recipe(tmp_path / "own.toml")
    assert message in str(caught.value)
    assert "own.toml: " in str(caught.value)
