"""Scans of scenes, with the checks of their arguments that `Scene.scan`, `Scene.cast` and `Sensor.scan`
share."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arguments, _edgepuck, _poses
from ._scan import Scan, scan_of


def scan(
    scene: _edgepuck.Scene,
    sensor: _edgepuck.Sensor,
    at: NDArray[np.float64],
    effects: str | None,
    attributes: Iterable[str] | None,
    seed: int | None,
) -> Scan:
    """Scan `scene` by `sensor` at a `place` with `encoded` effects. `Scene.scan` describes the others."""
    if isinstance(attributes, str):
        raise _edgepuck.Error(f"attributes: expected a list of names, found {attributes!r}")
    names = None if attributes is None else list(attributes)
    key = None if seed is None else _arguments.seed(seed)
    return scan_of(scene.scan(sensor, at, effects, names, key))


def place(
    pose: ArrayLike | None, distance: float | None, elevation: float | None, azimuth: float | None
) -> NDArray[np.float64]:
    """The row of the pose of a sensor, or the three numbers of a sensor that looks at the origin, [1, 3]."""
    around = [distance, elevation, azimuth]
    if pose is None:
        names, usual = ("distance", "elevation", "azimuth"), (3.0, 20.0, 0.0)
        given = zip(names, around, usual, strict=True)
        found = [default if one is None else _arguments.real(name, one) for name, one, default in given]
        if not np.isfinite(found).all():
            raise _edgepuck.Error(f"expected finite numbers as the sensor's place, found {found}")
        if found[0] <= 0:
            raise _edgepuck.Error(f"expected a distance above 0, found {found[0]:g}")
        if abs(found[1]) > 90:
            raise _edgepuck.Error(f"expected an elevation from -90 to 90 degrees, found {found[1]:g}")
        return np.array([found])
    if around != [None] * 3:
        raise _edgepuck.Error("expected a pose, or a distance, an elevation and an azimuth, found both")
    return _poses.one("pose", pose)


# The effects that have keys of their own.
_KEYS = {
    "noise": "{'sigma_m': 0.01}, or the argument noise",
    "dropout": "{'probability': 0.1}, or the argument dropout",
    "detection": "{'reflectivity': 0.1, 'range_m': 200}",
    "footprint": "{'samples': 7}",
    "weather": "{'rain_mm_h': 20}",
    "motion": "{'velocity_m_s': [10, 0, 0]}",
}


def encoded(noise: float, dropout: float, effects: Mapping[str, Any] | None) -> str | None:
    """The effects that these ask for, in JSON; `None` if nothing is asked for."""
    if effects is not None and not isinstance(effects, Mapping):
        raise _edgepuck.Error(f"effects: expected a dict, found {effects!r}")
    wanted: dict[str, Any] = dict(effects or {})
    for name, example in _KEYS.items():
        if isinstance(wanted.get(name), (int, float)) and not isinstance(wanted[name], bool):
            raise _edgepuck.Error(f"effects.{name}: expected a dict, such as {example}, found {wanted[name]!r}")
    for name, given in [("noise", noise != 0), ("dropout", dropout != 0)]:
        if given and name in wanted:
            raise _edgepuck.Error(f"{name}: expected it once, found it in effects as well")
    if noise != 0:
        wanted["noise"] = {"sigma_m": noise, "mean_m": 0.0, "model": "range"}
    if dropout != 0:
        wanted["dropout"] = {"probability": dropout}
    return json.dumps(_plain(wanted, "effects")) if wanted or effects is not None else None


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
