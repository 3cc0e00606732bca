"""Clouds of many meshes, cast on demand."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from multiprocessing.context import get_spawning_popen
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _arguments, _edgepuck
from ._arguments import number, place, real, whole
from ._sensor import AnySensor, Sensor, profile_of

Range = float | tuple[float, float]


class Dataset:
    """The meshes of a folder as point clouds, cast on demand.

    It is a map-style dataset for PyTorch, but needs no PyTorch: `dataset[i]` is a cloud of shape
    [points, 3] in the unit sphere, and its class. `attributes` adds columns. A cloud depends only on the seed, the epoch and `i`,
    not on batches or workers; on the same adapter, it does not depend on the machine. In epoch 0, the
    clouds are those that `edgepuck gen-dataset` packs with the same settings; a view of too few points,
    which `gen-dataset` leaves out, is replaced by another view.

    Args:
        meshes: The folder, with the layout `CLASS/{train,test}/NAME.off`. In any other layout, a hash
            of the seed, the class and the name puts about one mesh in five into the test set, and of a
            class of two meshes or more at least one into each, so that the training and test sets must
            have the same seed.
        sensor: The name or path of a sensor, as in `Sensor`, or a `Sensor`, whose adapter casts.
        split: `train`, `test`, or None for both.
        points: The number of points of each cloud.
        views: The number of clouds of each mesh in an epoch, evenly around the mesh.
        distance: The distance of the sensor from the mesh, metres, or the limits of a random distance.
        elevation: The elevation of the sensor, degrees, or the limits of a random elevation.
        azimuth_jitter: The largest random rotation of each view around the mesh, degrees. 180 allows
            all sides.
        noise: Standard deviation of the noise of the ranges, metres.
        dropout: Probability that a return is missing.
        effects: The path of a TOML file with a table `[effects]`, instead of noise and dropout.
        seed: The seed of all random numbers.
        normalize: The normalisation of meshes, as in `Mesh`.
        units: The unit of the meshes' coordinates with `normalize="none"`, as in `Mesh`; the metre by
            default.
        up: The upward axis of meshes, as in `Mesh`.
        min_points: A view with fewer points is replaced by another view.
        cache_mb: The size of the cache of meshes in each process, MiB.
        adapter: The adapter, as in `Sensor`; by default that of `sensor`.
        attributes: The attributes of each point besides its position, as in `Sensor.scan`. A cloud then
            has the shape [points, 3 + k], with the attributes in this order after x, y and z: one
            column for each, but three for sensor, attitude and normal. Positions are in the unit
            sphere; attributes keep their units, such as metres of range.
        transform: A function that `dataset[i]` applies to each cloud; `batch` does not.

    Raises:
        Error: The folder has no mesh, or a setting is wrong. A mesh that cannot be read raises an
            error when one of its clouds is drawn.
    """

    def __init__(
        self,
        meshes: str | os.PathLike[str],
        sensor: AnySensor = "vlp32c",
        *,
        split: str | None = None,
        points: int = 1024,
        views: int = 1,
        distance: Range = 3.0,
        elevation: Range = 20.0,
        azimuth_jitter: float = 180.0,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: str | os.PathLike[str] | None = None,
        seed: int = 0,
        normalize: str = "unit-sphere",
        units: str | None = None,
        up: str | None = None,
        min_points: int = 64,
        cache_mb: int = 1024,
        adapter: str | None = None,
        attributes: Sequence[str] = (),
        transform: Callable[[NDArray[np.float32]], Any] | None = None,
    ) -> None:
        if not (effects is None or isinstance(effects, (str, os.PathLike))):
            raise _edgepuck.Error(f"effects: expected the path of a TOML file, found {type(effects).__name__}")
        if effects is not None and (noise != 0 or dropout != 0):
            raise _edgepuck.Error("effects: cannot be used with noise or dropout")
        settings = {
            "sensor": profile_of("sensor", sensor),
            "points": whole("points", points, 1, 2**24),
            "views": whole("views", views, 1, 2**32 - 1),
            "distance": _from_to("distance", distance),
            "elevation": _from_to("elevation", elevation),
            "azimuth_jitter": real("azimuth_jitter", azimuth_jitter),
            "seed": _arguments.seed(seed),
            "normalize": normalize,
            "units": units,
            "up": up,
            "min_points": whole("min_points", min_points, 1, 2**32 - 1),
            "effects": None if effects is None else place(effects),
            "noise": real("noise", noise),
            "dropout": real("dropout", dropout),
        }
        self._seed, self._transform = seed, transform
        cache = whole("cache_mb", cache_mb, 0, 2**30) << 20
        if isinstance(attributes, str):
            raise _edgepuck.Error(f"attributes: expected a list of names, found {attributes!r}")
        casts = adapter or (sensor._made_of[1]["adapter"] if isinstance(sensor, Sensor) else "cpu")
        self._arguments = (os.path.abspath(meshes), split, settings, list(attributes), cache, casts)
        self._clouds = _edgepuck.Clouds(*self._arguments)
        # Shared memory, so that workers that persist over epochs see the current epoch.
        self._epoch = multiprocessing.RawValue("Q", 0)

    def __len__(self) -> int:
        """The number of clouds in an epoch."""
        return len(self._clouds)

    @property
    def classes(self) -> list[str]:
        """The names of the classes, in the order of the labels."""
        return self._clouds.classes

    @property
    def labels(self) -> NDArray[np.int64]:
        """The labels of all clouds, [len]. Nothing is cast."""
        return self._clouds.labels

    @property
    def epoch(self) -> int:
        """The current epoch."""
        return int(self._epoch.value)

    def set_epoch(self, epoch: int) -> None:
        """Draw the views of epoch number `epoch` from now on. It takes effect in the workers of a
        `DataLoader` at once, so call it between two iterations."""
        self._epoch.value = whole("epoch", epoch, 0, 2**32 - 1)

    def source(self, index: int) -> str:
        """The mesh file of cloud `index`, relative to the folder of meshes."""
        return self._clouds.source(self._number(index))

    def batch(self, indices: Sequence[int]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """The clouds at `indices`, [n, points, 3 + k], and their labels, [n]."""
        seed = _edgepuck.seed_of_epoch(self._seed, self.epoch)
        return self._clouds.draw(seed, [self._number(index) for index in indices])

    def __repr__(self) -> str:
        settings, split = self._arguments[2], self._arguments[1] or "train and test"
        points, sensor = settings["points"], os.path.basename(str(settings["sensor"]))
        of = f"{len(self)} clouds of {points} points, {len(self.classes)} classes ({split}), by {sensor}"
        return f"<Dataset {os.path.basename(self._arguments[0])}: {of}>"

    def __getitem__(self, index: int) -> tuple[Any, int]:
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Sequence[int]) -> list[tuple[Any, int]]:
        clouds, labels = self.batch(indices)
        transformed = clouds if self._transform is None else map(self._transform, clouds)
        return list(zip(transformed, labels.tolist(), strict=True))

    def _number(self, index: int) -> int:
        return number("clouds", index, len(self))

    def __getstate__(self) -> dict[str, Any]:
        # Only children of this process can share its memory.
        shared = None if get_spawning_popen() is None else self._epoch
        return {
            "arguments": self._arguments,
            "seed": self._seed,
            "transform": self._transform,
            "epoch": self.epoch,
            "shared": shared,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._arguments, self._seed = state["arguments"], state["seed"]
        self._transform = state["transform"]
        self._clouds = _edgepuck.Clouds(*self._arguments)
        shared = state["shared"]
        self._epoch = multiprocessing.RawValue("Q", state["epoch"]) if shared is None else shared


def _from_to(name: str, value: Range) -> tuple[float, float | None]:
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise _edgepuck.Error(f"{name}: expected a number, or two, found {value!r}")
        return real(name, value[0]), real(name, value[1])
    return real(name, value), None
