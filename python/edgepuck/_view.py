"""Pages that show points, meshes and boxes in three dimensions."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._detect import Detection
from ._mesh import Mesh
from ._page import View, page_of
from ._scan import Scan
from ._scenes import DrawnScene


def view(
    *shown: str | os.PathLike[str] | Scan | DrawnScene | Mesh | Sequence[Detection] | ArrayLike,
    truth: str | os.PathLike[str] | Sequence[Detection] | None = None,
) -> View:
    """Show points, meshes and boxes, like `edgepuck view`: in a notebook below the cell, or by
    `view(...).open()` in the browser. Two clouds or meshes stand side by side.

    Args:
        shown: Each is a `Scan` or a `DrawnScene`, points of shape [n, 3], a `Mesh`, the detections of
            a sweep, which are drawn in what is named before them, or the path of any file or folder
            that `edgepuck view` shows.
        truth: Boxes to draw as truth, as detections or as the path of a file.

    Raises:
        Error: A file cannot be read, or the points have a wrong shape.

    >>> import edgepuck as ep
    >>> scan = ep.Sensor("vlp16").scan(ep.Mesh(*ep.box((1.0, 2.0, 0.5))), distance=4)
    >>> "<iframe" in view(scan)._repr_html_()
    True
    """
    if not shown:
        raise _edgepuck.Error("expected something to show, found nothing")
    with tempfile.TemporaryDirectory(prefix="edgepuck-") as folder:
        words = [_file(one, Path(folder, f"argument-{number}")) for number, one in enumerate(shown)]
        if truth is not None:
            words += ["--truth", _file(truth, Path(folder, "truth"))]
        return page_of(words, folder)


def _file(
    shown: str | os.PathLike[str] | Scan | DrawnScene | Mesh | Sequence[Detection] | ArrayLike, place: Path
) -> str:
    """The file of `shown`, which is written in the folder `place` if it is none."""
    if isinstance(shown, (str, os.PathLike)):
        return os.fspath(shown)
    place.mkdir()
    if isinstance(shown, DrawnScene):
        shown = shown.scan
    if isinstance(shown, Scan):
        file = place / "scan.npz"
        shown.save(file)
    elif isinstance(shown, Mesh):
        file = place / "mesh.off"
        file.write_text(_off(shown.vertices, shown.faces))
    elif isinstance(shown, (list, tuple)) and all(isinstance(one, Detection) for one in shown):
        file = place / "detections.json"
        file.write_text(json.dumps({"objects": [_box(one) for one in shown]}))
    else:
        try:
            points = np.asarray(shown, dtype=float)
        except (TypeError, ValueError):
            points = np.zeros(())
        if points.ndim == 0:
            kinds = "points, a Scan, a DrawnScene, a Mesh, detections or a path"
            raise _edgepuck.Error(f"expected {kinds}, found {type(shown).__name__}")
        if points.ndim != 2 or points.shape[1] < 3:
            raise _edgepuck.Error(f"points: expected an array of shape [n, 3], found {list(points.shape)}")
        file = place / "points.npy"
        np.save(file, points[:, :3])
    return os.fspath(file)


def _box(of: Detection) -> dict[str, Any]:
    box = {"centre_m": of.whole_centre, "size_m": of.whole_size, "yaw_deg": of.whole_yaw_deg}
    return {"class": of.label, "confidence": of.confidence, "points": of.points, "box": box}


def _off(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> str:
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(map(repr, row)) for row in vertices.tolist()]
    lines += ["3 " + " ".join(map(str, row)) for row in faces.tolist()]
    return "\n".join(lines) + "\n"
