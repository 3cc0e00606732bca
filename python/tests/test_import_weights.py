"""Checkpoints of PyTorch become model files, and the networks answer as before."""

import hashlib
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, SHARED, logits, read_safetensors

import edgepuck as ep

torch = pytest.importorskip("torch")
from torch import nn  # noqa: E402

from edgepuck import _checkpoint  # noqa: E402
from edgepuck.torch import import_weights  # noqa: E402

GOLDEN = ROOT / "tests/golden/checkpoints"
YANX27, CERTIFY3D = GOLDEN / "yanx27.pth", GOLDEN / "3dcertify_legacy.pth"
# Of the largest logit, or of 1 where that is less. Both sides round every product and sum to f32: see test_onnx.py.
TOLERANCE = 1e-5


def imported(checkpoint: Path, out: Path, **settings: Any) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """The tensors and the card of the model file."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*classes without names")
        import_weights(checkpoint, out, **settings)
    return read_safetensors(out)


def saved(tensors: dict[str, Any], path: Path) -> Path:
    torch.save({name: torch.as_tensor(np.array(value)) for name, value in tensors.items()}, path)
    return path


def refused(checkpoint: Path, out: Path, **settings: Any) -> str:
    """The error, after which an old file is as before."""
    out.write_text("old")
    with pytest.raises(ep.Error) as caught:
        imported(checkpoint, out, **settings)
    assert out.read_text() == "old"
    return str(caught.value)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "m.safetensors"


@pytest.mark.parametrize(
    ("checkpoint", "digest"),
    [
        (YANX27, "451c151ac2af1a4d2c4058448405afa4db657ee7aaddf84020084682a25c6f9f"),
        (CERTIFY3D, "2174362d9ab7f14b368d81f10be31ee5f74446719d70c1245d9af7622b3f4db3"),
    ],
)
def test_a_checkpoint_always_becomes_the_same_bytes(checkpoint: Path, digest: str, out: Path) -> None:
    for old in (None, b"old"):
        if old:
            out.write_bytes(old)
        imported(checkpoint, out)
        assert hashlib.sha256(out.read_bytes()).hexdigest() == digest
    assert list(out.parent.iterdir()) == [out]


def value(name: str, element: int) -> float:
    """What tests/golden/checkpoints/make.py wrote."""
    step = (sum(name.encode()) + 7 * element) % 61
    return (step + 1) / 64 if name.endswith("running_var") else (step - 30) / 64


@pytest.mark.parametrize(("checkpoint", "n_layers", "n_norms"), [(YANX27, 18, 15), (CERTIFY3D, 8, 7)])
def test_every_storage_layout_and_wrapper_becomes_f32(
    checkpoint: Path, n_layers: int, n_norms: int, out: Path
) -> None:
    tensors, _ = imported(checkpoint, out)
    assert len(tensors) == 2 * n_layers + 4 * n_norms
    for name, tensor in tensors.items():
        assert tensor.ravel().tolist() == [value(name, element) for element in range(tensor.size)], name


def test_the_card_has_the_facts_of_the_repository_and_of_the_checkpoint(out: Path) -> None:
    _, card = imported(CERTIFY3D, out)
    digest = hashlib.sha256(CERTIFY3D.read_bytes()).hexdigest()
    assert card == {
        "sampler": "fps",
        "points": "64",
        "fps_start": "first",
        "normalization": "unit-sphere",
        "pooled": "relu",
        "transform_after": "1",
        "trained": "true",
        "training_set": "ModelNet40",
        "accuracy": "instance 83.35 %, class 80.11 %, as its checkpoint says",
        "provenance": f"3dcertify_legacy.pth, SHA-256 {digest}",
        "widths": "3-4-4-4-5-6 | 6-5-4-3",
    }
    with pytest.warns(UserWarning, match="3 classes without names"):
        import_weights(YANX27, out)
    _, card = read_safetensors(out)
    assert (card["sampler"], card["pooled"], card["widths"]) == ("all", "linear", "3-4-5-8 | 8-6-5-3")
    assert "points" not in card
    # NumPy's numbers are pickled as objects.
    assert card["accuracy"] == "instance 90.62 %, class 87.50 %, as its checkpoint says"


def test_arguments_overrule_the_repository_and_the_checkpoint(out: Path) -> None:
    facts = {"normalization": "none", "training_set": "ours", "accuracy": "99%", "provenance": "me"}
    classes = ["cup", "bowl", "vase"]
    _, card = imported(CERTIFY3D, out, classes=classes, sampler="cpl", points=48, card=facts)
    assert card == {
        **{"classes": '["cup","bowl","vase"]', "sampler": "cpl", "points": "48", "pooled": "relu"},
        **{"transform_after": "1", "trained": "true", "widths": "3-4-4-4-5-6 | 6-5-4-3", **facts},
    }
    assert ep.Classifier(out).classes == classes


def test_layers_of_any_names_are_imported(out: Path) -> None:
    tensors, _ = imported(YANX27, out)
    theirs = saved({f"net.{name}": tensor for name, tensor in tensors.items()}, out.with_name("c.pth"))
    layers = {f"net.{name[:-7]}": name[:-7] for name in tensors if name.endswith(".weight")}
    again, card = imported(theirs, out, layers=layers, classes=["a", "b", "c"], card={"points": "7"})
    assert again.keys() == tensors.keys()
    assert all((again[name] == tensors[name]).all() for name in tensors)
    assert card["points"] == "7"


def test_f16_stays_f16(out: Path) -> None:
    tensors, _ = imported(YANX27, out)
    halves = {name: tensor.astype(np.float16) for name, tensor in tensors.items()}
    again, _ = imported(saved(halves, out.with_name("half.pth")), out)
    assert b'"F16"' in out.read_bytes() and b'"F32"' not in out.read_bytes()
    assert all((again[name] == tensors[name]).all() for name in tensors)


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (lambda zip, old: b"", "expected a PyTorch checkpoint"),
        (lambda zip, old: b"[net]\nwidth = 3\n", "expected a PyTorch checkpoint"),
        (lambda zip, old: b"\x80\x02}." * 3, "expected a PyTorch checkpoint"),
        (lambda zip, old: zip[: len(zip) // 2], "expected a PyTorch checkpoint"),
        (lambda zip, old: old[:100], "expected a PyTorch checkpoint"),
        (lambda zip, old: old[:-1], "expected a whole PyTorch checkpoint"),
    ],
)
def test_another_file_is_an_error(content: Callable[[bytes, bytes], bytes], cause: str, out: Path) -> None:
    path = out.with_name("c.pth")
    path.write_bytes(content(YANX27.read_bytes(), CERTIFY3D.read_bytes()))
    message = refused(path, out)
    assert message.startswith(f"{path}: ") and cause in message


def test_other_objects_are_errors(out: Path, tmp_path: Path) -> None:
    path = tmp_path / "c.pth"
    torch.save({}, path)
    assert refused(path, out) == f"{path}: expected weights, found no tensor"
    torch.save(nn.Linear(2, 2), path)
    expected = "expected a dictionary of tensors, found an object of torch.nn.modules.linear.Linear"
    assert expected in refused(path, out)
    torch.jit.save(torch.jit.script(nn.Linear(2, 2)), path)
    assert "expected a dictionary of tensors, found an object of __torch__" in refused(path, out)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("net/data.pkl", bytes(10_000_000))
    assert "expected an archive without compression, found `data.pkl` compressed" in refused(path, out)
    assert refused(tmp_path / "absent.pth", out) == f"{tmp_path / 'absent.pth'}: No such file or directory"
    assert refused(tmp_path, out) == f"{tmp_path}: Is a directory"
    message = refused(YANX27, tmp_path / "m.npz")
    assert message.startswith("path: expected a name with .safetensors, found ")


def test_no_code_of_a_checkpoint_is_executed(out: Path, tmp_path: Path) -> None:
    class Attack:
        def __reduce__(self) -> tuple[Any, ...]:
            return open, (str(tmp_path / "made by the checkpoint"), "w")

    path = tmp_path / "c.pth"
    for legacy in (False, True):
        torch.save({"a": torch.ones(1), "attack": Attack()}, path, _use_new_zipfile_serialization=not legacy)
        assert "does not know `a`" in refused(path, out)
        assert not (tmp_path / "made by the checkpoint").exists()


@pytest.mark.parametrize("original", [YANX27, CERTIFY3D])
def test_a_damaged_checkpoint_is_an_error_or_a_checkpoint(original: Path, tmp_path: Path) -> None:
    random, path = np.random.default_rng(0), tmp_path / "c.pth"
    for _ in range(128):
        content = np.frombuffer(original.read_bytes(), np.uint8).copy()
        n = random.integers(8)
        content[random.integers(0, len(content), n)] = random.integers(0, 256, n)
        path.write_bytes(content[: random.choice([len(content), random.integers(len(content))])].tobytes())
        try:
            found = _checkpoint.read(path)
            found.values({name: name for name in found.tensors})
        except ep.Error:
            pass


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["fc1.bias", "fc2.bias"], ["fc1.bias", "fc2.bias"]),
        (["module.a", "module.b"], ["a", "b"]),
        (["module.a", "b"], ["b", "module.a"]),
        (["model_state_dict.module.a", "optimizer_state_dict.state.0.exp_avg"], ["a"]),
        (["optimizer.x", "state_dict.a"], ["a"]),
        (["_orig_mod.a", "_orig_mod.b"], ["a", "b"]),
        (["_orig_mod.module.a", "_orig_mod.module.b"], ["a", "b"]),
        (["module._orig_mod.a", "module._orig_mod.b"], ["a", "b"]),
        (["state_dict.feat._orig_mod.a", "state_dict.fc1.b"], ["fc1.b", "feat.a"]),
    ],
)
def test_the_model_is_found_beside_the_optimiser_and_below_its_wrappers(
    names: list[str], found: list[str]
) -> None:
    assert sorted(_checkpoint._of_model(dict.fromkeys(names))) == found


def test_default_classes_are_those_of_the_data_set() -> None:
    if not (SHARED / "points/classes.txt").exists():
        pytest.skip("no ../shared/data/points")
    assert (SHARED / "points/classes.txt").read_text().splitlines() == _checkpoint._MODELNET40


UNKNOWN = "expected the layers of yanx27, fxia22 or 3dcertify, or those that the argument layers names; the nearest, yanx27"


def changed(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict], dict]:
    return lambda tensors: {**tensors, name: change(tensors[name])}


def added(name: str, value: Any = (1.0,)) -> Callable[[dict], dict]:
    return lambda tensors: {**tensors, name: np.array(value)}


def without(*names: str) -> Callable[[dict], dict]:
    return lambda tensors: {name: value for name, value in tensors.items() if not name.startswith(names)}


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (changed("fc2.bias", lambda x: x * [1, 1, 1, np.nan, 1]), "tensor `fc2.bias`: element 3 is NaN"),
        (added("encoder.0.weight"), f"{UNKNOWN}, does not know `encoder.0.weight`"),
        (added("fc1.scale"), f"{UNKNOWN}, does not know `fc1.scale`"),
        (added("feat.bn9.bias", [1]), "tensor `feat.bn9.bias`: expected floating-point numbers, found torch.int64"),
        (without("feat.bn2.running_mean"), "tensor `feat.bn2.running_mean`: missing"),
        (added("fc4.bias"), "tensor `bn3.weight`: missing"),
        (added("bn7.bias"), "tensor `bn7.bias`: unexpected"),
        (
            changed("feat.conv2.weight", lambda x: np.ones((4, 5, 1))),
            "tensor `feat.conv2.weight`: expected shape [4, 4, 1], found [4, 5, 1]",
        ),
        (without("feat", "bn"), "tensor `feat.conv2.weight`: missing"),
        (
            lambda tensors: {f"x{i}": np.ones(1) for i in range(7)},
            "does not know `x0`, `x1`, `x2`, `x3`, `x4` and 2 more",
        ),
    ],
)
def test_weights_that_make_no_network_are_errors(change: Callable[[dict], dict], cause: str, out: Path) -> None:
    tensors, _ = imported(YANX27, out)
    path = saved(change(tensors), out.with_name("c.pth"))
    message = refused(path, out)
    assert message.startswith(f"{path}: ") and cause in message


def test_a_view_that_repeats_one_element_without_end_is_an_error(out: Path) -> None:
    path = out.with_name("c.pth")
    torch.save({"fc1.bias": torch.ones(1).expand(1 << 28)}, path)
    expected = f"{path}: tensor `fc1.bias`: expected at most 134217728 elements in the model, found more"
    assert refused(path, out) == expected


def test_an_error_has_both_names_of_a_tensor(out: Path) -> None:
    tensors, _ = imported(CERTIFY3D, out)
    tensors["fc2.bias"] = tensors["fc2.bias"][None]
    path = saved({f"net.{name}": tensor for name, tensor in tensors.items()}, out.with_name("c.pth"))
    layers = {f"net.{layer}{{i}}": f"{layer}{{i}}" for layer in ("feat.conv", "feat.bn", "fc", "bn")}
    expected = f"{path}: tensor `fc2.bias` (there `net.fc2.bias`): expected shape [4]"
    assert refused(path, out, layers=layers).startswith(expected)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"layers": {"a{i}": "b"}}, "layers: 'a{i}': 'b': expected {i} once on both sides or on none"),
        ({"layers": {}}, "the nearest, layers, does not know `bn1.bias`, "),
        ({"layers": {"fc{i}": "fc1"}}, "layers: 'fc{i}': 'fc1': expected {i} once"),
        ({"layers": {"fc1": "a", "fc2": "a"}}, "expected different names, found `a.bias` for fc1.bias and fc2.bias"),
        ({"card": {"point": "3"}}, "card: expected keys of a model's card, found `point`"),
        ({"card": {"points": "-3"}}, "metadata `points`: expected a count, found `-3`"),
        ({"sampler": "nearest"}, "nearest"),
        ({"points": 0}, "points: expected a whole number from 1"),
        ({"classes": ["cup", "bowl"]}, "classes: expected 3 names, one for each logit, found 2"),
        ({"classes": ["cup", "bowl", "cup"]}, "classes: expected a name for each class, found two classes `cup`"),
        ({"calibrate": "absent.npz"}, "absent.npz"),
    ],
)
def test_wrong_arguments_are_errors(settings: dict[str, Any], message: str, out: Path) -> None:
    assert message in refused(YANX27, out, **settings)


class TNet(nn.Module):
    """Predicts a k x k matrix; layers are named as yanx27's STN3d and STNkd are."""

    def __init__(self, k: int) -> None:
        super().__init__()
        self.k = k
        self.conv1, self.bn1 = nn.Conv1d(k, 64, 1), nn.BatchNorm1d(64)
        self.conv2, self.bn2 = nn.Conv1d(64, 128, 1), nn.BatchNorm1d(128)
        self.conv3, self.bn3 = nn.Conv1d(128, 1024, 1), nn.BatchNorm1d(1024)
        self.fc1, self.bn4 = nn.Linear(1024, 512), nn.BatchNorm1d(512)
        self.fc2, self.bn5 = nn.Linear(512, 256), nn.BatchNorm1d(256)
        self.fc3 = nn.Linear(256, k * k)

    def forward(self, x: "torch.Tensor") -> "torch.Tensor":
        for i in (1, 2, 3):
            x = torch.relu(self.get_submodule(f"bn{i}")(self.get_submodule(f"conv{i}")(x)))
        x = torch.relu(self.bn4(self.fc1(torch.amax(x, 2))))
        x = torch.relu(self.bn5(self.fc2(x)))
        return self.fc3(x).view(-1, self.k, self.k) + torch.eye(self.k, dtype=x.dtype)


