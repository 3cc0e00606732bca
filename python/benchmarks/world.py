"""How fast moving scenes are cast, beside MuJoCo, MuJoCo-LiDAR and Open3D.

    python python/benchmarks/world.py [--rows tori,poses,environments,move,build] [--rounds 9] [--small]

- `tori`: 20 moving tori of 10,000 triangles and a floor, moved before each turn of a VLP-32C;
- `poses`: 4,096 poses of a 2-D scanner of 359 rays in a room of 50,000 triangles;
- `environments`: 1,024 environments of 2,048 rays, in each of which 8 objects stand elsewhere;
- `move`: a turn of a VLP-32C alone, and after a move of 100 objects;
- `build`: what it takes to make tori of 0.5, 5 and 10 million triangles ready to be cast, on one thread, and the
  most memory that this takes beside the arrays, each in a process of its own, in 3 rounds at most (Linux).

In each round, the programs take turns on the same poses and rays. The figures are medians of the rounds: milliseconds
of the wall clock, and rays per CPU-second, which counts all threads; then the medians of the ratios of Edgepuck's rays
per CPU-second to those of each other program. Programs that are not installed are left out. `--small` casts a tenth.
"""

import argparse
import importlib.util
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import edgepuck as ep

THREADS = 2
# The pose of a sensor, 1 m high: x, y, z and a quaternion x, y, z, w.
AT = np.array([0.0, 0, 1, 0, 0, 0, 1])
HAS = {name: importlib.util.find_spec(name) is not None for name in ("mujoco", "mujoco_lidar", "open3d")}
Cast = Callable[[int], object]


def torus(n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """A torus of radii 0.5 and 0.2 m, of n x m quadrilaterals."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    radius = 0.5 + 0.2 * np.cos(v)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), 0.2 * np.sin(v)], -1).reshape(-1, 3)
    at = np.arange(n * m).reshape(n, m)
    a, b, c, d = at, np.roll(at, -1, 0), np.roll(at, (-1, -1), (0, 1)), np.roll(at, -1, 1)
    return vertices, np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in [(a, b, c), (a, c, d)]])


def room(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A room of 20 m by 20 m by 4 m whose six sides have n x n quadrilaterals with bumps of up to 0.2 m."""
    rng, sides = np.random.default_rng(1), []
    for axis in range(3):
        for end in (-1, 1):
            heights = rng.uniform(-0.2, 0, (n + 1, n + 1))
            heights[[0, -1]] = heights[:, [0, -1]] = 0
            vertices, faces = ep.heightfield(heights, cell=2 / n, origin=(-1, -1, 0))
            size = np.roll([10.0, 10.0, 2.0], -axis)
            across = vertices[:, 0] * size[1], vertices[:, 1] * size[2], end * (size[0] + vertices[:, 2])
            sides.append((np.roll(np.stack([across[2], across[0], across[1]], -1), axis, 1), faces))
    first = np.cumsum([0, *(len(vertices) for vertices, _ in sides[:-1])])
    faces = np.concatenate([faces + at for at, (_, faces) in zip(first, sides, strict=True)])
    return np.concatenate([vertices for vertices, _ in sides]), faces


def uniform(azimuths: int, elevations: int) -> ep.Sensor:
    """A sensor of evenly spaced beams, between 30 degrees below and above the horizon if there are many rows."""
    half = 30 if elevations > 1 else 0
    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder, "uniform.toml")
        profile.write_text(
            f'name = "uniform"\n[range]\nmax_m = 100\n[uniform]\nazimuth_from_deg = -180\n'
            f"azimuth_to_deg = {180 - 360 / azimuths}\nazimuth_steps = {azimuths}\n"
            f"elevation_from_deg = {-half}\nelevation_to_deg = {half}\nelevation_steps = {elevations}\n"
        )
        return ep.Sensor(profile)


def around(rng: np.random.Generator, *shape: int, most: float = 15.0) -> np.ndarray:
    """Poses [..., 7], turned at random, 2 m to `most` metres away from the origin and 0.3 to 1.7 m high."""
    away, angle = rng.uniform(2, most, shape), rng.uniform(0, 2 * np.pi, shape)
    at = np.stack([away * np.cos(angle), away * np.sin(angle), rng.uniform(0.3, 1.7, shape)], -1)
    quaternions = rng.normal(size=(*shape, 4))
    return np.concatenate([at, quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)], -1)


