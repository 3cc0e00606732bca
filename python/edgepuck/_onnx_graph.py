"""The graph of a network in ONNX. A node has the name of its first output.

Weights have PyTorch's names and shapes: a layer that all points share is a convolution [outputs, inputs, 1], and a layer
after a pooling is a `Gemm` [outputs, inputs].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import GraphProto, NodeProto, TensorProto, ValueInfoProto, helper

from ._edgepuck import Error

# A layer: its name, its weights [outputs, inputs] and biases [outputs], and whether a ReLU follows.
Layer = tuple[str, NDArray[np.float32], NDArray[np.float32], bool]
# The output with the indices of the points that a Critical Points Layer selects.
KEPT = "kept"


@dataclass
class Inputs:
    """The inputs of a network, as values of the graph."""

    points: str
    """The points, [batch, points, 3]."""
    cloud: str | None = None
    """All points of the cloud, [batch, all, 3], for networks with EdgeConv layers."""
    centres: str | None = None
    """The centres of set abstractions, [batch, centres, 3], for networks with any."""
    pooled_stn: str | None = None
    """The pooled vector of the input T-Net, [batch, features], if it is in the graph already."""


def graph(network: dict[str, Any], n_points: int | None) -> GraphProto:
    """The graph of a `network` of `_edgepuck.read_network`, behind a Critical Points Layer of `n_points` if given."""
    made = Graph()
    if n_points is not None:
        inputs = critical_points(made, network, made.input("cloud", "all"), n_points)
    else:
        inputs = Inputs(made.input("points", "points"))
        inputs.cloud = made.input("cloud", "all") if network["edges"] else None
        inputs.centres = made.input("centres", "centres") if network["abstractions"] else None
    logits(made, network, inputs)
    n_classes = len(network["head"][-1][2])
    outputs = [helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["batch", n_classes])]
    if n_points is not None:
        outputs.append(helper.make_tensor_value_info(KEPT, TensorProto.INT64, ["batch", "kept"]))
    constants = [made.constants[name] for name in sorted(made.constants)]
    return helper.make_graph(made.nodes, "pointnet", made.inputs, outputs, constants)


class Graph:
    """A graph under construction: nodes in the order in which they can run, and constants by name."""

    def __init__(self) -> None:
        self.nodes: list[NodeProto] = []
        self.constants: dict[str, TensorProto] = {}
        self.inputs: list[ValueInfoProto] = []

    def input(self, name: str, n: str) -> str:
        """An input of points, [batch, n, 3]."""
        self.inputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", n, 3]))
        return name

    def add(self, operator: str, name: str, *inputs: str, **attributes: Any) -> str:
        """Adds a node with one output, `name`."""
        return self.add_of_many(operator, [name], *inputs, **attributes)[0]

    def add_of_many(self, operator: str, outputs: list[str], *inputs: str, **attributes: Any) -> list[str]:
        self.nodes.append(helper.make_node(operator, inputs, outputs, name=outputs[0], **attributes))
        return outputs

    def reals(self, name: str, values: Any) -> str:
        """A constant of f32."""
        array = np.ascontiguousarray(values, np.float32)
        self.constants[name] = helper.make_tensor(name, TensorProto.FLOAT, array.shape, array.tobytes(), raw=True)
        return name

    def whole(self, *values: int) -> str:
        """A constant of whole numbers. Equal lists are one constant."""
        name = f"int64.{'.'.join(map(str, values))}"
        raw = np.array(values, "<i8").tobytes()
        self.constants[name] = helper.make_tensor(name, TensorProto.INT64, [len(values)], raw, raw=True)
        return name

    def convolutions(self, layers: Sequence[Layer], x: str, prefix: str) -> str:
        """Layers that all points share. If they run twice, before and after a Critical Points Layer, both runs share the
        weights, and differ in `prefix`."""
        for layer in layers:
            name, weight, bias, _ = layer
            kernel = self.reals(f"{name}.weight", weight[:, :, None])
            # Converters of other engines require the attributes that have defaults in ONNX.
            explicit = {"kernel_shape": [1], "strides": [1], "pads": [0, 0], "dilations": [1], "group": 1}
            output = f"{prefix}.{name.rpartition('.')[2]}"
            y = self.add("Conv", output, x, kernel, self.reals(f"{name}.bias", bias), **explicit)
            x = self.relu(layer, y)
        return x

    def gemm(self, layer: Layer, x: str, output: str) -> str:
        """A layer after a pooling, without its ReLU."""
        name, weight, bias, _ = layer
        constants = self.reals(f"{name}.weight", weight), self.reals(f"{name}.bias", bias)
        return self.add("Gemm", output, x, *constants, transB=1)

    def relu(self, layer: Layer, y: str) -> str:
        return self.add("Relu", f"{y}.relu", y) if layer[3] else y

    def pool(self, name: str, x: str, axis: int = 2) -> str:
        """The maximum along an axis, which goes."""
        return self.add("ReduceMax", name, x, self.whole(axis), keepdims=0)

    def transposed(self, name: str, x: str) -> str:
        """The last two axes exchanged."""
        return self.add("Transpose", name, x, perm=[0, 2, 1])


def logits(graph: Graph, network: dict[str, Any], inputs: Inputs) -> None:
    """Adds the network. The logits are value `logits`."""
    features = trunk(graph, network, inputs, "feat")
    if inputs.centres is None:
        x = graph.pool("feat.pool", features)
    else:
        x = set_abstractions(graph, network["abstractions"], inputs.centres, inputs.points, features)
    *hidden, last = network["head"]
    for layer in hidden:
        x = graph.relu(layer, graph.gemm(layer, x, layer[0]))
    graph.gemm(last, x, "logits")


def trunk(graph: Graph, network: dict[str, Any], inputs: Inputs, prefix: str) -> str:
    """The features of each point after the trunk, [batch, features, points]."""
    points = inputs.points
    if network["stn"]:
        x = graph.transposed("feat.stn.points", points)
        matrix = t_net(graph, network["stn"], "feat.stn", x, inputs.pooled_stn)
        points = graph.add("MatMul", "feat.stn.turned", points, matrix)
    if network["edges"] and inputs.cloud is not None:
        around = edges(graph, network["edges"], inputs.points, inputs.cloud, f"{prefix}.edge")
        points = graph.add("Concat", f"{prefix}.edged", points, *around, axis=2)
    x = graph.transposed(f"{prefix}.entry", points)
    before = network["transform_after"] if network["fstn"] else 0
    x = graph.convolutions(network["trunk"][:before], x, prefix)
    if network["fstn"]:
        matrix = t_net(graph, network["fstn"], "feat.fstn", x, None)
        rows = graph.transposed("feat.fstn.rows", x)
        x = graph.transposed("feat.fstn.features", graph.add("MatMul", "feat.fstn.turned", rows, matrix))
    return graph.convolutions(network["trunk"][before:], x, prefix)


def t_net(graph: Graph, net: tuple[int, list[Layer], list[Layer]], name: str, x: str, pooled: str | None) -> str:
    """The matrix that a T-Net predicts from `x`, [batch, channels, points]. Its last biases hold the identity."""
    size, convolutions, dense = net
    x = pooled or graph.pool(f"{name}.pool", graph.convolutions(convolutions, x, name))
    for layer in dense:
        x = graph.relu(layer, graph.gemm(layer, x, layer[0]))
    # In a reshape, 0 keeps the size of the batch.
    return graph.add("Reshape", f"{name}.matrix", x, graph.whole(0, size, size))


def edges(graph: Graph, layers: list[tuple[float, Layer]], points: str, cloud: str, prefix: str) -> list[str]:
    """EdgeConv features, [batch, points, channels] of each layer, as infer-cpu/src/edge_conv.rs defines them.

    That is for each radius and channel the maximum of relu(w (q - p) / r + b) over the points q of `cloud` within the
    radius r of the point p. The graph rounds as that code does. A point that is not a neighbor contributes an offset of 0,
    as p itself does.
    """
    offset = offsets(graph, points, cloud, prefix)
    squared = squared_lengths(graph, offset, prefix)
    found = []
    for radius, (layer, weight, bias, _) in layers:
        name = f"{prefix}.{layer.rpartition('.')[2]}"
        limit = graph.reals(f"{layer}.squared_radius", [np.float32(radius) ** 2])
        zero = graph.reals("edge.zero", [0.0])
        per_radius = graph.reals(f"{layer}.weight_over_radius", weight.T / np.float32(radius))
        is_near = graph.add("LessOrEqual", f"{name}.is_near", squared, limit)
        near = graph.add("Where", f"{name}.near", is_near, offset, zero)
        product = graph.add("MatMul", f"{name}.product", near, per_radius)
        # Bias and ReLU are monotonic, so that they can follow the maximum.
        largest = graph.pool(f"{name}.largest", product)
        biased = graph.add("Add", name, largest, graph.reals(f"{layer}.bias", bias))
        found.append(graph.add("Relu", f"{name}.relu", biased))
    return found


def offsets(graph: Graph, points: str, cloud: str, prefix: str) -> str:
    """q - p, [batch, points, all, 3], for all p of `points` and q of `cloud`."""
    every = graph.add("Unsqueeze", f"{prefix}.neighbours", cloud, graph.whole(1))
    each = graph.add("Unsqueeze", f"{prefix}.centres", points, graph.whole(2))
    return graph.add("Sub", f"{prefix}.offset", every, each)


def squared_lengths(graph: Graph, offset: str, prefix: str) -> str:
    """x x + y y + z z in this order, [batch, points, all, 1]."""
    axes = [f"{prefix}.{axis}" for axis in "xyz"]
    graph.add_of_many("Split", axes, offset, graph.whole(1, 1, 1), axis=3)
    x, y, z = (graph.add("Mul", f"{axis}.squared", axis, axis) for axis in axes)
    return graph.add("Add", f"{prefix}.squared", graph.add("Add", f"{prefix}.xy.squared", x, y), z)


def set_abstractions(
    graph: Graph,
    levels: list[tuple[int, float, Layer, list[Layer]]],
    centres: str,
    points: str,
    features: str,
) -> str:
    """The maxima and then the means of the last level's features, [batch, 2 * channels].

    infer-cpu/src/set_abstraction.rs defines them: for a centre p and channel c, the maximum of
    relu(a u + v (q - p) / r + b) over the points q within the radius r of p, where u is the feature of q. The graph sums
    in the order of that code: the maximum of a u + v q / r, then - v p / r + b.
    """
    for number, (n_centres, radius, pooling, convolutions) in enumerate(levels, 1):
        prefix = f"sa{number}"
        span = graph.whole(0), graph.whole(n_centres), graph.whole(1)
        first = graph.add("Slice", f"{prefix}.first_centres", centres, *span)
        layer, weight, bias, _ = pooling
        own = graph.reals(f"{layer}.weight_of_feature", weight[:, 0])
        axes = graph.reals(f"{layer}.weight_over_radius", weight[:, 1:].T / np.float32(radius))
        rows = graph.transposed(f"{prefix}.rows", features)
        of_features = graph.add("Mul", f"{prefix}.own", rows, own)
        along = graph.add("MatMul", f"{prefix}.along", points, axes)
        product = graph.add("Add", f"{prefix}.product", of_features, along)
        largest = largest_near(graph, radius, first, points, product, prefix)
        along_centre = graph.add("MatMul", f"{prefix}.along_centre", first, axes)
        moved = graph.add("Sub", f"{prefix}.moved", largest, along_centre)
        biased = graph.add("Add", f"{prefix}.conv1", moved, graph.reals(f"{layer}.bias", bias))
        pooled = graph.add("Relu", f"{prefix}.conv1.relu", biased)
        features = graph.convolutions(convolutions, graph.transposed(f"{prefix}.entry", pooled), prefix)
        points = first
    largest = graph.pool("feat.pool", features)
    mean = graph.add("ReduceMean", "feat.mean", features, graph.whole(2), keepdims=0)
    return graph.add("Concat", "feat.pooled", largest, mean, axis=1)


def largest_near(graph: Graph, radius: float, centres: str, points: str, product: str, prefix: str) -> str:
    """The maximum of `product`, [batch, points, channels], over the points near each centre, [batch, centres, channels]."""
    squared = squared_lengths(graph, offsets(graph, centres, points, prefix), prefix)
    limit = graph.reals(f"{prefix}.squared_radius", [np.float32(radius) ** 2])
    is_near = graph.add("LessOrEqual", f"{prefix}.is_near", squared, limit)
    products = graph.add("Unsqueeze", f"{prefix}.products", product, graph.whole(1))
    least = graph.reals("sa.least", [-np.inf])
    near = graph.add("Where", f"{prefix}.near", is_near, products, least)
    return graph.pool(f"{prefix}.largest", near)


def critical_points(graph: Graph, network: dict[str, Any], cloud: str, n_points: int) -> Inputs:
    """Selects the `n_points` points of `cloud` with the largest scores in a max-pooling, and returns the network's inputs.

    Scores are summed in f32, and in f64 in infer-cpu. Ties are broken by the index of a point, and by geometry in
    infer-cpu. For clouds of distinct points that are sorted by x, y, z, both break ties the same way.
    """
    if network["abstractions"]:
        raise Error("expected no set abstractions before a Critical Points Layer, found some")
    is_stn = network["front"] is None and network["stn"] is not None
    features = front(graph, network, cloud)
    pooled = graph.pool("cpl.pool", features)
    kept = best(graph, cloud, scores(graph, cloud, features, pooled), n_points)
    column = graph.add("Unsqueeze", "cpl.kept_column", kept, graph.whole(2))
    index = graph.add("Expand", "cpl.kept_index", column, graph.whole(1, 1, 3))
    points = graph.add("GatherElements", "points", cloud, index, axis=1)
    # If the input T-Net is the front end, it pools all points.
    return Inputs(points, cloud, pooled_stn=pooled if is_stn else None)


def front(graph: Graph, network: dict[str, Any], cloud: str) -> str:
    """The features to pool, [batch, features, all], by infer-cpu's choice of a front end."""
    if network["front"] is not None:
        return graph.convolutions(network["front"], graph.transposed("cpl.entry", cloud), "cpl")
    if network["stn"] is not None:
        return graph.convolutions(network["stn"][1], graph.transposed("cpl.entry", cloud), "feat.stn")
    if network["fstn"] is not None:
        raise Error("expected a front end of its own or a T-Net of coordinates, found a T-Net of features alone")
    return trunk(graph, network, Inputs(cloud, cloud), "cpl")


