"""PointNet++ and DGCNN for clouds [1024, 3] and the 40 classes of ModelNet40: as ONNX graphs, and
as plain forward passes in f64, by which the graphs are checked.

The layers are those of models/pointnet2_cls_ssg.py in github.com/yanx27/Pointnet_Pointnet2_pytorch,
without normals, and of pytorch/model.py in github.com/WangYueFt/dgcnn, with the defaults of its
main.py: 20 neighbours and 1,024 channels. Weights are random, and include the batch norms.

PointNet++ takes `centres`, 512 points in the order in which farthest point sampling chooses them.
The 128 of its second level are the first of these: sampling them again would choose the same.
"""

import graph
import numpy

N_POINTS = 1024

# Layers by their stems: on how many rows they work, and their channels.
POINTNET2 = {
    "sa1": (512 * 32, [3, 64, 64, 128]),
    "sa2": (128 * 64, [3 + 128, 128, 128, 256]),
    "sa3": (128, [3 + 256, 256, 512, 1024]),
    "fc": (1, [1024, 512, 256, 40]),
}
# Centres, the radius, and how many points within it are grouped.
LEVELS = {"sa1": (512, 0.2, 32), "sa2": (128, 0.4, 64)}

NEIGHBOURS = 20
EDGES = {"edge1": [3, 64], "edge2": [64, 64], "edge3": [64, 128], "edge4": [128, 256]}
DGCNN = {
    **{stem: (N_POINTS * NEIGHBOURS, [2 * n_in, n_out]) for stem, (n_in, n_out) in EDGES.items()},
    "conv5": (N_POINTS, [64 + 64 + 128 + 256, 1024]),
    "fc": (1, [2 * 1024, 512, 256, 40]),
}
# With `edge_of_points`.
DGCNN_OF_POINTS = DGCNN | {stem: (N_POINTS, DGCNN[stem][1]) for stem in EDGES}
SLOPE = 0.2


def layers(network):
    """Weights [out, in] and biases [out] that keep the size of activations (He et al. 2015)."""
    random = numpy.random.default_rng(0)
    made = {}
    for stem, (_, channels) in network.items():
        for i, (n_in, n_out) in enumerate(zip(channels, channels[1:]), 1):
            weights = random.normal(0, (2 / n_in) ** 0.5, (n_out, n_in))
            bias = random.normal(0, 0.1, n_out)
            made[f"{stem}.{i}"] = weights.astype(numpy.float32), bias.astype(numpy.float32)
    return made


def size(network):
    """The numbers of weights and biases, and of the multiplications in layers."""
    pairs = [(n, *io) for n, channels in network.values() for io in zip(channels, channels[1:])]
    return sum((i + 1) * o for _, i, o in pairs), sum(n * i * o for n, i, o in pairs)


class Sets(graph.Graph):
    """Points and features are the rows of matrices."""

    def new(self, kind, *inputs, **attributes):
        return self.op(kind, list(inputs), f"{kind}.{len(self.nodes)}", **attributes)

    def mlp(self, stem, x):
        for key in self.layers:
            if key.startswith(f"{stem}."):
                x = self.dense(key, x, relu=key != "fc.3")
        return x

    def squared_distances(self, a, b):
        """[rows of a, rows of b], as |a|^2 + |b|^2 - 2 a b, which both originals compute."""
        row = self.new("Transpose", self.new("ReduceSumSquare", b, self.shape(1)))
        sums = self.new("Add", self.new("ReduceSumSquare", a, self.shape(1)), row)
        twice = self.new("Mul", b, self.constant("two", numpy.float32(2)))
        return self.new("Sub", sums, self.new("MatMul", a, self.new("Transpose", twice)))

    def smallest(self, x, k):
        """The smallest `k` values of each row, in any order, and their columns."""
        name = f"TopK.{len(self.nodes)}"
        outputs = [f"{name}.values", f"{name}.columns"]
        top = graph.helper.make_node("TopK", [x, self.shape(k)], outputs, largest=0, sorted=0)
        self.nodes.append(top)
        return outputs

    def pooled(self, stem, groups, k):
        """The largest outputs of the layers over groups [n, k, channels]."""
        weights = [weights for key, (weights, _) in self.layers.items() if key.startswith(stem)]
        rows = self.new("Reshape", groups, self.shape(-1, weights[0].shape[1]))
        found = self.mlp(stem, rows)
        grouped = self.new("Reshape", found, self.shape(-1, k, weights[-1].shape[0]))
        return self.new("ReduceMax", grouped, self.shape(1), keepdims=0)


class Leaky(Sets):
    """With leaky ReLUs."""

    def activated(self, key, relu, linear):
        if not relu:
            return linear(key)
        return self.op("LeakyRelu", [linear(f"{key}.linear")], key, alpha=SLOPE)


