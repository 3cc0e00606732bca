"""Models in ONNX: their graphs keep ONNX's rules, and ONNX Runtime answers as infer-cpu does."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ASSETS, ROOT, edgepuck, logits, read_safetensors

import edgepuck as ep

onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")
from edgepuck.onnx import export  # noqa: E402

# With batch norms, with and without T-Nets, and with a ReLU before the pooling.
NARROW = ROOT / "infer-cpu/tests/golden"
PLAIN = {
    **{name: NARROW / f"{name}.safetensors" for name in ("tiny", "plain")},
    **{name: ASSETS / f"weights/{name}.safetensors" for name in ("untrained-test", "shapes-rotational-64")},
}
EDGES = {"edge-64": "edge-64", "cpl-64": ASSETS / "weights/cpl-64.safetensors"}

# Both sides round every product and sum to f32. Roundings of a sum of k terms add up to about sqrt(k) 2^-24 of the terms'
# magnitude (Higham and Mary 2019, "A new approach to probabilistic rounding error analysis"). With k <= 1024 in each of
# the 12 layers of the longest way, through both T-Nets, that is sqrt(12 * 1024) 2^-24 = 6.6e-6 on either side, 9.3e-6 for
# their difference: of the largest logit, which is of the size of the terms.
TOLERANCE = 1e-5

# Two points whose scores, or features in a channel, differ by less than they are rounded by may be chosen either way,
# which the kernels of a machine decide: this many of 48 clouds may get other points, and other logits.
MOST_TIES = 3

SIZES = [3, 4, 5, 17, 64, 255, 1024, 2000]


def cloud(n: int, seed: int) -> np.ndarray:
    """Points on and in a random ellipsoid, the farthest at 1; no two alike."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(n, 3)) * random.uniform(0.2, 1, size=3)
    points[::2] /= np.linalg.norm(points[::2], axis=1, keepdims=True)
    points /= np.linalg.norm(points, axis=1).max()
    # Sorted as infer-cpu sorts them, so that equal scores are the same points'.
    points = np.unique(points.astype(np.float32), axis=0)
    assert len(points) == n
    return points


@pytest.fixture(scope="module")
def clouds() -> list[np.ndarray]:
    return [cloud(n, seed) for seed, n in enumerate(SIZES)]


