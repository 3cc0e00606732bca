"""Sensors."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck, _poses, _scanning
from ._arguments import Remade, place
from ._mesh import AnyMesh
from ._mesh import taken as mesh_of
from ._scan import Scan


class Sensor(Remade):
    """A LiDAR with its beam pattern.

    Args:
        name: A built-in sensor, such as `vlp32c` (`edgepuck profile` lists them), or the path of a
            profile in TOML or of an Ouster's metadata in JSON.
        adapter: The adapter that casts: `cpu`, `auto` (a GPU if there is one), or a part of a GPU's
            name. Each process opens it when it first casts.

    Raises:
        Error: There is no such sensor, or its profile is wrong.

    >>> Sensor("vlp32c").directions.shape
    (57870, 3)
    """

    def __init__(self, name: str | os.PathLike[str], *, adapter: str = "cpu") -> None:
        profile = place(name)
        self._made_of = (profile,), {"adapter": adapter}
        self._sensor = _edgepuck.Sensor(profile, adapter)

    @property
    def name(self) -> str:
        """The sensor's name."""
        return self._sensor.name

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors of all beams of a revolution, in firing order, [n_beams, 3]."""
        return self._sensor.directions

    @property
    def rings(self) -> NDArray[np.uint16]:
        """The ring of each beam, from below, [n_beams]."""
        return self._sensor.rings

    @property
    def times(self) -> NDArray[np.float64]:
        """Seconds from the start of a revolution to each beam, [n_beams]."""
        return self._sensor.times

    def scan(
        self,
        mesh: AnyMesh,
        *,
        distance: float | None = None,
        elevation: float | None = None,
        azimuth: float | None = None,
        pose: ArrayLike | None = None,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: Mapping[str, Any] | None = None,
        attributes: Iterable[str] = ("range", "beam", "ring", "time"),
        seed: int = 0,
    ) -> Scan:
        """Scan one mesh from a position around the origin, like `Scene.scan` of a scene with only it.

        `mesh` is a `Mesh`, or anything that `Mesh` takes alone, such as a path: it keeps its size. The other
        arguments are those of `Scene.scan`.

        Raises:
            Error: A value is out of its limits, or an attribute or effect is unknown.
        """
        scene = _edgepuck.Scene()
        scene.add(mesh_of(mesh)._mesh, _poses.placed(None, None), [1.0] * 3, None, None, 1.0, 0.0)
        at = _scanning.place(pose, distance, elevation, azimuth)
        wanted = _scanning.encoded(noise, dropout, effects)
        return _scanning.scan(scene, self._sensor, at, wanted, attributes, seed)

    def __repr__(self) -> str:
        n_rings, n_beams = len(np.unique(self.rings)), len(self.rings)
        return f"<Sensor {self.name}: {n_rings} rings, {n_beams} beams>"


# What functions take for a sensor.
AnySensor: TypeAlias = "Sensor | str | os.PathLike[str]"


def taken(sensor: AnySensor) -> Sensor:
    """`sensor`, or the sensor of a name or a profile."""
    if isinstance(sensor, (str, os.PathLike)):
        return Sensor(sensor)
    if not isinstance(sensor, Sensor):
        raise _edgepuck.Error(f"expected an edgepuck.Sensor, or its name or profile, found {type(sensor).__name__}")
    return sensor


def profile_of(name: str, sensor: AnySensor) -> str:
    """The name or the path of the profile of `sensor`, for an argument of this name."""
    if isinstance(sensor, Sensor):
        return str(sensor._made_of[0][0])
    if not isinstance(sensor, (str, os.PathLike)):
        found = type(sensor).__name__
        raise _edgepuck.Error(f"{name}: expected the name or profile of a sensor, or an edgepuck.Sensor, found {found}")
    return place(sensor)
