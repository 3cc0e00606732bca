"""A dataset works in the workers of a data loader, however they are started and whatever their
parent did before, and gives the same clouds to any number of them."""

import faulthandler
import multiprocessing
import queue
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import edgepuck as ep

TIMEOUT_S = 120
BATCHES = [[0, 7, 3], [11, 2], [59, 58, 57, 56], [1]]


def work(dataset: ep.Dataset, tasks, answers) -> None:
    """As a worker of a `DataLoader` does: draw batches until there is none."""
    faulthandler.dump_traceback_later(TIMEOUT_S, exit=True)
    # A classifier of the parent's works here as well.
    classify = ep.Classifier("edge-64", precision="i8")
    for number, indices in iter(tasks.get, None):
        points, labels = dataset.batch(indices)
        answers.put((number, points, labels, classify(points[0]).label))


def loaded(dataset: ep.Dataset, method: str, workers: int, epochs: list[int]) -> Iterator[list]:
    """The batches of each of these epochs, drawn by workers that outlive them."""
    context = multiprocessing.get_context(method)
    tasks, answers = context.Queue(), context.Queue()
    started = [context.Process(target=work, args=(dataset, tasks, answers)) for _ in range(workers)]
    for process in started:
        process.start()
    try:
        for epoch in epochs:
            dataset.set_epoch(epoch)
            for task in enumerate(BATCHES):
                tasks.put(task)
            found = [answers.get(timeout=TIMEOUT_S) for _ in BATCHES]
            yield [batch for _, *batch in sorted(found, key=lambda answer: answer[0])]
    except queue.Empty:
        pytest.fail(f"{workers} workers by {method} gave no batch in {TIMEOUT_S} s")
    finally:
        for _ in started:
            tasks.put(None)
        for process in started:
            process.join(TIMEOUT_S)
            assert process.exitcode == 0


@pytest.fixture(scope="module")
def dataset(shapes: Path) -> ep.Dataset:
    """A dataset whose process has cast on all cores and classified before it forks."""
    dataset = ep.Dataset(shapes, "vlp32c", views=2, distance=(2, 5), points=128, seed=1)
    dataset.batch(range(16))
    ep.Classifier("edge-64")(dataset[0][0])
    ep.Scenes("yard")[0]
    return dataset


@pytest.mark.parametrize("workers", [1, 2, 4])
@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
def test_batches_are_equal_for_any_workers(dataset: ep.Dataset, method: str, workers: int) -> None:
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system has no {method}")
    for epoch, found in zip([0, 3], loaded(dataset, method, workers, [0, 3]), strict=True):
        dataset.set_epoch(epoch)
        for indices, (points, labels, label) in zip(BATCHES, found, strict=True):
            expected, expected_labels = dataset.batch(indices)
            np.testing.assert_array_equal(points, expected)
            np.testing.assert_array_equal(labels, expected_labels)
            assert label == ep.Classifier("edge-64", precision="i8")(expected[0]).label


def test_epochs_differ_and_come_back(dataset: ep.Dataset) -> None:
    dataset.set_epoch(0)
    first, label = dataset[5]
    dataset.set_epoch(1)
    second, same_label = dataset[5]
    assert label == same_label
    assert not np.array_equal(first, second)
    dataset.set_epoch(0)
    np.testing.assert_array_equal(dataset[5][0], first)


def test_a_pickled_dataset_draws_the_same(dataset: ep.Dataset) -> None:
    import pickle

    dataset.set_epoch(2)
    again = pickle.loads(pickle.dumps(dataset))
    assert again.epoch == 2
    np.testing.assert_array_equal(again[9][0], dataset[9][0])
    # A copy has an epoch of its own.
    dataset.set_epoch(0)
    assert again.epoch == 2


def test_threads_are_those_that_were_asked_for(dataset: ep.Dataset) -> None:
    points, _ = dataset.batch(range(8))
    ep.set_num_threads(1)
    np.testing.assert_array_equal(dataset.batch(range(8))[0], points)
    ep.set_num_threads(0)
    np.testing.assert_array_equal(dataset.batch(range(8))[0], points)


def draw_into(dataset: ep.Dataset, answers) -> None:
    answers.put(dataset.batch(BATCHES[0])[0])


def test_a_child_opens_the_adapter_for_itself(shapes: Path) -> None:
    if not any("llvmpipe" in name for name in ep.adapters()):
        pytest.skip("this system has no software Vulkan")
    dataset = ep.Dataset(shapes, points=64, adapter="llvmpipe")
    expected, _ = dataset.batch(BATCHES[0])
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=draw_into, args=(dataset, answers))
    child.start()
    np.testing.assert_array_equal(answers.get(timeout=TIMEOUT_S), expected)
    child.join(TIMEOUT_S)
    # Of noise in f32 and in f64; positions are below 1.
    on_cpu, _ = ep.Dataset(shapes, points=64).batch(BATCHES[0])
    np.testing.assert_allclose(expected, on_cpu, atol=1e-6)
