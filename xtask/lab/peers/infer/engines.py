"""Inference engines, each with the options its makers advise for one cloud at a
time on one thread.

Where an engine can run the model in more than one form, each is tried at every
size and the fastest is kept.
"""

import graph
import numpy
from pointnet import log_softmax
from turns import fastest


class Edgepuck:
    """The Python package, which classifies on one thread."""

    def __init__(self, folder, precision):
        import edgepuck

        self.version = edgepuck.__version__
        self.classifier = edgepuck.Classifier(folder / "model.safetensors", precision=precision)

    def load(self, points):
        self.run = lambda: self.classifier(points)

    def answer(self, prediction):
        return log_softmax(prediction.logits.astype(numpy.float64))


class OnnxRuntime:
    def __init__(self, folder, suffix=""):
        import onnxruntime

        self.onnxruntime = onnxruntime
        self.version = onnxruntime.__version__
        self.files = [folder / f"{form}{suffix}.onnx" for form in graph.FORMS]

    def load(self, points):
        channels_first = numpy.ascontiguousarray(points.T[None])
        self.run = fastest([self.ready(file, channels_first) for file in self.files])

    def ready(self, file, x):
        options = self.onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        session = self.onnxruntime.InferenceSession(
            file, options, providers=["CPUExecutionProvider"]
        )
        binding = session.io_binding()
        binding.bind_cpu_input("x", x)
        binding.bind_output("logp", "cpu")

        def run():
            session.run_with_iobinding(binding)
            return binding

        return run

    def answer(self, binding):
        return binding.copy_outputs_to_cpu()[0][0]


class OpenVino:
    def __init__(self, folder, suffix="", precision="f32"):
        import openvino

        self.openvino = openvino
        self.core = openvino.Core()
        self.version = openvino.__version__.split("-")[0]
        self.precision = precision
        if precision == "bf16" and "BF16" not in self.core.get_property(
            "CPU", "OPTIMIZATION_CAPABILITIES"
        ):
            raise RuntimeError("this processor has no bf16 arithmetic")
        self.files = [folder / f"{form}{suffix}.onnx" for form in graph.FORMS]

    def load(self, points):
        # OpenVINO and ncnn do not keep an array alive whose memory they use.
        self.x = numpy.ascontiguousarray(points.T[None])
        self.run = fastest([self.ready(file, self.x) for file in self.files])

    def ready(self, file, x):
        model = self.core.read_model(file)
        model.reshape(list(x.shape))
        options = {
            "INFERENCE_NUM_THREADS": 1,
            "INFERENCE_PRECISION_HINT": self.precision,
            "PERFORMANCE_HINT": "LATENCY",
        }
        request = self.core.compile_model(model, "CPU", options).create_infer_request()
        request.set_input_tensor(self.openvino.Tensor(x, shared_memory=True))

        def run():
            request.infer()
            return request

        return run

    def answer(self, request):
        return request.get_output_tensor().data[0]


class Ncnn:
    def __init__(self, folder, suffix="", storage="f32"):
        import ncnn

        self.ncnn = ncnn
        self.version = ncnn.__version__
        self.storage = storage
        self.stem = f"{folder}/{{form}}{suffix}".format

    def load(self, points):
        self.arrays = numpy.ascontiguousarray(points.T[:, None]), numpy.ascontiguousarray(points)
        image, rows = (self.ncnn.Mat(array).clone() for array in self.arrays)
        self.run = fastest([self.ready("image", image), self.ready("rows", rows)])

    def ready(self, form, x):
        net = self.ncnn.Net()
        options = net.opt
        options.num_threads = 1
        options.use_vulkan_compute = False
        if self.storage != "f16":
            # On by default.
            options.use_fp16_packed = False
            options.use_fp16_storage = False
            options.use_fp16_arithmetic = False
        options.use_bf16_storage = self.storage == "bf16"
        for load, part in ((net.load_param, "param"), (net.load_model, "bin")):
            if load(f"{self.stem(form=form)}.{part}") != 0:
                raise RuntimeError(f"ncnn does not take {form}.{part}")

        def run():
            extractor = net.create_extractor()
            extractor.input("x", x)
            return extractor.extract("logp")[1]

        return run

    def answer(self, blob):
        return numpy.array(blob)
