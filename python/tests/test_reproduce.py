"""The script that repeats the paper's experiments, on shapes that take no time."""

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

PLAN = """
about = "a test"
mesh_steps = 300
points = [16, 8]
tested_points = [64, 16]
kept = [8]
fronts = [[8, 16]]
mesh_points = 16
[recipe]
epochs = 12
batch = 4
[recipe.network]
trunk = [8, 16]
head = [12]
[recipe.augment]
drop = 0.2
"""


def box(path: Path, size: tuple[float, float, float]) -> None:
    """Writes the mesh of a box as OFF."""
    corners = [(x, y, z) for x in (0, size[0]) for y in (0, size[1]) for z in (0, size[2])]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = [" ".join(map(str, corner)) for corner in corners] + [" ".join(map(str, (4, *side))) for side in sides]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("OFF\n8 6 0\n" + "\n".join(lines) + "\n")


def reproduce(folder: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    words = [folder / "plan.toml", "--meshes", folder / "meshes", "--out", folder / "out"]
    command = [sys.executable, ROOT / "python/training/reproduce.py", *words]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done


def test_every_experiment_is_reported_and_a_second_run_trains_only_what_is_missing(tmp_path: Path) -> None:
    for i in range(4):
        half = "train" if i < 3 else "test"
        box(tmp_path / f"meshes/cube/{half}/cube_{i}.off", (1, 1 + 0.05 * i, 1))
        box(tmp_path / f"meshes/rod/{half}/rod_{i}.off", (0.1, 0.1 + 0.01 * i, 1))
    (tmp_path / "plan.toml").write_text(PLAN)
    found = reproduce(tmp_path).stdout
    assert found.endswith((tmp_path / "out/report.md").read_text())
    tables = found.split("## ")[1:]
    # Each has two lines of heading.
    assert [table.count("\n|") - 2 for table in tables] == [2, 2, 3, 7, 11]
    # A network tells these shapes apart on the data set that it was trained on.
    (row,) = [line for line in tables[3].splitlines() if line.startswith("| VLP-32C clean")]
    assert float(row.split("|")[7].split("%")[0]) > 80, row

    models = tmp_path / "out/models"
    (models / "random-8.safetensors").unlink()
    done = reproduce(tmp_path)
    assert done.stdout == found
    assert [line.split(":")[0] for line in done.stderr.splitlines() if "training" in line] == ["training random-8"]

    (models / "random-8.safetensors").write_bytes((models / "random-16.safetensors").read_bytes())
    assert "expected a training set, points and classes ('random-8', '8'" in reproduce(tmp_path, 1).stderr
    (tmp_path / "plan.toml").write_text(PLAN.replace("[16, 8]", "[8, 16]"))
    assert "an earlier run had another plan or other data" in reproduce(tmp_path, 1).stderr


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("kept = [8]", "kept = []", "expected counts in `points` and `kept`"),
        ("kept =", "keep =", "unexpected keyword argument 'keep'"),
        ("mesh_steps = 300\n", "", "missing 1 required positional argument: 'mesh_steps'"),
    ],
)
def test_another_plan_is_refused(before: str, after: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN.replace(before, after))
    assert message in reproduce(tmp_path, 1).stderr