def scores(graph: Graph, cloud: str, features: str, pooled: str) -> str:
    """The score of each point, [batch, all]: the sum of the maxima above 0 that it wins."""
    winners = graph.add("ArgMax", "cpl.winners", features, axis=2, keepdims=0)
    worth = graph.add("Relu", "cpl.worth", pooled)
    shape = graph.add("Shape", "cpl.batch_and_all", cloud, start=0, end=2)
    none = graph.add("ConstantOfShape", "cpl.no_score", shape)
    return graph.add("ScatterElements", "cpl.score", none, winners, worth, axis=1, reduction="add")


def best(graph: Graph, cloud: str, score: str, n_points: int) -> str:
    """The indices of the `n_points` best points, [batch, M]. If fewer points have a score, copies of the best point fill
    the rest, which changes no maximum."""
    every = graph.add("Shape", "cpl.all", cloud, start=1, end=2)
    k = graph.add("Min", "cpl.k", graph.whole(n_points), every)
    values, indices = graph.add_of_many(
        "TopK", ["cpl.best_score", "cpl.best"], score, k, axis=1, largest=1, sorted=1
    )
    is_critical = graph.add("Greater", "cpl.is_critical", values, graph.reals("cpl.zero", [0.0]))
    span = graph.whole(0), graph.whole(1), graph.whole(1)
    first = graph.add("Slice", "cpl.first", indices, *span)
    return graph.add("Where", KEPT, is_critical, indices, first)
