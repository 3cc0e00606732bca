"""Terrain as heights over a grid."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck


def heightfield(
    heights: ArrayLike | str | os.PathLike[str],
    *,
    cell: float | tuple[float, float],
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    height: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The vertices and faces of terrain, for `Mesh(*heightfield(...))`.

    Each cell is two triangles, which share the diagonal from its corner with the lowest x and y.

    Args:
        heights: Heights in metres, [rows, columns]: columns run along x, and rows along y. A corner that
            is not a number is a hole: its cells are left out. Or the path of a grey PNG of 16 bits, seen
            from above, with y upwards: its last row is at the origin.
        cell: The distance of columns and of rows in metres: one number, or two.
        origin: The place of the first column, of the first row (of a PNG's last), and of height 0.
        height: The height of white (65535) above black (0) in metres, for a PNG.

    Raises:
        Error: The file cannot be read; there is no whole cell; a height is infinite.

    >>> vertices, faces = heightfield([[0.0, 0.0], [0.5, 0.5]], cell=2.0)
    >>> vertices.tolist(), len(faces)
    ([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.5], [2.0, 2.0, 0.5]], 2)
    """
    is_file = isinstance(heights, (str, os.PathLike))
    if is_file != (height is not None):
        expected = "the height of white in metres" if is_file else "none beside heights in metres"
        raise _edgepuck.Error(f"height: expected {expected}, found {height}")
    if isinstance(heights, (str, os.PathLike)):
        z = _edgepuck.read_grey16(os.fspath(heights))[::-1] * (_positive("height", height) / 65535)
    else:
        z = np.asarray(heights, dtype=np.float64)
    if z.ndim != 2 or min(z.shape) < 2:
        raise _edgepuck.Error(
            f"heights: expected shape [rows, columns] of two or more each, found {list(z.shape)}"
        )
    if np.isinf(z).any():
        row, column = np.argwhere(np.isinf(z))[0]
        raise _edgepuck.Error(
            f"heights[{row}, {column}]: expected metres, or NaN for a hole, found {z[row, column]}"
        )
    sides = np.asarray(cell, dtype=np.float64)
    if sides.shape not in [(), (2,)]:
        raise _edgepuck.Error(f"cell: expected one number or two, found {cell!r}")
    dx, dy = (_positive("cell", side) for side in np.broadcast_to(sides, 2))
    corner = np.asarray(origin, dtype=np.float64)
    if corner.shape != (3,) or not np.isfinite(corner).all():
        raise _edgepuck.Error(f"origin: expected three finite metres, found {origin!r}")
    rows, columns = np.indices(z.shape)
    vertices = np.stack([columns * dx, rows * dy, z], axis=-1).reshape(-1, 3) + corner
    at = (rows * z.shape[1] + columns).astype(np.int64)
    low, right, up, far = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    faces = np.stack([low, right, far, low, far, up], axis=-1).reshape(-1, 2, 3)
    is_known = np.isfinite(vertices[:, 2])
    if not is_known.all():
        corners = np.stack([low, right, up, far], axis=-1).reshape(-1, 4)
        faces = faces[is_known[corners].all(axis=1)]
        if len(faces) == 0:
            raise _edgepuck.Error("heights: expected a cell with four heights, found none")
        used, faces = np.unique(faces, return_inverse=True)
        vertices = vertices[used]
    return vertices, faces.reshape(-1, 3)


def _positive(name: str, value: float | None) -> float:
    if value is None or not 0 < value < np.inf:
        raise _edgepuck.Error(f"{name}: expected a number of metres above 0, found {value}")
    return float(value)
