"""Writes one PointNet in every engine's form.

prepare.py MODEL.safetensors CLOUD.safetensors FOLDER

MODEL has yanx27's key names, CLOUD one tensor `points` [n, 3]. Into FOLDER go
image.onnx and rows.onnx, the same quantised (-i8), and both again for ncnn.
"""

import sys
from pathlib import Path

import graph
import ncnn_files
import numpy
import onnx
import pointnet
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from safetensors.numpy import load_file

CALIBRATION_POINTS = 1024


class Clouds(CalibrationDataReader):
    """Clouds over which activations' ranges are taken."""

    def __init__(self, clouds):
        self.clouds = list(clouds)

    def get_next(self):
        if not self.clouds:
            return None
        return {"x": numpy.ascontiguousarray(self.clouds.pop().T[None])}


def main(model_file, cloud_file, folder):
    folder.mkdir(parents=True, exist_ok=True)
    layers = pointnet.layers(model_file)
    points = load_file(cloud_file)["points"]
    starts = range(0, len(points), CALIBRATION_POINTS)
    clouds = [points[start : start + CALIBRATION_POINTS] for start in starts]
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


main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
