"""Networks in PyTorch answer as their exports do, and learn as `edgepuck train` does."""

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import edgepuck

import edgepuck as ep

torch = pytest.importorskip("torch")
from edgepuck.torch import PointNet, SetNetwork, export  # noqa: E402


def seen(model: "torch.nn.Module", clouds: np.ndarray) -> None:
    """Lets batch norms see clouds, so that they do not leave numbers as they are."""
    for _ in range(10):
        model(torch.from_numpy(clouds))
    if isinstance(model, SetNetwork):
        # Some channels take the smallest of their neighborhood.
        with torch.no_grad():
            model.sa1.bn1.weight[::3] *= -1.0
            model.sa2.bn1.weight[::2] *= -0.5


@pytest.mark.parametrize(("kind", "n_points"), [(PointNet, 64), (SetNetwork, 300)])
def test_an_exported_network_answers_as_in_pytorch(kind: type, n_points: int, shapes: Path, tmp_path: Path) -> None:
    torch.manual_seed(0)
    test = ep.Dataset(shapes, split="test", points=n_points)
    clouds, _ = test.batch(range(len(test)))
    model = kind(len(test.classes))
    seen(model, clouds)
    export(model.eval(), tmp_path / "my.safetensors", classes=test.classes, points=n_points)
    logits = model(torch.from_numpy(clouds)).detach().numpy()
    classify = ep.Classifier(tmp_path / "my.safetensors", sampler="all")
    found = np.stack([classify(cloud).logits for cloud in clouds])
    np.testing.assert_allclose(found, logits, atol=1e-3 * np.abs(logits).max())

    export(model, tmp_path / "half.safetensors", classes=test.classes, points=n_points, half=True)
    sizes = [(tmp_path / name).stat().st_size for name in ("my.safetensors", "half.safetensors")]
    assert sizes[1] < 0.55 * sizes[0]
    classify = ep.Classifier(tmp_path / "half.safetensors", sampler="all")
    found = np.stack([classify(cloud).logits for cloud in clouds])
    # Weights of f16 are within 2^-11; their errors add up over seven layers and hundreds of inputs.
    np.testing.assert_allclose(found, logits, atol=1e-2 * np.abs(logits).max())


@pytest.mark.parametrize(
    ("path", "settings", "message"),
    [
        ("m.npz", {}, "path: expected a name with .safetensors, found"),
        ("m.safetensors", {"classes": ["a"]}, "classes: 1 class names for 2 logits"),
        ("m.safetensors", {"classes": ["a", "a"]}, "classes: expected a name for each class, found two classes `a`"),
        ("m.safetensors", {"classes": [0, 1]}, "classes: expected a list of names, found [0, 1]"),
        ("m.safetensors", {"points": 0}, "points: expected a whole number from 1"),
    ],
)
def test_what_cannot_be_exported_is_named(path: str, settings: dict, message: str, tmp_path: Path) -> None:
    export(PointNet(2), tmp_path / "m.safetensors", classes=["a", "b"])
    before = (tmp_path / "m.safetensors").read_bytes()
    with pytest.raises(ep.Error) as caught:
        export(PointNet(2), tmp_path / path, **{"classes": ["a", "b"], **settings})
    assert message in str(caught.value)
    assert (tmp_path / "m.safetensors").read_bytes() == before
    export(PointNet(2), tmp_path / "m.safetensors", classes=["b", "a"])
    assert (tmp_path / "m.safetensors").read_bytes() != before


RECIPE = """
points = 300
batch = 10
epochs = 1
validation = 0
sampling = "random"
dropout = 0
label_smoothing = 0
[network]
input_transform = false
feature_transform = false
trunk = [64, 128]
abstractions = [
    { centres = 256, radius = 0.2, widths = [256, 256] },
    { centres = 64, radius = 0.4, widths = [512, 512, 1024] },
]
head = [256]
[adam]
rate = 1.0
epsilon = 1.0
l2 = 0.0
[augment]
drop = 0
scale = [1, 1]
shift = 0
jitter = 0
"""


def test_the_gradients_of_a_set_network_are_pytorch_s(shapes: Path, tmp_path: Path) -> None:
    torch.manual_seed(1)
    test = ep.Dataset(shapes, split="test", points=300)
    clouds, labels = test.batch(range(len(test)))
    model = SetNetwork(len(test.classes), dropout=0.0)
    seen(model, clouds)
    export(model, tmp_path / "start.safetensors", classes=test.classes, points=300)
    np.savez(tmp_path / "clouds.npz", points=clouds, labels=labels, classes=np.array(test.classes))
    (tmp_path / "one-step.toml").write_text(RECIPE)
    words = ["--data", tmp_path / "clouds.npz", "--recipe", tmp_path / "one-step.toml"]
    edgepuck("train", *words, "--init", tmp_path / "start.safetensors", "--out", tmp_path / "step.safetensors")

    found = read_safetensors(tmp_path / "step.run" / "current.safetensors")
    # In f64: in f32, PyTorch's own gradients are 1 % apart.
    logits = model.double().train()(torch.from_numpy(clouds).double())
    torch.nn.functional.cross_entropy(logits, torch.from_numpy(labels)).backward()
    for name, parameter in model.named_parameters():
        # Adam's first step, with a rate and an epsilon of 1, is g / (|g| + 1).
        g = parameter.grad
        expected = (parameter - g / (g.abs() + 1)).detach().numpy()
        # Sums over 3,000 points in f32: 3,000^0.5 times 2^-24 of gradients of up to 2, in each of seven layers.
        np.testing.assert_allclose(found[name], expected, atol=5e-5, err_msg=name)


def read_safetensors(path: Path) -> dict[str, np.ndarray]:
    """The tensors of a file in f32, by name."""
    raw = path.read_bytes()
    size = int.from_bytes(raw[:8], "little")
    header, body = json.loads(raw[8 : 8 + size]), raw[8 + size :]
    header.pop("__metadata__", None)
    values = {name: np.frombuffer(body[slice(*of["data_offsets"])], "<f4") for name, of in header.items()}
    return {name: values[name].reshape(of["shape"]) for name, of in header.items()}
