"""Meshes come from arrays, and scans are arrays."""

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import edgepuck as ep


def test_points_lie_on_the_mesh_at_their_ranges(cube: tuple) -> None:
    mesh = ep.Mesh(*cube, normalize="none")
    scan = ep.Sensor("vlp32c").scan(mesh, distance=4, elevation=0, attributes=["range", "normal"])
    assert scan.positions.dtype == np.float32
    distance = np.abs(scan.positions).max(axis=1)
    np.testing.assert_allclose(distance, 0.5, atol=1e-6)
    sensor = np.array([4.0, 0.0, 0.0])
    np.testing.assert_allclose(np.linalg.norm(scan.positions - sensor, axis=1), scan.range, rtol=1e-6)
    np.testing.assert_array_equal(scan.normal, np.tile(np.float32([1, 0, 0]), (len(scan), 1)))


def test_arrays_are_views_of_what_was_cast(cube: tuple) -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*cube))
    assert not scan.positions.flags.owndata
    assert np.shares_memory(np.from_dlpack(scan.positions), scan.positions)
    assert np.shares_memory(np.asarray(scan), scan.positions)


def test_the_repr_of_a_scan_is_short(cube: tuple) -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*cube), attributes=["ring"])
    assert repr(scan) == f"<Scan of {len(scan)} points: positions, ring>"


def test_a_pose_is_a_matrix(cube: tuple) -> None:
    lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*cube)
    # At (3, 0, 0), looking back along x.
    pose = np.array([[-1, 0, 0, 3], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    there = lidar.scan(mesh, pose=pose)
    around = lidar.scan(mesh, distance=3, elevation=0)
    np.testing.assert_allclose(there.positions, around.positions, atol=1e-6)


def test_effects_change_a_scan_and_a_seed_its_noise(cube: tuple) -> None:
    lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*cube)
    clean = lidar.scan(mesh)
    noisy = [lidar.scan(mesh, noise=0.05, seed=seed).range for seed in (1, 1, 2)]
    np.testing.assert_array_equal(noisy[0], noisy[1])
    assert not np.array_equal(noisy[0], noisy[2])
    assert np.std(noisy[0] - clean.range) == pytest.approx(0.05, rel=0.1)
    dual = lidar.scan(
        mesh, effects={"footprint": {"samples": np.int64(7)}, "returns": "dual"},
        attributes=["return"],
    )
    assert len(dual) > len(clean)


def test_meshes_of_other_libraries_are_taken(cube: tuple) -> None:
    vertices, faces = cube
    other = SimpleNamespace(vertices=vertices, faces=faces.astype(np.uint32))
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(other))
    np.testing.assert_array_equal(scan.positions, ep.Sensor("vlp32c").scan(ep.Mesh(*cube)).positions)


def test_meshes_of_trimesh_are_taken() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=4)
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(ball), distance=3)
    np.testing.assert_allclose(np.linalg.norm(scan.positions, axis=1), 1.0, atol=2e-3)


def test_meshes_go_to_trimesh_where_scans_find_them() -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = ep.Mesh(trimesh.creation.box((4.0, 2.0, 2.0)), normalize="unit-sphere")
    back = trimesh.Trimesh(mesh.vertices, mesh.faces)
    assert len(back.faces) == len(mesh)
    # Farthest 1 m from the origin: a box of 4 : 2 : 2.
    np.testing.assert_allclose(back.extents, np.array([4, 2, 2]) / 6**0.5, atol=1e-12)
    scan = ep.Sensor("vlp32c").scan(mesh, distance=3)
    # Each point is on a side of it.
    np.testing.assert_allclose(np.abs(2 * scan.positions / back.extents).max(axis=1), 1, atol=1e-6)


def test_objects_are_pickled_by_their_arguments(cube: tuple) -> None:
    mesh, lidar, classify = ep.Mesh(*cube), ep.Sensor("vlp32c"), ep.Classifier("edge-64")
    again = [pickle.loads(pickle.dumps(it)) for it in (mesh, lidar, classify)]
    scan = lidar.scan(mesh)
    np.testing.assert_array_equal(again[1].scan(again[0]).positions, scan.positions)
    np.testing.assert_array_equal(again[2](scan).logits, classify(scan).logits)


