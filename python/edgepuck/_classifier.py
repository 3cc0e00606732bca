"""Classification of clouds."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import Remade, place, whole
from ._exchange import foreign_points
from ._scan import Scan


@dataclass(eq=False, repr=False)
class Prediction:
    """The answer of a network to a cloud."""

    label: str
    """The answer: the name of the most probable class, or `unknown`."""
    index: int
    """The index of the most probable class in `Classifier.classes`, known or not."""
    is_unknown: bool
    """Whether the object belongs to no known class."""
    confidence: float
    """The probability of the class."""
    logits: NDArray[np.float32]
    """The outputs of the network, [n_classes]."""
    nearest: str
    """The name of the most probable class, known or not."""

    def __repr__(self) -> str:
        share = f"{100 * self.confidence:.1f} %"
        if self.is_unknown:
            return f"<Prediction unknown: resembles {self.nearest} the most, {share}>"
        return f"<Prediction {self.label}, {share}>"


class Classifier(Remade):
    """A PointNet with a sampler, on one thread of the CPU.

    Args:
        model: A bundled model, `edge-64` or `set-64` (the classes of ModelNet40, from all sides;
            `set-64` is slower and more accurate), `shapes-rotational-64` (scans of the built-in
            shapes) or `street-128` (cars and persons among other things), or the path of a model
            file.
        precision: The precision: f32 or i8.
        sampler: The sampler of points: all, random, fps or cpl. By default, as in training.
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

    def __repr__(self) -> str:
        model, precision = os.path.basename(self._made_of[0][0]), self._made_of[1]["precision"]
        return f"<Classifier {model}: {len(self.classes)} classes, {precision}>"

    @overload
    def __call__(self, cloud: Scan, *, ground_z: float | None = None) -> Prediction: ...
    @overload
    def __call__(self, cloud: Sequence[Scan], *, ground_z: float | None = None) -> list[Prediction]: ...
    @overload
    def __call__(self, cloud: ArrayLike, *, ground_z: float | None = None) -> Prediction | list[Prediction]: ...
    def __call__(
        self, cloud: Scan | Sequence[Scan] | ArrayLike, *, ground_z: float | None = None
    ) -> Prediction | list[Prediction]:
        """Classify a cloud, or each cloud of a batch.

        Args:
            cloud: A scan, or points, [n, 3], z up, or a cloud of Open3D or trimesh, or the path of a file
                that `Scan.read` reads. Further columns, such as the intensity in [n, 4], are ignored, and so
                are lost returns: points at 0, 0, 0 or without finite coordinates. A batch is a list of these,
                or an array of shape [b, n, 3].
            ground_z: The height of the ground below the object, metres, for models such as
                `street-128` that were trained with it.
        """
        is_batch = _is_batch(cloud)
        clouds: Any = cloud if is_batch else [cloud]
        found = []
        for i, one in enumerate(clouds):
            try:
                one = Scan.read(one) if isinstance(one, (str, os.PathLike)) else one
                points = points_of(one.positions if isinstance(one, Scan) else one)
                answer = self._classifier.classify(points, ground_z, isinstance(one, Scan))
                found.append(Prediction(**answer, nearest=self.classes[answer["index"]]))
            except _edgepuck.Error as error:
                raise _edgepuck.Error(f"cloud {i}: {error}" if is_batch else str(error)) from None
        return found if is_batch else found[0]


def _is_batch(cloud: Any) -> bool:
    if isinstance(cloud, (Scan, str, os.PathLike)):
        return False
    if isinstance(cloud, (list, tuple)) and cloud:
        first = cloud[0]
        if isinstance(first, (Scan, str, os.PathLike)) or foreign_points(first) is not first:
            return True
        if isinstance(first, np.ndarray):
            return first.ndim == 2
    return np.ndim(foreign_points(cloud)) == 3


def points_of(cloud: Any) -> NDArray[np.float32]:
    """The first three columns of `cloud`: points of shape [n, 3], or a cloud of another library."""
    points = np.asarray(foreign_points(cloud))
    if points.dtype.names is not None:
        missing = [axis for axis in "xyz" if axis not in points.dtype.names]
        if missing:
            raise _edgepuck.Error(f"expected fields x, y and z, found {list(points.dtype.names)}")
        points = np.stack([points[axis] for axis in "xyz"], axis=-1)
    try:
        points = np.asarray(points, dtype=np.float32)
    except (TypeError, ValueError):
        raise _edgepuck.Error(f"expected points of shape [n, 3], found {type(cloud).__name__}") from None
    if points.ndim != 2 or points.shape[1] < 3 or (points.shape[0] == 3 and points.shape[1] > 32):
        way_out = ": transpose it" if points.ndim == 2 and points.shape[0] == 3 else ""
        raise _edgepuck.Error(f"expected points of shape [n, 3], found {list(points.shape)}{way_out}")
    return np.ascontiguousarray(points[:, :3])
