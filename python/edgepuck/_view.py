"""Pages that show points, meshes and boxes in three dimensions."""

from __future__ import annotations

import base64
import json
import os
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _edgepuck, _poses
from ._detect import Detection
from ._mesh import Mesh
from ._page import View, page_of
from ._scan import Scan
from ._scene import Batch, Scene
from ._scenes import DrawnScene


def view(*shown: Any, truth: str | os.PathLike[str] | Sequence[Detection] | None = None) -> View:
    """Show points, meshes and boxes, like `edgepuck view`: in a notebook below the cell, or by
    `view(...).open()` in the browser. A mesh lies under the points that are its scan; two others stand side
    by side.

    Args:
        shown: Each is a `Scan`, a `DrawnScene`, or points of shape [n, 3]; a `Mesh` or a `Scene`; a `Batch`,
            a frame for each pose, in the sensor's frame; a point cloud or a mesh of Open3D or trimesh, or a
            scene of trimesh; the detections of a sweep, which are drawn in what is named before them; or the
            path of any file or folder that `edgepuck view` shows.
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
        if any(isinstance(one, (Scan, DrawnScene)) for one in shown):
            words = [_for_any_sweep(word, Path(folder)) for word in words]
        if truth is not None:
            words += ["--truth", _file(truth, Path(folder, "truth"))]
        return page_of(words, folder)


def _file(shown: Any, place: Path) -> str:
    """The file of `shown`, which is written in the folder `place` if it is none."""
    if isinstance(shown, (str, os.PathLike)):
        return os.fspath(shown)
    place.mkdir()
    if hasattr(shown, "graph") and hasattr(shown, "geometry"):
        shown = Scene.of(shown)
    if isinstance(shown, DrawnScene):
        shown = shown.scan
    if isinstance(shown, Scan):
        file = place / "scan.npz"
        shown.save(file)
    elif isinstance(shown, Mesh):
        file = _save_mesh(place / "mesh.off", shown.vertices, shown.faces)
    elif isinstance(shown, Scene):
        return _save_scene(shown, place)
    elif isinstance(shown, Batch):
        _save_batch(shown, place)
        file = place
    elif isinstance(shown, (list, tuple)) and shown and all(isinstance(one, Detection) for one in shown):
        file = place / "detections.json"
        file.write_text(json.dumps({"objects": [_box(one) for one in shown]}), encoding="utf-8")
    elif (mesh := _triangles(shown)) is not None:
        file = _save_mesh(place / "mesh.off", *mesh)
    else:
        points = _points(shown)
        if points.ndim != 2 or points.shape[1] < 3:
            raise _edgepuck.Error(f"points: expected an array of shape [n, 3], found {list(points.shape)}")
        file = place / "points.npy"
        np.save(file, points[:, :3])
    return os.fspath(file)


def _for_any_sweep(word: str, folder: Path) -> str:
    """The file of boxes of `detect` without the name of their sweep, which a scan in memory does not have; any
    other file unchanged."""
    if not word.endswith(".json") or Path(word).stat().st_size > 1e8:
        return word
    try:
        boxes = json.loads(Path(word).read_text(encoding="utf-8"))
    except ValueError:
        return word
    if not isinstance(boxes, dict) or boxes.pop("sweep", None) is None:
        return word
    file = folder / Path(word).name
    file.write_text(json.dumps(boxes), encoding="utf-8")
    return os.fspath(file)


def _array(found: Any) -> NDArray[Any]:
    """An array of NumPy, or of a tensor of Open3D."""
    return np.asarray(found.numpy() if hasattr(found, "numpy") else found)


def _triangles(shown: Any) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """The vertices and the faces of a mesh of trimesh or Open3D."""
    if hasattr(shown, "triangle") and hasattr(shown, "vertex"):
        return _array(shown.vertex.positions), _array(shown.triangle.indices)
    faces = getattr(shown, "faces", getattr(shown, "triangles", None))
    if faces is None or not hasattr(shown, "vertices"):
        return None
    return _array(shown.vertices), _array(faces)


def _points(shown: Any) -> NDArray[Any]:
    """The points of a cloud of Open3D or trimesh, or of an array."""
    if hasattr(shown, "point") and hasattr(shown.point, "positions"):
        shown = shown.point.positions
    shown = getattr(shown, "points", getattr(shown, "vertices", shown))
    try:
        points = np.asarray(_array(shown), dtype=float)
    except (TypeError, ValueError):
        points = np.zeros(())
    if points.ndim == 0:
        kinds = (
            "points, a Scan, a DrawnScene, a Mesh, a Scene, a Batch, detections, a cloud or a mesh of Open3D or "
            "trimesh, or a path"
        )
        raise _edgepuck.Error(f"expected {kinds}, found {type(shown).__name__}")
    return points


def _save_scene(scene: Scene, place: Path) -> str:
    """The file of a scene: its own, or one in the folder `place` of what was added to it."""
    if scene._file is not None and not scene._added:
        if scene._moved:
            warnings.warn(
                f"{scene._file[0]}: shown as the file has it, without what moved",
                stacklevel=4,
            )
        return scene._file[0]
    if len(scene) == 0:
        raise _edgepuck.Error("expected something to show, found a scene without instances")
    first = len(scene) - len(scene._added)
    if first:
        assert scene._file is not None
        warnings.warn(
            f"{scene._file[0]}: only what was added to the file's scene is shown",
            stacklevel=4,
        )
    parts = []
    for number, (mesh, (scale, name, label, *_)) in enumerate(scene._added, first):
        row = np.asarray(scene._moved[number])
        pose = _poses.matrix("pose", row.reshape(4, 4) if len(row) == 16 else row)
        vertices = (mesh.vertices * scale) @ pose[:3, :3].T + pose[:3, 3]
        parts.append((name or f"object {number}", label, vertices.astype(np.float32), mesh.faces.astype(np.uint32)))
    return _save_gltf(place / "scene.gltf", parts)


def _save_gltf(file: Path, parts: list[tuple[str, str | None, NDArray[Any], NDArray[Any]]]) -> str:
    """A glTF file of parts: a name, perhaps a label, vertices and faces of each."""
    views: list[Any] = []
    accessors: list[Any] = []
    meshes: list[Any] = []
    data = b""

    def add(array: NDArray[Any], component: int, kind: str, **bounds: Any) -> int:
        """Appends an array to the buffer and returns the number of its accessor."""
        nonlocal data
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        of = {"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind}
        accessors.append(of | bounds)
        data += np.ascontiguousarray(array).tobytes()
        return len(accessors) - 1

    for _, label, vertices, faces in parts:
        # The y axis of glTF points up.
        corners = vertices[:, [0, 2, 1]] * np.array([1, 1, -1], dtype=np.float32)
        low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        position = add(corners, 5126, "VEC3", min=low, max=high)
        part = {"attributes": {"POSITION": position}, "indices": add(faces.ravel(), 5125, "SCALAR")}
        meshes.append({"primitives": [part]} | ({"name": label} if label else {}))
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(parts)))}],
        "nodes": [{"mesh": number, "name": name} for number, (name, *_) in enumerate(parts)],
        "meshes": meshes,
        "bufferViews": views,
        "accessors": accessors,
        "buffers": [{"byteLength": len(data), "uri": uri}],
    }
    file.write_text(json.dumps(gltf), encoding="utf-8")
    return os.fspath(file)


def _save_batch(batch: Batch, folder: Path) -> None:
    """A scan for each row, in the sensor's frame."""
    for number, ranges in enumerate(batch.ranges):
        hit = np.isfinite(ranges)
        columns = {
            name: None if (all_ := getattr(batch, name)) is None else all_[number][hit]
            for name in ("intensity", "power")
        }
        scan = Scan(
            positions=(batch.sensor.directions[hit] * ranges[hit, None]).astype(np.float32),
            origin=np.zeros(3),
            range=ranges[hit],
            ring=batch.sensor.rings[hit],
            object=batch.object[number][hit].astype(np.uint32),
            **columns,
        )
        scan.save(folder / f"{number:04d}.npz")


def _box(of: Detection) -> dict[str, Any]:
    box = {
        "centre_m": of.whole_centre,
        "size_m": of.whole_size,
        "yaw_deg": of.whole_yaw_deg,
    }
    return {
        "class": of.label,
        "confidence": of.confidence,
        "points": of.points,
        "box": box,
    }


def _save_mesh(file: Path, vertices: NDArray[Any], faces: NDArray[Any]) -> Path:
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(map(repr, row)) for row in np.asarray(vertices, dtype=float).tolist()]
    lines += ["3 " + " ".join(map(str, row)) for row in np.asarray(faces).tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file