def test_a_classifier_knows_a_chair(shapes) -> None:
    classify = ep.Classifier("edge-64", precision="i8")
    (file, *_) = sorted((shapes / "chair/test").glob("*.off"))
    found = classify(ep.Sensor("vlp32c").scan(ep.Mesh(file), distance=3))
    assert found.label in classify.classes
    assert found.index == int(np.argmax(found.logits))
    assert 0 < found.confidence <= 1


def test_a_mesh_keeps_its_arrays(cube: tuple) -> None:
    vertices = cube[0].copy()
    mesh = ep.Mesh(vertices, cube[1], normalize="none")
    vertices *= 0.1
    again = pickle.loads(pickle.dumps(mesh))
    lidar = ep.Sensor("vlp32c")
    np.testing.assert_array_equal(lidar.scan(again).positions, lidar.scan(mesh).positions)


def test_a_scan_around_a_mesh_is_segmented_from_its_sensor(cube: tuple, tmp_path: Path) -> None:
    mesh = ep.Mesh(cube[0] + [0, 0, 0], cube[1], normalize="none")
    scan = ep.Sensor("vlp32c").scan(mesh, distance=6, elevation=0, azimuth=70)
    from_sensor = scan.in_sensor_frame()
    np.testing.assert_allclose(np.linalg.norm(from_sensor, axis=1), scan.range, rtol=1e-5)
    assert (from_sensor[:, 0] > 5).all()
    np.testing.assert_array_equal(ep.segment(scan), ep.segment(from_sensor, rings=scan.ring))
    assert (ep.segment(scan) >= 0).any()
    for name in ["scan.npz", "scan.ply"]:
        scan.save(tmp_path / name)
        again = ep.Scan.read(tmp_path / name)
        np.testing.assert_array_equal(again.in_sensor_frame(), from_sensor)


def test_clusters_are_numbered_and_ground_is_minus_1() -> None:
    scene = ep.Scenes("street", seed=2)[4]
    assert scene.cluster.max() + 1 == len(scene.cluster_class)
    assert {-1, 0} <= set(scene.cluster)
    own = ep.segment(scene.scan)
    # The recipe draws how low a robot takes points for ground; alone, it is the default.
    assert (own == -1).any()
    assert own.max() > 5


def test_a_mesh_that_is_not_scaled_stays_where_its_source_has_it():
    # The corners of a tetrahedron of 40 x 30 x 20 m, away from the origin.
    corners = np.array([[0, 0, 0], [40, 0, 0], [0, 30, 0], [0, 0, 20]]) + [100.0, 0.0, 5.0]
    faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
    mesh = ep.Mesh(corners, faces, normalize="none")
    np.testing.assert_array_equal(mesh.vertices, corners)
    assert mesh.scale == 1 and not mesh.centre.any()
    pose = np.eye(4)
    pose[:3, 3] = [90, 5, 8]
    points = ep.Sensor("vlp32c").scan(mesh, pose=pose)
    world = points.positions + points.origin
    assert len(points) > 100
    assert np.all(world >= corners.min(axis=0) - 1e-4)
    assert np.all(world <= corners.max(axis=0) + 1e-4)


