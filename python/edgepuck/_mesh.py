"""Triangle meshes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import Remade, place

Axis = Literal["y", "z"]
Normalize = Literal["unit-sphere", "bbox", "none"]
Unit = Literal["m", "mm", "cm", "in", "ft"]


class Mesh(Remade):
    """A triangle mesh, z up, in metres.

    Args:
        source: The path of an OBJ, OFF, PLY, STL or glTF file; vertices, of shape [n, 3]; or a mesh of
            trimesh (also all of a `trimesh.Scene` as one mesh) or of Open3D, or anything else with
            `vertices` and `faces`.
        faces: The indices of each triangle's vertices, of shape [m, 3], if `source` is vertices.
        normalize: `none`, the default, leaves the mesh in its place and size. `unit-sphere` moves the
            mean of the vertices to the origin and scales the farthest of them to 1 m, as data sets of
            shapes have it. `bbox` moves the middle of the bounding box there and scales its longest side
            to 2 m.
        units: The unit of length of `source`: m, mm, cm, in or ft; by default that which a mesh of trimesh
            states, or m. Unless this says m, a mesh that keeps its size and is larger than 100 m or smaller
            than 1 cm gives a warning.
        up: The upward axis of `source`: y or z. By default, y for OBJ and glTF files and z for
            all others.

    Raises:
        Error: The file cannot be read, a number is not finite, an index is out of range, or there
            is no triangle.

    >>> Mesh(*box((1.0, 2.0, 0.5)))
    <Mesh of 12 triangles, 1 x 2 x 0.5 m>
    """

    _mesh: _edgepuck.Mesh

    def __init__(
        self,
        source: str | os.PathLike[str] | ArrayLike | Any,
        faces: ArrayLike | None = None,
        *,
        normalize: Normalize = "none",
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
        factor = 1.0
        if faces is None:
            if normalize == "none":
                units, factor, _ = unit_of(units, source)
            source, faces = _parts(source)
        # A copy, so that later changes of the arrays do not change the mesh.
        vertices = np.array(source, dtype=np.float64, order="C")
        vertices *= factor
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

    def __repr__(self) -> str:
        source = self._made_of[0][0]
        name = f" {os.path.basename(source)}:" if isinstance(source, str) else " of"
        x, y, z = np.ptp(self.vertices, axis=0)
        return f"<Mesh{name} {len(self)} triangles, {x:.4g} x {y:.4g} x {z:.4g} m>"

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


# What functions take for a mesh.
AnyMesh: TypeAlias = "Mesh | str | os.PathLike[str] | Any"


def taken(mesh: AnyMesh) -> Mesh:
    """`mesh`, or the mesh of a path or of another library."""
    return mesh if isinstance(mesh, Mesh) else Mesh(mesh)


# The units of `Mesh` in metres, and the names that trimesh has for them.
_METRES: dict[str | None, float] = {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254, "ft": 0.3048}
_NAMES: dict[str, Unit] = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("in", "inch", "inches"), "in"),
    **dict.fromkeys(("ft", "foot", "feet"), "ft"),
}
# Further units of trimesh and of 3MF in metres.
_OTHERS = {"micron": 1e-6, "microns": 1e-6, "micrometer": 1e-6, "yard": 0.9144, "yards": 0.9144, "kilometers": 1e3}


def unit_of(units: Unit | None, source: Any) -> tuple[Unit | None, float, float]:
    """The unit of lengths of a mesh or a scene of trimesh, if it states one and `units` does not replace
    it; the factor from its lengths to those in this unit, and the one to metres."""
    stated = [getattr(source, "units", None)]
    if stated == [None]:
        parts = getattr(source, "geometry", None)
        stated = list({getattr(of, "units", None): None for of in parts.values()}) if isinstance(parts, Mapping) else []
    if units is not None:
        if units not in _METRES:
            raise _edgepuck.Error(f"units: expected one of m, mm, cm, in, ft, found {units!r}")
        return units, 1.0, _METRES[units]
    if len(stated) > 1:
        raise _edgepuck.Error(f"units: expected one unit of all geometries, found {', '.join(map(str, stated))}: name one")
    name = str(stated[0]).lower() if stated and stated[0] is not None else None
    if name is None:
        return None, 1.0, 1.0
    if name in _NAMES:
        return _NAMES[name], 1.0, _METRES[_NAMES[name]]
    if name in _OTHERS:
        return "m", _OTHERS[name], _OTHERS[name]
    raise _edgepuck.Error(f"units: expected one of {', '.join(_NAMES)}, found {name!r}: name the unit")


def _parts(source: Any) -> tuple[Any, Any]:
    """The vertices and faces of a mesh of another library."""
    if hasattr(source, "graph") and hasattr(source, "to_mesh"):
        source = source.to_mesh()
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return source.vertices, source.faces
    if hasattr(source, "vertices") and hasattr(source, "triangles"):
        return np.asarray(source.vertices), np.asarray(source.triangles)
    if hasattr(source, "vertex") and hasattr(source, "triangle"):
        return source.vertex["positions"].cpu().numpy(), source.triangle["indices"].cpu().numpy()
    raise _edgepuck.Error(
        "expected a path, a mesh with vertices and faces (of trimesh or Open3D), or vertices and faces, "
        f"found {type(source).__name__} alone"
    )


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
