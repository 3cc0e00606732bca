"""The examples of the README do what it says, and so does what they lead to in PyTorch."""

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


def test_the_example_of_a_loader_casts_batches(shapes: Path, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("torch")
    (example,) = re.findall(r"```python\n(import torch\n.*?)```", README.read_text(), re.DOTALL)
    # Quick, but the example's own lines.
    example = example.replace("ModelNet40/", str(shapes)).replace("range(200)", "range(2)")
    exec(example.replace("...  ", "print(*clouds.shape)"))
    assert capsys.readouterr().out == "30 1024 3\n" * 2


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
