"""Model files: weights with the card of a network."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _edgepuck
from ._edgepuck import Error

Tensors = Mapping[str, NDArray[np.float32] | NDArray[np.float16]]


def write(
    path: str | os.PathLike[str],
    tensors: Tensors,
    card: Mapping[str, str],
    *,
    calibrate: str | os.PathLike[str] | None,
    source: str,
    their_names: Mapping[str, str] | None = None,
) -> None:
    """Write a model file, once a classifier loads it. Its tensors are of one type, f32 or f16.

    Args:
        path: The file.
        tensors: The tensors by their names.
        card: The metadata, of which the keys are those of formats/src/model_card.rs.
        calibrate: A packed NPZ file of clouds, to measure the ranges that int8 needs.
        source: The name of the weights in errors.
        their_names: The names of the tensors there.
    """
    is_half = all(tensor.dtype == np.float16 for tensor in tensors.values())
    values = {name: np.ascontiguousarray(tensor, np.float32) for name, tensor in tensors.items()}
    with tempfile.TemporaryDirectory() as folder:
        trial = os.path.join(folder, "model.safetensors")
        _edgepuck.write_weights(trial, values, card, False)
        try:
            read, _ = _edgepuck.read_network(trial)
            unknown = [key for key in card if key not in read]
            if unknown:
                raise Error(f"{trial}: card: expected keys of a model's card, found `{unknown[0]}`")
            _edgepuck.Classifier(trial, "f32", None, None)
        except Error as error:
            raise Error(_in_source(str(error), trial, source, their_names or {})) from None
        if calibrate is not None:
            read["activation_ranges"] = _edgepuck.activation_ranges(trial, os.fspath(calibrate))
    read["widths"] = widths(tensors)
    _edgepuck.write_weights(os.fspath(path), values, read, is_half)


def _in_source(message: str, trial: str, source: str, their_names: Mapping[str, str]) -> str:
    """An error of the `trial` as one of the `source`, where a tensor may have another name."""
    message = message.replace(trial, source)
    name = re.search("tensor `([^`]+)`", message)
    theirs = their_names.get(name[1]) if name else None
    if name is None or theirs in (None, name[1]):
        return message
    return message.replace(name[0], f"{name[0]} (there `{theirs}`)", 1)


def widths(tensors: Tensors) -> str:
    """The widths of the trunk and the head, such as `3-64-128-1024 | 1024-512-256-40`."""
    return " | ".join("-".join(map(str, _widths(tensors, stem))) for stem in ("feat.conv", "fc"))


def n_logits(tensors: Tensors) -> int:
    """The number of classes that the last layer tells apart."""
    return (_widths(tensors, "fc") or [0])[-1]


def _widths(tensors: Tensors, stem: str) -> list[int]:
    """The inputs of layer `stem`1, and the outputs of `stem`1, `stem`2, ...."""
    shapes: list[tuple[int, ...]] = []
    while (weight := tensors.get(f"{stem}{len(shapes) + 1}.weight")) is not None:
        shapes.append(weight.shape)
    return [*shapes[0][1:2], *(shape[0] for shape in shapes if shape)] if shapes else []


def check_classes(classes: Sequence[str], tensors: Tensors) -> None:
    """Check that each logit has a name of its own."""
    if isinstance(classes, str) or not all(isinstance(name, str) for name in classes):
        raise Error(f"classes: expected a list of names, found {classes!r}")
    if len(classes) != n_logits(tensors):
        raise Error(f"classes: expected {n_logits(tensors)} names, one for each logit, found {len(classes)}")
    for i, name in enumerate(classes):
        if name in classes[:i]:
            raise Error(f"classes: expected a name for each class, found two classes `{name}`")
