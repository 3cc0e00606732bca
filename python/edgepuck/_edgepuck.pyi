from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Classifier",
    "Clouds",
    "Error",
    "Mesh",
    "Scene",
    "Scenes",
    "Sensor",
    "activation_ranges",
    "adapters",
    "detect",
    "main",
    "read_grey16",
    "read_network",
    "read_points",
    "run",
    "save_scan",
    "seed_of_epoch",
    "segment",
    "set_num_threads",
    "write_weights",
]

class Error(ValueError): ...

@final
class Mesh:
    @staticmethod
    def read(path: str, up: str | None, units: str, normalize: str) -> Mesh: ...
    @staticmethod
    def of_arrays(
        vertices: NDArray[np.float64],
        faces: NDArray[np.int64],
        up: str,
        units: str,
        normalize: str,
    ) -> Mesh: ...
    def __len__(self) -> int: ...
    @property
    def scale(self) -> float: ...
    def odd_size(self, units: str) -> str | None: ...
    @property
    def centre(self) -> list[float]: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> NDArray[np.int64]: ...

@final
class Sensor:
    def __new__(cls, name: str, adapter: str) -> Sensor: ...
    @property
    def name(self) -> str: ...
    @property
    def directions(self) -> NDArray[np.float64]: ...
    @property
    def rings(self) -> NDArray[np.uint16]: ...
    @property
    def times(self) -> NDArray[np.float64]: ...

@final
class Scene:
    def __new__(cls) -> Scene: ...
    @staticmethod
    def read(file: str, joints: dict[str, float], collision: bool, base_colours: bool) -> Scene: ...
    def __len__(self) -> int: ...
    def names(self) -> list[str | None]: ...
    def labels(self) -> list[str | None]: ...
    def bounds(self) -> list[list[list[float]]]: ...
    def add(
        self,
        mesh: Mesh,
        pose: NDArray[np.float64],
        scale: Sequence[float],
        name: str | None,
        label: str | None,
        reflectivity: float,
        retroreflection: float,
    ) -> int: ...
    def move_all(self, numbers: Sequence[int], poses: NDArray[np.float64]) -> None: ...
    def scan(
        self,
        sensor: Sensor,
        place: NDArray[np.float64],
        effects: str | None,
        attributes: Sequence[str] | None,
        seed: int | None,
    ) -> dict[str, Any]: ...
    def cast(
        self,
        sensor: Sensor,
        poses: NDArray[np.float64],
        numbers: Sequence[int],
        moved: NDArray[np.float64],
        effects: str | None,
        attributes: Sequence[str],
        seed: int | None,
    ) -> dict[str, Any]: ...
    def scan_all(self, adapter: str) -> list[tuple[str, dict[str, Any]]]: ...

@final
class Clouds:
    def __new__(
        cls,
        meshes: str,
        split: str | None,
        settings: dict[str, Any],
        attributes: Sequence[str],
        cache_bytes: int,
        adapter: str,
    ) -> Clouds: ...
    def __len__(self) -> int: ...
    @property
    def classes(self) -> list[str]: ...
    @property
    def labels(self) -> NDArray[np.int64]: ...
    def source(self, index: int) -> str: ...
    def draw(
        self, seed: int, indices: Sequence[int]
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]: ...

@final
class Classifier:
    def __new__(
        cls, model: str, precision: str, sampler: str | None, n_points: int | None
    ) -> Classifier: ...
    @property
    def classes(self) -> list[str]: ...
    def classify(
        self, cloud: NDArray[np.float32], ground_z: float | None, is_scan: bool
    ) -> dict[str, Any]: ...

@final
class Scenes:
    def __new__(
        cls, recipe: str, sensors: Sequence[str], meshes: str | None, seed: int
    ) -> Scenes: ...
    @property
    def classes(self) -> list[str]: ...
    def draw(self, number: int) -> dict[str, Any]: ...

def activation_ranges(model: str, clouds: str) -> str: ...
def adapters() -> list[str]: ...
def detect(
    cloud: NDArray[np.float32],
    rings: NDArray[np.uint16] | None,
    model: str,
    precision: str,
    min_points: int,
    min_confidence: float,
) -> list[dict[str, Any]]: ...
def read_grey16(file: str) -> NDArray[np.uint16]: ...
def read_network(model: str) -> tuple[dict[str, str], dict[str, Any]]: ...
def read_points(
    path: str, format: str | None, metadata: str | None, sender: str | None
) -> Mapping[str, Any]: ...
def save_scan(path: str, columns: Mapping[str, Any]) -> None: ...
def main(words: Sequence[str]) -> int: ...
def run(words: Sequence[str]) -> None: ...
def seed_of_epoch(seed: int, epoch: int) -> int: ...
def segment(
    cloud: NDArray[np.float32],
    rings: NDArray[np.uint16] | None,
    radius: float | None,
    min_points: int | None,
) -> NDArray[np.int32]: ...
def set_num_threads(threads: int) -> None: ...
def write_weights(
    path: str, tensors: Mapping[str, NDArray[np.float32]], metadata: Mapping[str, str], is_half: bool
) -> None: ...
