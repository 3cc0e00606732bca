"""Poses, as all functions take them.

A pose is a matrix [4, 4] or seven numbers: a position x, y, z in metres and a quaternion x, y, z, w of length 1, in
the order of ROS, of trajectories in TUM's format, and of scenes in TOML.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._edgepuck import Error

# A pose is one of these numbers of numbers in a row.
_MATRIX, _SEVEN = 16, 7


def one(name: str, pose: Any, most_off: float = 1e-6) -> NDArray[np.float64]:
    """The row of one pose, [1, 16] or [1, 7], whose rotation is off by `most_off` at the most."""
    found = _numbers(name, pose, "[4, 4]", "[7]")
    if found.shape not in [(4, 4), (_SEVEN,)]:
        raise Error(f"{name}: {_expected('[4, 4]', '[7]', list(found.shape))}")
    return _checked(name, found.reshape(1, -1), most_off)


def many(name: str, poses: Any, shape: tuple[int, ...] = ()) -> tuple[int, NDArray[np.float64]]:
    """The length of `poses` and their rows, [m, 16] or [m, 7]. `shape` is that before the last axes;
    without it, one axis of any length."""
    before = ", ".join(map(str, shape)) or "n"
    forms = f"[{before}, 4, 4]", f"[{before}, 7]"
    found = _numbers(name, poses, *forms)
    n_axes = len(shape) or 1
    is_matrix, is_seven = found.shape[n_axes:] == (4, 4), found.shape[n_axes:] == (_SEVEN,)
    if not (is_matrix or is_seven) or (shape and found.shape[:n_axes] != shape):
        raise Error(f"{name}: {_expected(*forms, list(found.shape))}")
    return len(found), _checked(name + "[{}]", found.reshape(-1, _MATRIX if is_matrix else _SEVEN))


def placed(pose: Any, position: ArrayLike | None) -> NDArray[np.float64]:
    """The row of a pose or of a position; without both, of the identity."""
    if pose is not None and position is not None:
        raise Error("expected a pose or a position, found both")
    if pose is not None:
        return one("pose", pose)
    matrix = np.eye(4)
    if position is not None:
        at = np.asarray(position, dtype=np.float64)
        if at.shape != (3,):
            raise Error(f"position: expected shape [3], found {list(at.shape)}")
        if not np.isfinite(at).all():
            raise Error(f"position: expected finite metres, found {at.tolist()}")
        matrix[:3, 3] = at
    return matrix.reshape(1, _MATRIX)


def matrix(name: str, pose: Any, most_off: float = 1e-6) -> NDArray[np.float64]:
    """The matrix of a pose, [4, 4]."""
    row: NDArray[np.float64] = one(name, pose, most_off)[0]
    if len(row) == _MATRIX:
        return row.reshape(4, 4)
    x, y, z, w = row[3:] / np.linalg.norm(row[3:])
    turned = np.eye(4)
    turned[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    turned[:3, 3] = row[:3]
    return turned


def _checked(name: str, rows: NDArray[np.float64], most_off: float = 1e-6) -> NDArray[np.float64]:
    """`rows`, if each is a rotation and a position; errors name the first that is none, or put its number
    into `name`."""

    def refuse(is_wrong: Any, cause: Callable[[int], str]) -> None:
        if is_wrong.any():
            i = int(np.argmax(is_wrong))
            raise Error(f"{name.format(i)}: {cause(i)}")

    at = rows[:, :3] if rows.shape[1] == _SEVEN else rows[:, 3:12:4]
    if rows.shape[1] == _SEVEN:
        length = np.linalg.norm(rows[:, 3:], axis=1)
        quaternion = "expected a quaternion of length 1, found {} (x, y, z, w) of length {:.4f}"
        refuse(~(np.abs(length**2 - 1) < 1e-3), lambda i: quaternion.format(rows[i, 3:].tolist(), length[i]))
    else:
        last = "expected a matrix whose last row is 0, 0, 0, 1, found {}"
        refuse((rows[:, 12:] != [0, 0, 0, 1]).any(axis=1), lambda i: last.format(rows[i, 12:].tolist()))
        turn = rows.reshape(-1, 4, 4)[:, :3, :3]
        off = np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
        size = np.linalg.det(turn) if len(turn) else np.zeros(0)
        rotation = (
            "expected a rotation in the first three rows and columns, found one that is off by {}, "
            "with determinant {:.4f}"
        )
        refuse(~((off <= most_off) & (size > 0)), lambda i: rotation.format(_short(off[i]), size[i]))
    place = "expected a position of finite metres, found {}"
    refuse(~np.isfinite(at).all(axis=1), lambda i: place.format(at[i].tolist()))
    return np.ascontiguousarray(rows)


def _short(value: float) -> str:
    """`value` with three digits, such as 2.01e-2."""
    digits, _, power = f"{value:.2e}".partition("e")
    return f"{digits}e{int(power)}" if power else digits


def _numbers(name: str, poses: Any, matrices: str, sevens: str) -> NDArray[np.float64]:
    try:
        return np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError):
        raise Error(f"{name}: {_expected(matrices, sevens, repr(poses)[:80])}") from None


def _expected(matrices: str, sevens: str, found: Any) -> str:
    return f"expected shape {matrices} or {sevens}, found {found}; seven are x, y, z and a quaternion x, y, z, w"