class Encoder(nn.Module):
    """From [batch, 3, n] to pooled features: yanx27's PointNetEncoder with both T-Nets."""

    def __init__(self, widths: list[int]) -> None:
        super().__init__()
        self.stn, self.fstn, self.n = TNet(3), TNet(widths[0]), len(widths)
        for i, (inputs, outputs) in enumerate(zip([3, *widths], widths), 1):
            self.add_module(f"conv{i}", nn.Conv1d(inputs, outputs, 1))
            self.add_module(f"bn{i}", nn.BatchNorm1d(outputs))

    def forward(self, x: "torch.Tensor") -> "torch.Tensor":
        x = torch.bmm(x.transpose(2, 1), self.stn(x)).transpose(2, 1)
        for i in range(1, self.n + 1):
            x = self.get_submodule(f"bn{i}")(self.get_submodule(f"conv{i}")(x))
            if i < self.n:
                x = torch.relu(x)
            if i == 1:
                x = torch.bmm(x.transpose(2, 1), self.fstn(x)).transpose(2, 1)
        return torch.amax(x, 2)


class Pooled(nn.Module):
    """yanx27's `pointnet_cls`, of any widths."""

    def __init__(self, widths: list[int]) -> None:
        super().__init__()
        self.feat = Encoder(widths)
        self.fc1, self.bn1 = nn.Linear(widths[-1], 512), nn.BatchNorm1d(512)
        self.fc2, self.bn2 = nn.Linear(512, 256), nn.BatchNorm1d(256)
        self.fc3 = nn.Linear(256, 40)

    def forward(self, clouds: "torch.Tensor") -> "torch.Tensor":
        x = torch.relu(self.bn1(self.fc1(self.feat(clouds.transpose(1, 2)))))
        return self.fc3(torch.relu(self.bn2(self.fc2(x))))


