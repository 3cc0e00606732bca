"""Triangle meshes."""

from __future__ import annotations

import os
import warnings
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import Remade, place

Axis = Literal["y", "z"]
Normalize = Literal["unit-sphere", "bbox", "none"]
Unit = Literal["m", "mm", "cm", "in", "ft"]


class Mesh(Remade):
    """A triangle mesh, z up.

    Args:
        source: The path of an OBJ, OFF, PLY, STL or glTF file; vertices, of shape [n, 3]; or anything
            with `vertices` and `faces`, such as a mesh of trimesh.
        faces: The indices of each triangle's vertices, of shape [m, 3], if `source` is vertices.
        normalize: `unit-sphere` moves the mean of the vertices to the origin and scales the
            farthest of them to 1 m. `bbox` moves the middle of the bounding box there and scales its
            longest side to 2 m. `none` leaves the mesh in its place.
        units: The unit of length of `source`: m (the default), mm, cm, in or ft. Unless this says m,
            a mesh that keeps its size and is larger than 100 m or smaller than 1 cm gives a warning.
        up: The upward axis of `source`: y or z. By default, y for OBJ and glTF files and z for
            all others.

    Raises:
        Error: The file cannot be read, a number is not finite, an index is out of range, or there
            is no triangle.

    >>> len(Mesh(*box((1.0, 1.0, 1.0))))
    12
    """

    _mesh: _edgepuck.Mesh

    def __init__(
        self,
        source: str | os.PathLike[str] | ArrayLike | Any,
        faces: ArrayLike | None = None,
        *,
        normalize: Normalize = "unit-sphere",
        units: Unit | None = None,
        up: Axis | None = None,
    ) -> None:
        if units is not None and normalize != "none":
            raise _edgepuck.Error(
                f'units: expected normalize="none" beside it, found {normalize!r}, which scales '
                "meshes of any unit"
            )
        if faces is None and isinstance(source, (str, os.PathLike)):
            path = place(source)
            self._made_of = (path,), {"normalize": normalize, "units": units, "up": up}
            self._mesh = _edgepuck.Mesh.read(path, up, units or "m", normalize)
            self._warn(path)
            return
        if faces is None and hasattr(source, "vertices") and hasattr(source, "faces"):
            source, faces = source.vertices, source.faces
        if faces is None:
            raise _edgepuck.Error(
                "expected a path, a mesh with vertices and faces, or vertices and faces, found "
                f"{type(source).__name__} alone"
            )
        # A copy, so that later changes of the arrays do not change the mesh.
        vertices = np.array(source, dtype=np.float64, order="C")
        indices = _indices(faces)
        for name, array in [("vertices", vertices), ("faces", indices)]:
            if array.ndim != 2:
                shape = list(array.shape)
                raise _edgepuck.Error(f"expected {name} of shape [n, 3], found {shape}")
        self._made_of = (vertices, indices), {"normalize": normalize, "units": units, "up": up}
        self._mesh = _edgepuck.Mesh.of_arrays(vertices, indices, up or "z", units or "m", normalize)
        self._warn("mesh")

    def _warn(self, what: str) -> None:
        """Warn if the unit of the source is probably another."""
        settings = self._made_of[1]
        warning = self._mesh.odd_size(settings["units"] or "m")
        if settings["normalize"] == "none" and settings["units"] != "m" and warning:
            warnings.warn(f"{what}: {warning}", stacklevel=3)

    def __len__(self) -> int:
        """The number of triangles."""
        return len(self._mesh)

    @property
    def vertices(self) -> NDArray[np.float64]:
        """The vertices in the mesh's frame, metres, [n, 3]."""
        return self._mesh.vertices

    @property
    def faces(self) -> NDArray[np.int64]:
        """The indices of each triangle's vertices, [m, 3]: `trimesh.Trimesh(mesh.vertices, mesh.faces)`."""
        return self._mesh.faces

    @property
    def scale(self) -> float:
        """The length of the source's unit in metres."""
        return self._mesh.scale

    @property
    def centre(self) -> NDArray[np.float64]:
        """The point of the source that became the origin, in the source's units, z up."""
        return np.array(self._mesh.centre)


def native(mesh: Mesh) -> _edgepuck.Mesh:
    """The mesh of the module in Rust, if `mesh` is an `edgepuck.Mesh`."""
    if not isinstance(mesh, Mesh):
        raise _edgepuck.Error(f"expected an edgepuck.Mesh, found {type(mesh).__name__}")
    return mesh._mesh


def _indices(faces: ArrayLike) -> NDArray[np.int64]:
    found = np.asarray(faces)
    if found.size and not np.issubdtype(found.dtype, np.integer):
        raise _edgepuck.Error(f"expected faces of whole numbers, found {found.dtype}")
    return np.array(found, dtype=np.int64, order="C")


def box(size: tuple[float, float, float]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The vertices and faces of a box with this length, width and height around the origin.

    >>> vertices, faces = box((2.0, 1.0, 1.0))
    >>> vertices.max(axis=0).tolist(), faces.shape
    ([1.0, 0.5, 0.5], (12, 3))
    """
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - 0.5
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    faces = [[a, *pair] for a, b, c, d in quads for pair in ([b, c], [c, d])]
    return corners * np.asarray(size, dtype=np.float64), np.array(faces, dtype=np.int64)
