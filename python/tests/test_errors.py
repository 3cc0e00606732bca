"""What cannot be used is named, with the cause, in an exception."""

from pathlib import Path

import numpy as np
import pytest

import edgepuck as ep

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
CUBE = ep.Mesh(*ep.box((1, 1, 1)))
BALL = np.random.default_rng(1).normal(size=(200, 3))
FLOOR = np.stack([*np.meshgrid(*[np.linspace(-9.0, 9.0, 90)] * 2), np.full((90, 90), -1.5)], -1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ep.Mesh("missing.off"), "missing.off: cannot be read"),
        (lambda: ep.Mesh(SQUARE), "found list alone"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, 3]]), "index"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, -1]]), "expected indices of 3 vertices, found -1"),
        (lambda: ep.Mesh(SQUARE, [[0.5, 1, 2]]), "expected faces of whole numbers"),
        (lambda: ep.Mesh(SQUARE, [[0, 1]]), "expected faces of shape"),
        (lambda: ep.Mesh(SQUARE, []), "expected faces of shape"),
        (lambda: ep.Mesh(SQUARE, np.zeros((0, 3), int)), "at least one triangle"),
        (lambda: ep.Mesh([[0, 0, np.nan], *SQUARE], [[0, 1, 2]]), "finite coordinates"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, 2]], up="x"), "expected one of y, z"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, 2]], normalize="no"), "unit-sphere"),
        (lambda: ep.Sensor("vlp99"), "vlp99"),
        (lambda: ep.Classifier("edge-65"), "edge-65: name: expected a model file, or one of edge-64, set-64, street-128"),
        (lambda: ep.Scenes("streets"), "expected a recipe's file, or one of"),
        (lambda: ep.Sensor("vlp32c").scan(ep.Mesh(*ep.box((1, 1, 1)))).save("x.las"), "x.las"),
        (lambda: ep.Sensor("vlp32c").scan(CUBE).save("x.pcap"), "`edgepuck scan` writes them"),
        (lambda: ep.Classifier("edge-64", precision="i9"), "i9"),
        (lambda: ep.Classifier("edge-64")(np.zeros((5, 2))), "expected points of shape"),
        (lambda: ep.Classifier("edge-64")(np.zeros(5)), "expected points of shape"),
        (lambda: ep.Classifier("edge-64")(np.full((5, 3), np.nan)), "finite"),
        (lambda: ep.Classifier("edge-64")(np.ones((5, 3))), "found 5 in one place"),
        (lambda: ep.segment(np.zeros((5, 2))), "expected points of shape"),
        (lambda: ep.detect(np.zeros((5, 2))), "expected points of shape"),
        (lambda: ep.detect(np.ones((5, 3)), "no-model"), "no-model"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, 2]], normalize="none", units="km"), "expected one of m, mm, cm, in, ft"),
        (lambda: ep.segment(np.ones((5, 3)), rings=[1, 2]), "ring"),
        (lambda: ep.segment(np.zeros((2, 3)), rings=[1, 2.5]), "rings: expected whole numbers"),
        (lambda: ep.detect(np.zeros((2, 3)), rings=[1, np.nan]), "rings: expected whole numbers"),
        (lambda: ep.detect(np.full((5, 3), 49520.0)), "point 0: expected metres from the sensor"),
        (lambda: ep.segment([[1.0, 2.0, np.nan]]), "point 0: expected three finite numbers"),
        (lambda: ep.segment(np.zeros((5, 3))), "points: expected metres from the sensor, found no point"),
        (lambda: ep.detect(np.full((5, 3), np.nan)), "found no point with a position"),
        (lambda: ep.detect(np.zeros((0, 3))), "found no point with a position"),
        (lambda: ep.detect(np.zeros((3, 200))), "found [3, 200]: transpose it"),
        (lambda: ep.Classifier("edge-64")(np.zeros((2, 3, 200))), "found [3, 200]: transpose it"),
        (lambda: ep.segment(np.zeros(5, [("x", "f4"), ("y", "f4")])), "expected fields x, y and z"),
        (lambda: ep.segment("sweep.npz"), "sweep.npz"),
        (lambda: ep.detect(CUBE), "expected points of shape [n, 3], found Mesh"),
        (lambda: ep.detect([[1, 2, "x"]]), "expected points of shape [n, 3], found list"),
        (lambda: ep.detect(FLOOR, min_confidence=2), "min_confidence: expected a number from 0 to 1"),
        (lambda: ep.detect(FLOOR, min_confidence=np.nan), "min_confidence: expected a number from 0"),
        (lambda: ep.Scene().add(CUBE, position=(np.nan, 0, 0)), "position: expected finite metres"),
        (lambda: ep.Sensor("vlp16").scan(CUBE, effects="fog"), "effects: expected a dict, found 'fog'"),
        (lambda: ep.Scenes("moon"), "moon"),
        (lambda: ep.scan_scene("missing.toml"), "missing.toml"),
        (lambda: ep.Dataset("missing"), "missing: cannot be read"),
        (lambda: ep.Scene().add("chair.off"), "chair.off: cannot be read"),
        (lambda: ep.Scene().add(7), "expected a path, a mesh with vertices and faces (of trimesh or Open3D)"),
        (lambda: ep.Scene().add(ep.Mesh(*ep.box((1, 1, 1))), scale=[1, 2]), "expected one number or three"),
        (lambda: ep.Scene().add(CUBE, scale=0), "scale: expected a number above 0, found 0"),
        (lambda: ep.Scene().add(CUBE, scale=[1, -1, 1]), "scale: expected a number above 0, found -1"),
        (lambda: ep.Scene().add(CUBE, reflectivity=80), "reflectivity: expected a number within 0..=1, found 80"),
        (lambda: ep.Scene().add(CUBE, retroreflection=5), "retroreflection: expected a number within 0..=1"),
        (lambda: ep.Scene().move(0, np.eye(4)), "expected the number of one of 0 instances, found 0"),
        (lambda: ep.Scene().move(-1, np.eye(4)), "instance: expected a whole number"),
        (lambda: ep.Scene().move(0), "expected a pose or a position, found neither"),
        (lambda: ep.Scene().scan(ep.Sensor("vlp16"), pose=np.eye(4), azimuth=0), "a distance, an elevation and an azimuth, found both"),
        (lambda: ep.Scene.of("robot.glb"), "expected a trimesh.Scene, found the path 'robot.glb': `Scene.read` reads files"),
        (lambda: ep.Scan(np.zeros((5, 2)), np.zeros(3)), "positions: expected shape [n, 3], found [5, 2]"),
        (lambda: ep.Scan(BALL, [0.0] * 3, range=[1, 2]).save("x.npz"), "range: expected type float32 and shape [n], found int64 and"),
        (lambda: ep.Scan(BALL, [0.0] * 3, range=BALL[:9, 0].astype("f4")).save("x.npz"), "range"),
        (lambda: ep.segment(FLOOR, min_points=-1), "min_points: expected a whole number from 1"),
        (lambda: ep.set_num_threads(-1), "threads: expected a whole number from 0, found -1"),
        (lambda: ep.Dataset("meshes", effects={}), "effects: expected the path of a TOML file, found dict"),
        (lambda: ep.Classifier("edge-64")([BALL, BALL[:0]]), "cloud 1: the cloud has no points"),
        (lambda: ep.Scene().scan(7), "expected an edgepuck.Sensor, or its name or profile, found int"),
        (lambda: ep.Dataset("meshes", 7), "sensor: expected the name or profile of a sensor, or an edgepuck.Sensor, found int"),
        (lambda: ep.Scan(BALL, [0.0] * 3, pose=np.diag([1, 1, 1, 2])), "pose: expected a matrix whose last row is 0, 0, 0, 1"),
        (lambda: ep.Scan(BALL, [0.0] * 3, pose=[0] * 7), "pose: expected a quaternion of length 1, found [0.0, 0.0, 0.0, 0.0] (x, y, z, w) of length 0"),
        (lambda: ep.Mesh(SQUARE, [[0, 1, 2]], normalize="unit-sphere", units="mm"), "units: expected normalize=\"none\" beside it"),
    ],
)
def test_wrong_arguments_are_named(make, message: str) -> None:
    with pytest.raises(ep.Error, match="(?s)") as caught:
        make()
    assert message in str(caught.value)