def compare(model: nn.Module, file: Path) -> None:
    """Compares the logits of a network with those of its model file, on clouds of many sizes."""
    random, folder = torch.Generator().manual_seed(5), file.parent
    for n in (3, 17, 64, 255, 1024, 2000):
        points = torch.randn(n, 3, generator=random)
        points /= points.norm(dim=1).max()
        np.save(folder / f"cloud{n}.npy", points.numpy())
        with torch.inference_mode():
            expected = model.eval()(points[None])[0].double().numpy()
        (found,) = logits(file, [folder / f"cloud{n}.npy"], "--sampler", "all")
        assert np.abs(found - expected).max() <= TOLERANCE * max(1.0, np.abs(expected).max()), n


@pytest.mark.parametrize("has_t_nets", [False, True])
def test_imported_networks_answer_as_in_pytorch(has_t_nets: bool, out: Path) -> None:
    torch.manual_seed(5)
    model = Pooled([64, 128, 1024]) if has_t_nets else ep.torch.PointNet(40, (48, 64, 96, 200))
    for layer in model.modules():
        if isinstance(layer, nn.BatchNorm1d):
            layer.running_mean.normal_(0, 0.1)
            layer.running_var.uniform_(0.5, 2)
            nn.init.uniform_(layer.weight, 0.5, 1.5)
            nn.init.normal_(layer.bias, 0, 0.1)
    torch.save({"model_state_dict": model.state_dict()}, out.with_name("c.pth"))
    import_weights(out.with_name("c.pth"), out)
    compare(model, out)