@pytest.fixture(scope="module")
def files(clouds: list[np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("clouds")
    for points in clouds:
        np.save(folder / f"cloud{len(points)}.npy", points)
    return [folder / f"cloud{n}.npy" for n in SIZES]


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file of two set abstractions with random weights."""
    random, file = np.random.default_rng(0), tmp_path_factory.mktemp("sets") / "sets.safetensors"
    # A pooling takes 4 inputs: the feature of its channel, x, y and z.
    widths = {
        **{"feat.conv": [3, 8, 16], "sa1.conv": [4, 16, 24], "sa2.conv": [4, 24, 70, 90]},
        "fc": [180, 32, 10],
    }
    tensors = {}
    for stem, channels in widths.items():
        for i, (n_in, n_out) in enumerate(zip(channels, channels[1:]), 1):
            largest = (6 / n_in) ** 0.5
            weight, bias = random.uniform(-largest, largest, (n_out, n_in)), random.uniform(-0.1, 0.1, n_out)
            tensors |= {f"{stem}{i}.weight": weight.astype("f4"), f"{stem}{i}.bias": bias.astype("f4")}
    ep._edgepuck.write_weights(str(file), tensors, {"abstractions": "[[100, 0.4], [33, 0.9]]"}, False)
    return file


def exported(model: "Path | str", folder: Path, **settings: Any) -> "onnxruntime.InferenceSession":
    """A session of ONNX Runtime with the model, once ONNX's checker took it."""
    file = folder / "m.onnx"
    export(model, file, **settings)
    graph = onnx.load(file)
    onnx.checker.check_model(graph, full_check=True)
    assert [(o.domain, o.version) for o in graph.opset_import] == [("", 18)]
    card = {entry.key: entry.value for entry in graph.metadata_props}
    classes = graph.graph.output[0].type.tensor_type.shape.dim[1].dim_value
    assert card["normalization"] in ("unit-sphere", "none")
    assert classes == len(json.loads(card.get("classes", "null")) or [0] * classes)
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(file, options, providers=["CPUExecutionProvider"])


def distance(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, as a part of the largest logit or of 1."""
    return np.abs(found - expected).max() / max(1.0, np.abs(expected).max())


@pytest.mark.parametrize("name", PLAIN)
def test_networks_of_points_answer_as_in_infer_cpu(
    name: str, clouds: list[np.ndarray], files: list[Path], tmp_path: Path
) -> None:
    session = exported(PLAIN[name], tmp_path)
    expected = logits(PLAIN[name], files, "--sampler", "all")
    for points, logits_of_one in zip(clouds, expected, strict=True):
        (found,) = session.run(["logits"], {"points": points[None]})
        assert distance(found[0], logits_of_one) <= TOLERANCE, len(points)
    batch = np.stack([points[:64] for points in clouds if len(points) >= 64])
    (together,) = session.run(["logits"], {"points": batch})
    for points, found in zip(batch, together, strict=True):
        (alone,) = session.run(["logits"], {"points": points[None]})
        assert distance(found, alone[0]) <= TOLERANCE


@pytest.mark.parametrize("name", EDGES)
def test_networks_of_edges_answer_as_in_infer_cpu(
    name: str, clouds: list[np.ndarray], files: list[Path], tmp_path: Path
) -> None:
    """Points among all those of their cloud: infer-cpu keeps the first ones."""
    session = exported(EDGES[name], tmp_path)
    for n_kept in (1, 64, 4096):
        expected = logits(EDGES[name], files, "--sampler", "first", "--points", n_kept)
        for points, logits_of_one in zip(clouds, expected, strict=True):
            (found,) = session.run(["logits"], {"points": points[None, :n_kept], "cloud": points[None]})
            assert distance(found[0], logits_of_one) <= TOLERANCE, (n_kept, len(points))


def test_set_abstractions_answer_as_in_infer_cpu(
    sets: Path, clouds: list[np.ndarray], files: list[Path], tmp_path: Path
) -> None:
    """All points, and as centres the farthest ones that infer-cpu chooses."""
    session = exported(sets, tmp_path)
    for points, file, expected in zip(clouds, files, logits(sets, files, "--sampler", "all"), strict=True):
        chosen = tmp_path / "centres.npy"
        edgepuck("sample", "--sampler", "fps", "--points", 100, "--overwrite", file, chosen)
        centres = np.load(chosen).astype(np.float32)
        (found,) = session.run(["logits"], {"points": points[None], "centres": centres[None]})
        assert distance(found[0], expected) <= TOLERANCE, len(points)


def test_critical_points_are_those_of_infer_cpu(clouds: list[np.ndarray], files: list[Path], tmp_path: Path) -> None:
    ties = 0
    for model, n_kept in [*((model, 32) for model in PLAIN.values()), *((model, 64) for model in EDGES.values())]:
        session = exported(model, tmp_path, critical_points=True, points=n_kept)
        expected = logits(model, files, "--sampler", "cpl", "--points", n_kept)
        for points, logits_of_one in zip(clouds, expected, strict=True):
            found, kept = session.run(["logits", "kept"], {"cloud": points[None]})
            assert kept.shape == (1, min(n_kept, len(points)))
            ties += distance(found[0], logits_of_one) > TOLERANCE
    assert ties <= MOST_TIES


def graphs(sets: Path, folder: Path) -> Iterator["onnx.ModelProto"]:
    for model in (*PLAIN.values(), *EDGES.values()):
        for settings in ({}, {"critical_points": True, "points": 16}):
            export(model, folder / "m.onnx", **settings)
            yield onnx.load(folder / "m.onnx")
    export(sets, folder / "m.onnx")
    yield onnx.load(folder / "m.onnx")


def test_every_constant_is_used_and_values_are_those_of_the_model_file(sets: Path, tmp_path: Path) -> None:
    for model in graphs(sets, tmp_path):
        used = {name for node in model.graph.node for name in node.input}
        assert {tensor.name for tensor in model.graph.initializer} <= used
        assert not any("bn" in tensor.name for tensor in model.graph.initializer)
    shapes = {"feat.conv1.weight": [8, 3, 1], "feat.stn.conv3.weight": [64, 16, 1], "feat.fstn.fc3.weight": [64, 16]}
    export(PLAIN["untrained-test"], tmp_path / "m.onnx")
    found = {tensor.name: list(tensor.dims) for tensor in onnx.load(tmp_path / "m.onnx").graph.initializer}
    assert {name: found[name] for name in (*shapes, "fc3.bias")} == {**shapes, "fc3.bias": [4]}
    # A network without norms.
    export(PLAIN["shapes-rotational-64"], tmp_path / "m.onnx")
    found = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in onnx.load(tmp_path / "m.onnx").graph.initializer}
    for name, tensor in read_safetensors(PLAIN["shapes-rotational-64"])[0].items():
        assert (found[name].ravel() == tensor.ravel()).all(), name


def test_inputs_and_outputs_are_those_of_the_network(sets: Path, tmp_path: Path) -> None:
    for model, settings, names in [
        (PLAIN["tiny"], {}, (["points"], ["logits"])),
        ("edge-64", {}, (["points", "cloud"], ["logits"])),
        ("edge-64", {"critical_points": True}, (["cloud"], ["logits", "kept"])),
        (sets, {}, (["points", "centres"], ["logits"])),
    ]:
        session = exported(model, tmp_path, **settings)
        assert ([one.name for one in session.get_inputs()], [one.name for one in session.get_outputs()]) == names


def test_a_model_becomes_the_same_bytes_each_time_by_its_name_or_file(tmp_path: Path) -> None:
    files = [tmp_path / f"{i}.onnx" for i in range(3)]
    for model, file in zip(("edge-64", "edge-64", ASSETS / "weights/edge-64.safetensors"), files, strict=True):
        export(model, file)
    first, *others = (file.read_bytes() for file in files)
    assert all(other == first for other in others)


@pytest.mark.parametrize(
    ("model", "settings", "message"),
    [
        ("edge-65", {}, "expected a model file, or one of edge-64"),
        ("cut.safetensors", {}, "too short for safetensors"),
        (PLAIN["untrained-test"], {"critical_points": True}, "points: expected a number, since"),
        ("edge-64", {"points": 16}, "points: expected critical_points=True"),
        ("edge-64", {"critical_points": True, "points": 0}, "points: expected a whole number from 1"),
        ("sets", {"critical_points": True, "points": 4}, "cannot be exported: expected no set abstractions"),
        ("features", {"critical_points": True, "points": 4}, "cannot be exported: expected a front end of its own"),
    ],
)
def test_wrong_models_and_arguments_are_errors(
    model: "Path | str", settings: dict[str, Any], message: str, sets: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cut.safetensors").write_text("{}")
    if model == "features":
        tensors, card = read_safetensors(PLAIN["untrained-test"])
        tensors = {name: tensor for name, tensor in tensors.items() if not name.startswith(("feat.stn", "cpl"))}
        ep._edgepuck.write_weights("features.safetensors", tensors, card, False)
    model = {"sets": sets, "features": "features.safetensors"}.get(model, model)
    with pytest.raises(ep.Error) as caught:
        export(model, "m.onnx", **settings)
    assert message in str(caught.value)
    assert not Path("m.onnx").exists()
    with pytest.raises(ep.Error, match="path: expected a name with .onnx, found m.txt"):
        export("edge-64", "m.txt")
