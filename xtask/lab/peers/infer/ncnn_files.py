"""A PointNet as ncnn's two files, written by hand: pnnx gives Convolution1D
layers, which ncnn runs at half the speed of Convolution.

The forms are those of `graph`: `image` takes the blob x [3, 1, n], `rows`
takes x [n, 3]. With `ranges`, as `pointnet.input_ranges` gives them, layers
compute in eight bits.
"""

import numpy

MAGIC = 7767517
# Before weights: plain f32.
RAW_F32 = numpy.uint32(0)
RELU = 1
# Scales of weights and of inputs follow the bias.
SCALED = 1
I8_LARGEST = 127


class Net:
    def __init__(self, layers, form, ranges=None):
        self.layers = layers
        self.form = form
        self.ranges = ranges
        self.lines = []
        self.weights = []

    def layer(self, kind, inputs, output, **parameters):
        numbered = {f"{key[1:]}": value for key, value in parameters.items()}
        self.lines.append((kind, inputs, output, numbered))
        return output

    def linear(self, kind, key, x, relu, **parameters):
        weights, bias = self.layers[key]
        self.weights += [RAW_F32, weights, bias]
        activation = RELU if relu else 0
        if self.ranges:
            largest = numpy.abs(weights).max(1)
            scales = I8_LARGEST / numpy.append(largest, self.ranges[key])
            self.weights.append(scales.astype(numpy.float32))
            parameters["_8"] = SCALED
        return self.layer(kind, [x], key, _0=len(bias), _9=activation, **parameters)

    def dense(self, key, x, relu=True):
        size = self.layers[key][0].size
        return self.linear("InnerProduct", key, x, relu, _1=1, _2=size)

    def shared(self, key, x, relu=True):
        if self.form == "rows":
            return self.dense(key, x, relu)
        size = self.layers[key][0].size
        return self.linear("Convolution", key, x, relu, _1=1, _5=1, _6=size)

    def pooled(self, x, name):
        if self.form == "rows":
            # The maximum over the outermost axis.
            return self.layer("Reduction", [x], name, _0=4, _1=0, **{"_-23303": "1,0"}, _5=1)
        return self.layer("Pooling", [x], name, _0=0, _4=1)

    def turned(self, x, matrix, channels, name):
        if self.form == "rows":
            return self.layer("Gemm", [x, matrix], name)
        flat = self.layer("Reshape", [x], f"{name}.flat", _0=-1, _1=channels)
        # The first factor transposed.
        turned = self.layer("Gemm", [matrix, flat], f"{name}.turned", _2=1)
        return self.layer("Reshape", [turned], name, _0=-1, _1=1, _2=channels)

    def t_net(self, key, x, side):
        for layer in ("conv1", "conv2", "conv3"):
            x = self.shared(f"{key}.{layer}", x)
        x = self.pooled(x, f"{key}.global")
        x = self.dense(f"{key}.fc2", self.dense(f"{key}.fc1", x))
        x = self.dense(f"{key}.fc3", x, relu=False)
        return self.layer("Reshape", [x], f"{key}.matrix", _0=side, _1=side)


def write(layers, form, stem, ranges=None):
    """Writes `stem`.param and `stem`.bin; blob `logp` is the answer."""
    net = Net(layers, form, ranges)
    x = net.layer("Input", [], "x")
    x = net.turned(x, net.t_net("feat.stn", x, 3), 3, "turned")
    x = net.shared("feat.conv1", x)
    x = net.turned(x, net.t_net("feat.fstn", x, 64), 64, "features")
    x = net.shared("feat.conv3", net.shared("feat.conv2", x), relu=False)
    x = net.dense("fc2", net.dense("fc1", net.pooled(x, "global")))
    x = net.layer("Softmax", [net.dense("fc3", x, relu=False)], "p", _0=0, _1=1)
    # The logarithm.
    net.layer("UnaryOp", [x], "logp", _0=8)
    lines = split(net.lines)
    blobs = sum(len(outputs) for _, _, outputs, _ in lines)
    with open(f"{stem}.param", "w") as file:
        print(MAGIC, f"{len(lines)} {blobs}", sep="\n", file=file)
        for kind, inputs, outputs, parameters in lines:
            counts = f"{len(inputs)} {len(outputs)}"
            settings = [f"{key}={value}" for key, value in parameters.items()]
            print(kind, outputs[0], counts, *inputs, *outputs, *settings, file=file)
    with open(f"{stem}.bin", "wb") as file:
        for array in net.weights:
            file.write(array.tobytes())


def split(lines):
    """The layers, with a Split where a blob is read more than once."""
    readers = {}
    for _, inputs, _, _ in lines:
        for blob in inputs:
            readers[blob] = readers.get(blob, 0) + 1
    copies = {blob: [f"{blob}.{i}" for i in range(n)] for blob, n in readers.items() if n > 1}
    unread = {blob: list(names) for blob, names in copies.items()}
    whole = []
    for kind, inputs, output, parameters in lines:
        inputs = [unread[blob].pop(0) if blob in unread else blob for blob in inputs]
        whole.append((kind, inputs, [output], parameters))
        if output in copies:
            whole.append(("Split", [output], copies[output], {}))
    return whole
