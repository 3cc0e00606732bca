"""Models as ONNX, for ONNX Runtime and other engines. Only this module imports the package `onnx`."""

from __future__ import annotations

import os
from importlib.metadata import version

import onnx
from onnx import helper

from . import _arguments, _edgepuck, _onnx_graph

# The operators are those of ONNX 1.13, the first version in which ReduceMax takes its axes as an input. ONNX Runtime 1.14
# and later run them. The version of the messages came with them.
_OPSET, _IR_VERSION = 18, 8
# The largest message of protobuf, in bytes.
_LARGEST = 2**31 - 1


def export(
    model: str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    critical_points: bool = False,
    points: int | None = None,
) -> None:
    """Write a model as ONNX: opset 18, IR version 8, f32. An existing file is replaced.

    The inputs, in f32, are normalised as the model's card says; `ep.Classifier` does this, the graph does not. For
    `unit-sphere`, subtract the mean, and divide by the largest radius.

    - `points` [batch, points, 3]: the points that the network sees, chosen by any sampler.
    - `cloud` [batch, all, 3]: all points, for networks with EdgeConv features.
    - `centres` [batch, centres, 3]: for networks of set abstractions, the farthest of `points` in their order, from the
      one farthest from the mean, as `infer-cpu sample --sampler fps` chooses them.

    With `critical_points`, `cloud` is the only input, and the graph selects the points. The outputs:

    - `logits` [batch, classes]: before the softmax, as `Prediction.logits`.
    - `kept` [batch, points], int64: with `critical_points`, the indices of the chosen points.

    Batch norms are folded into weights, which have the names of PyTorch's checkpoints (`feat.conv1.weight`). The
    `metadata_props` of the file have the model's card. EdgeConv needs memory for points x all x 64 channels x 4 bytes,
    16 MB for 64 of 1,024 points; set abstractions for centres x points x channels x 4 bytes, 64 MB for 256 centres,
    1,024 points and 64 channels.

    Args:
        model: A bundled model by its name, such as `edge-64`, or a model file.
        path: The file, `.onnx`.
        critical_points: Whether the graph has a Critical Points Layer, which `Classifier(sampler="cpl")` is.
        points: The number of points that this layer keeps. The default is that of the training.

    Raises:
        Error: The model cannot be read, or has no layers that a Critical Points Layer could pool; `points` is given
            without that layer, or neither the model nor the argument states the number; or the file cannot be written.
    """
    _arguments.check_extension(path, ".onnx")
    place = _arguments.place(model)
    card, network = _edgepuck.read_network(place)
    if points is not None:
        points = _arguments.whole("points", points, 1, 2**32 - 1)
        if not critical_points:
            raise _edgepuck.Error("points: expected critical_points=True, found a number of points without it")
    elif critical_points:
        points = int(card.get("points", 0))
        if points == 0:
            raise _edgepuck.Error(f"points: expected a number, since {place} states none")
    try:
        graph = _onnx_graph.graph(network, points)
    except _edgepuck.Error as error:
        raise _edgepuck.Error(f"{place} cannot be exported: {error}") from None
    made = helper.make_model(
        graph,
        producer_name="edgepuck",
        producer_version=version("edgepuck"),
        doc_string="PointNet: logits of clouds that are normalised as metadata `normalization` says",
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
    )
    helper.set_model_props(made, dict(sorted(card.items())))
    if made.ByteSize() > _LARGEST:
        raise _edgepuck.Error(f"{place} cannot be exported: expected at most 2 GiB, found {made.ByteSize()} bytes")
    _arguments.write(path, made.SerializeToString(deterministic=True))
