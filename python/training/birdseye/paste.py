"""Persons and two-wheelers of other sweeps put into a sweep: beside walls and each other, and in rows, as streets have them.

The network then learns what they look like wherever they stand (GT sampling: Yan, Mao and Li, "SECOND", Sensors 2018)."""

import numpy as np
from numpy import ndarray
from numpy.random import Generator
from peaks import within

PERSON, TWO_WHEELER = 1, 2
FEWEST_POINTS = 15
# How far from the sensor, metres; and by how much nearer or farther the object was seen, as a factor.
NEAREST_M, FARTHEST_M, CLOSE = 3.0, 38.0, 1.6
# Directions by which cutouts are sorted.
N_YAWS = 8
# The cells of the map of what stands where, and how far it reaches, metres.
CELL_M, REACH_M = 0.1, 42.0


class Cutouts:
    """The points of objects about their middles, turned so that the sensor saw them along x."""

    def __init__(self) -> None:
        self.of: dict[tuple[int, int], list[tuple[float, ndarray, ndarray]]] = {}

    def add(self, points: ndarray, boxes: ndarray) -> None:
        """Adds the objects of a sweep."""
        for box in boxes:
            of, x, y, length, width, yaw, _, seen = box
            away = np.hypot(x, y)
            if of not in (PERSON, TWO_WHEELER) or seen < FEWEST_POINTS or not NEAREST_M < away < FARTHEST_M:
                continue
            near = points[(np.abs(points[:, 0] - x) < 1.5) & (np.abs(points[:, 1] - y) < 1.5)]
            own = near[within(near, int(of), x, y, length, width, yaw)]
            if len(own) >= FEWEST_POINTS:
                sight = np.arctan2(y, x)
                cut = own.copy()
                cut[:, :2] = turned(own[:, :2] - [x, y], -sight)
                kept = box.copy()
                kept[5] -= sight
                self.of.setdefault((int(of), number(kept[5])), []).append((away, cut, kept))

    def draw(self, rng: Generator, of: int, yaw: float, away: float) -> tuple[ndarray, ndarray] | None:
        """An object seen from about as far away in this direction to the sight."""
        choice = self.of.get((of, number(yaw)), [])
        for _ in range(6 if choice else 0):
            one = choice[rng.integers(len(choice))]
            if away / CLOSE < one[0] < away * CLOSE:
                return one[1], one[2]
        return None


def number(yaw: float) -> int:
    return int(np.floor(yaw % np.pi / np.pi * N_YAWS)) % N_YAWS


def turned(xy: ndarray, angle: float) -> ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return xy @ np.array([[cos, sin], [-sin, cos]], np.float32)


class Street:
    """A sweep to which objects are added."""

    def __init__(self, points: ndarray, boxes: ndarray) -> None:
        self.points, self.boxes, self.added = points, list(boxes), []
        n = int(2 * REACH_M / CELL_M)
        self.taken = np.zeros((n, n), bool)
        self.standing = points[(points[:, 3] == 0) & (points[:, 2] > 0.15) & (points[:, 2] < 2.0)]
        self.mark(self.standing)
        self.far = np.hypot(points[:, 0], points[:, 1])
        self.sight = np.arctan2(points[:, 1], points[:, 0])
        self.kept = np.ones(len(points), bool)

    def mark(self, points: ndarray) -> None:
        cells = ((points[:, :2] + REACH_M) / CELL_M).astype(int)
        cells = cells[((cells >= 0) & (cells < len(self.taken))).all(1)]
        self.taken[cells[:, 0], cells[:, 1]] = True

    def put(self, rng: Generator, cutouts: Cutouts, of: int, at: ndarray, yaw: float | None, room_m: float) -> bool:
        """Puts an object at `at`, with this yaw or any, if there is room."""
        away, sight = np.hypot(*at), np.arctan2(at[1], at[0])
        if not NEAREST_M < away < FARTHEST_M:
            return False
        low, high = (((at + side * room_m + REACH_M) / CELL_M).astype(int) for side in (-1, 1))
        if self.taken[low[0] : high[0] + 1, low[1] : high[1] + 1].any():
            return False
        one = cutouts.draw(rng, of, (rng.uniform(0, np.pi) if yaw is None else yaw) - sight, away)
        if one is None:
            return False
        cut, box = one[0].copy(), one[1].copy()
        cut[:, :2] = turned(cut[:, :2], sight) + at
        box[1:3], box[5] = at, box[5] + sight
        behind = np.abs((self.sight - sight + np.pi) % (2 * np.pi) - np.pi) * away < 0.2
        self.kept &= ~(behind & (self.far > away) & (self.points[:, 2] < 1.6))
        self.added.append(cut)
        self.boxes.append(box)
        self.mark(cut)
        return True

    def place(self, rng: Generator) -> ndarray:
        """Somewhere: on the open ground, or beside what stands there."""
        if rng.random() < 0.5 and len(self.standing):
            off = rng.uniform(0.35, 1.2) * turned(np.array([1.0, 0.0], np.float32), rng.uniform(-np.pi, np.pi))
            return self.standing[rng.integers(len(self.standing)), :2] + off
        return turned(np.array([rng.uniform(4, 34), 0.0], np.float32), rng.uniform(-np.pi, np.pi))


