"""Networks in PyTorch answer as their exports do."""

from pathlib import Path

import numpy as np
import pytest

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
        ("m.safetensors", {"classes": ["a"]}, "classes: expected 2 names, one for each logit, found 1"),
        ("m.safetensors", {"classes": ["a", "a"]}, "classes: expected a name for each class, found two classes `a`"),
        ("m.safetensors", {"classes": [0, 1]}, "classes: expected a list of names, found [0, 1]"),
        ("m.safetensors", {"points": 0}, "points: expected a whole number from 1"),
    ],
)
def test_unsupported_networks_are_named(path: str, settings: dict, message: str, tmp_path: Path) -> None:
    export(PointNet(2), tmp_path / "m.safetensors", classes=["a", "b"])
    before = (tmp_path / "m.safetensors").read_bytes()
    with pytest.raises(ep.Error) as caught:
        export(PointNet(2), tmp_path / path, **{"classes": ["a", "b"], **settings})
    assert message in str(caught.value)
    assert (tmp_path / "m.safetensors").read_bytes() == before
    export(PointNet(2), tmp_path / "m.safetensors", classes=["b", "a"])
    assert (tmp_path / "m.safetensors").read_bytes() != before


def test_a_compiled_network_is_exported_as_itself(tmp_path: Path) -> None:
    model = PointNet(3, widths=(16, 32, 64), head=(32, 16)).eval()
    # The programs of Debian have a PyTorch that cannot compile.
    compiled = torch.compile(model) if hasattr(torch, "compile") else torch.nn.ModuleDict({"_orig_mod": model})
    wrapped = [compiled, torch.nn.DataParallel(compiled)]
    for half in (False, True):
        export(model, tmp_path / "own.safetensors", classes=list("abc"), half=half)
        for network in wrapped:
            export(network, tmp_path / "m.safetensors", classes=list("abc"), half=half)
            assert (tmp_path / "m.safetensors").read_bytes() == (tmp_path / "own.safetensors").read_bytes()
