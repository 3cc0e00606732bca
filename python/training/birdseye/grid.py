"""What a bird's-eye network sees of a sweep: heights over the ground, and which cells they occupy. `infer-cpu/src/birdseye`
has the same in Rust, and a test holds one to the other."""

import numpy as np
from numpy import ndarray
from scipy.ndimage import distance_transform_edt

# The classes of the heat; trucks and buses are one.
CLASSES = {"car": 0, "person": 1, "two-wheeler": 2, "truck": 3, "bus": 3}
NAMES = ["car", "person", "two-wheeler", "truck"]
# The length of a cell, and how far the network sees, metres.
CELL_M, REACH_M = 0.2, 40.0
# The borders of the heights over the ground, metres: one more channel for each quarter of a cell than there are borders.
BORDERS_M = np.array([0.2, 0.4, 0.65, 0.9, 1.15, 1.4, 1.65, 1.9, 2.3, 3.0], np.float32)
N_HEIGHTS = len(BORDERS_M) + 1
CHANNELS = 4 * N_HEIGHTS + 3
# The cells whose median gives the height of the ground, and how far they reach, metres.
GROUND_CELL_M, GROUND_REACH_M = 1.0, 46.0
LOWEST_M, HIGHEST_M = -0.6, 5.0


def heights(points: ndarray, is_ground: ndarray) -> ndarray:
    """The height of each point over the median of the ground in the nearest cell that has some."""
    n = int(2 * GROUND_REACH_M / GROUND_CELL_M)
    cells = np.floor((points[:, :2] + GROUND_REACH_M) / GROUND_CELL_M).astype(int)
    ground = is_ground & (cells >= 0).all(1) & (cells < n).all(1)
    numbers = cells[ground, 0] * n + cells[ground, 1]
    order = np.lexsort((points[ground, 2], numbers))
    known, first, count = np.unique(numbers[order], return_index=True, return_counts=True)
    medians = np.full(n * n, np.nan)
    medians[known] = points[ground, 2][order][first + count // 2]
    medians = medians.reshape(n, n)
    nearest = distance_transform_edt(np.isnan(medians), return_distances=False, return_indices=True)
    cells = np.clip(cells, 0, n - 1)
    return points[:, 2] - medians[tuple(nearest)][cells[:, 0], cells[:, 1]]


def points_of(points: ndarray, labels: ndarray) -> tuple[ndarray, ndarray]:
    """(x, y, height, whether ground) of the points that the network sees, in centimetres, and which of `points` they are.

    `labels` are those of `edgepuck.segment`: -1 is ground, -3 is invalid."""
    over = heights(points, labels == -1)
    used = (np.hypot(points[:, 0], points[:, 1]) < 44) & (labels != -3) & (over > LOWEST_M) & (over < HIGHEST_M)
    table = np.column_stack([np.round(points[used, :2] * 100), np.round(over[used] * 100), labels[used] == -1])
    return table.astype(np.int16), used


def raster(points: ndarray, x0: float, y0: float, n: int) -> ndarray:
    """[CHANNELS, n, n] of the square that begins at (x0, y0), of points (x, y, height, whether ground) in metres.

    Of each cell: which heights are occupied in its four quarters; whether it has ground; the logarithm of its number of
    other points; its distance if it has any points."""
    along, across = (points[:, 0] - x0) / CELL_M, (points[:, 1] - y0) / CELL_M
    within = (along >= 0) & (along < n) & (across >= 0) & (across < n)
    along, across, height, ground = along[within], across[within], points[within, 2], points[within, 3] > 0
    i, j = along.astype(int), across.astype(int)
    image, cell, standing = np.zeros((CHANNELS, n * n), np.float32), i * n + j, ~ground
    quarter = 2 * (along - i >= 0.5) + (across - j >= 0.5)
    image[np.digitize(height[standing], BORDERS_M) + N_HEIGHTS * quarter[standing], cell[standing]] = 1
    image[-3, cell[ground]] = 1
    image[-2] = np.log1p(np.bincount(cell[standing], minlength=n * n)) / 4
    middle = (np.arange(n) + 0.5) * CELL_M
    # Cells without points are all alike, so that the network need not compute them one by one.
    image[-1] = (np.hypot((x0 + middle)[:, None], y0 + middle) / 40).ravel() * (np.bincount(cell, minlength=n * n) > 0)
    return image.reshape(CHANNELS, n, n)