@pytest.mark.parametrize(
    ("points", "message"),
    [
        (FLOOR * 500, "6408.003 m from the sensor"),
        (FLOOR / 1000, "are the points in metres"),
        (FLOOR + [300, 200, 30], "is the origin the position of the sensor"),
        (FLOOR[:, [0, 2, 1]], "if y does: expected the sensor's frame, z up"),
    ],
)
def test_a_sweep_in_another_unit_or_frame_warns(points: np.ndarray, message: str) -> None:
    with pytest.warns(UserWarning, match=message):
        ep.segment(points)


def test_a_mesh_without_area_warns() -> None:
    with pytest.warns(UserWarning, match="no triangle has an area") as caught:
        ep.Mesh(SQUARE, [[0, 1, 1]])
    assert len(caught) == 1


def test_part_of_an_object_warns() -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*ep.box((1, 1, 1))))
    for cloud in [scan, FLOOR[:500] * 0.1 + [20, 0, 0]]:
        with pytest.warns(UserWarning, match="the cloud is a scan of one side, and edge-64 learnt"):
            ep.Classifier("edge-64")(cloud)
    sweep = np.repeat(FLOOR * np.abs(FLOOR) ** 3 / 81, 2, axis=0)
    with pytest.warns(UserWarning, match="the cloud looks like a sweep"):
        ep.Classifier("street-128")(sweep)


