"""ONNX Runtime on what `cargo xtask export-onnx` writes, against infer-cpu.

Each model is exported, passes ONNX's own checker, and is run on the clouds that
infer-cpu gets. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json

from peer import OUT, ROOT, edgepuck, infer, skipped_if_missing

with skipped_if_missing():
    import numpy
    import onnx
    import onnxruntime

WEIGHTS = ROOT / "assets/weights"
# With batch norms, with and without T-Nets, and with a ReLU before the pooling.
NARROW = ROOT / "infer-cpu/tests/golden"

OPSET = 18

# Both sides round every product and sum to f32. Roundings of a sum of k terms
# add up to about sqrt(k) 2^-24 of the terms' magnitude (Higham and Mary 2019,
# "A new approach to probabilistic rounding error analysis"). With k <= 1024 in
# each of the 12 layers of the longest way, through both T-Nets, that is
# sqrt(12 * 1024) 2^-24 = 6.6e-6 on either side, 9.3e-6 for their difference:
# of the largest logit, which is of the size of the terms.
TOLERANCE = 1e-5

# Two points whose scores, or features in a channel, differ by less than they are
# rounded by may be chosen either way, which the kernels of a machine decide: of
# 64 clouds so many may get other points, and other logits.
MOST_TIES = 3

SIZES = [3, 4, 5, 17, 64, 255, 1024, 2000]


def main():
    clouds = [cloud(n, seed) for seed, n in enumerate(SIZES)]
    files = [OUT / f"cloud{n}.npy" for n in SIZES]
    for file, points in zip(files, clouds):
        numpy.save(file, points)
    models = [NARROW / "tiny.safetensors", NARROW / "plain.safetensors"]
    models += [WEIGHTS / f"{name}.safetensors" for name in ("untrained-test", "shapes-rotational-64")]
    ties = 0
    for model in models:
        compare_all_points(model, clouds, files)
        ties += compare_critical_points(model, 32, clouds, files)
    for name in ("edge-64", "cpl-64"):
        compare_surroundings(name, clouds, files)
        ties += compare_critical_points(WEIGHTS / f"{name}.safetensors", 64, clouds, files)
    compare_set_abstractions(clouds, files)
    assert ties <= MOST_TIES, f"{ties} clouds got other critical points than infer-cpu's"
    print(f"onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}: all agree")


def cloud(n, seed):
    """Points on and in a random ellipsoid, the farthest at 1; no two alike."""
    random = numpy.random.default_rng(seed)
    points = random.normal(size=(n, 3)) * random.uniform(0.2, 1, size=3)
    points[::2] /= numpy.linalg.norm(points[::2], axis=1, keepdims=True)
    points /= numpy.linalg.norm(points, axis=1).max()
    # Sorted as infer-cpu sorts them, so that equal scores are the same points'.
    points = numpy.unique(points.astype(numpy.float32), axis=0)
    assert len(points) == n
    return points


def compare_all_points(model, clouds, files):
    session = exported(model, model.stem)
    ours = logits(model, files)
    worst = 0.0
    for points, expected in zip(clouds, ours):
        (found,) = session.run(["logits"], {"points": points[None]})
        worst = max(worst, difference(model.stem, found[0], expected))
    # A batch is its clouds one by one.
    batch = numpy.stack([points[:64] for points in clouds if len(points) >= 64])
    (together,) = session.run(["logits"], {"points": batch})
    for one, found in zip(batch, together):
        (expected,) = session.run(["logits"], {"points": one[None]})
        difference(f"{model.stem} in a batch", found, expected[0])
    report(model.stem, worst)


def compare_surroundings(name, clouds, files):
    """Points among all those of their cloud: infer-cpu keeps the first ones."""
    model = WEIGHTS / f"{name}.safetensors"
    # One by its name, which the program has inside.
    session = exported(name if name == "edge-64" else model, name)
    worst = 0.0
    for n_kept in (1, 64, 4096):
        ours = logits(model, files, "--sampler", "first", "--points", n_kept)
        for points, expected in zip(clouds, ours):
            seen = {"points": points[None, :n_kept], "cloud": points[None]}
            (found,) = session.run(["logits"], seen)
            worst = max(worst, difference(f"{name}, {n_kept} points", found[0], expected))
    report(f"{name} with surroundings", worst)


def compare_set_abstractions(clouds, files):
    """All points, and as centres the farthest ones that infer-cpu chooses."""
    model = network_of_sets(OUT / "sets.safetensors", n_centres := 100)
    session = exported(model, model.stem)
    worst = 0.0
    for points, file, expected in zip(clouds, files, logits(model, files)):
        chosen = OUT / "centres.npy"
        infer("sample", "--sampler", "fps", "--points", n_centres, "--overwrite", file, chosen)
        centres = numpy.load(chosen).astype(numpy.float32)
        seen = {"points": points[None], "centres": centres[None]}
        (found,) = session.run(["logits"], seen)
        worst = max(worst, difference(f"{model.stem}, {len(points)} points", found[0], expected))
    report("set abstractions", worst)


def network_of_sets(file, n_centres):
    """A model file of two set abstractions with random weights."""
    random = numpy.random.default_rng(0)
    widths = {"feat.conv": [3, 8, 16], "sa1.conv": [4, 16, 24], "sa2.conv": [4, 24, 70, 90],
              "fc": [180, 32, 10]}
    header, data = {"__metadata__": {"abstractions": json.dumps([[n_centres, 0.4], [33, 0.9]])}}, b""
    for stem, channels in widths.items():
        # A pooling takes 4 inputs: the feature of its channel, x, y and z.
        for i, (n_in, n_out) in enumerate(zip(channels, channels[1:]), 1):
            largest = (6 / n_in) ** 0.5
            parts = {"weight": random.uniform(-largest, largest, (n_out, n_in)),
                     "bias": random.uniform(-0.1, 0.1, n_out)}
            for part, values in parts.items():
                more = values.astype("<f4").tobytes()
                header[f"{stem}{i}.{part}"] = {
                    "dtype": "F32", "shape": values.shape,
                    "data_offsets": [len(data), len(data) + len(more)]}
                data += more
    words = json.dumps(header).encode()
    file.write_bytes(len(words).to_bytes(8, "little") + words + data)
    return file


def compare_critical_points(model, n_kept, clouds, files):
    """How many clouds got other points than infer-cpu chooses."""
    session = exported(model, f"{model.stem}-cpl", "--critical-points", "--points", n_kept)
    ours = logits(model, files, "--sampler", "cpl", "--points", n_kept)
    apart = []
    for points, expected in zip(clouds, ours):
        found, kept = session.run(["logits", "kept"], {"cloud": points[None]})
        assert kept.shape == (1, min(n_kept, len(points))), kept.shape
        apart.append(distance(found[0], expected))
    same = [one for one in apart if one <= TOLERANCE]
    n_ties = len(apart) - len(same)
    tied = f"; {n_ties} clouds with ties got other points" if n_ties else ""
    report(f"{model.stem} behind a Critical Points Layer", max(same, default=0.0), tied)
    return n_ties


def exported(model, name, *flags):
    """A session of ONNX Runtime with the model, once ONNX's checker took it."""
    file = OUT / f"{name}.onnx"
    edgepuck("export-onnx", model, "--overwrite", "--out", file, *flags)
    graph = onnx.load(file)
    onnx.checker.check_model(graph, full_check=True)
    assert [(o.domain, o.version) for o in graph.opset_import] == [("", OPSET)]
    remarks = {entry.key: entry.value for entry in graph.metadata_props}
    classes = graph.graph.output[0].type.tensor_type.shape.dim[1].dim_value
    assert remarks["normalization"] in ("unit-sphere", "none")
    assert classes == len(json.loads(remarks.get("classes", "null")) or [0] * classes)
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(file, options, providers=["CPUExecutionProvider"])


def logits(model, files, *sampler):
    done = infer("classify", "--json", "--allow-untrained", "--model", model, "--normalize", "none",
                 *(sampler or ("--sampler", "all")), *files)
    return [json.loads(line)["logits"] for line in done.stdout.splitlines()]


def difference(name, found, expected):
    """Their distance, which must be within the tolerance."""
    apart = distance(found, expected)
    assert apart <= TOLERANCE, f"{name}: {apart:.2e} apart, {TOLERANCE} allowed"
    return apart


def distance(found, expected):
    """The largest difference, as a part of the largest logit or of 1."""
    expected = numpy.asarray(expected, numpy.float64)
    return numpy.abs(found - expected).max() / max(1.0, numpy.abs(expected).max())


def report(name, worst, remark=""):
    print(f"  {name}: logits within {worst:.1e} of the largest{remark}")


main()
