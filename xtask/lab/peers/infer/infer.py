"""One inference engine, for `cargo xtask bench infer`; `turns` has the protocol.

infer.py ENGINE MODEL.safetensors FOLDER

FOLDER holds what prepare.py made of MODEL, and cloud.safetensors: a cloud of N
points is the first N of its `points`.
"""

import sys
from pathlib import Path

import numpy
import turns
from safetensors.numpy import load_file


class OnCloud:
    """An engine that is given clouds by their size."""

    def __init__(self, engine, points):
        self.engine = engine
        self.points = points
        self.answer = engine.answer

    def load(self, size, threads):
        self.engine.load(numpy.ascontiguousarray(self.points[:size]), threads)

    def run(self):
        return self.engine.run()


def start(name, model, folder):
    if name.startswith("torch"):
        import torch_engines

        engine = torch_engines.ENGINES[name](model)
    else:
        from engines import Ncnn, OnnxRuntime, OpenVino

        engine = {
            "onnxruntime": lambda: OnnxRuntime(folder),
            "onnxruntime-i8": lambda: OnnxRuntime(folder, suffix="-i8"),
            "openvino": lambda: OpenVino(folder),
            "openvino-bf16": lambda: OpenVino(folder, precision="bf16"),
            "openvino-i8": lambda: OpenVino(folder, suffix="-i8"),
            "ncnn": lambda: Ncnn(folder),
            "ncnn-f16": lambda: Ncnn(folder, storage="f16"),
            "ncnn-bf16": lambda: Ncnn(folder, storage="bf16"),
            "ncnn-i8": lambda: Ncnn(folder, suffix="-i8"),
        }[name]()
    points = load_file(folder / "cloud.safetensors")["points"]
    return OnCloud(engine, points), engine.version


turns.serve(lambda: start(sys.argv[1], sys.argv[2], Path(sys.argv[3])))
