"""Open3D's DBSCAN, PCL's Euclidean clusters and Patchwork++, against `detect --segment-only`.

Every point of a simulated street sweep carries the number of the object that it lies on, 0 for
the ground, so that grounds and clusters are judged by the truth. Labelled sweeps of real sensors,
where the developers have them, judge the clusters of boxes. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import json
import re
import shutil
import time

from peer import OUT, ROOT, edgepuck, run, skipped_if_missing

with skipped_if_missing("(Debian: apt-get install libusb-1.0-0 libgomp1; Python 3.11)"):
    import numpy
    import open3d
    import plyfile
    import pypatchworkpp

N_SWEEPS = 12
RADII_M = [0.2, 0.5, 1.0]
# `detect --segment-only` writes clusters of at least this many points.
MIN_POINTS = 10
COLOURS = json.loads((ROOT / "assets/view/colours.json").read_text())
GROUND = list(bytes.fromhex(COLOURS["classes"]["ground"].removeprefix("#")))
# Both count what is lower for ground, whatever it is part of: Patchwork++ 0.125 m (th_dist),
# `detect --segment-only` 0.2 m.
CLEARANCE_M = 0.3
# Farther away a VLP-32C sees hardly any ground; Patchwork++'s own benchmark ends at 80 m.
MAX_RANGE_M = 60.0


# Clusters are judged by objects of so many points.
MIN_OBJECT = 30
# Of Open3D and PCL, which have one radius for all distances, the best of these is shown.
CLUSTER_RADII_M = [0.3, 0.5, 0.7, 1.0]
# Boxes are drawn tightly, and the ground is in them: points near their sides and bottoms are
# nobody's. As in infer-cpu/segment/tests/suite/frames.rs.
MARGIN_M, FEET_M, MAX_BOX_RANGE_M = 0.3, 0.25, 40.0
NOBODYS = -1


def main():
    edgepuck("gen-scenes", "--sweeps", N_SWEEPS, "--save", N_SWEEPS, "--seed", 2718,
             "--adapter", "cpu", "--out", OUT / "street")
    sweeps = sorted((OUT / "street/sweeps").glob("*.npz"))
    assert len(sweeps) == N_SWEEPS, sweeps
    for radius in RADII_M:
        compare_components(sweeps[0], radius)
    compare_ground(sweeps)
    ours, theirs = compare_clusters("simulated street", [simulated(sweep) for sweep in sweeps])
    assert ours <= theirs, "one radius for all distances is better"
    real = sorted((ROOT.parent / "shared/data/real_frames").glob("*.npz"))
    if real:
        compare_components(as_sweep(real_frame(real[0])), 0.5)
        compare_clusters("real sweeps with boxes", [real_frame(path) for path in real])
    else:
        print("labelled sweeps of real sensors are not here")


def compare_components(sweep, radius):
    """Both find the same sets of points."""
    folder = OUT / f"components-{radius}"
    edgepuck("detect", sweep, "--segment-only", "--radius", radius, "--overwrite", "--out", folder)
    ours = {as_set(numpy.load(file)) for file in folder.glob("cluster-*.npy")}
    loaded = numpy.load(sweep)
    points = (loaded if sweep.suffix == ".npy" else loaded["positions"]).astype(numpy.float64)
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
    f1 = 200 * found[:, 0] / (found.sum(axis=1) + kept[:, 1] - kept[:, 0])
    found, kept = (100 * counts[:, 0] / counts[:, 1] for counts in (found, kept))
    for name, ground, objects, both in zip(names, found, kept, f1):
        print(f"{name}: {ground:.2f} % of the ground found, {objects:.2f} % of objects kept, "
              f"F1 of the ground {both:.2f} %")
    ours, theirs = numpy.median(times_ms, axis=1)
    print(f"a sweep: ground and clusters {ours:.1f} ms, ground by Patchwork++ {theirs:.1f} ms")
    assert (found + kept)[0] >= (found + kept)[1]
    assert min(found[0], kept[0]) > 97


def our_ground(sweep):
    folder = OUT / "clusters"
    said = edgepuck("detect", sweep, "--segment-only", "--overwrite", "--out", folder).stderr
    vertices = plyfile.PlyData.read(str(folder / "sweep.ply"))["vertex"]
    colours = numpy.stack([vertices[name] for name in ("red", "green", "blue")], 1)
    return (colours == GROUND).all(1), float(re.search(r"([0-9.]+) ms", said)[1])


def simulated(sweep):
    """A sweep's file, its points, and the object of each."""
    scan = numpy.load(sweep)
    return sweep, scan["positions"].astype(numpy.float32), scan["object"].ravel().astype(int)


def real_frame(path):
    """The same of a labelled sweep: 1, 2, ... in boxes, 0 elsewhere."""
    frame = numpy.load(path)
    # The mean of Argoverse's two sensors over the rear axle.
    sensor = [1.35, 0, 1.6] if path.stem.startswith("argoverse") else [0, 0, 0]
    points = (frame["xyz_mm"].astype(float) / 1e3 - sensor).astype(numpy.float32)
    objects = numpy.zeros(len(points), int)
    for number, (*centre, length, width, height, yaw) in enumerate(frame["boxes"].astype(float), 1):
        offset = points - (numpy.array(centre) - sensor)
        along = numpy.abs(numpy.cos(yaw) * offset[:, 0] + numpy.sin(yaw) * offset[:, 1])
        across = numpy.abs(numpy.cos(yaw) * offset[:, 1] - numpy.sin(yaw) * offset[:, 0])
        inside = [(along <= length / 2 + margin) & (across <= width / 2 + margin)
                  & (numpy.abs(offset[:, 2]) <= height / 2 + margin) for margin in (0, MARGIN_M)]
        body = inside[0] & (offset[:, 2] >= FEET_M - height / 2)
        objects[inside[1] & (objects == 0)] = NOBODYS
        far = numpy.hypot(*(centre - numpy.array(sensor))[:2]) > MAX_BOX_RANGE_M
        objects[body] = NOBODYS if far else number
    return OUT / f"{path.stem}.npy", points, objects