def test_a_bundled_network_answers_as_in_pytorch(tmp_path: Path) -> None:
    file = ROOT / "assets/weights/shapes-rotational-64.safetensors"
    model, (tensors, _) = ep.torch.PointNet(10), read_safetensors(file)
    for layer in model.modules():
        if isinstance(layer, nn.BatchNorm1d):
            # The norms are folded into the weights.
            layer.eps = 0.0
    state = {name: torch.from_numpy(tensor.copy()) for name, tensor in tensors.items()}
    state = {name: tensor[:, :, None] if ".conv" in name and tensor.ndim == 2 else tensor for name, tensor in state.items()}
    missing = model.load_state_dict(state, strict=False)
    assert not missing.unexpected_keys and all("bn" in name for name in missing.missing_keys)
    (tmp_path / "m.safetensors").write_bytes(file.read_bytes())
    compare(model, tmp_path / "m.safetensors")


def shared(*names: str) -> list[Path]:
    paths = [SHARED / name for name in names]
    for path in paths:
        if not path.exists():
            pytest.skip(f"no {path}")
    return paths


def clouds_and_labels(file: Path) -> tuple[np.ndarray, np.ndarray]:
    with np.load(file) as arrays:
        points = arrays["points_i16"] / np.float32(32767) if "points_i16" in arrays else arrays["points"]
        return points.astype(np.float32), arrays["labels"]


