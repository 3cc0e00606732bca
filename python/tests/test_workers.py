"""A dataset works in the workers of a data loader, however they are started and whatever their
parent did before, and gives the same clouds to any number of them."""

import faulthandler
import multiprocessing
import queue
import shutil
import subprocess
import sys
import textwrap
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


def test_attributes_are_columns_behind_the_positions(shapes: Path) -> None:
    import pickle

    settings = {"points": 128, "seed": 1, "noise": 0.0}
    plain = ep.Dataset(shapes, "vlp32c", **settings)
    attributes = ["ring", "range", "normal"]
    dataset = pickle.loads(pickle.dumps(ep.Dataset(shapes, "vlp32c", attributes=attributes, **settings)))
    clouds, labels = dataset.batch([0, 3])
    expected, expected_labels = plain.batch([0, 3])
    assert clouds.shape == (2, 128, 8) and clouds.dtype == np.float32
    np.testing.assert_array_equal(clouds[..., :3], expected)
    np.testing.assert_array_equal(labels, expected_labels)
    ring, distance, normal = clouds[..., 3], clouds[..., 4], clouds[..., 5:]
    assert np.array_equal(ring, ring.round()) and 0 <= ring.min() < ring.max() <= 31
    # The sensor is 3 m from the centre of a mesh of radius 1 m.
    assert 2 <= distance.min() < distance.max() <= 4
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, atol=1e-5)
    assert dataset[3][0].shape == (128, 8)
    assert dataset.batch([])[0].shape == (0, 128, 8)
    for wrong in ["ring", ["colour"]]:
        with pytest.raises(ep.Error, match="attributes|colour"):
            ep.Dataset(shapes, attributes=wrong)


def test_a_mesh_warns_once(tmp_path: Path) -> None:
    (tmp_path / "cup").mkdir()
    # A square of 150 m: the unit of its file is probably the millimetre. Its edges cross.
    corners = "v 0 0 0\nv 150 150 0\nv 150 0 0\nv 0 150 0\nv 0 0 150\n"
    for name in ["one", "two"]:
        (tmp_path / "cup" / f"{name}.obj").write_text(corners + "f 1 3 5\nf 1 2 3 4\n")
    dataset = ep.Dataset(tmp_path, normalize="none", up="z", distance=3, points=64, min_points=1)
    with pytest.warns(UserWarning) as caught:
        for _ in range(2):
            dataset.batch(range(len(dataset)))
    for part in ["one.obj: expected a size of 1 cm to 100 m", "two.obj: expected a size", "cross", "inside"]:
        assert sum(part in str(one.message) for one in caught) == (1 if ".obj" in part else 2), part
    # In millimetres it has a size of 15 cm.
    settings = {"normalize": "none", "units": "mm", "up": "z", "points": 64, "min_points": 1}
    small = ep.Dataset(tmp_path, distance=3, attributes=["range"], **settings)
    np.testing.assert_allclose(small[0][0][:, 3], 3, atol=0.3)


def test_a_folder_warns(tmp_path: Path, shapes: Path) -> None:
    shutil.copytree(shapes, tmp_path / "meshes")
    (tmp_path / "meshes/bus").mkdir()
    (tmp_path / "meshes/bus/a.fbx").write_bytes(b"Kaydara")
    with pytest.warns(UserWarning, match=r"1 file is ignored \(.fbx\); the class bus has no mesh"):
        ep.Dataset(tmp_path / "meshes")


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


def count_threads(dataset: ep.Dataset, answers) -> None:
    dataset.batch(BATCHES[0])
    names = [path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")]
    answers.put(sum(name.startswith("edgepuck-") for name in names))


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="this system has no /proc")
@pytest.mark.parametrize("method", ["fork", "forkserver", "spawn"])
def test_a_worker_casts_on_one_thread(
    dataset: ep.Dataset, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Even where a pool would have more, and whatever the parent has asked for.
    monkeypatch.setenv("RAYON_NUM_THREADS", "5")
    ep.set_num_threads(3)
    context = multiprocessing.get_context(method)
    answers = context.Queue()
    child = context.Process(target=count_threads, args=(dataset, answers))
    child.start()
    assert answers.get(timeout=TIMEOUT_S) == 1
    child.join(TIMEOUT_S)
    ep.set_num_threads(0)


def run_script(script: str) -> None:
    """Runs Python in a process of its own, which must end in time."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], timeout=TIMEOUT_S, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_threads_that_cast_at_once_do_not_wait_for_each_other_for_ever() -> None:
    run_script(
        """
        import sys, threading
        import edgepuck as ep
        sys.setswitchinterval(1e-6)
        lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*ep.box((1, 1, 1)))
        def cast():
            for _ in range(100):
                ep.set_num_threads(0)
                lidar.scan(mesh, distance=9)
        threads = [threading.Thread(target=cast) for _ in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        """
    )


@pytest.mark.parametrize("end", ["del lidar", "import gc; lidar.me = lidar; del lidar; gc.collect()", "pass"])
def test_a_child_leaves_what_its_parent_opened(end: str) -> None:
    if not any("llvmpipe" in name for name in ep.adapters()):
        pytest.skip("this system has no software Vulkan")
    run_script(
        f"""
        import os, sys
        import edgepuck as ep
        lidar, mesh = ep.Sensor("vlp32c", adapter="llvmpipe"), ep.Mesh(*ep.box((1, 1, 1)))
        lidar.scan(mesh)
        child = os.fork()
        if child == 0:
            {end}
            sys.exit(0)
        assert os.waitpid(child, 0)[1] == 0
        """
    )


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


def test_a_transform_is_applied_to_each_cloud(shapes: Path) -> None:
    plain, halved = ep.Dataset(shapes), ep.Dataset(shapes, transform=lambda cloud: 0.5 * cloud)
    (cloud, label), (half, same) = plain[0], halved[0]
    np.testing.assert_array_equal(half, 0.5 * cloud)
    assert same == label
    np.testing.assert_array_equal(halved.__getitems__([0])[0][0], half)
