"""Times PointNet++ and DGCNN in ONNX Runtime beside Edgepuck's networks, on one thread.

    pip install -r requirements.txt ../../../../python
    python sets.py CLOUDS.npz

CLOUDS.npz is a packed set of clouds of 1,024 points, of which the first 32 are classified. The
weights of PointNet++ and DGCNN are random: their classes mean nothing, but their logits must be
those of a plain forward pass before anything is measured. Networks take turns on the same clouds.
A time is the median over the rounds of the median over the clouds, from points to logits. ONNX
Runtime has no farthest point sampling: fpsample's is part of the times of networks that need it,
and also has a row of its own. Multiplications are those of layers, without those of distances.
"""

import argparse
import itertools
import json
import statistics
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

try:
    import edgepuck
    import fpsample
    import numpy
    import onnxruntime
    import published
    import turns
except ImportError as error:
    requirements = Path(__file__).with_name("requirements.txt")
    sys.exit(f"{error}: pip install -r {requirements} ./python")

N_CLOUDS = 32
I16_SCALE = 32767

# The depth of its tree that fpsample's makers advise for small clouds.
TREE_HEIGHT = 3

# Parts of the largest logit. Roundings of a sum of k terms add up to about sqrt(k) 2^-24 of the
# terms' magnitude (Higham and Mary 2019): PointNet++ has 12 layers of up to 1,024 terms, 6.6e-6.
ROUNDED = 1e-5
# DGCNN takes one neighbour for another if their distances differ by less than their rounding. On
# real clouds that moves logits by up to 3e-4; 19 neighbours instead of 20 move them by 1.5e-2.
EXCHANGED = 2e-3

OURS = ("set-64", "edge-64")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clouds", metavar="CLOUDS.npz", type=Path)
    parser.add_argument("--rounds", type=int, default=9, help="turns of each [default: 9]")
    args = parser.parse_args()
    if args.rounds < 1:
        parser.error(f"--rounds: expected at least 1, found {args.rounds}")
    clouds = first_clouds(args.clouds)
    rows = ours() | theirs(clouds[0])
    ms = in_turns({name: run for name, (run, _) in rows.items()}, clouds, args.rounds)
    print("| network | parameters | MMACs | ms | times set-64's |\n|---|---|---|---|---|")
    for name, (_, size) in rows.items():
        sizes = f"{size[0]:,} | {size[1] / 1e6:,.0f}" if size else " | "
        print(f"| {name} | {sizes} | {ms[name]:.2f} | {ms[name] / ms['set-64']:.2f} |")
    packages = ("edgepuck", "onnxruntime", "fpsample", "numpy")
    versions = ", ".join(f"{package} {version(package)}" for package in packages)
    print(f"\n{turns.processor()}, one thread; {versions}")


def first_clouds(file):
    """The first clouds [n, 3] of a packed set, in the unit sphere."""
    try:
        with numpy.load(file) as arrays:
            scaled = "points_i16" in arrays
            points = arrays["points_i16" if scaled else "points"][:N_CLOUDS].astype(float)
    except OSError as error:
        sys.exit(str(error))
    except Exception:
        sys.exit(f"{file}: expected an NPZ file with numbers `points` or `points_i16`, found none")
    n_points = published.N_POINTS
    if points.shape[1:] != (n_points, 3) or not len(points):
        sys.exit(f"{file}: expected points [clouds, {n_points}, 3], found {list(points.shape)}")
    points /= I16_SCALE if scaled else 1
    points -= points.mean(1, keepdims=True)
    radii = numpy.linalg.norm(points, axis=2).max(1)
    for i in numpy.flatnonzero(~(numpy.isfinite(radii) & (radii > 0))):
        sys.exit(f"{file}: cloud {i}: expected finite points that are not all the same")
    return list((points / radii[:, None, None]).astype(numpy.float32))


def ours():
    """Rows of the table: what classifies a cloud, and its numbers of parameters and of MACs."""
    rows = {}
    for name in OURS:
        told = json.loads(edgepuck_program("inspect", name, "--json"))
        macs = told["macs_per_point"] * told["points"] + told["macs_per_cloud"]
        size = told["parameters"], macs
        rows[name] = edgepuck.Classifier(name), size
        rows[f"{name}, int8"] = edgepuck.Classifier(name, precision="i8"), size
    return rows


def theirs(cloud):
    """Rows of the published networks, once each agrees with its plain forward pass on `cloud`."""
    net = published
    n_centres = net.LEVELS["sa1"][0]

    def row(graph, inputs, expected, tolerance, network):
        run = in_onnx_runtime(graph.SerializeToString(), inputs)
        apart = numpy.abs(run(cloud) - expected).max() / numpy.abs(expected).max()
        # A NaN agrees with nothing.
        if not apart <= tolerance:
            wanted = f"expected logits within {tolerance} of a plain pass's"
            sys.exit(f"{graph.graph.name}: {wanted}, found {apart:.1e}")
        return run, net.size(network)

    def of_sets(cloud):
        return {"points": cloud, "centres": farthest(cloud, n_centres)}

    def of_edges(cloud):
        return {"points": cloud}

    layers = net.layers(net.POINTNET2)
    expected = net.pointnet2(layers, **of_sets(cloud))
    graph = net.pointnet2_graph(layers)
    rows = {
        "PointNet++ (SSG)": row(graph, of_sets, expected, ROUNDED, net.POINTNET2),
        f"its {n_centres} farthest points alone": (of_sets, None),
    }
    layers = net.layers(net.DGCNN)
    expected = net.dgcnn(layers, **of_edges(cloud))
    for name, edge, network in (
        ("DGCNN", net.edge_of_pairs, net.DGCNN),
        ("DGCNN, layers before neighbours", net.edge_of_points, net.DGCNN_OF_POINTS),
    ):
        graph = net.dgcnn_graph(layers, edge)
        rows[name] = row(graph, of_edges, expected, EXCHANGED, network)
    return rows


def in_onnx_runtime(model, inputs):
    """What computes the logits of a cloud, which `inputs` turns into the model's inputs."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return lambda cloud: session.run(None, inputs(cloud))[0][0]


def farthest(cloud, keep):
    return cloud[fpsample.bucket_fps_kdline_sampling(cloud, keep, h=TREE_HEIGHT, start_idx=0)]


def in_turns(runs, clouds, rounds):
    """Milliseconds for a cloud, of each."""
    medians = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            turn = itertools.cycle(clouds)
            costs = turns.timed(lambda: run(next(turn)), len(clouds))
            medians[name].append(statistics.median(cost["wall_s"] for cost in costs) * 1e3)
    return {name: statistics.median(ms) for name, ms in medians.items()}


def edgepuck_program(*words):
    command = [sys.executable, "-m", "edgepuck", *words]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr.strip())
    return done.stdout


main()
