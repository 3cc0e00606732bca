"""Clouds of many meshes, cast as they are read."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from multiprocessing.context import get_spawning_popen
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _arguments, _edgepuck
from ._arguments import number, place, whole

Range = float | tuple[float, float]


class Dataset:
    """A folder of meshes as clouds of points, each cast when it is read.

    It is a map-style dataset of PyTorch, but needs no PyTorch: `dataset[i]` is a cloud of shape
    [points, 3] in the unit sphere, and its class. What it is depends on the seed, the epoch and `i`
    alone, not on batches or workers, and on one adapter not on the machine. In epoch 0, the clouds are
    those that `edgepuck gen-dataset` packs with the same settings; a view of too few points, which that
    leaves out, is replaced by another.

    Args:
        meshes: The folder: `CLASS/{train,test}/NAME.off`, or any other layout, in which a hash
            of the seed, the class and the name puts about one mesh in five into the test set: there, the
            sets to train and to test with must have one seed.
        sensor: As of `Sensor`.
        split: `train`, `test`, or None for both.
        points: Points of each cloud.
        views: Clouds of each mesh in an epoch, from as many sides.
        distance: From the mesh to the sensor, metres; of two, a random one between them.
        elevation: Of the sensor above the mesh, degrees; of two, a random one between them.
        azimuth_jitter: Each view is turned around the mesh by a random angle of at most this,
            degrees: 180 is any side.
        noise: Standard deviation of the noise of the ranges, metres; 0.01 if there are no effects.
        dropout: Probability that a return is missing.
        effects: The path of a TOML file with a table `[effects]`, in place of noise and dropout.
        seed: Of all random numbers.
        normalize: As of `Mesh`.
        up: As of `Mesh`.
        min_points: A view that sees fewer points is replaced by another.
        cache_mb: Meshes stay in the memory of each process up to this, MiB.
        adapter: As of `Sensor`.

    Raises:
        Error: The folder has no mesh, or a setting is wrong. A mesh that cannot be read is named
            when it is drawn.
    """

    def __init__(
        self,
        meshes: str | os.PathLike[str],
        sensor: str | os.PathLike[str] = "vlp32c",
        *,
        split: str | None = None,
        points: int = 1024,
        views: int = 1,
        distance: Range = 3.0,
        elevation: Range = 20.0,
        azimuth_jitter: float = 180.0,
        noise: float | None = None,
        dropout: float | None = None,
        effects: str | os.PathLike[str] | None = None,
        seed: int = 0,
        normalize: str = "unit-sphere",
        up: str | None = None,
        min_points: int = 64,
        cache_mb: int = 1024,
        adapter: str = "cpu",
    ) -> None:
        flags = {
            "sensor": place(sensor),
            "points": points,
            "views": views,
            "distance": _from_to(distance),
            "elevation": _from_to(elevation),
            "azimuth-jitter": azimuth_jitter,
            "seed": _arguments.seed(seed),
            "normalize": normalize,
            "up": up,
            "min-points": min_points,
            "effects": None if effects is None else place(effects),
            "noise": noise,
            "dropout": dropout,
        }
        words = [f"--{flag}={value}" for flag, value in flags.items() if value is not None]
        self._seed = seed
        cache = whole("cache_mb", cache_mb, 0, 2**30) << 20
        self._arguments = (os.path.abspath(meshes), split, words, cache, adapter)
        self._clouds = _edgepuck.Clouds(*self._arguments)
        # Shared, so that workers that outlive an epoch see the next one.
        self._epoch = multiprocessing.RawValue("Q", 0)

    def __len__(self) -> int:
        """The number of clouds of an epoch."""
        return len(self._clouds)

    @property
    def classes(self) -> list[str]:
        """The classes' names; labels are indices into them."""
        return self._clouds.classes

    @property
    def labels(self) -> NDArray[np.int64]:
        """The label of each cloud, without casting any, [len]."""
        return self._clouds.labels

    @property
    def epoch(self) -> int:
        """The epoch that is drawn."""
        return int(self._epoch.value)

    def set_epoch(self, epoch: int) -> None:
        """Draw other views from now on, of epoch number `epoch`. Workers of a `DataLoader` follow
        at once, so call it between two iterations."""
        self._epoch.value = whole("epoch", epoch, 0, 2**32 - 1)

    def source(self, index: int) -> str:
        """The mesh file that cloud `index` is of, from the folder of meshes."""
        return self._clouds.source(self._number(index))

    def batch(self, indices: Sequence[int]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Some clouds, [n, points, 3], and their labels, [n]."""
        seed = _edgepuck.seed_of_epoch(self._seed, self.epoch)
        return self._clouds.draw(seed, [self._number(index) for index in indices])

    def __getitem__(self, index: int) -> tuple[NDArray[np.float32], int]:
        clouds, labels = self.batch([index])
        return clouds[0], int(labels[0])

    def __getitems__(self, indices: Sequence[int]) -> list[tuple[NDArray[np.float32], int]]:
        clouds, labels = self.batch(indices)
        return list(zip(clouds, labels.tolist(), strict=True))

    def _number(self, index: int) -> int:
        return number("clouds", index, len(self))

    def __getstate__(self) -> dict[str, Any]:
        # The shared epoch goes to the children of this process alone.
        shared = None if get_spawning_popen() is None else self._epoch
        return {"arguments": self._arguments, "seed": self._seed, "epoch": self.epoch, "shared": shared}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._arguments, self._seed = state["arguments"], state["seed"]
        self._clouds = _edgepuck.Clouds(*self._arguments)
        shared = state["shared"]
        self._epoch = multiprocessing.RawValue("Q", state["epoch"]) if shared is None else shared


def _from_to(value: Range) -> str:
    return ",".join(map(str, value)) if isinstance(value, (tuple, list)) else str(value)
