"""Runs each notebook of `src/notebooks` from its first cell to its last, in an empty folder, by Jupyter's own kernel."""

import importlib.util
import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted(Path(__file__).parent.glob("src/notebooks/*.ipynb"))
# The longest time of a cell.
LONGEST_S = 300


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs(file, tmp_path, monkeypatch):
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    missing = [name for name in notebook.metadata.edgepuck.needs if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} is not installed")
    # Commands of cells are those beside this Python, and the kernel is this Python.
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    NotebookClient(notebook, timeout=LONGEST_S, resources={"metadata": {"path": tmp_path}}).execute()


def test_notebooks_are_kept_without_outputs():
    assert len(NOTEBOOKS) == 3
    for file in NOTEBOOKS:
        cells = nbformat.read(file, as_version=4).cells
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), file