def level(rng: np.random.Generator, n: int, most: float, height: float) -> np.ndarray:
    """Level poses [n, 7] at this height, within a square of twice `most` metres."""
    half, found = rng.uniform(0, np.pi, n), np.zeros((n, 7))
    found[:, :2], found[:, 2] = rng.uniform(-most, most, (n, 2)), height
    found[:, 6], found[:, 5] = np.cos(half), np.sin(half)
    return found


def turned(vectors: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Vectors [n, 3], turned by the quaternion of a pose."""
    across = 2 * np.cross(pose[3:6], vectors)
    return vectors + pose[6] * across + np.cross(pose[3:6], across)


class Muj:
    """Meshes that move in MuJoCo, as mocap bodies, and a floor."""

    def __init__(self, mesh: tuple[np.ndarray, np.ndarray], n: int) -> None:
        import mujoco

        self.mujoco, spec = mujoco, mujoco.MjSpec()
        spec.add_mesh(
            name="mesh",
            uservert=mesh[0].ravel(),
            userface=mesh[1].ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[100, 100, 1])
        spec.worldbody.add_site(name="lidar", pos=[0, 0, 1])
        for _ in range(n):
            spec.worldbody.add_body(mocap=True).add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def move(self, poses: np.ndarray) -> None:
        self.data.mocap_pos[:], self.data.mocap_quat[:] = poses[:, :3], poses[:, [6, 3, 4, 5]]
        self.mujoco.mj_kinematics(self.model, self.data)

    def cast(self, point: np.ndarray, directions: np.ndarray) -> np.ndarray:
        n = len(directions)
        geoms, ranges = np.empty(n, np.int32), np.empty(n)
        vectors = np.ascontiguousarray(directions).ravel()
        self.mujoco.mj_multiRay(self.model, self.data, point, vectors, None, 1, -1, geoms, ranges, None, n, 100.0)
        return np.where(geoms < 0, np.inf, ranges)


def floor() -> tuple[np.ndarray, np.ndarray]:
    return np.array([[-100.0, -100, 0], [100, -100, 0], [100, 100, 0], [-100, 100, 0]]), np.array(
        [[0, 1, 2], [0, 2, 3]]
    )


def open3d_scene(meshes: list[tuple[np.ndarray, np.ndarray]]):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=THREADS)
    for vertices, faces in meshes:
        scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    return scene


def open3d_cast(scene, rays: np.ndarray, threads: int) -> np.ndarray:
    import open3d

    return scene.cast_rays(open3d.core.Tensor(rays), nthreads=threads)["t_hit"].numpy()


def rays_from(sensors: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Rays as Open3D takes them, [n * n_beams, 6]."""
    origins = np.repeat(sensors[:, :3], len(directions), axis=0)
    return np.hstack([origins, np.vstack([turned(directions, pose) for pose in sensors])]).astype(np.float32)


def moved(mesh: tuple[np.ndarray, np.ndarray], pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return turned(mesh[0], pose) + pose[:3], mesh[1]


def row_tori(rounds: int, share: float) -> None:
    n, sensor, mesh = 20, ep.Sensor("vlp32c"), torus(100, 50)
    steps = around(np.random.default_rng(2), rounds + 1, n)
    scene, shape = ep.Scene(), ep.Mesh(*mesh)
    scene.add(ep.Mesh(*floor(), units="m"))
    tori = [scene.add(shape) for _ in range(n)]

    def edgepuck(i: int) -> np.ndarray:
        scene.move(tori, steps[i])
        return scene.cast(sensor, AT[None]).ranges[0]

    casts: dict[str, Cast] = {"edgepuck": edgepuck}
    if HAS["mujoco"]:
        world = Muj(mesh, n)

        def mujoco(i: int) -> np.ndarray:
            world.move(steps[i])
            return world.cast(AT[:3], sensor.directions)

        casts["mj_multiRay"] = mujoco
    if HAS["mujoco_lidar"]:
        from mujoco_lidar import MjLidarWrapper

        x, y, z = sensor.directions.T
        theirs, theta, phi = MjLidarWrapper(world.model, "lidar", "cpu"), np.arctan2(y, x), np.arcsin(z)

        def mujoco_lidar(i: int) -> np.ndarray:
            world.move(steps[i])
            ranges = theirs.trace_rays(world.data, theta, phi)
            return np.where(ranges < 0, np.inf, ranges)

        casts["MuJoCo-LiDAR, CPU"] = mujoco_lidar
    if HAS["open3d"]:
        rays = rays_from(AT[None], sensor.directions)
        build = lambda i: open3d_scene([floor(), *(moved(mesh, pose) for pose in steps[i])])  # noqa: E731
        built = build(0)
        open3d_cast(built, rays[:9], THREADS)
        casts["Open3D, not moved"] = lambda i: open3d_cast(built, rays, 1)
        casts["Open3D, rebuilt"] = lambda i: open3d_cast(build(i), rays, 1)
    measure("tori: 20 moving tori of 10,000 triangles and a floor, VLP-32C", casts, len(sensor.directions), rounds)


def row_poses(rounds: int, share: float) -> None:
    n, sensor, mesh = int(4096 * share), uniform(359, 1), room(65)
    sensors, scene = level(np.random.default_rng(3), n, 8.0, 0.0), ep.Scene()
    scene.add(ep.Mesh(*mesh, units="m"))
    casts: dict[str, Cast] = {"edgepuck": lambda i: scene.cast(sensor, sensors).ranges}
    if HAS["open3d"]:
        built, rays = open3d_scene([mesh]), rays_from(sensors, sensor.directions)
        casts["Open3D"] = lambda i: open3d_cast(built, rays, THREADS)
    measure(f"poses: {n} poses of 359 rays, a room of {len(mesh[1])} triangles", casts, n * 359, rounds)


def row_environments(rounds: int, share: float) -> None:
    n, n_moving, sensor, mesh = int(1024 * share), 8, uniform(128, 16), torus(20, 10)
    rng, scene, shape = np.random.default_rng(4), ep.Scene(), ep.Mesh(*mesh)
    scene.add(ep.Mesh(*floor(), units="m"))
    moving = [scene.add(shape) for _ in range(n_moving)]
    sensors, of_each = level(rng, n, 1.0, 1.0), around(rng, n, n_moving)
    n_rays = len(sensor.directions)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    batch = scene.cast(sensor, sensors, move=(moving, of_each))
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    results = batch.ranges.nbytes + batch.object.nbytes
    casts: dict[str, Cast] = {"edgepuck": lambda i: scene.cast(sensor, sensors, move=(moving, of_each)).ranges}
    if HAS["mujoco"]:
        world = Muj(mesh, n_moving)

        def mujoco(i: int) -> np.ndarray:
            found = np.empty((n, n_rays))
            for e in range(n):
                world.move(of_each[e])
                found[e] = world.cast(sensors[e, :3], turned(sensor.directions, sensors[e]))
            return found

        casts["mj_multiRay"] = mujoco
    measure(f"environments: {n} of {n_rays} rays and {n_moving} moving objects", casts, n * n_rays, rounds)
    print(
        f"  the first batch raised the peak of the memory by {grown / n:.0f} bytes an environment; {results / n:.0f} are results"
    )


def row_move(rounds: int, share: float) -> None:
    sensor, shape, n = ep.Sensor("vlp32c"), ep.Mesh(*torus(20, 10)), 100
    steps, scene, at = around(np.random.default_rng(5), rounds + 1, n, most=40.0), ep.Scene(), np.eye(4)
    at[:3, 3] = AT[:3]
    scene.add(ep.Mesh(*floor(), units="m"))
    objects = [scene.add(shape) for _ in range(n)]

    def both(i: int) -> object:
        scene.move(objects, steps[i])
        return scene.scan(sensor, pose=at)

    casts = {"move and scan": both, "scan alone": lambda i: scene.scan(sensor, pose=at)}
    measure("move: 100 objects, VLP-32C", casts, len(sensor.directions), rounds)


def build_one(program: str, n: int) -> None:
    """Build a torus of n triangles, and print the CPU-seconds and the bytes that it took at most."""
    vertices, faces = torus(n // 4000, 2000)
    sensor, ray = uniform(2, 1), np.array([[5.0, 0, 0, -1, 0, 0]], np.float32)
    if program == "edgepuck":
        vertices, faces = np.ascontiguousarray(vertices), faces.astype(np.int32)
    else:
        import open3d

        vertices, faces = vertices.astype(np.float32), faces.astype(np.uint32)
        open3d_cast(open3d_scene([floor()]), ray, 1)
    # The peak starts anew: to make the arrays took memory, too.
    Path("/proc/self/clear_refs").write_text("5")
    before, start = held("VmRSS"), time.process_time()
    if program == "edgepuck":
        scene = ep.Scene()
        scene.add(ep.Mesh(vertices, faces, units="m"))
        scene.cast(sensor, AT[None])
    else:
        scene = open3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(vertices, faces)
        open3d_cast(scene, ray, 1)
    print(time.process_time() - start, held("VmHWM") - before)


def held(what: str) -> int:
    """The bytes of memory that this process holds (VmRSS), or held at most (VmHWM)."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split(f"{what}:")[1].split()[0])


def row_build(rounds: int, share: float) -> None:
    programs = ["edgepuck", *(["Open3D"] if HAS["open3d"] else [])]
    for n in (int(share * 1e6 * millions) for millions in (0.5, 5, 10)):
        took = {program: [] for program in programs}
        for _ in range(min(rounds, 3)):
            for program in programs:
                command = [sys.executable, __file__, f"--build={program},{n}"]
                said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                took[program].append([float(word) for word in said.split()])
        print(f"build: a torus of {n / 1e6:g} million triangles, one thread")
        for program in programs:
            seconds, most = np.median(took[program], axis=0)
            print(f"  {program:20} {seconds:9.2f} CPU-s {most / 1e9:8.2f} GB at most", flush=True)


def measure(title: str, casts: dict[str, Cast], n_rays: int, rounds: int) -> None:
    """Let the casts take turns; print the medians, and the ratios to the first."""
    first = {name: cast(0) for name, cast in casts.items()}
    wall, cpu = ({name: [] for name in casts} for _ in range(2))
    for i in range(1, rounds + 1):
        for name, cast in casts.items():
            start, used = time.perf_counter(), time.process_time()
            cast(i)
            wall[name].append(time.perf_counter() - start)
            cpu[name].append(time.process_time() - used)
    print(title)
    ours, *others = casts
    for name in casts:
        milliseconds, rate = 1e3 * statistics.median(wall[name]), n_rays / statistics.median(cpu[name])
        line = f"  {name:20} {milliseconds:9.2f} ms {rate / 1e6:8.2f} M rays per CPU-second"
        if name in others:
            line += f"   {ours}: {statistics.median(np.divide(cpu[name], cpu[ours])):.2f} times as many"
            if isinstance(first[ours], np.ndarray):
                line += f"; {agreement(np.ravel(first[ours]), np.ravel(first[name]))}"
        print(line, flush=True)


def agreement(ours: np.ndarray, theirs: np.ndarray) -> str:
    """How the ranges of the first step agree."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    off = np.abs(ours[both].astype(np.float64) - theirs[both])
    return f"{(np.isfinite(ours) == np.isfinite(theirs)).mean():.2%} hit alike, 99 % within {1e3 * np.quantile(off, 0.99):.3g} mm"


ROWS = {"tori": row_tori, "poses": row_poses, "environments": row_environments, "move": row_move, "build": row_build}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", default=",".join(ROWS), help="the rows to measure, by default all of them")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--small", action="store_true", help="cast a tenth of the poses and environments")
    parser.add_argument("--build", help=argparse.SUPPRESS)
    words = parser.parse_args()
    if words.build:
        ep.set_num_threads(1)
        program, n = words.build.split(",")
        return build_one(program, int(n))
    names = words.rows.split(",")
    for name in names:
        if name not in ROWS:
            parser.error(f"--rows: expected some of {', '.join(ROWS)}, found {name}")
    if len(names) == 1:
        ep.set_num_threads(THREADS)
        ROWS[names[0]](words.rounds, 0.1 if words.small else 1.0)
        return
    # Each in a process of its own, whose peak of memory is that of the row.
    flags = [f"--rounds={words.rounds}", *(["--small"] if words.small else [])]
    for name in names:
        subprocess.run([sys.executable, __file__, f"--rows={name}", *flags], check=True)


if __name__ == "__main__":
    main()
