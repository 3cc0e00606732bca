"""Streets, yards and rooms that recipes draw."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _arguments, _edgepuck
from ._arguments import Remade, number, place, whole
from ._scan import Scan, scan_of
from ._sensor import AnySensor, Sensor, profile_of


@dataclass(eq=False, repr=False)
class DrawnScene:
    """A scene that a recipe drew, with its scan and the clusters of the scan."""

    sensor: str
    """The sensor's name."""
    scan: Scan
    """The points in the frame of the sensor. `object` 0 is the ground, and `i` is `objects[i - 1]`."""
    objects: list[dict[str, Any]]
    """`class`, `position` (the middle of the footprint), `size` and `yaw_deg` of each object. The
    origin is on the ground below the sensor, and x is along the road."""
    cluster: NDArray[np.int32]
    """The cluster of each point, numbered as by `ep.segment`. The segmentation allows for the lowest
    ground that the recipe can draw. [n]."""
    cluster_class: NDArray[np.int64]
    """The class of each cluster, an index into `Scenes.classes`, [n_clusters]."""
    cluster_truth_share: NDArray[np.float32]
    """The share of each cluster's points that lie on one surface, [n_clusters]."""
    cluster_height: NDArray[np.float32]
    """The height of each cluster's lowest point above the ground, metres, [n_clusters]."""

    def _repr_html_(self) -> str | None:
        return self.scan._repr_html_()

    def __repr__(self) -> str:
        clusters = len(self.cluster_class)
        return f"<DrawnScene of {self.sensor}: {self.scan!r}, {len(self.objects)} objects, {clusters} clusters>"


class Scenes(Remade):
    """Scenes that a recipe draws, cast on demand: a map-style dataset.

    Args:
        recipe: `street`, `yard`, `room`, or the path of a recipe in TOML.
        length: The number of scenes.
        sensors: Sensors that replace those of the recipe, each a `Sensor`, its name or its profile.
        meshes: The folder of your own meshes, if the recipe has objects of kind "mesh".
        seed: The seed of all random numbers.

    Raises:
        Error: The recipe or a mesh cannot be read.

    >>> scene = Scenes("street", seed=3)[0]
    >>> len(scene.cluster) == len(scene.scan)
    True
    """

    def __init__(
        self,
        recipe: str | os.PathLike[str] = "street",
        *,
        length: int = 1000,
        sensors: Sequence[AnySensor] = (),
        meshes: str | os.PathLike[str] | None = None,
        seed: int = 0,
    ) -> None:
        if isinstance(sensors, (str, os.PathLike, Sensor)):
            raise _edgepuck.Error(f"sensors: expected a list of names, found {sensors!r}")
        folder = None if meshes is None else os.path.abspath(meshes)
        names = [profile_of("sensors", sensor) for sensor in sensors]
        file, key = place(recipe), _arguments.seed(seed)
        self._length = whole("length", length, 0, 2**32)
        named = {"length": self._length, "sensors": names, "meshes": folder, "seed": key}
        self._made_of = (file,), named
        self._scenes = _edgepuck.Scenes(file, names, folder, key)

    def __len__(self) -> int:
        """The number of scenes."""
        return self._length

    @property
    def classes(self) -> list[str]:
        """The names of the classes, including `other`."""
        return self._scenes.classes

    def __repr__(self) -> str:
        recipe, seed = os.path.basename(self._made_of[0][0]), self._made_of[1]["seed"]
        return f"<Scenes {recipe}: {self._length} scenes, seed {seed}>"

    def __getitem__(self, index: int) -> DrawnScene:
        drawn = self._scenes.draw(number("scenes", index, self._length))
        return DrawnScene(**{**drawn, "scan": scan_of(drawn["scan"])})
