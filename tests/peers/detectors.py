"""pykitti on our sequences, and nuscenes-devkit on the boxes that test the precision of `eval`.

pykitti reads a drive that `gen-scenes --drive S --layout semantickitti` wrote. Its points on objects that stand
still must coincide over all sweeps once its poses have moved them into the first camera's frame, but
for the noise. nuscenes-devkit's average precision of the
boxes in train/src/detections/precision.json must be what that file says, which the test of
precision.rs beside it expects of ours. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import shutil

from peer import OUT, ROOT, edgepuck, skipped_if_missing

with skipped_if_missing():
    import numpy
    import pykitti
    from nuscenes.eval.common.data_classes import EvalBoxes
    from nuscenes.eval.common.utils import center_distance
    from nuscenes.eval.detection.algo import accumulate, calc_ap
    from nuscenes.eval.detection.data_classes import DetectionBox

N_TURNS, PERIOD_S, SPEED_M_S = 8, 0.1, 12
# Walls of 3 by 2 m stand anywhere, so that no motion is along all of them.
WALL, THICKNESS_M = 51, 0.002
# The noise of ranges, and the unit of an HDL-64E's.
NOISE_M, QUANTUM_M = 0.02, 0.002
RECIPE = f"""
[ground]
road_width_m = [10, 10]
slope_deg = [2, 2]
[mount]
height_m = [1.8, 1.8]
tilt_deg = [2, 2]
sway_deg = [1, 1]
[[sensor]]
profile = "hdl64e"
effects = {{ noise = {{ sigma_m = {NOISE_M} }} }}
[[object]]
kind = "mesh"
class = "wall"
meshes = "walls"
height_m = [2, 2]
count = [12, 12]
place = "anywhere"
distance_m = [5, 25]
"""


def main():
    sequence()
    precision()


def sequence():
    """Reads a drive past walls."""
    (OUT / "walls.toml").write_text(RECIPE)
    (OUT / "meshes/walls").mkdir(parents=True)
    corners = [(x, y, z) for x in (0, 3) for y in (0, THICKNESS_M) for z in (0, 2)]
    faces = ["0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3"]
    lines = ["OFF", "8 6 0", *(" ".join(map(str, at)) for at in corners), *("4 " + f for f in faces)]
    (OUT / "meshes/walls/wall.off").write_text("\n".join(lines) + "\n")
    folder = OUT / "kitti/sequences/00"
    edgepuck("gen-scenes", OUT / "walls.toml", "--meshes", OUT / "meshes", "--sensor", "hdl64e",
             "--drive", N_TURNS * PERIOD_S, "--speed", SPEED_M_S, "--layout", "semantickitti",
             "--out", folder)
    # pykitti expects them where KITTI's odometry benchmark has them.
    (OUT / "kitti/poses").mkdir()
    shutil.copy(folder / "poses.txt", OUT / "kitti/poses/00.txt")
    read = pykitti.odometry(str(OUT / "kitti"), "00")
    assert len(read) == len(read.poses) == len(read.velo_files) == N_TURNS, len(read)
    times = [time.total_seconds() for time in read.timestamps]
    assert numpy.allclose(times, PERIOD_S * numpy.arange(N_TURNS), atol=1e-6), times
    assert (read.poses[0] == numpy.eye(4)).all(), read.poses[0]
    # The camera looks along its z, to where the car drives; it sways by a degree or two.
    driven = read.poses[-1][:3, 3]
    expected = SPEED_M_S * PERIOD_S * (N_TURNS - 1)
    # The speed is that on a map; the street climbs by 2 degrees at most.
    longest = expected / numpy.cos(numpy.radians(2))
    assert expected - 1e-6 < numpy.linalg.norm(driven) < longest + 1e-6, driven
    assert driven[2] > 0.99 * expected, driven
    tr = read.calib.T_cam0_velo
    assert numpy.allclose(tr[:3, :3] @ tr[:3, :3].T, numpy.eye(3)) and numpy.linalg.det(tr) > 0
    objects = {}
    for number, pose in enumerate(read.poses):
        cloud = read.get_velo(number)
        labels = numpy.fromfile(folder / f"labels/{number:06}.label", numpy.uint32)
        assert len(cloud) == len(labels) > 30_000, (len(cloud), len(labels))
        assert (0 <= cloud[:, 3]).all() and (cloud[:, 3] <= 1).all()
        homogeneous = numpy.column_stack([cloud[:, :3].astype(float), numpy.ones(len(cloud))])
        world = (homogeneous @ (pose @ tr).T)[:, :3]
        for instance in numpy.unique(labels[labels & 0xFFFF == WALL] >> 16):
            own = (labels >> 16 == instance) & (labels & 0xFFFF == WALL)
            objects.setdefault(instance, []).append(world[own])
    check_walls(objects)


def check_walls(objects):
    """The points that all sweeps have of a wall are in one plane, but for the noise of their ranges."""
    # A range that is off moves a point by no more off the plane.
    most = numpy.sqrt(NOISE_M ** 2 + QUANTUM_M ** 2 / 12 + THICKNESS_M ** 2)
    n_walls = 0
    for instance, sweeps in objects.items():
        points = numpy.concatenate(sweeps)
        if len(points) < 1000 or len(sweeps) < N_TURNS // 2:
            continue
        n_walls += 1
        _, sizes, _ = numpy.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        off = sizes[2] / numpy.sqrt(len(points))
        # The relative deviation of a root mean square of n numbers is 1 / sqrt(2 n).
        bound = most * (1 + 5 / numpy.sqrt(2 * len(points)))
        print(f"wall {instance}: {len(points)} points of {len(sweeps)} sweeps, {1000 * off:.1f} mm")
        assert off < bound, (off, bound)
    assert n_walls >= 3, n_walls


def boxes(rows):
    """Boxes of nuscenes-devkit: frames, centres and, of what was found, scores."""
    by_frame = EvalBoxes()
    for frame, x, y, *score in rows:
        by_frame.add_boxes(str(int(frame)), [DetectionBox(
            str(int(frame)), (x, y, 0), (1, 1, 1), (1, 0, 0, 0), detection_name="car",
            detection_score=float(score[0]) if score else -1.0)])
    return by_frame


def precision():
    """The devkit's precision of the boxes that ours is tested by."""
    file = ROOT / "train/src/detections/precision.json"
    for case in json.loads(file.read_text()):
        labelled, found = boxes(case["labelled"]), boxes(case["found"])
        for within_m, expected in case["precision"]:
            data = accumulate(labelled, found, "car", center_distance, within_m)
            ap = calc_ap(data, 0.1, 0.1)
            assert abs(ap - expected) < 1e-12, (within_m, ap, expected)
            print(f"{len(case['found'])} boxes within {within_m} m: {ap}")


main()
