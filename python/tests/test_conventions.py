"""One convention of poses, sizes, units, noise and names, and objects of other libraries wherever they make sense."""

import inspect
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import edgepuck as ep

SENSOR = ep.Sensor("vlp16")
BOX = ep.box((1.0, 2.0, 0.5))
HALF = np.sqrt(0.5)
# A quarter turn about z at (3, 1, 0.2), as a matrix and as seven numbers.
QUARTER = np.array([[0.0, -1, 0, 3], [1, 0, 0, 1], [0, 0, 1, 0.2], [0, 0, 0, 1]])
SEVEN = [3, 1, 0.2, 0, 0, HALF, HALF]


def scene_of(pose=None) -> ep.Scene:
    scene = ep.Scene()
    scene.add(ep.Mesh(*BOX), pose)
    return scene


def test_all_functions_take_both_forms_of_a_pose() -> None:
    seen = [scene_of(pose).scan(SENSOR, pose=np.eye(4)) for pose in (QUARTER, SEVEN)]
    np.testing.assert_allclose(seen[0].positions, seen[1].positions, atol=1e-6)
    moved = [scene_of(), scene_of()]
    moved[0].move(0, QUARTER)
    moved[1].move(0, SEVEN)
    for scene in moved:
        np.testing.assert_allclose(scene.bounds, scene_of(QUARTER).bounds, atol=1e-12)
    from_there = np.linalg.inv(QUARTER)
    x, y, z = from_there[:3, 3]
    inverse = [x, y, z, 0, 0, -HALF, HALF]
    scans = [scene_of().scan(SENSOR, pose=pose) for pose in (from_there, inverse)]
    scans += [SENSOR.scan(ep.Mesh(*BOX), pose=pose) for pose in (from_there, inverse)]
    for scan in scans:
        np.testing.assert_allclose(scan.positions, scans[0].positions, atol=1e-6)
    assert np.isfinite(scene_of().cast(SENSOR, [inverse]).ranges).sum() == len(scans[0]) > 100
    np.testing.assert_allclose(ep.Scan(np.zeros((1, 3)), np.zeros(3), pose=SEVEN).pose, QUARTER, atol=1e-12)


