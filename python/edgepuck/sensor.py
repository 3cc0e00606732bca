"""Sensors."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arguments, _edgepuck
from ._arguments import Remade, place
from .mesh import Mesh
from .scan import Scan, scan_of


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
        distance: float = 3.0,
        elevation: float = 20.0,
        azimuth: float = 0.0,
        pose: ArrayLike | None = None,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: Mapping[str, Any] | None = None,
        attributes: Iterable[str] = ("range", "beam", "ring", "time"),
        seed: int = 0,
    ) -> Scan:
        """Scan a mesh from a position around it.

        Args:
            mesh: The mesh, at the origin.
            distance: The distance of the sensor from the origin, metres.
            elevation: The elevation of the sensor above the horizon, degrees.
            azimuth: The azimuth of the sensor, counterclockwise from x, degrees.
            pose: The pose of the sensor, instead of these three: a matrix of shape [4, 4] from the
                frame of the sensor (x forward, z up) to the world.
            noise: Standard deviation of the noise of the ranges, metres.
            dropout: Probability that a return is missing.
            effects: Further effects, with the keys of the table `[effects]` of a scene:
                `{"footprint": {"samples": 7}, "returns": "last"}`.
            attributes: The attributes of each point besides its position: range, beam, ring, time,
                triangle, object, intensity, power, reflectivity, return, medium, normal.
            seed: The seed of all random numbers.

        Raises:
            Error: A value is out of its limits, or an attribute or effect is unknown.
        """
        if not isinstance(mesh, Mesh):
            raise _edgepuck.Error(f"expected an edgepuck.Mesh, found {type(mesh).__name__}")
        if isinstance(attributes, str):
            raise _edgepuck.Error(f"attributes: expected a list of names, found {attributes!r}")
        wanted: dict[str, Any] = dict(effects or {})
        for name, given in [("noise", noise != 0), ("dropout", dropout != 0)]:
            if given and name in wanted:
                raise _edgepuck.Error(f"{name}: expected it once, found it in effects as well")
        if noise != 0:
            wanted["noise"] = {"sigma_m": noise, "mean_m": 0.0, "model": "range"}
        if dropout != 0:
            wanted["dropout"] = {"probability": dropout}
        at = [float(distance), float(elevation), float(azimuth)]
        if pose is not None:
            matrix = np.asarray(pose, dtype=np.float64)
            if matrix.shape != (4, 4):
                found = list(matrix.shape)
                raise _edgepuck.Error(f"pose: expected a matrix of shape [4, 4], found {found}")
            at = matrix.ravel().tolist()
        encoded = json.dumps(_plain(wanted, "effects"))
        key = _arguments.seed(seed)
        return scan_of(self._sensor.scan(mesh._mesh, at, encoded, list(attributes), key))

    def __repr__(self) -> str:
        return f"Sensor({self.name!r})"


def _plain(value: Any, key: str) -> Any:
    """`value`, found at `key`, as types of JSON."""
    if isinstance(value, Mapping):
        return {str(name): _plain(of, f"{key}.{name}") for name, of in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(of, f"{key}[{i}]") for i, of in enumerate(value)]
    plain = value.item() if isinstance(value, np.generic) else value
    if isinstance(plain, float) and not math.isfinite(plain):
        raise _edgepuck.Error(f"{key}: expected a finite number, found {plain}")
    return plain