def test_a_baseline_equals_the_same_weights_in_safetensors(out: Path) -> None:
    checkpoint, peer = shared("parity/pointnet.pth", "parity/pointnet.safetensors")
    tensors, card = imported(checkpoint, out)
    expected, _ = read_safetensors(peer)
    expected = {name: value for name, value in expected.items() if not name.endswith("num_batches_tracked")}
    assert tensors.keys() == expected.keys()
    assert all((tensors[name] == expected[name]).all() for name in tensors)
    assert ep.Classifier(out).classes[39] == "xbox" and len(ep.Classifier(out).classes) == 40


# The clouds are normalised, and rounded to 16 bits since.
AS_THEY_ARE = {"normalization": "none"}


def test_the_network_of_3dcertify_gives_its_reference_logits_and_accuracy(out: Path) -> None:
    """64 points from the first by farthest point sampling, as that network was trained. 1020 of 1234 is 82.66 %."""
    checkpoint, data, reference = shared(
        "checkpoints/3dcertify_64p_natural.pth", "modelnet40-clouds/dev.npz", "reference/3dcertify_64p/logits_fps64.npy"
    )
    imported(checkpoint, out, card=AS_THEY_ARE)
    classify, right = ep.Classifier(out), 0
    (clouds, labels), expected = clouds_and_labels(data), np.load(reference)
    for cloud, label, logits in zip(clouds, labels, expected, strict=True):
        found = classify(cloud)
        right += found.index == label
        # Logits reach 45: f32 of other orders of summation differ by some 50 roundings of that, 50 * 45 / 2^24.
        assert np.abs(found.logits - logits).max() < 1.4e-4
    assert (right, len(expected)) == (1020, 1234)