def test_quaternions_with_w_first_are_told_where_things_turn_over() -> None:
    with pytest.warns(UserWarning, match="the sensor stands on its head: expected quaternions in the order x y z w"):
        scene_of(QUARTER).cast(SENSOR, [[0, 0, 0, 1, 0, 0, 0]] * 2)
    with pytest.warns(UserWarning, match="the instance stands on its head"):
        scene_of().move(0, [1, 0, 0, np.cos(0.3), 0, 0, np.sin(0.3)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # A sensor that is mounted upside down, as a matrix; and upright.
        scene_of(QUARTER).scan(SENSOR, pose=np.diag([1.0, -1, -1, 1]))
        scene_of(QUARTER).cast(SENSOR, [[0, 0, 0, 0, 0, 0, 1]])


def test_meshes_keep_their_metres(tmp_path: Path) -> None:
    (tmp_path / "a.off").write_text("OFF\n3 1 0\n5 0 0\n7 0 0\n5 3 0\n3 0 1 2\n")
    for mesh in (ep.Mesh(tmp_path / "a.off"), ep.Mesh([[5, 0, 0], [7, 0, 0], [5, 3, 0]], [[0, 1, 2]])):
        np.testing.assert_array_equal(mesh.vertices, [[5, 0, 0], [7, 0, 0], [5, 3, 0]])
    scene = ep.Scene()
    scene.add(tmp_path / "a.off")
    np.testing.assert_array_equal(scene.bounds, [[[5, 0, 0], [7, 3, 0]]])
    unit = ep.Mesh(tmp_path / "a.off", normalize="unit-sphere")
    assert np.linalg.norm(unit.vertices, axis=1).max() == pytest.approx(1)
    with pytest.warns(UserWarning, match="`units` names another"):
        ep.Mesh(1000 * BOX[0], BOX[1])
    assert inspect.signature(ep.Dataset).parameters["normalize"].default == "unit-sphere"


@pytest.mark.parametrize("function", [ep.Scene.scan, ep.Scene.cast, ep.Sensor.scan, ep.Dataset])
def test_noise_is_zero_by_default(function) -> None:
    assert inspect.signature(function).parameters["noise"].default == 0


def test_reprs_are_a_line_with_what_matters(shapes: Path, tmp_path: Path) -> None:
    scene = ep.Scene()
    for i in range(7):
        scene.add(ep.Mesh(*BOX), position=(3, 3 * i, 0), label="box" if i else None, name=None if i else "first")
    batch = scene.cast(SENSOR, np.eye(4)[None])
    mesh = min(shapes.glob("*/*/*.off"))
    scan = SENSOR.scan(ep.Mesh(mesh, normalize="unit-sphere"))
    dataset = ep.Dataset(shapes, SENSOR, points=64, split="train")
    n, beams = len(ep.Mesh(mesh)), len(SENSOR.directions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        prediction = ep.Classifier("edge-64")(scan)
    expected = {
        ep.Mesh(*BOX): "<Mesh of 12 triangles, 1 x 2 x 0.5 m>",
        SENSOR: f"<Sensor vlp16: 16 rings, {beams} beams>",
        scene: "<Scene of 7 instances: first, box, box, box, box and 2 more>",
        ep.Scene(): "<Scene of 0 instances>",
        dataset: f"<Dataset shapes0: {len(dataset)} clouds of 64 points, 10 classes (train), by vlp16>",
        ep.Classifier("edge-64"): "<Classifier edge-64: 40 classes, f32>",
        ep.Scenes("street", length=9, seed=3): "<Scenes street: 9 scenes, seed 3>",
    }
    for shown, text in expected.items():
        assert repr(shown).replace(shapes.name, "shapes0") == text
    assert repr(ep.Mesh(mesh)).startswith(f"<Mesh {mesh.name}: {n} triangles, ")
    share = 100 * np.isfinite(batch.ranges).mean()
    assert repr(batch) == f"<Batch of 1 x {beams} ranges by vlp16: {share:.1f} % returned>"
    assert repr(prediction) == f"<Prediction {prediction.label}, {100 * prediction.confidence:.1f} %>"
    unknown = ep.Prediction("unknown", 3, True, 0.94, np.zeros(5), "chair")
    assert repr(unknown) == "<Prediction unknown: resembles chair the most, 94.0 %>"
    found = ep.detect(ep.Scenes("street", seed=1)[0].scan)
    assert all(repr(one).startswith(f"<Detection {one.label}, ") and "\n" not in repr(one) for one in found)
    assert len(repr(found)) < 200 * len(found)


def test_a_sensor_serves_a_data_set_and_its_names_do_everywhere(shapes: Path, tmp_path: Path) -> None:
    profile = tmp_path / "own.toml"
    profile.write_text(
        'name = "own"\n[range]\nmax_m = 100\n[uniform]\nazimuth_from_deg = -20\nazimuth_to_deg = 20\n'
        "azimuth_steps = 60\nelevation_from_deg = -20\nelevation_to_deg = 20\nelevation_steps = 60\n"
    )
    own = ep.Sensor(profile)
    with_sensor, with_path = (ep.Dataset(shapes, of, points=64, min_points=1)[0][0] for of in (own, profile))
    np.testing.assert_array_equal(with_sensor, with_path)
    scans = [scene_of(QUARTER).scan(of, pose=np.eye(4)) for of in (own, profile, str(profile))]
    for scan in scans:
        np.testing.assert_array_equal(scan.positions, scans[0].positions)
    assert len(scans[0]) > 0
    assert ep.Scenes("street", sensors=[own], seed=1)[0].sensor == "own"
    with pytest.raises(ep.Error, match="sensors: expected the name or profile of a sensor"):
        ep.Scenes("street", sensors=[7])


class Tensor:
    """An array as Open3D's tensors give theirs."""

    def __init__(self, values: object) -> None:
        self.values = np.asarray(values)

    def cpu(self) -> "Tensor":
        return self

    def numpy(self) -> np.ndarray:
        return self.values


def test_meshes_of_other_libraries_are_taken() -> None:
    vertices, faces = BOX
    legacy = SimpleNamespace(vertices=vertices, triangles=faces)
    tensor = SimpleNamespace(vertex={"positions": Tensor(vertices)}, triangle={"indices": Tensor(faces)})
    stated = SimpleNamespace(vertices=1000 * vertices, faces=faces, units="millimeters")
    feet = SimpleNamespace(vertices=vertices / 0.3048, faces=faces, units="foot")
    micro = SimpleNamespace(vertices=1e6 * vertices, faces=faces, units="micron")
    for other in (legacy, tensor, stated, feet, micro):
        np.testing.assert_allclose(ep.Mesh(other).vertices, vertices, rtol=1e-12)
        scene = ep.Scene()
        scene.add(other)
        np.testing.assert_allclose(scene.bounds[0, 1], [0.5, 1, 0.25], rtol=1e-12)
    np.testing.assert_allclose(ep.Mesh(stated, units="cm").vertices, 10 * vertices, rtol=1e-12)
    with pytest.raises(ep.Error, match="units: expected one of m, .* found 'parsec': name the unit"):
        ep.Mesh(SimpleNamespace(vertices=vertices, faces=faces, units="parsec"))


def test_meshes_and_clouds_of_open3d_are_taken_and_given(tmp_path: Path) -> None:
    o3d = pytest.importorskip("open3d")
    legacy = o3d.geometry.TriangleMesh.create_box(1, 2, 0.5)
    tensor = o3d.t.geometry.TriangleMesh.from_legacy(legacy)
    for mesh in (legacy, tensor):
        np.testing.assert_array_equal(ep.Mesh(mesh).vertices.max(axis=0), [1, 2, 0.5])
    scan = SENSOR.scan(tensor, attributes=["ring", "beam", "object", "intensity", "reflectivity", "normal"])
    cloud = scan.to_open3d()
    np.testing.assert_array_equal(cloud.point.positions.numpy(), scan.positions)
    for name, of in [("ring", scan.ring), ("beam", scan.beam), ("object", scan.object), ("intensity", scan.intensity)]:
        np.testing.assert_array_equal(cloud.point[name].numpy()[:, 0], of)
    np.testing.assert_array_equal(cloud.point.normals.numpy(), scan.normal)
    for name in ("a.ply", "a.npz", "a.pcd"):
        assert o3d.t.io.write_point_cloud(str(tmp_path / name), cloud)
        again = o3d.t.io.read_point_cloud(str(tmp_path / name))
        np.testing.assert_array_equal(again.point["ring"].numpy(), cloud.point["ring"].numpy())
        assert set(again.point) == set(cloud.point) or name == "a.pcd"
    assert len(cloud.to_legacy().points) == len(scan)
    post = np.array([[5.0, 0.0, 0.05 * i - 1.0] for i in range(30)], np.float32)
    expected = ep.segment(post)
    for points in (o3d.t.geometry.PointCloud(post), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(post))):
        np.testing.assert_array_equal(ep.segment(points), expected)


def test_units_of_scenes_of_trimesh_are_used() -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    for i in range(2):
        at = trimesh.transformations.translation_matrix([10.0 * i, 0, 0])
        scene.add_geometry(trimesh.creation.box((10, 20, 30)), geom_name="box", transform=at)
    scene.units = "inch"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounds = ep.Scene.of(scene).bounds
    np.testing.assert_allclose(bounds[1, 1] - bounds[0, 0], 0.0254 * np.array([20, 20, 30]), rtol=1e-12)
    whole = ep.Mesh(scene)
    np.testing.assert_allclose(np.ptp(whole.vertices, axis=0), 0.0254 * np.array([20, 20, 30]), rtol=1e-12)
    as_mm = ep.Scene.of(scene, units="mm").bounds
    np.testing.assert_allclose(as_mm * 25.4, bounds, rtol=1e-12)
    one = ep.Scene.of(trimesh.creation.box((1, 2, 3)))
    np.testing.assert_array_equal(one.bounds, [[[-0.5, -1, -1.5], [0.5, 1, 1.5]]])
    with pytest.warns(UserWarning, match="`units` names another"):
        ep.Scene.of(trimesh.Scene(trimesh.creation.box((200, 200, 200))))


def test_paths_are_swept_too(tmp_path: Path) -> None:
    scan = ep.Scenes("street", seed=1)[0].scan
    scan.save(tmp_path / "a.npz")
    assert ep.detect(tmp_path / "a.npz") == ep.detect(scan)
    np.testing.assert_array_equal(ep.segment(str(tmp_path / "a.npz")), ep.segment(scan))


def test_a_message_of_ros_has_its_fields() -> None:
    scan = SENSOR.scan(ep.Mesh(*BOX), attributes=["range", "ring", "time", "intensity", "beam", "reflectivity", "normal"])
    message = scan.to_pointcloud2("lidar", stamp=1.25)
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("lidar", 1, 250_000_000)
    layout = [(of.name, of.offset, of.datatype, of.count) for of in message.fields]
    # Datatypes of sensor_msgs/PointField: 2 is uint8, 4 uint16, 6 uint32 and 7 float32.
    assert layout == [
        *(("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("intensity", 12, 7, 1), ("ring", 16, 4, 1), ("time", 18, 7, 1)),
        *(("range", 22, 7, 1), ("beam", 26, 6, 1), ("reflectivity", 30, 2, 1)),
        *(("normal_x", 31, 7, 1), ("normal_y", 35, 7, 1), ("normal_z", 39, 7, 1)),
    ]
    assert (message.height, message.width, message.point_step, message.row_step) == (1, len(scan), 43, 43 * len(scan))
    assert (message.is_bigendian, message.is_dense, len(message.data)) == (False, True, 43 * len(scan))
    types = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4"}
    packed = np.frombuffer(message.data, [(of.name, types[of.datatype]) for of in message.fields])
    np.testing.assert_array_equal(np.stack([packed[axis] for axis in "xyz"], -1), scan.positions)
    np.testing.assert_array_equal(packed["ring"], scan.ring)
    np.testing.assert_array_equal(packed["beam"], scan.beam)
    np.testing.assert_array_equal(packed["normal_z"], scan.normal[:, 2])
    assert repr(message).startswith(f"<PointCloud2 of {len(scan)} points: x, y, z, intensity")
    assert SENSOR.scan(ep.Mesh(*BOX), attributes=[]).to_pointcloud2().point_step == 12
    away = np.frombuffer(ep.Scan(np.zeros((1, 3), np.float32), origin=[500, 0, 2]).to_pointcloud2().data, "<f4")
    assert away.tolist() == [500, 0, 2]
    with pytest.raises(ep.Error, match="stamp: expected seconds since 1970, found -1"):
        scan.to_pointcloud2(stamp=-1)


@pytest.mark.parametrize("lost", [0.0, np.nan])
def test_lost_returns_are_dropped_and_counted(shapes: Path, lost: float) -> None:
    chair = min(shapes.glob("chair/test/*.off"))
    cloud = ep.Sensor("vlp32c").scan(ep.Mesh(chair, normalize="unit-sphere")).positions + np.float32(2)
    classify = ep.Classifier("shapes-rotational-64")
    expected = classify(cloud)
    for n in (1, 500):
        with pytest.warns(UserWarning, match=f"dropped {n} points? at 0, 0, 0 or not finite"):
            found = classify(np.vstack([np.full((n, 3), lost, np.float32), cloud]))
        np.testing.assert_array_equal(found.logits, expected.logits)
    sweep = ep.Scenes("street", seed=1)[0].scan
    points = sweep.in_sensor_frame()
    with_lost = np.vstack([points, np.full((900, 3), lost, np.float32)])
    rings = np.append(sweep.ring, np.zeros(900, np.uint16))
    assert ep.detect(with_lost, rings=rings) == ep.detect(points, rings=sweep.ring)


def test_names_and_labels_of_objects_stay_with_their_points(tmp_path: Path) -> None:
    scene, mesh = ep.Scene(), ep.Mesh(*BOX)
    scene.add(mesh, position=(3, 0, 0), label="chair", name="near chair")
    scene.add(mesh, position=(0, 5, 0), label="table")
    scene.add(mesh, position=(0, -5, 0))
    scan = scene.scan(SENSOR, pose=np.eye(4))
    assert scan.object_names == ["near chair", "table", "2"]
    assert scan.object_labels == ["chair", "table", ""]
    for name in ("a.npz", "a.ply"):
        scan.save(tmp_path / name)
        again = ep.Scan.read(tmp_path / name)
        assert (again.object_names, again.object_labels) == (scan.object_names, scan.object_labels)
        np.testing.assert_array_equal(again.object, scan.object)
    assert {scan.object_labels[of] for of in scan.object} == {"chair", "table", ""}
    assert "near chair" in ep.view(scan).page
    assert SENSOR.scan(mesh).object_names is None and scene_of(QUARTER).scan(SENSOR).object_labels is None


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.stl", "solid a", "is a mesh: `Scene().add(Mesh("),
        ("a.dae", "<COLLADA>", "is read by trimesh: `Scene.of(trimesh.load_scene("),
        ("a.xacro", "<robot>", "is to be expanded first: `xacro "),
        ("a.xml", "<?xml version='1.0'?>\n<mujoco model='a'/>", "is a model of MuJoCo: `edgepuck.mujoco.Lidar("),
        ("a.xml", "<robot name='a'/>", "is a robot in URDF: name it .urdf"),
        ("a.xml", "<svg/>", "is XML of another kind"),
        ("a.npz", "", "has points: `Scan.read("),
    ],
)
def test_files_of_another_kind_than_scenes_are_told_what_takes_them(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    for read in (ep.Scene.read, ep.scan_scene):
        with pytest.raises(ep.Error) as caught:
            read(tmp_path / name)
        assert message in str(caught.value) and name in str(caught.value) and "\n" not in str(caught.value)


def test_files_without_sensors_are_scanned_by_one_that_is_named(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(
        '<robot name="a"><link name="base"><visual><geometry><box size="1 2 0.5"/></geometry></visual></link></robot>'
    )
    with pytest.raises(ep.Error, match=r"box.urdf: expected sensors, .*scan_scene\(file, \"vlp32c\"\)"):
        ep.scan_scene(tmp_path / "box.urdf")
    ((name, scan),) = ep.scan_scene(tmp_path / "box.urdf", SENSOR, pose=[-3, 0, 0, 0, 0, 0, 1]).items()
    assert name == "vlp16" and scan.positions[:, 0].min() == pytest.approx(-0.5, abs=1e-6)
    assert scan.object_labels == ["base"]
    with pytest.raises(ep.Error, match="pose: expected a sensor beside it"):
        ep.scan_scene(tmp_path / "box.urdf", pose=SEVEN)


@pytest.mark.parametrize("name", ["distance", "elevation", "azimuth"])
def test_the_place_of_a_sensor_is_of_numbers(name):
    with pytest.raises(ep.Error, match=f"{name}: expected a number, found '3'"):
        ep.Sensor("vlp16").scan(ep.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), **{name: "3"})
