"""Open3D's DBSCAN and Patchwork++ on simulated street sweeps, against `segment`.

Every point of such a sweep carries the number of the object that it lies on, 0 for
the ground, so that both grounds are judged by the truth. Run by `cargo xtask test`;
see xtask/src/test/peers.rs.
"""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

# A file of this folder has the name of a package: that one must not be imported.
HERE = Path(__file__).resolve().parent
sys.path = [entry for entry in sys.path if Path(entry).resolve() != HERE]

try:
    import numpy
    import open3d
    import plyfile
    import pypatchworkpp
except ImportError as error:
    print(f"SKIPPED: {error} (Debian: apt-get install libusb-1.0-0 libgomp1; Python 3.11)")
    sys.exit(77)

OUT = Path(os.environ["EDGEPUCK_OUT"])
N_SWEEPS = 12
RADII_M = [0.2, 0.5, 1.0]
# `segment` writes clusters of at least so many points.
MIN_POINTS = 10
GROUND = [150, 150, 150]
# Both count what is lower for ground, whatever it is part of: Patchwork++ 0.125 m (th_dist),
# `segment` 0.2 m.
CLEARANCE_M = 0.3
# Farther away a VLP-32C sees hardly any ground; Patchwork++'s own benchmark ends at 80 m.
MAX_RANGE_M = 60.0


def main():
    run("gen-scenes", "--sweeps", str(N_SWEEPS), "--save", str(N_SWEEPS), "--seed", "2718",
        "--adapter", "cpu", "--out", str(OUT / "street"))
    sweeps = sorted((OUT / "street/sweeps").glob("*.npz"))
    assert len(sweeps) == N_SWEEPS, sweeps
    for radius in RADII_M:
        compare_components(sweeps[0], radius)
    compare_ground(sweeps)


def compare_components(sweep, radius):
    """Both find the same sets of points."""
    folder = OUT / f"components-{radius}"
    run("segment", str(sweep), "--radius", str(radius), "--out", str(folder))
    ours = {as_set(numpy.load(file)) for file in folder.glob("cluster-*.npy")}
    points = numpy.load(sweep)["positions"].astype(numpy.float64)
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    labels = numpy.asarray(cloud.cluster_dbscan(eps=radius, min_points=1))
    clusters = [points[labels == label] for label in range(labels.max() + 1)]
    theirs = {as_set(one) for one in clusters if len(one) >= MIN_POINTS}
    n_common = len(ours & theirs)
    print(f"{radius} m: {len(theirs)} components of {MIN_POINTS} points, {n_common} in common")
    assert len(theirs) > 10 and ours == theirs


def compare_ground(sweeps):
    """Ours keeps more of the objects, and finds as much of the ground."""
    names = ["segment", "Patchwork++"]
    found, kept = numpy.zeros((2, 2)), numpy.zeros((2, 2))
    times_ms = numpy.zeros((2, len(sweeps)))
    for column, sweep in enumerate(sweeps):
        scan = numpy.load(sweep)
        points, is_ground = scan["positions"], scan["object"].ravel() == 0
        height = height_over_ground(points, is_ground)
        near = numpy.linalg.norm(points[:, :2], axis=1) < MAX_RANGE_M
        lower, upper = near & is_ground, near & ~is_ground & (height > CLEARANCE_M)
        both = [our_ground(sweep), patchwork(points, mount_height(sweep))]
        for row, (ground, time_ms) in enumerate(both):
            times_ms[row, column] = time_ms
            found[row] += [ground[lower].sum(), lower.sum()]
            kept[row] += [(~ground[upper]).sum(), upper.sum()]
    found, kept = (100 * counts[:, 0] / counts[:, 1] for counts in (found, kept))
    for name, ground, objects in zip(names, found, kept):
        print(f"{name}: {ground:.2f} % of the ground found, {objects:.2f} % of objects kept")
    ours, theirs = numpy.median(times_ms, axis=1)
    print(f"a sweep: ground and clusters {ours:.1f} ms, ground by Patchwork++ {theirs:.1f} ms")
    assert (found + kept)[0] >= (found + kept)[1]
    assert min(found[0], kept[0]) > 97


def our_ground(sweep):
    folder = OUT / "clusters"
    said = run("segment", str(sweep), "--out", str(folder))
    vertices = plyfile.PlyData.read(str(folder / "sweep.ply"))["vertex"]
    colours = numpy.stack([vertices[name] for name in ("red", "green", "blue")], 1)
    return (colours == GROUND).all(1), float(re.search(r"([0-9.]+) ms", said)[1])


def mount_height(sweep):
    facts = json.loads(sweep.with_suffix(".json").read_text())
    return facts["sensor_pose"]["position_m"][2]


def patchwork(points, height):
    parameters = pypatchworkpp.Parameters()
    # The sweep has no intensity, by which it tells reflected noise.
    parameters.enable_RNR = False
    # It has to be told the true height; ours finds it.
    parameters.sensor_height = height
    segmenter = pypatchworkpp.patchworkpp(parameters)
    cloud = numpy.column_stack([points, numpy.zeros(len(points))])
    # As with ours, the second run finds the memory of the first.
    segmenter.estimateGround(cloud)
    started = time.perf_counter()
    segmenter.estimateGround(cloud)
    time_ms = 1e3 * (time.perf_counter() - started)
    ground = numpy.zeros(len(points), bool)
    ground[segmenter.getGroundIndices()] = True
    return ground, time_ms


def height_over_ground(points, is_ground):
    """The height over the nearest ground that was seen, or else over the lowest."""
    ground = points[is_ground].astype(numpy.float64)
    flat = numpy.column_stack([ground[:, :2], numpy.zeros(len(ground))])
    tree = open3d.core.nns.NearestNeighborSearch(open3d.core.Tensor(flat))
    tree.knn_index()
    at = numpy.column_stack([points[:, :2].astype(numpy.float64), numpy.zeros(len(points))])
    nearest = tree.knn_search(open3d.core.Tensor(at), 1)[0].numpy().ravel()
    return points[:, 2] - ground[nearest, 2]


def as_set(points):
    return frozenset(map(tuple, points.astype(numpy.float32).tolist()))


def run(*arguments):
    done = subprocess.run(
        [os.environ["EDGEPUCK_PROGRAM"], *arguments], capture_output=True, text=True
    )
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}\n{done.stdout}{done.stderr}")
    return done.stderr


main()
