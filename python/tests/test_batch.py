"""`Scene.cast`: ranges from many poses, each in a world of its own."""

import pickle

import numpy as np
import pytest

import edgepuck as ep

SENSOR = ep.Sensor("vlp16")
N = len(SENSOR.directions)


def world() -> tuple[ep.Scene, int]:
    """A room of 8 m by 6 m by 4 m around the sensor, and a box in it."""
    scene = ep.Scene()
    scene.add(ep.Mesh(*ep.box((8, 6, 4)), normalize="none"))
    return scene, scene.add(ep.Mesh(*ep.box((0.5, 0.5, 0.5)), normalize="none"), position=(2, 0, 0))


def at(*position: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def test_a_row_is_the_scan_of_its_own_world() -> None:
    scene, box = world()
    poses = np.stack([at(0, 0.2 * i, 0) for i in range(4)])
    of_each = np.stack([[at(1 + 0.5 * i, 0, 0)] for i in range(4)])
    batch = scene.cast(SENSOR, poses, move=([box], of_each))
    assert batch.ranges.shape == batch.object.shape == (4, N)
    assert batch.ranges.dtype == np.float32
    for i in range(4):
        alone, moved = world()
        alone.move(moved, of_each[i, 0])
        scan = alone.scan(SENSOR, pose=poses[i])
        ranges, objects = np.full(N, np.inf, np.float32), np.full(N, -1)
        ranges[scan.beam], objects[scan.beam] = scan.range, scan.object
        np.testing.assert_array_equal(batch.ranges[i], ranges)
        np.testing.assert_array_equal(batch.object[i], objects)
    # The walls of the room are 4, 3 and 2 m off, so that every beam ends on the nearest.
    from_middle = scene.cast(SENSOR, np.eye(4)[None], move=([box], at(50, 0, 0)[None, None])).ranges[0]
    expected = (np.array([4, 3, 2]) / np.maximum(np.abs(SENSOR.directions), 1e-9)).min(axis=1)
    np.testing.assert_allclose(from_middle, expected, rtol=1e-6)


def test_quaternions_are_poses_too() -> None:
    scene, _ = world()
    half = np.sqrt(0.5)
    turned = np.array([[0.0, -1, 0, 1], [1, 0, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
    both = [scene.cast(SENSOR, [turned]), scene.cast(SENSOR, [[1, 0.5, 0, 0, 0, half, half]])]
    np.testing.assert_allclose(both[0].ranges, both[1].ranges, rtol=1e-6)


def test_the_image_has_a_row_for_each_ring() -> None:
    scene, _ = world()
    batch = scene.cast(SENSOR, np.eye(4)[None])
    image = batch.range_image()
    counts = np.bincount(SENSOR.rings)
    assert image.shape == (1, 16, counts.max()) and counts.min() < counts.max()
    for ring in (0, 7, 15):
        of_ring = np.flatnonzero(SENSOR.rings == ring)
        in_time = of_ring[np.argsort(SENSOR.times[of_ring])]
        np.testing.assert_array_equal(image[0, ring, : len(in_time)], batch.ranges[0, in_time])
        assert np.isinf(image[0, ring, len(in_time) :]).all()


def test_intensities_and_second_returns_are_those_of_scans() -> None:
    scene, _ = world()
    settings = {"effects": {"footprint": {"samples": 7, "divergence_deg": [2, 2]}, "returns": "dual"}}
    wanted = ["intensity", "power"]
    batch = scene.cast(SENSOR, np.eye(4)[None], attributes=wanted, **settings)
    columns = ["range", "beam", *wanted]
    scan = scene.scan(SENSOR, pose=np.eye(4), seed=int(batch.seeds[0]), attributes=columns, **settings)
    # Two returns of a beam follow each other, the last behind the strongest.
    is_second = np.r_[False, scan.beam[1:] == scan.beam[:-1]]
    assert is_second.sum() > 10
    np.testing.assert_array_equal(batch.ranges[0, scan.beam[~is_second]], scan.range[~is_second])
    np.testing.assert_array_equal(batch.second_ranges[0, scan.beam[is_second]], scan.range[is_second])
    assert np.isfinite(batch.second_ranges).sum() == is_second.sum()
    for name in wanted:
        np.testing.assert_array_equal(
            getattr(batch, name)[0, scan.beam[~is_second]], getattr(scan, name)[~is_second]
        )
    assert scene.cast(SENSOR, np.eye(4)[None]).power is None


def test_noise_is_that_of_scans() -> None:
    scene, _ = world()
    settings = {"noise": 0.02, "dropout": 0.3, "effects": {"returns": "last"}}
    batch = scene.cast(SENSOR, np.stack([np.eye(4)] * 2), seed=5, **settings)
    assert 0.25 < np.isinf(batch.ranges).mean() < 0.35
    for ranges, seed in zip(batch.ranges, batch.seeds, strict=True):
        scan = scene.scan(SENSOR, pose=np.eye(4), seed=int(seed), **settings)
        np.testing.assert_array_equal(ranges[scan.beam], scan.range)
        assert np.isfinite(ranges).sum() == len(scan)


def test_many_instances_move_at_once_and_stay_so_when_pickled() -> None:
    box, half = ep.Mesh(*ep.box((0.5, 0.5, 0.5)), normalize="none"), np.sqrt(0.5)
    many, alone = ep.Scene(), ep.Scene()
    numbers = [many.add(box) for _ in range(3)]
    # Quarter turns about z, as quaternions and as matrices.
    quaternions = np.array([[3.0, i, 0.2, 0, 0, half, half] for i in range(3)])
    for x, y, z, *_ in quaternions:
        alone.add(box, [[0, -1, 0, x], [1, 0, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])
    many.move(numbers, quaternions)
    quaternions[:] = np.nan
    for scene in [many, pickle.loads(pickle.dumps(many))]:
        found, expected = scene.cast(SENSOR, np.eye(4)[None]), alone.cast(SENSOR, np.eye(4)[None])
        np.testing.assert_array_equal(found.object, expected.object)
        np.testing.assert_allclose(found.ranges, expected.ranges, rtol=1e-6)
    assert set(found.object[0]) == {-1, 0, 1, 2}


@pytest.mark.parametrize(
    ("numbers", "poses", "message"),
    [
        ([0, 1], np.eye(4), "pose: expected shape [2, 4, 4] or [2, 7], found [4, 4]; seven are x, y, z and a quaternion x, y, z, w"),
        ([0, 1], np.stack([np.eye(4), np.diag([1, 1, 1.01, 1])]), "pose[1]: expected a rotation in the first three rows"),
        ([0, 1], np.stack([np.eye(4), np.diag([1, 1, 1.01, 1])]), "off by 2.01e-2, with determinant 1.0100"),
        ([0, 2], np.stack([np.eye(4)] * 2), "expected the number of one of 2 instances, found 2"),
        ([0, -1], np.stack([np.eye(4)] * 2), "instance: expected a whole number from 0"),
        ([0, 1], None, "expected the poses of all instances"),
        ([1, 1], np.stack([np.eye(4)] * 2), "instance: expected each instance once, found 1 twice"),
    ],
)
def test_many_instances_all_move_or_none(numbers, poses, message: str) -> None:
    scene, _ = world()
    before = scene.cast(SENSOR, np.eye(4)[None]).ranges
    with pytest.raises(ep.Error) as caught:
        scene.move(numbers, poses)
    assert message in str(caught.value)
    np.testing.assert_array_equal(scene.cast(SENSOR, np.eye(4)[None]).ranges, before)


@pytest.mark.parametrize(
    ("poses", "move", "message"),
    [
        (np.eye(4), None, "poses: expected shape [n, 4, 4] or [n, 7], found [4, 4]"),
        (2 * np.eye(4)[None], None, "poses[0]: expected a matrix whose last row is 0, 0, 0, 1, found [0.0, 0.0, 0.0, 2.0]"),
        (np.diag([2.0, 1, 1, 1])[None], None, "poses[0]: expected a rotation in the first three rows and columns, found"),
        ([[0, 0, 0, 1, 1, 0, 0]], None, "poses[0]: expected a quaternion of length 1"),
        ([[0, 0, 0, np.nan, 0, 0, 0]], None, "poses[0]: expected a quaternion of length 1"),
        (np.eye(4)[None], ([1], np.eye(4)[None]), "move: expected shape [1, 1, 4, 4] or [1, 1, 7]"),
        (np.eye(4)[None], ([5], np.eye(4)[None, None]), "one of 2 instances, found 5"),
    ],
)
def test_wrong_arguments_are_named(poses, move, message: str) -> None:
    scene, _ = world()
    with pytest.raises(ep.Error) as caught:
        scene.cast(SENSOR, poses, move=move)
    assert message in str(caught.value)