def test_a_scan_of_nothing_warns() -> None:
    with pytest.warns(UserWarning, match="no beam returned a point"):
        scan = ep.Scene().scan(ep.Sensor("vlp16"))
    assert len(scan.positions) == 0


def test_a_file_without_points_warns(tmp_path: Path) -> None:
    np.save(tmp_path / "empty.npy", np.zeros((0, 3)))
    with pytest.warns(UserWarning, match=r"empty\.npy: holds no points"):
        assert len(ep.Scan.read(tmp_path / "empty.npy")) == 0


def test_the_fields_x_y_and_z_are_points() -> None:
    post = np.array([[5.0, 0.0, 0.05 * i - 1.0] for i in range(30)], np.float32)
    fields = [("ring", "u2"), ("x", "f4"), ("y", "f4"), ("z", "f4")]
    named = np.array([(7, *point) for point in post], fields)
    assert np.array_equal(ep.segment(named), ep.segment(post))


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"distance": 0}, "distance above 0, found 0"),
        ({"distance": float("nan")}, "finite"),
        ({"elevation": 500}, "elevation from -90 to 90 degrees, found 500"),
        ({"noise": float("inf")}, "sigma"),
        ({"dropout": 2}, "probability"),
        ({"attributes": ["colour"]}, "colour"),
        ({"effects": {"mist": 1}}, "mist"),
        ({"effects": {"noise": 0.01}}, "effects.noise: expected a dict, such as {'sigma_m': 0.01}, or the argument noise, found 0.01"),
        ({"effects": {"footprint": 7}}, "effects.footprint: expected a dict, such as {'samples': 7}, found 7"),
        ({"effects": {"footprint": {"samples": 5}}}, "samples"),
        ({"pose": np.eye(3)}, "shape"),
        ({"pose": [3, 0, 0]}, "pose: expected shape [4, 4] or [7], found [3]; seven are x, y, z and a quaternion x, y, z, w"),
        ({"pose": [3, 0, 0, 0, 0, 0, 2]}, "pose: expected a quaternion of length 1, found [0.0, 0.0, 0.0, 2.0] (x, y, z, w) of length 2.0"),
        ({"pose": [[1], [2, 3]]}, "pose: expected shape [4, 4] or [7], found [[1], [2, 3]]"),
        ({"pose": np.diag([1, 1, 1, 2])}, "pose: expected a matrix whose last row is 0, 0, 0, 1"),
        ({"seed": -1}, "seed: expected a whole number"),
        ({"seed": 2**64}, "seed"),
        ({"attributes": "range"}, "list of names"),
        ({"noise": 0.1, "effects": {"noise": {"sigma_m": 0.1}}}, "expected it once"),
        ({"pose": np.eye(4), "distance": 5}, "expected a pose, or a distance, an elevation and an azimuth, found both"),
        ({"pose": 2 * np.diag([1, 1, 1, 0.5])}, "rotation"),
    ],
)
def test_a_scan_that_cannot_be_made_is_refused(cube: tuple, wanted: dict, message: str) -> None:
    with pytest.raises(ep.Error) as caught:
        ep.Sensor("vlp32c").scan(ep.Mesh(*cube), **wanted)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"sensor": "vlp99"}, "vlp99"),
        ({"distance": (5, 2)}, "expected the smaller number first, 2,5"),
        ({"noise": -1}, "noise.sigma_m: expected a number"),
        ({"split": "dev"}, "dev"),
        ({"points": 0}, "points"),
        ({"views": 0}, "views"),
        ({"views": 2**32}, "views"),
        ({"views": 65536}, "views: expected at most 65535 where each scan is a file, found 65536"),
        ({"seed": -1}, "seed"),
        ({"cache_mb": -1}, "cache_mb"),
        ({"distance": "far"}, "distance: expected a number, found 'far'"),
        ({"elevation": (1, 2, 3)}, "elevation: expected a number, or two"),
        ({"noise": 0.1, "effects": __file__}, "cannot be used with"),
        ({"min_points": 1 << 24}, "expected a view of at least 16777216 points"),
    ],
)
def test_a_dataset_that_cannot_be_drawn_says_why(shapes: Path, wanted: dict, message: str) -> None:
    with pytest.raises(ep.Error) as caught:
        ep.Dataset(shapes, **wanted)[0]
    assert message in str(caught.value)


