"""Detection of objects in sweeps."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import place, whole
from ._classifier import points_of
from ._scan import Scan
from ._segment import rings_of


@dataclass(repr=False)
class Detection:
    """An object of a known class in a sweep."""

    label: str
    """The name of its class."""
    confidence: float
    """How sure the detection is, 0 to 1: of those from 0.7 to 0.9 in sweeps of other sources, some seven in ten are right."""
    points: int
    """The number of its points."""
    indices: NDArray[np.uint32] = field(compare=False)
    """The rows of its points in the sweep, ascending, [points]."""
    centre: list[float]
    """The centre of the box around its points, in the frame of the sensor, metres, [3]."""
    size: list[float]
    """The length, width and height of the box, metres, [3]."""
    yaw_deg: float
    """The rotation of the box about the z axis, counterclockwise from x, degrees."""
    whole_centre: list[float]
    """The centre of the box of the whole object, with what its points do not show, metres, [3]."""
    whole_size: list[float]
    """The length, width and height of that box, metres, [3]."""
    whole_yaw_deg: float
    """The rotation of that box, degrees; front and rear are not told apart."""

    def __repr__(self) -> str:
        at, (length, width, height) = ", ".join(f"{x:.2f}" for x in self.centre), self.size
        box = f"at ({at}), {length:.1f} x {width:.1f} x {height:.1f} m, {self.points} points"
        return f"<Detection {self.label}, {100 * self.confidence:.1f} %, {box}>"


def detect(
    sweep: Scan | str | os.PathLike[str] | ArrayLike | Any,
    model: str | os.PathLike[str] = "street-bev",
    *,
    rings: ArrayLike | None = None,
    precision: str = "f32",
    min_points: int = 20,
    min_confidence: float = 0.5,
) -> list[Detection]:
    """Find the objects of known classes in a sweep, like `edgepuck detect`.

    Args:
        sweep: A scan, or the path of a file that `Scan.read` reads, or points of shape [n, 3] in the frame
            of the sensor, metres, z up, or a cloud of Open3D or trimesh; further columns are ignored, and so
            are lost returns: points at 0, 0, 0 or without finite coordinates.
        model: `street-bev`, or the path of a bird's-eye model.
        rings: The ring of each point, from below, [n]. A scan has its own.
        precision: The precision of the networks: f32 or i8.
        min_points: The smallest number of points of an object.
        min_confidence: The smallest confidence of an object; 0 returns all that the model is asked about.

    Raises:
        Error: The model cannot be read, or the points have a wrong shape.

    >>> import edgepuck as ep
    >>> found = detect(ep.Scenes("street", seed=1)[0].scan)
    >>> all(0 < one.confidence <= 1 for one in found)
    True
    """
    if isinstance(sweep, (str, os.PathLike)):
        sweep = Scan.read(sweep)
    if isinstance(sweep, Scan):
        rings = sweep.ring if rings is None else rings
        sweep = sweep.in_sensor_frame()
    least = whole("min_points", min_points, 1, 2**32)
    if not 0 <= min_confidence <= 1:
        raise _edgepuck.Error(
            f"min_confidence: expected a number from 0 to 1, found {min_confidence!r}"
        )
    cloud = points_of(sweep)
    found = _edgepuck.detect(
        cloud, rings_of(rings), place(model), precision, least, min_confidence
    )
    return [Detection(**one) for one in found]
