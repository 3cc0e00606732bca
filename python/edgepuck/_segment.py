"""Segmentation of sweeps."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import whole
from ._classifier import points_of
from ._scan import Scan


def segment(
    sweep: Scan | str | os.PathLike[str] | ArrayLike | Any,
    *,
    rings: ArrayLike | None = None,
    radius: float | None = None,
    min_points: int | None = None,
) -> NDArray[np.int32]:
    """The cluster of each point of a sweep, counted from 0. -1 is ground, -2 is a point in no cluster,
    and -3 is a lost return: a point at 0, 0, 0, unless `radius` is given, or without finite coordinates.

    Args:
        sweep: A scan, or the path of a file that `Scan.read` reads, or points of shape [n, 3] in the frame
            of the sensor, metres, z up, or a cloud of Open3D or trimesh; further columns are ignored.
        rings: The ring of each point, from below, [n]. A scan has its own.
        radius: If given, clusters are the connected components of points within this distance,
            metres, and there is no ground. This suits clouds that are not sweeps of a sensor.
        min_points: The smallest number of points of a cluster.

    >>> post = [[5.0, 0.0, 0.05 * i - 1.0] for i in range(30)]
    >>> int(segment(post)[20])
    0
    """
    if isinstance(sweep, (str, os.PathLike)):
        sweep = Scan.read(sweep)
    if isinstance(sweep, Scan):
        rings = sweep.ring if rings is None else rings
        sweep = sweep.in_sensor_frame()
    least = None if min_points is None else whole("min_points", min_points, 1, 2**32)
    return _edgepuck.segment(points_of(sweep), rings_of(rings), radius, least)


def rings_of(rings: ArrayLike | None) -> NDArray[np.uint16] | None:
    """The rings of points, [n], if they are known."""
    if rings is None:
        return None
    found = np.asarray(rings)
    is_whole = found.dtype.kind in "iuf" and np.array_equal(found, np.floor(found))
    if found.ndim != 1 or not is_whole or (found.size and not (0 <= found.min() and found.max() < 2**16)):
        raise _edgepuck.Error("rings: expected whole numbers from 0 to 65535 of shape [n]")
    return np.ascontiguousarray(found, dtype=np.uint16)
