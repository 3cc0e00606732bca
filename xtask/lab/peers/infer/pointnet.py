"""A PointNet's layers, batch norms folded into them in f64, and a plain forward
pass, to calibrate them and to judge answers.

The keys are those of yanx27's `pointnet_cls`. The identity that a T-Net adds
to its answer is added to its last bias.
"""

import sys
from pathlib import Path

import numpy
from safetensors.numpy import load_file

# The layers that networks are trained with.
sys.path.append(str(Path(__file__).resolve().parents[4] / "python/training"))

from pointnet_cls import PointNet, norm_of, sizes

BN_EPSILON = 1e-5

def layers(model_file):
    """The weights [out, in] and biases [out] of each layer, f32, by its key."""
    tensors = load_file(model_file)
    n_classes = len(tensors["fc3.bias"])
    folded = {key: fold(tensors, key, norm_of(key)) for key in sizes(n_classes)}
    for key, side in (("feat.stn.fc3", 3), ("feat.fstn.fc3", 64)):
        weights, bias = folded[key]
        folded[key] = weights, bias + numpy.eye(side, dtype=numpy.float32).ravel()
    return folded


def fold(tensors, key, norm):
    bias = tensors[f"{key}.bias"].astype(numpy.float64)
    weights = tensors[f"{key}.weight"].astype(numpy.float64).reshape(len(bias), -1)
    if norm:
        part = {name: tensors[f"{norm}.{name}"].astype(numpy.float64) for name in
                ("weight", "bias", "running_mean", "running_var")}
        scale = part["weight"] / numpy.sqrt(part["running_var"] + BN_EPSILON)
        weights *= scale[:, None]
        bias = (bias - part["running_mean"]) * scale + part["bias"]
    return weights.astype(numpy.float32), bias.astype(numpy.float32)


class Folded(PointNet):
    """Layers with their norms folded into them."""

    def __init__(self, layers):
        self.layers = layers

    def norm(self, name, x):
        return x


class Ranges(Folded):
    """Clouds [n, 3], and the largest magnitude that reaches each layer."""

    def __init__(self, layers):
        super().__init__(layers)
        self.found = dict.fromkeys(layers, 0.0)

    def linear(self, layer, x):
        self.found[layer] = max(self.found[layer], float(numpy.abs(x).max()))
        weights, bias = self.layers[layer]
        return x @ weights.T + bias

    def relu(self, x):
        return numpy.maximum(x, 0)

    def pooled(self, x, name):
        return x.max(0)

    def matrix(self, x, side, key):
        return x.reshape(side, side)

    def turned(self, x, matrix, side, name):
        return x @ matrix


def input_ranges(layers, clouds):
    """The largest magnitude that reaches each layer over `clouds` [n, 3]."""
    ranges = Ranges(layers)
    for x in clouds:
        ranges.logits(x)
    return ranges.found


def log_probabilities(layers, cloud):
    """Those of all classes, in f64."""
    logits, _ = Ranges(layers).logits(cloud.astype(numpy.float64))
    return log_softmax(logits)


def log_softmax(logits):
    return logits - numpy.logaddexp.reduce(logits)
