"""Checks of arguments, and objects that are pickled by their arguments."""

from __future__ import annotations

import functools
import operator
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import _edgepuck
from ._edgepuck import Error

if TYPE_CHECKING:
    from typing_extensions import Self


class Remade:
    """An object that is pickled by its arguments, and made again from them."""

    _made_of: tuple[tuple[Any, ...], dict[str, Any]]

    def __reduce__(self) -> tuple[Any, ...]:
        positional, named = self._made_of
        return functools.partial(type(self), *positional, **named), ()

    def __deepcopy__(self, _: dict[int, Any]) -> Self:
        # Nothing of it changes.
        return self


def whole(name: str, value: Any, least: int, most: int) -> int:
    """`value` as a whole number from `least` to `most`."""
    try:
        number = operator.index(value)
    except TypeError:
        raise Error(f"{name}: expected a whole number, found {value!r}") from None
    if not least <= number <= most:
        raise Error(f"{name}: expected a whole number from {least} to {most}, found {number}")
    return number


def real(name: str, value: Any) -> float:
    """`value` as a number."""
    try:
        if not isinstance(value, (str, bytes)):
            return float(value)
        raise TypeError
    except (TypeError, ValueError):
        raise Error(f"{name}: expected a number, found {value!r}") from None


def some_of(names: Sequence[str], most: int = 5) -> str:
    """The first of `names`, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def seed(value: Any) -> int:
    """`value` as a seed."""
    return whole("seed", value, 0, 2**64 - 1)


def place(name_or_path: str | os.PathLike[str]) -> str:
    """The absolute path of a file, which stays valid in another folder. Other names stay unchanged,
    even if a folder has that name."""
    text = os.fspath(name_or_path)
    return os.path.abspath(text) if os.path.isfile(text) else text


def number(name: str, index: Any, length: int) -> int:
    """The index of one of `length` items; a negative `index` counts from the end."""
    found = operator.index(index)
    if not -length <= found < length:
        raise IndexError(f"expected the number of one of {length} {name}, found {found}")
    return found % length


def check_extension(path: str | os.PathLike[str], extension: str) -> None:
    """Check that the name of the file to write has this extension."""
    if not os.fspath(path).lower().endswith(extension):
        raise Error(f"path: expected a name with {extension}, found {os.fspath(path)}")


def write(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file, which is complete or not there."""
    unfinished = f"{os.fspath(path)}.{os.getpid()}"
    try:
        with open(unfinished, "wb") as file:
            file.write(content)
        os.replace(unfinished, path)
    except OSError as error:
        if os.path.exists(unfinished):
            os.remove(unfinished)
        raise Error(f"{os.fspath(path)}: {error.strerror}") from None


def run(words: Sequence[str], folder: str) -> None:
    """Run a command of the program. Errors name the files in the temporary `folder` without it."""
    try:
        _edgepuck.run(["edgepuck", *words])
    except Error as error:
        raise Error(str(error).replace(os.path.join(folder, ""), "")) from None
