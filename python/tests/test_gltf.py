"""glTF files that trimesh writes: their meshes stand where trimesh puts them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import edgepuck as ep


def world() -> trimesh.Scene:
    """Three levels of nodes, with turns, scales and one mesh in two places."""
    turn = trimesh.transformations.rotation_matrix
    scene = trimesh.Scene()
    house = turn(0.7, [0, 0, 1], [1, 2, 0]) @ trimesh.transformations.translation_matrix([3, -2, 1])
    scene.graph.update("house", matrix=house)
    table = turn(-1.1, [1, 2, 3]) @ np.diag([1.5, 0.5, 2.0, 1.0])
    scene.add_geometry(trimesh.creation.box([1, 2, 3]), node_name="table", parent_node_name="house", transform=table)
    ball = trimesh.creation.icosphere(subdivisions=2)
    scene.add_geometry(ball, geom_name="ball", node_name="left", parent_node_name="table", transform=turn(0.3, [0, 1, 0]))
    away = trimesh.transformations.translation_matrix([5, 5, 5])
    scene.graph.update("right", "house", matrix=away, geometry="ball")
    return scene


@pytest.mark.parametrize("extension", ["glb", "gltf"])
def test_meshes_stand_where_trimesh_puts_them(tmp_path: Path, extension: str) -> None:
    scene, path = world(), tmp_path / f"world.{extension}"
    exported = scene.export(file_type=extension)
    if extension == "glb":
        path.write_bytes(exported)
    else:
        for name, content in exported.items():
            (path if name.endswith(".gltf") else tmp_path / name).write_bytes(content)
    expected = trimesh.load_scene(path).to_mesh()
    mesh = ep.Mesh(path, normalize="none")
    assert len(mesh.faces) == len(expected.faces)
    x, y, z = expected.vertices.T
    turned = np.stack([x, -z, y], axis=1)
    found = mesh.vertices[np.asarray(mesh.faces)].reshape(-1, 9)
    wanted = turned[expected.faces].reshape(-1, 9)
    # The order of nodes may differ; coordinates are f32 in the file.
    order = [np.lexsort(np.round(corners, 3).T) for corners in (found, wanted)]
    np.testing.assert_allclose(found[order[0]], wanted[order[1]], atol=1e-5)
    np.testing.assert_allclose(
        [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], [turned.min(axis=0), turned.max(axis=0)], atol=1e-5
    )


def test_a_scene_of_trimesh_is_the_file_that_it_writes(tmp_path: Path) -> None:
    world_, path = world(), tmp_path / "world.glb"
    mirrored = np.diag([1.0, -1.0, 1.0, 1.0])
    mirrored[0, 3] = -6
    world_.add_geometry(trimesh.creation.cone(1, 2), node_name="cone", geom_name="cone", transform=mirrored)
    path.write_bytes(world_.export(file_type="glb"))
    scene = ep.Scene.of(trimesh.load_scene(path), up="y")
    assert len(scene) == 4
    lidar, pose = ep.Sensor("vlp16"), np.eye(4)
    pose[:3, 3] = [0, 0, 6]
    found = scene.cast(lidar, pose[None])
    whole = ep.Scene()
    whole.add(ep.Mesh(path, normalize="none"))
    expected = whole.cast(lidar, pose[None])
    hits = np.isfinite(expected.ranges)
    assert hits.sum() > 300
    # At grazing edges, f32 coordinates decide otherwise.
    assert (np.isfinite(found.ranges) != hits).sum() <= 3
    both = hits & np.isfinite(found.ranges)
    assert np.quantile(np.abs(found.ranges[both] - expected.ranges[both]), 0.99) < 1e-4
    assert set(found.object[np.isfinite(found.ranges)]) <= set(range(4))
    with pytest.raises(ep.Error, match="expected a scene with meshes, found none"):
        ep.Scene.of(trimesh.Scene())


def test_instances_have_the_bounds_of_trimesh_s_nodes(tmp_path: Path) -> None:
    world_, path = world(), tmp_path / "world.glb"
    world_.add_geometry(
        trimesh.creation.cone(1, 2), node_name="mirrored", geom_name="cone", transform=np.diag([1.0, -1.0, 1.0, 1.0])
    )
    path.write_bytes(world_.export(file_type="glb"))
    expected = trimesh.load_scene(path)
    scene = ep.Scene.read(path)
    assert sorted(scene.names) == sorted(expected.graph.nodes_geometry)
    for name, label, bounds in zip(scene.names, scene.labels, scene.bounds, strict=True):
        matrix, geometry = expected.graph[name]
        assert label == geometry
        x, y, z = trimesh.transform_points(expected.geometry[geometry].vertices, matrix).T
        turned = np.stack([x, -z, y], axis=1)
        np.testing.assert_allclose(bounds, [turned.min(axis=0), turned.max(axis=0)], rtol=1e-6, atol=1e-6)
    # As one mesh, it has the same bounds, and beams meet the same surfaces.
    whole = ep.Scene()
    whole.add(ep.Mesh(path, normalize="none"))
    np.testing.assert_allclose(whole.bounds[0, 0], scene.bounds[:, 0].min(axis=0), atol=1e-6)
    lidar, poses = ep.Sensor("vlp16"), np.eye(4)[None] + np.eye(4, k=3) * 6
    found, wanted = scene.cast(lidar, poses).ranges, whole.cast(lidar, poses).ranges
    assert (np.isfinite(found) != np.isfinite(wanted)).sum() <= 3
    both = np.isfinite(found) & np.isfinite(wanted)
    assert both.sum() > 300 and np.quantile(np.abs(found[both] - wanted[both]), 0.99) < 1e-5


def test_an_object_of_a_file_turns_on_its_trajectory_as_the_closed_form(tmp_path: Path) -> None:
    """A cube of 1 m, 3 m from an axis around which it turns once in 8 s."""
    world_ = trimesh.Scene()
    away = trimesh.transformations.translation_matrix([3, 0, 0])
    world_.add_geometry(trimesh.creation.box([1, 1, 1]), node_name="cube", transform=away)
    (tmp_path / "cube.glb").write_bytes(world_.export(file_type="glb"))
    starts = [0.0, 0.5, 1.0, 1.7, 2.25, 3.3, 4.05, 5.9, 6.6, 7.8]
    sensor = '[[sensor]]\nprofile = "vlp16"\nname = "{0}"\nstart_s = {0}\nposition_m = [0, 0, 0]\nyaw_deg = 0\n'
    poses = ", ".join(f"{{ time_s = {i}, position_m = [0, 0, 0], yaw_deg = {45 * i} }}" for i in range(9))
    scene = f'[[object]]\nscene = "cube.glb"\ntrajectory = [{poses}]\n' + "".join(map(sensor.format, starts))
    (tmp_path / "scene.toml").write_text('attributes = ["time", "object"]\n' + scene)
    scans = ep.scan_scene(tmp_path / "scene.toml")
    for start in starts:
        scan = scans[str(start)]
        assert len(scan) > 200
        # Counterclockwise from above; the cube moves while the scan runs.
        angle = (start + scan.time) * 2 * np.pi / 8
        x, y, z = scan.positions.T.astype(np.float64)
        along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        # From inside of the circle, beams meet the cube's inner side, and hardly any other.
        assert np.abs(across).max() < 0.5 + 1e-6 and np.abs(z).max() < 0.5 + 1e-6
        assert np.abs(along - 2.5).max() < 2e-6
    still = ep.Scene.read(tmp_path / "cube.glb")
    np.testing.assert_allclose(still.bounds, [[[2.5, -0.5, -0.5], [3.5, 0.5, 0.5]]], atol=1e-6)


def test_base_colours_are_asked_for(tmp_path: Path) -> None:
    cube, path = trimesh.creation.box([1, 1, 1]), tmp_path / "cube.glb"
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0.5, 0.25, 1.0, 1.0])
    cube.visual = trimesh.visual.TextureVisuals(material=material)
    path.write_bytes(trimesh.Scene(cube).export(file_type="glb"))
    lidar = ep.Sensor("vlp16")
    power = [
        scene.scan(lidar, effects={"detection": True}, attributes=["power"]).power
        for scene in (ep.Scene.read(path), ep.Scene.read(path, base_colours=True))
    ]
    # Power is in proportion to reflectivity. Weights of BT.709; trimesh writes colours of 8 bits.
    expected = 0.2126 * 0.5 + 0.7152 * 0.25 + 0.0722
    assert len(power[0]) > 200
    np.testing.assert_allclose(power[1] / power[0], expected, atol=0.004)
    with pytest.raises(ep.Error, match="joints: expected it only for robots"):
        ep.Scene.read(path, joints={"a": 0.0})
