"""Sensors."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck, _scanning
from ._arguments import Remade, place
from ._mesh import Mesh
from ._mesh import native as mesh_of
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
        mesh: Mesh,
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

        The arguments besides `mesh` are those of `Scene.scan`.

        Raises:
            Error: A value is out of its limits, or an attribute or effect is unknown.
        """
        scene = _edgepuck.Scene()
        scene.add(mesh_of(mesh), np.eye(4).ravel().tolist(), [1.0] * 3, None, None, 1.0, 0.0)
        at = _scanning.place(pose, distance, elevation, azimuth)
        wanted = _scanning.encoded(noise, dropout, effects)
        return _scanning.scan(scene, self._sensor, at, wanted, attributes, seed)

    def __repr__(self) -> str:
        return f"Sensor({self.name!r})"


def native(sensor: Sensor) -> _edgepuck.Sensor:
    """The sensor of the module in Rust, if `sensor` is an `edgepuck.Sensor`."""
    if not isinstance(sensor, Sensor):
        raise _edgepuck.Error(f"expected an edgepuck.Sensor, found {type(sensor).__name__}")
    return sensor._sensor
