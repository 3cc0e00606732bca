"""Robots in URDF: their links stand where the joints put them."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh

import edgepuck as ep

ARM = """<robot name="arm">
  <link name="base"><visual><geometry><cylinder radius="0.3" length="1"/></geometry></visual></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="boom"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="0" upper="1"/></joint>
  <link name="boom">
    <visual><origin xyz="1 0 0"/><geometry><box size="2 0.2 0.2"/></geometry></visual>
    <collision><geometry><sphere radius="0.5"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute"><parent link="boom"/><child link="hand"/>
    <origin xyz="2 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint>
  <link name="hand"><visual><geometry><mesh filename="package://arm/meshes/hand.stl" scale="2 1 1"/></geometry></visual></link>
</robot>"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    folder = tmp_path / "arm"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box(bounds=[[0, 0, 0], [1, 0.1, 0.1]]).export(folder / "meshes/hand.stl")
    (folder / "arm.urdf").write_text(ARM)
    return folder / "arm.urdf"


def test_links_stand_where_the_joints_put_them(robot: Path) -> None:
    scene = ep.Scene.read(robot, joints={"lift": 0.25, "turn": 0.5})
    assert scene.names == scene.labels == ["base", "boom", "hand"]
    corners = np.array([[x, y] for x in (0, 2) for y in (0, 0.1)]) @ np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    corners += [2, 0]
    expected = [
        # The bound of round shapes is 1 mm; the ends of a cylinder are exact.
        [[-0.3, -0.3, -0.5], [0.3, 0.3, 0.5]],
        [[0, -0.1, 0.65], [2, 0.1, 0.85]],
        [[*corners.min(axis=0), 0.75], [*corners.max(axis=0), 0.85]],
    ]
    np.testing.assert_allclose(scene.bounds[0], expected[0], atol=1e-3)
    np.testing.assert_allclose(scene.bounds[1:], expected[1:], atol=1e-6)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(scene)).bounds, scene.bounds)
    assert ep.Scene.read(robot, collision=True).names == ["boom"]


def test_errors_name_the_joint(robot: Path) -> None:
    with pytest.warns(UserWarning, match=r'arm.urdf: joint "turn": expected a position from -1 to 1'):
        ep.Scene.read(robot, joints={"turn": 2.0})
    with pytest.raises(ep.Error, match='arm.urdf:1: joint "wrist": expected one of lift, turn, found none'):
        ep.Scene.read(robot, joints={"wrist": 2.0})
    robot.write_text(ARM.replace("hand.stl", "hand.dae"))
    with pytest.raises(ep.Error, match='arm.urdf:11: link "hand": mesh .*: expected .stl, .obj, .*found Collada'):
        ep.Scene.read(robot)