def test_instances_share_a_mesh_and_move(cube):
    mesh, sensor, scene = ep.Mesh(*cube, normalize="none"), ep.Sensor("vlp32c"), ep.Scene()
    near = scene.add(mesh, position=(3, 0, 0), label="box")
    far = scene.add(mesh, position=(5, 2, 0), scale=(1, 1, 3), reflectivity=0.2)
    assert (len(scene), near, far) == (2, 0, 1)
    both = scene.scan(sensor, pose=np.eye(4), attributes=["object", "range"])
    assert set(both.object) == {near, far}
    # The face towards the sensor is 2.5 m ahead.
    assert both.positions[both.object == near][:, 0].min() == pytest.approx(2.5, abs=1e-6)
    scene.move(near, position=(4, 0, 0))
    moved = scene.scan(sensor, pose=np.eye(4), attributes=["object"])
    assert moved.positions[moved.object == near][:, 0].min() == pytest.approx(3.5, abs=1e-6)
    for wrong in [lambda: scene.move(2, position=(0, 0, 0)), lambda: scene.add("cube.off")]:
        with pytest.raises(ep.Error, match="expected|cube.off: cannot be read"):
            wrong()
    with pytest.raises(ep.Error, match="reflectivity"):
        scene.add(mesh, reflectivity=2.0)
        scene.scan(sensor)


def test_a_scene_of_one_mesh_is_the_scan_of_that_mesh(cube):
    mesh, sensor, scene = ep.Mesh(*cube), ep.Sensor("vlp32c"), ep.Scene()
    scene.add(mesh)
    alone = sensor.scan(mesh, noise=0.02, seed=3)
    np.testing.assert_array_equal(scene.scan(sensor, noise=0.02, seed=3).positions, alone.positions)


def test_a_scene_that_was_read_keeps_its_effects_attributes_and_seed(tmp_path, cube):
    lines = ["OFF", "8 12 0", *(" ".join(map(str, row)) for row in cube[0])]
    lines += ["3 " + " ".join(map(str, face)) for face in cube[1]]
    (tmp_path / "cube.off").write_text("\n".join(lines))
    (tmp_path / "scene.toml").write_text(
        'seed = 5\nattributes = ["range"]\neffects = { noise = { sigma_m = 0.1 } }\n'
        'object = [{ mesh = "cube.off" }]\n'
        'sensor = [{ profile = "vlp32c", position_m = [3, 0, 0], look_at_m = [0, 0, 0] }]\n'
    )
    scene, sensor = ep.Scene.read(tmp_path / "scene.toml"), ep.Sensor("vlp32c")
    noisy = scene.scan(sensor)
    assert noisy.ring is None
    assert noisy.range.std() > scene.scan(sensor, effects={}).range.std()
    other = scene.scan(sensor, seed=6)
    assert not np.array_equal(noisy.range, other.range)


def test_a_pickled_scene_has_the_same_scan(cube: tuple) -> None:
    scene, mesh = ep.Scene(), ep.Mesh(*cube)
    near = scene.add(mesh, position=(4, 0, 0))
    scene.add(mesh, position=(8, 2, 0), scale=2.0, reflectivity=0.3, name="far")
    scene.move(near, position=(4, -1, 0))
    again = pickle.loads(pickle.dumps(scene))
    scans = [of.scan(ep.Sensor("vlp32c"), pose=np.eye(4), noise=0.01) for of in (scene, again)]
    assert len(again) == 2 and len(scans[0]) > 0
    np.testing.assert_array_equal(scans[0].positions, scans[1].positions)


def test_a_mesh_in_millimetres_has_its_size_in_metres(cube: tuple) -> None:
    vertices, faces = cube
    mesh = ep.Mesh(1000 * vertices, faces, normalize="none", units="mm")
    np.testing.assert_allclose(mesh.vertices, vertices, rtol=1e-15)
    with pytest.warns(UserWarning, match=r"1000 x 1000 x 1000 m .* `units` names another"):
        ep.Mesh(1000 * vertices, faces, normalize="none")
    with pytest.warns(UserWarning, match=r"0.001 x 0.001 x 0.001 m if its unit is millimetres \(1 x 1"):
        ep.Mesh(vertices, faces, normalize="none", units="mm")