def test_the_baseline_gives_its_reference_log_probabilities(out: Path) -> None:
    checkpoint, data, reference = shared(
        "checkpoints/pointnet_cls_modelnet40.pth", "modelnet40-clouds/dev.npz", "reference/pointnet_cls/logp_1024.npy"
    )
    imported(checkpoint, out, card=AS_THEY_ARE)
    classify, (clouds, _), expected = ep.Classifier(out), clouds_and_labels(data), np.load(reference)
    for cloud, log_probabilities in zip(clouds[: len(expected) : 12], expected[::12], strict=True):
        found = classify(cloud).logits.astype(np.float64)
        found -= found.max()
        # Log-probabilities reach -60 and come from logits that reach 40.
        assert np.abs(found - np.log(np.exp(found).sum()) - log_probabilities).max() < 1.4e-4


def test_int8_agrees_with_fp32_on_trained_weights(out: Path) -> None:
    """int8 costs a few clouds in a hundred at most: 95 % agreement of 300 clouds is six sigma from 90 %."""
    checkpoint, data = shared("checkpoints/3dcertify_64p_natural.pth", "modelnet40-clouds/dev.npz")
    imported(checkpoint, out)
    exact, cheap = (ep.Classifier(out, precision=precision) for precision in ("f32", "i8"))
    same = [exact(cloud).index == cheap(cloud).index for cloud in clouds_and_labels(data)[0][::4]]
    assert sum(same) >= 0.95 * len(same)
