"""Arrays in Python hold the bytes that the program writes."""

import io
import tarfile
from pathlib import Path

import numpy as np
from conftest import ASSETS, edgepuck

import edgepuck as ep


def test_clouds_of_a_dataset_are_those_that_gen_dataset_packs(shapes: Path, tmp_path: Path) -> None:
    flags = ["--sensor", "vlp32c", "--views", 2, "--distance", "2,6", "--elevation", "-20,60"]
    flags += ["--azimuth-jitter", 180, "--noise", 0.02, "--points", 256, "--seed", 5]
    edgepuck("gen-dataset", shapes, "--out", tmp_path / "out", "--adapter", "cpu", *flags)
    packed = np.load(tmp_path / "out/packed/rotational-noisy-train.npz")

    dataset = ep.Dataset(
        shapes, "vlp32c", split="train", views=2, distance=(2, 6), elevation=(-20, 60),
        noise=0.02, points=256, seed=5,
    )
    points, labels = dataset.batch(range(len(dataset)))
    assert dataset.classes == packed["classes"].tolist()
    np.testing.assert_array_equal(labels, packed["labels"])
    np.testing.assert_array_equal(labels, dataset.labels)
    np.testing.assert_array_equal(points, packed["points"])


def test_tars_hold_the_clouds_of_the_dataset(shapes: Path, tmp_path: Path) -> None:
    flags = ["--sensor", "vlp32c", "--views", 2, "--distance", "2,6", "--azimuth-jitter", 180]
    flags += ["--points", 64, "--seed", 5, "--layout", "webdataset", "--tar-clouds", 25]
    edgepuck("gen-dataset", shapes, "--out", tmp_path / "out", "--adapter", "cpu", *flags)
    packed = []
    for file in sorted((tmp_path / "out").glob("train-*.tar")):
        with tarfile.open(file) as tar:
            packed += [np.load(io.BytesIO(tar.extractfile(name).read())) for name in tar.getnames()]
    dataset = ep.Dataset(
        shapes, "vlp32c", split="train", views=2, distance=(2, 6), points=64, seed=5
    )
    points, labels = dataset.batch(range(len(dataset)))
    expected = {cloud.tobytes(): label for cloud, label in zip(points, labels, strict=True)}
    found = [pair for npz in packed for pair in zip(npz["points"], npz["labels"], strict=True)]
    assert len(found) == len(expected) == len(dataset)
    assert all(expected[cloud.tobytes()] == label for cloud, label in found)


def test_scenes_in_files_are_scanned_as_by_the_program(tmp_path: Path) -> None:
    file = ASSETS / "scenes/two_chairs.toml"
    edgepuck("scan", file, "--out", tmp_path / "scan.npz", "--adapter", "cpu")
    (scan,) = ep.scan_scene(file).values()
    assert_same(scan, tmp_path / "scan.npz")


def test_scenes_of_a_recipe_are_those_of_gen_scenes(tmp_path: Path) -> None:
    edgepuck("gen-scenes", "yard", "--sweeps", 2, "--seed", 3, "--out", tmp_path, "--adapter", "cpu")
    scenes = ep.Scenes("yard", seed=3)
    assert_same(scenes[1].scan, tmp_path / "sweeps/000001.npz")
    packed = np.load(tmp_path / "packed/train.npz")
    labels = np.concatenate([scenes[0].cluster_class, scenes[1].cluster_class])
    np.testing.assert_array_equal(labels, packed["labels"])
    assert scenes.classes == packed["classes"].tolist()


def test_a_saved_scan_is_read_by_the_program(cube: tuple, tmp_path: Path) -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*cube), attributes=["range", "return", "normal"])
    scan.save(tmp_path / "scan.npz")
    edgepuck("view", tmp_path / "scan.npz", "--out", tmp_path / "scan.png")
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")
    printed = edgepuck("detect", tmp_path / "scan.npz", "--segment-only", "--radius", 0.5, "--out", tmp_path / "cut")
    assert f"{len(scan)} points" in printed.stderr


def assert_same(scan: ep.Scan, file: Path) -> None:
    columns = np.load(file)
    names = {"return": "return_number"}
    assert set(columns.files) >= {"positions"}
    for name in columns.files:
        found = getattr(scan, names.get(name, name))
        if name.startswith("object_"):
            found = np.frombuffer("\n".join(found).encode(), np.uint8)
        # Files have a column of shape [n, 1].
        np.testing.assert_array_equal(found, columns[name].reshape(found.shape), err_msg=name)