def test_a_scan_is_saved_as_its_extension_says(cube: tuple, tmp_path: Path) -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*cube))
    for name in ["a.npz", "a.ply", "a.csv"]:
        scan.save(tmp_path / name)
    saved = np.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(saved["positions"], scan.positions)
    np.testing.assert_array_equal(saved["ring"].ravel(), scan.ring)
    read = ep.Scan.read(tmp_path / "a.npz")
    np.testing.assert_array_equal(read.positions, scan.positions)
    np.testing.assert_array_equal(read.ring, scan.ring)
    assert f"element vertex {len(scan)}" in (tmp_path / "a.ply").read_bytes()[:400].decode("latin-1")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert len(lines) == len(scan) + 1 and lines[0].startswith("x,y,z")
    first = np.array(lines[1].split(",")[:3], dtype=np.float32)
    np.testing.assert_array_equal(first, scan.positions[0])


def test_points_are_read_in_the_format_of_the_name_or_the_argument(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(50, 5)).astype(np.float32)
    points[:, 4] = np.arange(50) % 32
    points.tofile(tmp_path / "a.bin")
    with pytest.raises(ep.Error, match="look like rings of nuScenes"):
        ep.Scan.read(tmp_path / "a.bin")
    read = ep.Scan.read(tmp_path / "a.bin", format="nuscenes")
    np.testing.assert_array_equal(read.positions, points[:, :3])
    np.testing.assert_array_equal(read.intensity, points[:, 3])
    np.save(tmp_path / "a.npy", points)
    np.testing.assert_array_equal(ep.Scan.read(tmp_path / "a.npy").positions, points[:, :3])
    with pytest.raises(ep.Error, match="unknown cloud format `kity`"):
        ep.Scan.read(tmp_path / "a.bin", format="kity")
    with pytest.raises(ep.Error, match="sender: expected an address"):
        ep.Scan.read(tmp_path / "a.bin", sender="me")


def test_a_batch_has_the_answers_of_its_clouds(cube: tuple) -> None:
    lidar, mesh, classify = ep.Sensor("vlp32c"), ep.Mesh(*cube), ep.Classifier("edge-64")
    scans = [lidar.scan(mesh, azimuth=azimuth) for azimuth in (0, 40)]
    alone = [classify(scan).logits for scan in scans]
    for found, expected in zip(classify(scans), alone, strict=True):
        np.testing.assert_array_equal(found.logits, expected)
    clouds = np.stack([scan.positions[:500] for scan in scans])
    first, second = classify(clouds)
    np.testing.assert_array_equal(first.logits, classify(clouds[0]).logits)
    # A fourth column, such as KITTI's intensity, is no coordinate.
    with_intensity = np.column_stack([clouds[1], np.ones(500)])
    np.testing.assert_array_equal(second.logits, classify(with_intensity).logits)


def test_objects_of_a_street_are_detected_where_they_stand() -> None:
    scene = ep.Scenes("street", seed=1)[0]
    found = ep.detect(scene.scan)
    taken = np.concatenate([one.indices for one in found])
    assert len(np.unique(taken)) == len(taken) > 0
    for one in found:
        points = scene.scan.positions[one.indices]
        assert len(points) == one.points >= 20
        low, high = points.min(axis=0) - 1e-4, points.max(axis=0) + 1e-4
        assert (low <= one.centre).all() and (one.centre <= high).all()
    least = np.median([one.confidence for one in found])
    assert all(one.confidence >= least for one in ep.detect(scene.scan, min_confidence=least))


def test_scans_know_where_their_sensor_stood(cube: tuple) -> None:
    scan = ep.Sensor("vlp32c").scan(ep.Mesh(*cube), distance=4, elevation=0)
    np.testing.assert_allclose(scan.sensor_position[0], [4, 0, 0], atol=1e-6)
    away = np.eye(4)
    away[:3, 3] = [501, 2, 3]
    far = ep.Scan(positions=np.zeros((2, 3), np.float32), origin=np.array([500.0, 0, 0]), pose=away)
    np.testing.assert_array_equal(far.sensor_position, [[1, 2, 3]] * 2)
    drawn = ep.Scenes("street", seed=1)[0].scan
    np.testing.assert_array_equal(drawn.pose, np.eye(4))
    np.testing.assert_array_equal(drawn.sensor_position[-1], [0, 0, 0])
