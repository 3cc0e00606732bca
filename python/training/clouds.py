"""Packed sets of clouds: their reading, their halves, and how they vary."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from recipe import Augment
from torch import Tensor


@dataclass
class Clouds:
    """Clouds in the unit sphere, `[clouds, points, 3]`, with their labels, and the classes that these number."""

    points: np.ndarray
    labels: np.ndarray
    classes: list[str]
    names: list[str]


def read(path: Path) -> Clouds:
    """The clouds of a packed set, moved and scaled into the unit sphere."""
    with np.load(path) as file:
        points = file["points_i16"] / np.float32(32767) if "points_i16" in file else file["points"]
        if points.ndim != 3:
            raise SystemExit(f"{path}: expected points [clouds, points, 3], found {list(points.shape)}")
        points = points - points.mean(1, keepdims=True, dtype=np.float64).astype(np.float32)
        points = (points / np.linalg.norm(points, axis=2).max(1)[:, None, None]).astype(np.float32)
        names = _texts(file["names"]) if "names" in file else []
        return Clouds(points, file["labels"].astype(np.int64), _texts(file["classes"]), names)


def _texts(values: np.ndarray) -> list[str]:
    return [value.decode() if isinstance(value, bytes) else str(value) for value in values]


def held_meshes(clouds: Clouds, share: float, seed: int) -> np.ndarray:
    """Which clouds are held back: all views of a mesh or none, and the `share` of each class's meshes."""
    draws = np.random.default_rng(seed)
    held = np.zeros(len(clouds.names), bool)
    bare = np.array([re.sub(r"_v\d+$", "", name) for name in clouds.names])
    for label in range(len(clouds.classes)):
        meshes = draws.permutation(np.unique(bare[clouds.labels == label]))
        chosen = meshes[: round(len(meshes) * share)]
        held |= (clouds.labels == label) & np.isin(bare, chosen)
    return held


def uniform(shape: tuple[int, ...], low: float, high: float, device: torch.device) -> Tensor:
    return torch.empty(shape, device=device).uniform_(low, high)


def varied(points: Tensor, augment: Augment) -> Tensor:
    """Clouds `[..., points, 3]` moved point by point, scaled and shifted. Dropping is not done here."""
    if augment.jitter > 0:
        points = points + (augment.jitter * torch.randn_like(points)).clamp(-0.05, 0.05)
    clouds, device = points.shape[:-2], points.device
    scale = uniform((*clouds, 1, 1), *augment.scale, device)
    if augment.stretch > 0:
        scale = scale * uniform((*clouds, 1, 3), 1 - augment.stretch, 1 + augment.stretch, device)
    return points * scale + uniform((*clouds, 1, 3), -augment.shift, augment.shift, device)
