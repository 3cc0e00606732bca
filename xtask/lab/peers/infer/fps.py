"""One way of farthest point sampling, for `cargo xtask bench infer`; `turns`
has the protocol.

fps.py ENGINE FOLDER

FOLDER holds cloud.safetensors: a cloud of N points is the first N of its
`points`. The answer is the indices that are kept, in order.
"""

import importlib.metadata
import sys
from pathlib import Path

import numpy
import turns
from safetensors.numpy import load_file

# Levels of fpsample's tree. Its makers advise 3 for small clouds, 5 for medium ones.
TREE_HEIGHTS = (3, 4, 5)


def loop(points, keep):
    """The loop of yanx27's data loader, but for its random beginning."""
    distance = numpy.full(len(points), 1e10)
    kept = numpy.zeros(keep, numpy.int32)
    farthest = 0
    for i in range(keep):
        kept[i] = farthest
        squared = numpy.sum((points - points[farthest]) ** 2, -1)
        closer = squared < distance
        distance[closer] = squared[closer]
        farthest = numpy.argmax(distance, -1)
    return kept


def fpsample(points, keep):
    from fpsample import fps_sampling

    return [lambda: fps_sampling(points, keep, start_idx=0)]


def fpsample_tree(points, keep):
    """Exact too, but begins wherever the tree puts its first point."""
    from fpsample import bucket_fps_kdline_sampling

    def of_height(h):
        return lambda: bucket_fps_kdline_sampling(points, keep, h=h, start_idx=0)

    return [of_height(h) for h in TREE_HEIGHTS]


class Sampler:
    def __init__(self, ways, points):
        self.ways = ways
        self.points = points

    def load(self, size, keep):
        cloud = numpy.ascontiguousarray(self.points[:size])
        self.run = turns.fastest(self.ways(cloud, keep))

    def answer(self, kept):
        return kept


def start(name, folder):
    points = load_file(folder / "cloud.safetensors")["points"]
    ways, package = {
        "numpy": (lambda cloud, keep: [lambda: loop(cloud, keep)], "numpy"),
        "fpsample": (fpsample, "fpsample"),
        "fpsample-tree": (fpsample_tree, "fpsample"),
    }[name]
    return Sampler(ways, points), importlib.metadata.version(package)


turns.serve(lambda: start(sys.argv[1], Path(sys.argv[2])))
