"""A PointNet as an ONNX graph from `x` [1, 3, n], n dynamic, to `logp` [1, classes].

Two forms that compute the same, since engines differ in which they run fast:
`image`, points as the pixels of one row, convolved by 1x1, and `rows`, points
as the rows of matrices.
"""

import numpy
import onnx
from onnx import TensorProto, helper, numpy_helper
from pointnet import Folded

OPSET = 18
IR_VERSION = 9
FORMS = ("image", "rows")


class Graph:
    def __init__(self, layers):
        self.layers = layers
        self.nodes = []
        self.constants = {}

    def op(self, kind, inputs, output, **attributes):
        self.nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def constant(self, name, array):
        self.constants[name] = numpy_helper.from_array(numpy.ascontiguousarray(array), name)
        return name

    def shape(self, *sizes):
        name = "shape." + ".".join(map(str, sizes))
        return self.constant(name, numpy.array(sizes, numpy.int64))

    def model(self, name, inputs, outputs):
        """The model of all nodes so far; `inputs` and `outputs` are shapes, all f32, by names."""

        def infos(shapes):
            return [
                helper.make_tensor_value_info(key, TensorProto.FLOAT, shape)
                for key, shape in shapes.items()
            ]

        constants = list(self.constants.values())
        made = helper.make_graph(self.nodes, name, infos(inputs), infos(outputs), constants)
        opset = helper.make_opsetid("", OPSET)
        model = helper.make_model(made, opset_imports=[opset], ir_version=IR_VERSION)
        onnx.checker.check_model(model)
        return model

    def dense(self, key, x, relu=True):
        weights, bias = self.layers[key]
        inputs = [x, self.constant(f"{key}.w", weights), self.constant(f"{key}.b", bias)]
        return self.activated(key, relu, lambda out: self.op("Gemm", inputs, out, transB=1))

    def activated(self, key, relu, linear):
        if not relu:
            return linear(key)
        return self.op("Relu", [linear(f"{key}.linear")], key)


class Form(Graph, Folded):
    """A PointNet whose layers of points are a form's own."""

    def layer(self, name, x, relu=True):
        return (self.shared if "conv" in name else self.dense)(name, x, relu)

    def matrix(self, x, side, key):
        return self.op("Reshape", [x, self.shape(1, side, side)], f"{key}.matrix")


class Image(Form):
    """Points lie along the last axis of [1, channels, 1, n]."""

    def enter(self):
        return self.op("Unsqueeze", ["x", self.shape(2)], "points")

    def shared(self, key, x, relu):
        weights, bias = self.layers[key]
        kernel = self.constant(f"{key}.w", weights[:, :, None, None])
        inputs = [x, kernel, self.constant(f"{key}.b", bias)]
        # As exporters do; rten asks for it.
        explicit = {
            "kernel_shape": [1, 1],
            "strides": [1, 1],
            "pads": [0, 0, 0, 0],
            "dilations": [1, 1],
            "group": 1,
        }
        return self.activated(key, relu, lambda out: self.op("Conv", inputs, out, **explicit))

    def pooled(self, x, name):
        return self.op("Flatten", [self.op("GlobalMaxPool", [x], f"{name}.max")], name)

    def turned(self, x, matrix, side, name):
        transposed = self.op("Transpose", [matrix], f"{name}.matrix", perm=[0, 2, 1])
        flat = self.op("Squeeze", [x, self.shape(2)], f"{name}.flat")
        turned = self.op("MatMul", [transposed, flat], f"{name}.turned")
        return self.op("Unsqueeze", [turned, self.shape(2)], name)


class Rows(Form):
    """Points are the rows of [1, n, channels]."""

    def enter(self):
        return self.op("Transpose", ["x"], "points", perm=[0, 2, 1])

    def shared(self, key, x, relu):
        weights, bias = self.layers[key]
        product = self.op("MatMul", [x, self.constant(f"{key}.w", weights.T)], f"{key}.product")
        inputs = [product, self.constant(f"{key}.b", bias)]
        return self.activated(key, relu, lambda out: self.op("Add", inputs, out))

    def pooled(self, x, name):
        return self.op("ReduceMax", [x, self.shape(1)], name, keepdims=0)

    def turned(self, x, matrix, side, name):
        return self.op("MatMul", [x, matrix], name)


def pointnet(layers, form):
    """The model of `layers`, as `pointnet.layers` gives them, in `form`."""
    graph = {"image": Image, "rows": Rows}[form](layers)
    logits, _ = graph.logits(graph.enter())
    graph.op("LogSoftmax", [logits], "logp", axis=1)
    classes = len(layers["fc3"][1])
    return graph.model("pointnet", {"x": [1, 3, "n"]}, {"logp": [1, classes]})
