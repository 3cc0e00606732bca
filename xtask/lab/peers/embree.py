"""Casts rays with Open3D's RaycastingScene (Embree) for `cargo xtask bench`.

Reads one JSON request a line, answers with one JSON object a line:

{"mesh": [VERTICES.npy, TRIANGLES.npy]}   f32 [v, 3], u32 [t, 3]: builds a scene
{"rays": RAYS.npy, "copies": N, "as": KEY}  f32 [n, 6], to be cast N times over
{"cast": KEY}                             casts all copies once
{"answers": RANGES.npy, "of": KEY}        writes f32 [n], infinite where missed

Each answer holds `wall_s` and `cpu_s`, the latter of all threads.
"""

import json
import sys
import time

import numpy
import open3d


class Peer:
    def __init__(self):
        self.scene = None
        self.rays = {}
        self.first_copy = {}

    def mesh(self, vertices_file, triangles_file):
        vertices = open3d.core.Tensor(numpy.load(vertices_file))
        triangles = open3d.core.Tensor(numpy.load(triangles_file))

        def build():
            self.scene = open3d.t.geometry.RaycastingScene()
            self.scene.add_triangles(vertices, triangles)
            # Embree builds when the first ray asks.
            self.scene.cast_rays(open3d.core.Tensor(numpy.ones((1, 6), numpy.float32)))

        return timed(build)

    def aim(self, rays_file, copies, key):
        rays = numpy.load(rays_file)
        self.first_copy[key] = len(rays)
        self.rays[key] = open3d.core.Tensor(numpy.tile(rays, (copies, 1)))
        return timed(lambda: None)

    def cast(self, key):
        return timed(lambda: self.scene.cast_rays(self.rays[key]))

    def answers(self, ranges_file, key):
        rays = self.rays[key][: self.first_copy[key]]
        ranges = self.scene.cast_rays(rays)["t_hit"].numpy()
        numpy.save(ranges_file, ranges)
        return timed(lambda: None)


def timed(work):
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}


def main():
    peer = Peer()
    print(json.dumps({"open3d": open3d.__version__, "numpy": numpy.__version__}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        if "mesh" in request:
            answer = peer.mesh(*request["mesh"])
        elif "rays" in request:
            answer = peer.aim(request["rays"], request["copies"], request["as"])
        elif "cast" in request:
            answer = peer.cast(request["cast"])
        else:
            answer = peer.answers(request["answers"], request["of"])
        print(json.dumps(answer), flush=True)


main()
