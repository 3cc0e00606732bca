"""One PointNet with random weights in every engine's form, and a cloud for it."""

import graph
import ncnn_files
import numpy
import onnx
import pointnet
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from safetensors.numpy import save_file

SEED = 3
N_CLASSES = 40
# Points of the clouds over which activations are calibrated for int8: of all, at least, and of each.
CALIBRATED, OF_EACH = 4096, 1024
# The radii of the torus that the points lie on, whose sum is 1 as that of a normalised cloud.
RADII = (0.7, 0.3)
# The tensors of a batch norm, and the ranges that their numbers are drawn from.
NORM = {"weight": (0.8, 1.2), "bias": (-0.1, 0.1), "running_mean": (-0.1, 0.1), "running_var": (0.5, 1.5)}


class Clouds(CalibrationDataReader):
    """Clouds over which activations' ranges are taken."""

    def __init__(self, clouds):
        self.clouds = list(clouds)

    def get_next(self):
        if not self.clouds:
            return None
        return {"x": numpy.ascontiguousarray(self.clouds.pop().T[None])}


def prepare(folder, n_points):
    """Writes model.safetensors, image.onnx and rows.onnx, the same quantised (-i8), and both again for ncnn.

    Returns the layers, as `pointnet.layers` gives them, and `n_points` points or more.
    """
    folder.mkdir(parents=True, exist_ok=True)
    draws = numpy.random.default_rng(SEED)
    card = {"normalization": "none", "note": "random weights, to measure speed"}
    save_file(random_tensors(draws), folder / "model.safetensors", card)
    layers = pointnet.layers(folder / "model.safetensors")
    points = torus(draws, max(n_points, CALIBRATED))
    clouds = [points[start : start + OF_EACH] for start in range(0, len(points), OF_EACH)]
    ranges = pointnet.input_ranges(layers, clouds)
    for form in graph.FORMS:
        file = folder / f"{form}.onnx"
        onnx.save(graph.pointnet(layers, form), file)
        quantize_static(
            file,
            folder / f"{form}-i8.onnx",
            Clouds(clouds),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
        )
        ncnn_files.write(layers, form, folder / form)
        ncnn_files.write(layers, form, folder / f"{form}-i8", ranges)
    return layers, points


def random_tensors(draws):
    tensors = {}

    def add(name, shape, low, high):
        tensors[name] = draws.uniform(low, high, shape).astype(numpy.float32)

    for key, (inputs, outputs) in pointnet.sizes(N_CLASSES).items():
        # He et al. 2015: keeps the variance through ReLUs. A T-Net's last layer is smaller, so that its matrix stays
        # near the identity.
        bound = (6 / inputs) ** 0.5 * (0.02 if key.endswith("stn.fc3") else 1)
        add(f"{key}.weight", (outputs, inputs, 1) if "conv" in key else (outputs, inputs), -bound, bound)
        add(f"{key}.bias", outputs, -0.1, 0.1)
        norm = pointnet.norm_of(key)
        for part, limits in NORM.items() if norm else ():
            add(f"{norm}.{part}", outputs, *limits)
    return tensors


def torus(draws, n):
    """`n` points in a fixed order; a cloud of fewer is the first of them."""
    around, along = draws.uniform(0, 2 * numpy.pi, (2, n))
    radius = RADII[0] + RADII[1] * numpy.cos(along)
    points = [radius * numpy.cos(around), radius * numpy.sin(around), RADII[1] * numpy.sin(along)]
    return numpy.stack(points, 1).astype(numpy.float32)
