"""A PointNet's layers, batch norms folded into them in f64, and a plain forward
pass to calibrate them.

The keys are those of yanx27's `pointnet_cls`. The identity that a T-Net adds
to its answer is added to its last bias.
"""

import numpy
from safetensors.numpy import load_file

BN_EPSILON = 1e-5

# Each layer with the batch norm behind it.
T_NET = [
    ("conv1", "bn1"),
    ("conv2", "bn2"),
    ("conv3", "bn3"),
    ("fc1", "bn4"),
    ("fc2", "bn5"),
    ("fc3", None),
]
TRUNK = [("feat.conv1", "feat.bn1"), ("feat.conv2", "feat.bn2"), ("feat.conv3", "feat.bn3")]
HEAD = [("fc1", "bn1"), ("fc2", "bn2"), ("fc3", None)]


def layers(model_file):
    """The weights [out, in] and biases [out] of each layer, f32, by its key."""
    tensors = load_file(model_file)
    t_nets = [(f"{t}.{a}", b and f"{t}.{b}") for t in ("feat.stn", "feat.fstn") for a, b in T_NET]
    folded = {key: fold(tensors, key, norm) for key, norm in t_nets + TRUNK + HEAD}
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


def input_ranges(layers, clouds):
    """The largest magnitude that reaches each layer over `clouds` [n, 3]."""
    ranges = dict.fromkeys(layers, 0.0)

    def through(key, x, relu=True):
        ranges[key] = max(ranges[key], float(numpy.abs(x).max()))
        weights, bias = layers[key]
        x = x @ weights.T + bias
        return numpy.maximum(x, 0) if relu else x

    def t_net(key, x):
        side = x.shape[1]
        for layer in ("conv1", "conv2", "conv3"):
            x = through(f"{key}.{layer}", x)
        x = through(f"{key}.fc2", through(f"{key}.fc1", x.max(0)))
        return through(f"{key}.fc3", x, relu=False).reshape(side, side)

    for x in clouds:
        x = x @ t_net("feat.stn", x)
        x = through("feat.conv1", x)
        x = x @ t_net("feat.fstn", x)
        x = through("feat.conv3", through("feat.conv2", x), relu=False)
        through("fc3", through("fc2", through("fc1", x.max(0))), relu=False)
    return ranges
