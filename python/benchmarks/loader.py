"""How fast datasets are cast as they are read, beside the program and beside Open3D.

    python python/benchmarks/loader.py [MESHES]

Prints, as medians of interleaved rounds: views a second of two forked workers, as a `DataLoader`
starts them, in a first epoch that reads the meshes and in a later one; of `edgepuck gen-dataset` on
two threads, without its writing and packing; and, if Open3D is there, of two workers that cast the
same rays at the same meshes with its RaycastingScene. Then the time of one scan of a mesh of some
10,000 triangles, in Python and in Rust.
"""

import json
import multiprocessing
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import edgepuck as ep

WORKERS, BATCH, VIEWS, POINTS, ROUNDS = 2, 64, 4, 1024, 5
# Until both workers have read all meshes.
EPOCHS = 6
FORK = multiprocessing.get_context("fork")


def serve(draw, tasks, answers) -> None:
    for indices in iter(tasks.get, None):
        answers.put(len(draw(indices)))


def rate(draw, length: int, epochs: int) -> list[float]:
    """Clouds a second in each epoch of workers that stay."""
    tasks, answers = FORK.SimpleQueue(), FORK.SimpleQueue()
    started = [FORK.Process(target=serve, args=(draw, tasks, answers)) for _ in range(WORKERS)]
    for process in started:
        process.start()
    rates = []
    for _ in range(epochs):
        start = time.perf_counter()
        batches = [range(i, min(i + BATCH, length)) for i in range(0, length, BATCH)]
        for batch in batches:
            tasks.put(batch)
        drawn = sum(answers.get() for _ in batches)
        rates.append(drawn / (time.perf_counter() - start))
    for _ in started:
        tasks.put(None)
    for process in started:
        process.join()
    return rates


def program_rate(meshes: Path) -> float:
    """Views a second of gen-dataset on as many threads, but for writing and packing."""
    with tempfile.TemporaryDirectory() as out:
        flags = ["--sensor", "vlp32c", "--views", str(VIEWS), "--adapter", "cpu", "--hash", "none", "--noise", "0.01"]
        command = [sys.executable, "-m", "edgepuck", "gen-dataset", meshes, "--out", f"{out}/d", *flags]
        start = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        elapsed = time.perf_counter() - start
        manifest = json.loads(Path(out, "d/manifest.json").read_text())
    stages = re.search(r"seconds over all threads: (.*)", done.stderr)[1].split(", ")
    seconds = {name: float(s) for name, s in (stage.rsplit(" ", 1) for stage in stages)}
    share = (seconds["write"] + seconds["pack"]) / sum(seconds.values())
    return len(manifest["meshes"]) * VIEWS / (elapsed * (1 - share))


class Open3d:
    """The same rays at the same meshes, and a cloud of as many points."""

    def __init__(self, dataset: ep.Dataset, folder: Path) -> None:
        import open3d

        self.o3d, self.dataset, self.folder, self.scenes = open3d, dataset, folder, {}
        self.directions = ep.Sensor("vlp32c").directions
        angle = np.radians(20)
        position = 3 * np.array([np.cos(angle), 0, np.sin(angle)])
        forward, left = -position / 3, np.array([0.0, -1.0, 0.0])
        rotation = np.stack([forward, left, np.cross(forward, left)])
        towards = self.directions @ rotation
        within = towards @ forward > np.cos(np.arcsin(1 / 3) + 1e-3)
        rays = np.concatenate([np.broadcast_to(position, towards.shape), towards], 1)[within]
        self.rays = rays.astype(np.float32)

    def __call__(self, indices) -> list:
        rng, clouds = np.random.default_rng(0), []
        for index in indices:
            source = self.dataset.source(index)
            if source not in self.scenes:
                mesh = self.o3d.io.read_triangle_mesh(str(self.folder / source))
                vertices = np.asarray(mesh.vertices)
                vertices = vertices - vertices.mean(axis=0)
                vertices /= np.linalg.norm(vertices, axis=1).max()
                scene = self.o3d.t.geometry.RaycastingScene(nthreads=1)
                triangles = np.asarray(mesh.triangles).astype(np.uint32)
                scene.add_triangles(vertices.astype(np.float32), triangles)
                self.scenes[source] = scene
            found = self.scenes[source].cast_rays(self.o3d.core.Tensor(self.rays), nthreads=1)
            t = found["t_hit"].numpy()
            hit = np.isfinite(t)
            ranges = t[hit] + rng.normal(0, 0.01, hit.sum())
            points = self.rays[hit, :3] + ranges[:, None] * self.rays[hit, 3:]
            points = points[rng.choice(len(points), POINTS, replace=len(points) < POINTS)]
            points -= points.mean(axis=0)
            clouds.append((points / np.linalg.norm(points, axis=1).max()).astype(np.float32))
        return clouds


def ball(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of n x 2n quadrilaterals."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1))
    x, y, z = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)
    at = np.arange((2 * n + 1) * (n + 1)).reshape(2 * n + 1, n + 1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in [(a, b, c), (a, c, d)]])
    return np.stack([x, y, z], -1).reshape(-1, 3), faces


def milliseconds_of_a_scan() -> float:
    lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*ball(50))
    ep.set_num_threads(1)
    lidar.scan(mesh, attributes=[])
    start = time.perf_counter()
    for seed in range(200):
        lidar.scan(mesh, noise=0.01, attributes=[], seed=seed)
    ep.set_num_threads(0)
    return 1e3 * (time.perf_counter() - start) / 200


def main() -> None:
    os.environ["RAYON_NUM_THREADS"] = str(WORKERS)
    with tempfile.TemporaryDirectory() as shapes:
        meshes = Path(sys.argv[1] if len(sys.argv) > 1 else shapes)
        if len(sys.argv) == 1:
            command = [sys.executable, "-m", "edgepuck", "gen-dataset", "--save-meshes", shapes]
            subprocess.run(command, check=True, capture_output=True)
        rounds: dict[str, list[float]] = {}
        for _ in range(ROUNDS):
            dataset = ep.Dataset(meshes, "vlp32c", views=VIEWS, points=POINTS, noise=0.01)
            first, *_, later = rate(lambda indices, d=dataset: d.batch(indices)[1], len(dataset), EPOCHS)
            rounds.setdefault("Dataset, first epoch", []).append(first)
            rounds.setdefault("Dataset, later epoch", []).append(later)
            rounds.setdefault("gen-dataset, without writing", []).append(program_rate(meshes))
            try:
                first, *_, later = rate(Open3d(dataset, meshes), len(dataset), EPOCHS)
            except ImportError:
                continue
            rounds.setdefault("Open3D, first epoch", []).append(first)
            rounds.setdefault("Open3D, later epoch", []).append(later)
        for name, rates in rounds.items():
            print(f"{name:32} {statistics.median(rates):8.0f} views/s")
        scans = [milliseconds_of_a_scan() for _ in range(ROUNDS)]
        print(f"{'one scan of 10,000 triangles':32} {statistics.median(scans):8.3f} ms")


if __name__ == "__main__":
    main()
