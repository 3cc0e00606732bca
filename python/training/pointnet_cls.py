"""The layers of yanx27's `pointnet_cls`, whatever computes them. Nothing is imported."""


def norm_of(layer):
    """The batch norm behind a layer, or None: a T-Net numbers those of its dense layers after the shared ones'."""
    prefix, dot, name = layer.rpartition(".")
    kind, number = name[:-1], int(name[-1])
    if (kind, number) == ("fc", 3):
        return None
    return f"{prefix}{dot}bn{number + 3 if kind == 'fc' and prefix else number}"


def sizes(n_classes):
    """The inputs and outputs of each layer by its name."""
    layers = {}
    for prefix, side in (("feat.stn", 3), ("feat.fstn", 64)):
        widths = (side, 64, 128, 1024)
        layers |= {f"{prefix}.conv{i}": (widths[i - 1], widths[i]) for i in (1, 2, 3)}
        layers |= {f"{prefix}.fc1": (1024, 512), f"{prefix}.fc2": (512, 256), f"{prefix}.fc3": (256, side * side)}
    layers |= {f"feat.conv{i}": pair for i, pair in enumerate(((3, 64), (64, 128), (128, 1024)), 1)}
    return layers | {"fc1": (1024, 512), "fc2": (512, 256), "fc3": (256, n_classes)}


class PointNet:
    """The forward pass. A class that inherits it states what is computed, on arrays of any form:

    linear(layer, x)             a linear layer, of points (`conv`) or clouds (`fc`)
    norm(name, x)                a batch norm
    relu(x)
    pooled(x, name)              the maximum over points
    matrix(x, side, key)         a T-Net's answer as a matrix, the identity added to it
    turned(x, matrix, side, name) points times a matrix

    `name` is that of the result.
    """

    def layer(self, name, x, relu=True):
        x = self.linear(name, x)
        norm = norm_of(name)
        x = x if norm is None else self.norm(norm, x)
        return self.relu(x) if relu else x

    def t_net(self, key, x, side):
        for i in (1, 2, 3):
            x = self.layer(f"{key}.conv{i}", x)
        x = self.pooled(x, f"{key}.global")
        for i in (1, 2):
            x = self.layer(f"{key}.fc{i}", x)
        return self.matrix(self.layer(f"{key}.fc3", x, relu=False), side, key)

    def logits(self, x):
        """The logits, and the matrix of the features."""
        x = self.turned(x, self.t_net("feat.stn", x, 3), 3, "turned")
        x = self.layer("feat.conv1", x)
        matrix = self.t_net("feat.fstn", x, 64)
        x = self.layer("feat.conv2", self.turned(x, matrix, 64, "features"))
        x = self.pooled(self.layer("feat.conv3", x, relu=False), "global")
        x = self.layer("fc2", self.layer("fc1", x))
        return self.layer("fc3", x, relu=False), matrix
