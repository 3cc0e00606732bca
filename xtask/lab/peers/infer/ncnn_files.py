"""A PointNet as ncnn's two files, written by hand: pnnx gives Convolution1D
layers, which ncnn runs at half the speed of Convolution.

The forms are those of `graph`: `image` takes the blob x [3, 1, n], `rows`
takes x [n, 3]. With `ranges`, as `pointnet.input_ranges` gives them, layers
compute in eight bits.
"""

import numpy
from pointnet import Folded

MAGIC = 7767517
# Before weights: plain f32.
RAW_F32 = numpy.uint32(0)
RELU = 1
# Scales of weights and of inputs follow the bias.
SCALED = 1
I8_LARGEST = 127


class Net(Folded):
    def __init__(self, layers, form, ranges=None):
        super().__init__(layers)
        self.form = form
        self.ranges = ranges
        self.lines = []
        self.weights = []

    def add(self, kind, inputs, output, **parameters):
        numbered = {f"{key[1:]}": value for key, value in parameters.items()}
        self.lines.append((kind, inputs, output, numbered))
        return output

    def layer(self, name, x, relu=True):
        weights, bias = self.layers[name]
        self.weights += [RAW_F32, weights, bias]
        kind, parameters = "InnerProduct", {"_1": 1, "_2": weights.size}
        if self.form == "image" and "conv" in name:
            kind, parameters = "Convolution", {"_1": 1, "_5": 1, "_6": weights.size}
        if self.ranges:
            largest = numpy.abs(weights).max(1)
            scales = I8_LARGEST / numpy.append(largest, self.ranges[name])
            self.weights.append(scales.astype(numpy.float32))
            parameters["_8"] = SCALED
        return self.add(kind, [x], name, _0=len(bias), _9=RELU if relu else 0, **parameters)

    def pooled(self, x, name):
        if self.form == "rows":
            # The maximum over the outermost axis.
            return self.add("Reduction", [x], name, _0=4, _1=0, **{"_-23303": "1,0"}, _5=1)
        return self.add("Pooling", [x], name, _0=0, _4=1)

    def turned(self, x, matrix, side, name):
        if self.form == "rows":
            return self.add("Gemm", [x, matrix], name)
        flat = self.add("Reshape", [x], f"{name}.flat", _0=-1, _1=side)
        # The first factor transposed.
        turned = self.add("Gemm", [matrix, flat], f"{name}.turned", _2=1)
        return self.add("Reshape", [turned], name, _0=-1, _1=1, _2=side)

    def matrix(self, x, side, key):
        return self.add("Reshape", [x], f"{key}.matrix", _0=side, _1=side)


def write(layers, form, stem, ranges=None):
    """Writes `stem`.param and `stem`.bin; blob `logp` is the answer."""
    net = Net(layers, form, ranges)
    logits, _ = net.logits(net.add("Input", [], "x"))
    # The logarithm.
    net.add("UnaryOp", [net.add("Softmax", [logits], "p", _0=0, _1=1)], "logp", _0=8)
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
