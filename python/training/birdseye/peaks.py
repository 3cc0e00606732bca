"""The objects at the peaks of the network's scores, as infer-cpu/src/birdseye/peaks.rs finds them."""

import numpy as np
import torch
from grid import CELL_M, REACH_M, raster
from network import N_CLASSES
from numpy import ndarray
from torch.nn import functional as F

SIDE = int(2 * REACH_M / CELL_M)
REACH = [3, 1, 2, 4]
APART_M, CLOSER = [1.5, 0.4, 0.45, 3.0], 0.6
# How far about a box its points are, and about a person, metres; and up to which height.
MARGIN_M, PERSON_M, HIGHEST_M = 0.15, 0.55, 4.0
PERSON = 1


def scores(net: torch.nn.Module, points: ndarray) -> tuple[ndarray, ndarray]:
    """The outputs of the network, and the scores of its classes. `points` are those of `grid.points_of`, in metres."""
    with torch.no_grad():
        image = torch.from_numpy(raster(points, -REACH_M, -REACH_M, SIDE))[None]
        output = net(image.contiguous(memory_format=torch.channels_last))[0].float()
    return output.numpy(), torch.sigmoid(output[:N_CLASSES]).numpy()


def may_be(x: float, y: float, length: float, width: float, yaw: float) -> bool:
    """Whether a box is within reach, and does not hold the sensor: what does carries it."""
    ahead, aside = x * np.cos(yaw) + y * np.sin(yaw), y * np.cos(yaw) - x * np.sin(yaw)
    return bool(np.hypot(x, y) <= REACH_M and not (abs(ahead) < length / 2 and abs(aside) < width / 2))


def box_at(output: ndarray, i: int, j: int) -> tuple:
    """x, y, length, width, height and yaw of the object about a cell."""
    u, v, *sizes, cos, sin = output[N_CLASSES:, i, j]
    at = [(cell + 0.5 + off) * CELL_M - REACH_M for cell, off in ((i, u), (j, v))]
    return *at, *np.exp(np.clip(sizes, -2, 3)), np.arctan2(sin, cos) / 2


def objects(output: ndarray, score: ndarray, least: float) -> list[tuple]:
    """(score, class, x, y, length, width, height, yaw), the best first."""
    pooled = [F.max_pool2d(torch.from_numpy(score)[None, c : c + 1], 2 * r + 1, 1, r)[0, 0] for c, r in enumerate(REACH)]
    is_peak = (score == torch.stack(pooled).numpy()) & (score >= least)
    seen = []
    for of, i, j in zip(*np.nonzero(is_peak), strict=True):
        x, y, length, width, height, yaw = box_at(output, i, j)
        if may_be(x, y, length, width, yaw):
            seen.append((float(score[of, i, j]), int(of), x, y, length, width, height, yaw))
    seen.sort(reverse=True)
    of, places = np.array([one[1] for one in seen], int), np.array([one[2:4] for one in seen]).reshape(-1, 2)
    apart, kept, is_kept = np.array(APART_M)[of], [], np.zeros(len(seen), bool)
    for number, one in enumerate(seen):
        others = np.flatnonzero(is_kept[:number])
        least = np.maximum(apart[number], apart[others]) * np.where(of[others] == of[number], 1, CLOSER)
        if (np.hypot(*(places[others] - places[number]).T) > least).all():
            is_kept[number] = True
            kept.append(one)
    return kept


def within(points: ndarray, of: int, x: float, y: float, length: float, width: float, yaw: float) -> ndarray:
    """Which points are those of an object."""
    off = points[:, :2] - np.array([x, y], np.float32)
    if of == PERSON:
        inside = np.hypot(*off.T) < PERSON_M
    else:
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        inside = np.abs(off @ ahead) < length / 2 + MARGIN_M
        inside &= np.abs(off @ np.array([-ahead[1], ahead[0]])) < width / 2 + MARGIN_M
    return inside & (points[:, 3] == 0) & (points[:, 2] < HIGHEST_M)