def pasted(points: ndarray, boxes: ndarray, cutouts: Cutouts, rng: Generator) -> tuple[ndarray, ndarray]:
    """The sweep with more persons, alone and in groups, and two-wheelers in rows."""
    street = Street(points, boxes)
    if rng.random() < 0.6:
        for _ in range(rng.integers(1, 8)):
            at = street.place(rng)
            aside = turned(np.array([rng.uniform(0.5, 0.9), 0.0], np.float32), rng.uniform(-np.pi, np.pi))
            for i in range(rng.choice([1, 1, 2, 2, 3])):
                street.put(rng, cutouts, PERSON, at + i * aside, None, 0.25)
    for _ in range(rng.choice([0, 0, 1, 2])):
        at, yaw, apart = street.place(rng), rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.0)
        aside = turned(np.array([1.0, 0.0], np.float32), yaw + np.pi / 2 + rng.normal(0, 0.2))
        for i in range(rng.integers(2, 10)):
            street.put(rng, cutouts, TWO_WHEELER, at + (i * apart + rng.normal(0, 0.05)) * aside, yaw + rng.normal(0, 0.1), 0.2)
    if not street.added:
        return points, boxes
    return np.concatenate([points[street.kept], *street.added]), np.array(street.boxes, np.float32)


def covered(points: ndarray, rng: Generator) -> ndarray:
    """The sweep below awnings, arcades and crowns, of which each cell of 0.2 m has a point or none; or without all that is high.

    What hangs above them hid persons and trucks of real streets from a network whose streets were open."""
    if rng.random() < 0.3:
        points = points[(points[:, 3] > 0) | (points[:, 2] < rng.uniform(2.0, 4.0))]
    if rng.random() < 0.5:
        return points
    roofs = [points]
    for _ in range(rng.integers(1, 6)):
        half, dense = rng.uniform([1.5, 0.7], [10, 3]), rng.uniform(0.05, 0.8)
        cells = np.stack(np.meshgrid(*(np.arange(-side, side, 0.2) for side in half)), -1).reshape(-1, 2)
        roof = np.zeros((len(cells), 4), np.float32)
        roof[:, 2] = rng.uniform(2.2, 4.7) + roof[:, 0] * rng.normal(0, 0.05) + rng.normal(0, rng.choice([0.03, 0.5]), len(cells))
        roof[:, :2] = turned((cells + rng.uniform(0, 0.2, cells.shape)).astype(np.float32), rng.uniform(0, np.pi)) + rng.uniform(-28, 28, 2)
        roofs.append(roof[(rng.random(len(cells)) < dense) & (roof[:, 2] > 2.0)])
    return np.concatenate(roofs)
