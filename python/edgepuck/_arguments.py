"""Checks of what callers give, and what keeps it."""

from __future__ import annotations

import functools
import operator
import os
from typing import Any

from ._edgepuck import Error


class Remade:
    """Something that is pickled by what it was made of, and made again from that."""

    _made_of: tuple[tuple[Any, ...], dict[str, Any]]

    def __reduce__(self) -> tuple[Any, ...]:
        positional, named = self._made_of
        return functools.partial(type(self), *positional, **named), ()


def whole(name: str, value: Any, least: int, most: int) -> int:
    """`value` as a whole number within these bounds."""
    try:
        number = operator.index(value)
    except TypeError:
        raise Error(f"{name}: expected a whole number, found {value!r}") from None
    if not least <= number <= most:
        raise Error(f"{name}: expected a whole number from {least} to {most}, found {number}")
    return number


def seed(value: Any) -> int:
    """`value` as a seed."""
    return whole("seed", value, 0, 2**64 - 1)


def place(name_or_path: str | os.PathLike[str]) -> str:
    """A name as it is, though a folder may be called so; a file's path so that it stays right in
    another folder."""
    text = os.fspath(name_or_path)
    return os.path.abspath(text) if os.path.isfile(text) else text


def number(name: str, index: Any, length: int) -> int:
    """The number of one of `length` items, counted from the end if it is below 0."""
    found = operator.index(index)
    if not -length <= found < length:
        raise IndexError(f"expected the number of one of {length} {name}, found {found}")
    return found % length
