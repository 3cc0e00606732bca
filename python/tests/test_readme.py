"""The examples of the README do what it says."""

import doctest
import re
from pathlib import Path

import numpy as np
import pytest

import edgepuck as ep

README = Path(__file__).parents[1] / "README.md"


def test_examples_answer_as_shown() -> None:
    failed, tried = doctest.testfile(str(README), module_relative=False)
    assert tried > 10
    assert failed == 0


def test_a_network_is_trained_and_exported(
    shapes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    torch = pytest.importorskip("torch")
    (example,) = re.findall(r"```python\n(import torch\n.*?)```", README.read_text(), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    torch.manual_seed(0)
    # Quick, but the example's own lines.
    example = example.replace("ModelNet40/", str(shapes)).replace("range(20)", "range(30)")
    example = example.replace("points=1024", "points=128").replace("batch_size=32", "batch_size=15")
    known: dict = {}
    exec(example, known)

    # infer-cpu says of the exported file what PyTorch says of the network.
    test = ep.Dataset(shapes, split="test", points=64)
    clouds, labels = test.batch(range(len(test)))
    logits = known["model"](torch.from_numpy(clouds)).detach().numpy()
    classify = ep.Classifier("my.safetensors", sampler="all")
    found = np.stack([classify(cloud).logits for cloud in clouds])
    np.testing.assert_allclose(found, logits, atol=1e-3 * np.abs(logits).max())
    # Ten classes: chance is a tenth.
    assert np.mean(found.argmax(1) == labels) > 0.3


def test_a_data_loader_gives_the_same_batches_to_any_workers(shapes: Path) -> None:
    torch = pytest.importorskip("torch")
    dataset = ep.Dataset(shapes, "vlp32c", points=64)
    dataset.batch(range(8))
    batches = {}
    for workers, method in [(0, None), (2, "fork"), (2, "spawn"), (4, "forkserver")]:
        loader = torch.utils.data.DataLoader(
            dataset, 7, num_workers=workers, multiprocessing_context=method, timeout=120 * (workers > 0)
        )
        batches[workers, method] = [(points.numpy(), labels.numpy()) for points, labels in loader]
    expected = batches[0, None]
    assert sum(len(labels) for _, labels in expected) == len(dataset)
    for found in batches.values():
        for (points, labels), (expected_points, expected_labels) in zip(found, expected, strict=True):
            np.testing.assert_array_equal(points, expected_points)
            np.testing.assert_array_equal(labels, expected_labels)