def pointnet2_graph(layers):
    net = Sets(layers)
    points, n_points, features = "points", N_POINTS, []
    for stem, (n, radius, k) in LEVELS.items():
        centres = net.new("Slice", "centres", net.shape(0), net.shape(n))
        near = ball(net, net.squared_distances(centres, points), n_points, radius, k)
        origins = net.new("Unsqueeze", centres, net.shape(1))
        groups = net.new("Sub", net.new("Gather", points, near), origins)
        if features:
            groups = net.new("Concat", groups, net.new("Gather", *features, near), axis=2)
        points, n_points, features = centres, n, [net.pooled(stem, groups, k)]
    x = net.mlp("sa3", net.new("Concat", points, *features, axis=1))
    net.mlp("fc", net.new("ReduceMax", x, net.shape(0)))
    inputs = {"points": [N_POINTS, 3], "centres": [512, 3]}
    return net.model("pointnet2", inputs, {"fc.3": [1, 40]})


def ball(net, squared, n_points, radius, k):
    """As in the original: the first `k` by index within the radius; the first of all fills gaps."""
    none = net.constant(f"none.{n_points}", numpy.int32(n_points))
    indices = net.constant(f"indices.{n_points}", numpy.arange(n_points, dtype=numpy.int32))
    limit = net.constant(f"limit.{n_points}", numpy.float32(radius**2))
    within = net.new("Where", net.new("Greater", squared, limit), none, indices)
    found, _ = net.smallest(within, k)
    first = net.new("ReduceMin", found, net.shape(1))
    return net.new("Where", net.new("Equal", found, none), first, found)


def dgcnn_graph(layers, edge):
    """`edge` is a form of the convolutions of edges: `edge_of_pairs` or `edge_of_points`."""
    net = Leaky(layers)
    x, found = "points", []
    for stem in EDGES:
        _, near = net.smallest(net.squared_distances(x, x), NEIGHBOURS)
        x = edge(net, stem, x, near)
        found.append(x)
    x = net.mlp("conv5", net.new("Concat", *found, axis=1))
    pools = [net.new(kind, x, net.shape(0)) for kind in ("ReduceMax", "ReduceMean")]
    net.mlp("fc", net.new("Concat", *pools, axis=1))
    return net.model("dgcnn", {"points": [N_POINTS, 3]}, {"fc.3": [1, 40]})


def edge_of_pairs(net, stem, x, near):
    """As in the original: the maximum of a layer of [x_j - x_i, x_i] over the neighbours j of i."""
    own = net.new("Unsqueeze", x, net.shape(1))
    relative = net.new("Sub", net.new("Gather", x, near), own)
    repeated = net.new("Expand", own, net.shape(1, NEIGHBOURS, 1))
    return net.pooled(stem, net.new("Concat", relative, repeated, axis=2), NEIGHBOURS)


def edge_of_points(net, stem, x, near):
    """The same: A (x_j - x_i) + B x_i = A x_j + (B - A) x_i, and a leaky ReLU keeps the order."""
    weights, bias = net.layers[f"{stem}.1"]
    a, b = numpy.split(weights, 2, axis=1)
    net.layers = net.layers | {f"a.{stem}": (a, 0 * bias), f"b.{stem}": (b - a, bias)}
    theirs, own = (net.dense(f"{part}.{stem}", x, relu=False) for part in "ab")
    largest = net.new("ReduceMax", net.new("Gather", theirs, near), net.shape(1), keepdims=0)
    return net.activated(stem, True, lambda out: net.op("Add", [largest, own], out))


def mlp(layers, stem, x, slope=0.0):
    for key, (weights, bias) in layers.items():
        if key.startswith(f"{stem}."):
            x = x @ weights.T.astype(numpy.float64) + bias
            x = x if key == "fc.3" else numpy.where(x > 0, x, slope * x)
    return x


def pointnet2(layers, points, centres):
    """The logits of one cloud. Gaps need no filling: repeated points change no maximum."""
    points, centres = points.astype(numpy.float64), centres.astype(numpy.float64)
    features = numpy.empty((len(points), 0))
    for stem, (n, radius, k) in LEVELS.items():
        pooled = []
        for centre in centres[:n]:
            offsets = points - centre
            near = numpy.flatnonzero((offsets**2).sum(1) <= radius**2)[:k]
            group = numpy.hstack([offsets[near], features[near]])
            pooled.append(mlp(layers, stem, group).max(0))
        points, features = centres[:n], numpy.array(pooled)
    return mlp(layers, "fc", mlp(layers, "sa3", numpy.hstack([points, features])).max(0))


def dgcnn(layers, points):
    x, found = points.astype(numpy.float64), []
    for stem in EDGES:
        pooled = []
        for own in x:
            offsets = x - own
            near = numpy.argsort((offsets**2).sum(1))[:NEIGHBOURS]
            pairs = numpy.hstack([offsets[near], numpy.tile(own, (NEIGHBOURS, 1))])
            pooled.append(mlp(layers, stem, pairs, SLOPE).max(0))
        x = numpy.array(pooled)
        found.append(x)
    x = mlp(layers, "conv5", numpy.hstack(found), SLOPE)
    return mlp(layers, "fc", numpy.hstack([x.max(0), x.mean(0)]), SLOPE)
