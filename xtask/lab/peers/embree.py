"""Casts rays with Embree for `cargo xtask bench`: with Open3D's RaycastingScene, on all
cores, and with embreex, which calls Embree directly, on one.

Reads one JSON request a line, answers with one JSON object a line:

{"mesh": [VERTICES.npy, TRIANGLES.npy]}   f32 [v, 3], u32 [t, 3]: builds the scenes
{"rays": RAYS.npy, "copies": N}             f32 [n, 6], to be cast N times over
{"cast": "open3d" or "embreex"}             casts all copies once
{"answers": RANGES.npy, "of": as for cast}  writes f32 [n], infinite where missed

Each answer holds `wall_s` and `cpu_s`, the latter of all threads.
"""

import importlib.metadata
import json
import sys
import time

import numpy
import open3d
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

# What embreex answers where a ray misses, and more.
FARTHEST = 1e30


class Peer:
    def __init__(self):
        self.scene = None
        self.direct_scene = None
        self.rays = None
        self.prepared = {}

    def mesh(self, vertices_file, triangles_file):
        vertices, triangles = numpy.load(vertices_file), numpy.load(triangles_file)
        self.direct_scene = EmbreeScene()
        TriangleMesh(self.direct_scene, vertices, triangles.astype(numpy.int32))

        def build():
            self.scene = open3d.t.geometry.RaycastingScene()
            self.scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles))
            # Embree builds when the first ray asks.
            self.scene.cast_rays(open3d.core.Tensor(numpy.ones((1, 6), numpy.float32)))

        cost = timed(build)
        self.ranges("embreex", numpy.ones((1, 6), numpy.float32))
        return cost

    def aim(self, rays_file, copies):
        self.rays = numpy.load(rays_file)
        rays = numpy.tile(self.rays, (copies, 1))
        self.prepared = {rival: prepared(rival, rays) for rival in RIVALS}
        return timed(lambda: None)

    def run(self, rival, rays):
        if rival == "open3d":
            return self.scene.cast_rays(rays)["t_hit"]
        return self.direct_scene.run(*rays, query="DISTANCE")

    def cast(self, rival):
        return timed(lambda: self.run(rival, self.prepared[rival]))

    def ranges(self, rival, rays):
        found = self.run(rival, prepared(rival, rays))
        found = found.numpy() if rival == "open3d" else found
        return numpy.where(found < FARTHEST, found, numpy.float32(numpy.inf))

    def answers(self, ranges_file, rival):
        numpy.save(ranges_file, self.ranges(rival, self.rays))
        return timed(lambda: None)


RIVALS = ["open3d", "embreex"]


def prepared(rival, rays):
    """Rays as the rival takes them."""
    if rival == "open3d":
        return open3d.core.Tensor(rays)
    return numpy.ascontiguousarray(rays[:, :3]), numpy.ascontiguousarray(rays[:, 3:])


def timed(work):
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}


def main():
    peer = Peer()
    versions = {name: importlib.metadata.version(name) for name in [*RIVALS, "numpy"]}
    print(json.dumps(versions), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        if "mesh" in request:
            answer = peer.mesh(*request["mesh"])
        elif "rays" in request:
            answer = peer.aim(request["rays"], request["copies"])
        elif "cast" in request:
            answer = peer.cast(request["cast"])
        else:
            answer = peer.answers(request["answers"], request["of"])
        print(json.dumps(answer), flush=True)


main()