def test_a_bad_mesh_of_a_dataset_is_named_when_it_is_drawn(tmp_path: Path) -> None:
    (tmp_path / "cup/train").mkdir(parents=True)
    (tmp_path / "cup/train/a.off").write_text("OFF\n3 1 0\n0 0 nan\n")
    dataset = ep.Dataset(tmp_path)
    with pytest.raises(ep.Error, match=r"^cup/train/a.off:3: expected a finite coordinate"):
        dataset[0]
    with pytest.raises(IndexError, match="expected the number of one of 1 clouds, found 1"):
        dataset[1]


def test_wrong_indices_are_refused(shapes: Path) -> None:
    dataset = ep.Dataset(shapes)
    for epoch in [-1, 2**32, 0.5]:
        with pytest.raises(ep.Error, match="epoch"):
            dataset.set_epoch(epoch)
    with pytest.raises(TypeError):
        dataset[1.7]
    np.testing.assert_array_equal(dataset[np.int64(1)][0], dataset[1 - len(dataset)][0])
    with pytest.raises(ep.Error, match="length"):
        ep.Scenes(length=-1)
    with pytest.raises(ep.Error, match="chair.off: cannot be read"):
        ep.Sensor("vlp32c").scan("chair.off")


def test_paths_stay_right_in_another_folder(
    shapes: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(shapes.parent)
    dataset = ep.Dataset(shapes.name)
    monkeypatch.chdir(tmp_path)
    assert dataset[0][0].shape == (1024, 3)


def test_huge_and_tiny_meshes_are_ordinary(cube: tuple) -> None:
    vertices, faces = cube
    for size in [1e-200, 1e200]:
        scan = ep.Sensor("vlp32c").scan(ep.Mesh(vertices * size, faces, normalize="unit-sphere"))
        assert len(scan) > 1000
        assert np.isfinite(scan.positions).all()