def as_sweep(frame):
    file, points, _ = frame
    if file.suffix == ".npy":
        numpy.save(file, points)
    return file


def compare_clusters(data, frames):
    """Entropies of over- and under-segmentation, and times, of all on the same points. Gives the
    sums of both entropies, ours and the best radius's."""
    ours, rivals, times_ms = [], {radius: [] for radius in CLUSTER_RADII_M}, []
    lost = numpy.zeros(3)
    for file, points, objects in frames:
        ground, our_ms = our_ground(as_sweep((file, points, objects)))
        patchworks, _ = patchwork(points, mount_height(file))
        lost += [(mask & (objects > 0)).sum() for mask in (ground, patchworks, objects > 0)]
        ours.append(entropies(our_labels(points), objects))
        upright, labels = points[~ground].astype(float), numpy.full(len(points), -1)
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(upright))
        for radius in CLUSTER_RADII_M:
            started = time.perf_counter()
            labels[~ground] = numpy.asarray(cloud.cluster_dbscan(eps=radius, min_points=1))
            rival_ms = 1e3 * (time.perf_counter() - started)
            rivals[radius].append(entropies(large(labels), objects))
            if radius == 0.5:
                times_ms.append([our_ms, rival_ms, pcl_ms(cloud, radius, labels[~ground])])
    best = min(rivals, key=lambda radius: numpy.concatenate(rivals[radius]).sum(axis=1).mean())
    print(f"{data}: {len(frames)} sweeps; entropies in nats, the mean of "
          f"{len(numpy.concatenate(ours))} objects")
    for name, found in [("segment", ours), (f"one radius of {best} m, without our ground",
                                            rivals[best])]:
        over, under = numpy.concatenate(found).mean(axis=0)
        print(f"  {name}: over-segmentation {over:.3f}, under-segmentation {under:.3f}")
    print(f"  of objects' points, ground by segment {100 * lost[0] / lost[2]:.2f} %, by Patchwork++ "
          f"{100 * lost[1] / lost[2]:.2f} %")
    our_ms, dbscan_ms, pcl = numpy.median(numpy.array(times_ms), axis=0)
    print(f"  a sweep: segment, ground and clusters, {our_ms:.1f} ms; clusters of 0.5 m without "
          f"the ground: Open3D's DBSCAN {dbscan_ms:.1f} ms, PCL's Euclidean {pcl:.1f} ms")
    return [numpy.concatenate(found).sum(axis=1).mean() for found in (ours, rivals[best])]


def our_labels(points):
    """The cluster of each point by the files of the clusters; -1 of those in none."""
    number_of = {}
    for number, file in enumerate(sorted((OUT / "clusters").glob("cluster-*.npy"))):
        for point in numpy.load(file).astype(numpy.float32):
            number_of[point.tobytes()] = number
    return numpy.array([number_of.get(point.tobytes(), -1) for point in points])


def large(labels):
    """Labels without those of clusters that `detect --segment-only` would not write."""
    counts = numpy.bincount(labels[labels >= 0])
    return numpy.where((labels >= 0) & (counts[labels] >= MIN_POINTS), labels, -1)


def entropies(labels, objects):
    """Of each object: the entropy of the clusters that its points are in, and that of the objects
    that its largest cluster is of (Oh et al., TRAVEL, RA-L 2022, equations 13 and 14: a frame's
    sum of either)."""
    rows = []
    for number in numpy.unique(objects[objects > 0]):
        inside = objects == number
        if inside.sum() < MIN_OBJECT:
            continue
        clusters, counts = numpy.unique(labels[inside], return_counts=True)
        largest = clusters[counts.argmax()]
        others = objects[(labels == largest) & (objects != NOBODYS)] if largest >= 0 else [number]
        rows.append([entropy(counts), entropy(numpy.unique(others, return_counts=True)[1])])
    return numpy.array(rows).reshape(-1, 2)


def entropy(counts):
    shares = counts / counts.sum()
    return -(shares * numpy.log(shares)).sum()


def pcl_ms(cloud, radius, labels):
    """How long PCL takes for the same components; not a number where it is not installed."""
    program = shutil.which("pcl_cluster_extraction")
    if program is None:
        return numpy.nan
    shutil.rmtree(OUT / "pcl", ignore_errors=True)
    (OUT / "pcl").mkdir()
    open3d.io.write_point_cloud(str(OUT / "pcl/rest.pcd"), cloud)
    said = run(program, "rest.pcd", "cluster.pcd", "-tolerance", radius, "-min", MIN_POINTS, "-max",
               len(labels), cwd=OUT / "pcl").stdout
    milliseconds, n_clusters = re.search(r"done, ([0-9.]+) ms : (\d+) clusters", said).groups()
    assert int(n_clusters) == (numpy.bincount(labels) >= MIN_POINTS).sum(), said
    return float(milliseconds)


def mount_height(sweep):
    if sweep.suffix == ".npy":
        # Of KITTI's car (Geiger et al., CVPR 2012), and of Argoverse's over its axle and wheel.
        return 1.73 if sweep.stem.startswith("kitti") else 1.6 + 0.33
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


main()
