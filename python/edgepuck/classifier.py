"""Classification of clouds."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import Remade, place, whole
from .scan import Scan


@dataclass(eq=False)
class Prediction:
    """The answer of a network to a cloud."""

    label: str
    """The name of the most probable class, known or not."""
    index: int
    """The index of the class in `Classifier.classes`."""
    is_unknown: bool
    """Whether the object belongs to no known class."""
    confidence: float
    """The probability of the class."""
    logits: NDArray[np.float32]
    """The outputs of the network, [n_classes]."""


class Classifier(Remade):
    """A PointNet with a sampler, on one thread of the CPU.

    Args:
        model: A bundled model, `edge-64` (the classes of ModelNet40) or `street-128` (cars and
            persons among other things), or the path of a model file.
        precision: The precision: f32, f32-fc16, f16 or i8.
        sampler: The sampler of points: all, random, fps, voxel or cpl. By default, as in training.
        points: The number of points that the sampler chooses.

    Raises:
        Error: The model cannot be read, or a setting does not suit it.

    >>> Classifier("edge-64").classes[:3]
    ['airplane', 'bathtub', 'bed']
    """

    def __init__(
        self,
        model: str | os.PathLike[str] = "edge-64",
        *,
        precision: str = "f32",
        sampler: str | None = None,
        points: int | None = None,
    ) -> None:
        wanted = None if points is None else whole("points", points, 1, 2**32)
        file = place(model)
        self._made_of = (file,), {"precision": precision, "sampler": sampler, "points": wanted}
        self._classifier = _edgepuck.Classifier(file, precision, sampler, wanted)

    @property
    def classes(self) -> list[str]:
        """The names of the classes."""
        return self._classifier.classes

    def __call__(self, cloud: Scan | ArrayLike, *, ground_z: float | None = None) -> Prediction:
        """Classify a cloud, [n, 3], z up.

        Args:
            cloud: The points, which must be finite.
            ground_z: The height of the ground below the object, metres, for models such as
                `street-128` that were trained with it.
        """
        points = cloud.positions if isinstance(cloud, Scan) else cloud
        return Prediction(**self._classifier.classify(points_of(points), ground_z))


def points_of(cloud: ArrayLike) -> NDArray[np.float32]:
    """`cloud` as points of shape [n, 3]."""
    points = np.ascontiguousarray(cloud, dtype=np.float32)
    if points.ndim != 2:
        raise _edgepuck.Error(f"expected points of shape [n, 3], found {list(points.shape)}")
    return points
