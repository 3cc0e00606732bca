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
