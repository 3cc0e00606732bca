"""Open3D's RaycastingScene (Embree) on identical rays and meshes, against scans.

Each mesh is scanned by `cargo xtask scan`, and its beams, aimed anew from the
sensor's profile, are cast by Embree. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

from peer import OUT, ROOT, edgepuck, skipped_if_missing

with skipped_if_missing("(Debian: apt-get install libusb-1.0-0 libgomp1; Python 3.11)"):
    import tomllib

    import numpy
    import open3d

# Objects are 1 m long and some 2 m away. Embree holds rays and vertices in f32,
# whose steps at 2 m are 2.4e-7 m, and is wrong by some of them over the cosine
# of incidence: 5e-5 m allow for 1 in 100.
TOLERANCE_M = 5e-5

# A beam is at a silhouette if one that is turned by so little meets another
# surface: 20 micrometres at 2 m. Embree's f32 turns a ray by up to 1e-7 rad.
TURN_RAD = 1e-5

POSITIONS_M = [[2.0, 0.5, 0.8], [-1.0, -2.0, 0.3]]
TARGET_M = [0.05, -0.02, 0.1]
SENSORS = ["generic-static", "vlp32c"]


def main():
    counts = numpy.zeros(4, int)
    worst = 0.0
    for file in sorted((ROOT / "assets/meshes").glob("*/*")):
        vertices, triangles = read_mesh(file)
        low, high = vertices.min(0), vertices.max(0)
        scale = 1 / (high - low).max()
        place = -scale * (low + high) / 2
        vertices = vertices * scale + place
        scene = open3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            open3d.core.Tensor(vertices.astype(numpy.float32)),
            open3d.core.Tensor(triangles.astype(numpy.uint32)),
        )
        for sensor in SENSORS:
            directions = beams(tomllib.loads((ROOT / f"assets/sensors/{sensor}.toml").read_text()))
            for adapter in ("auto", "cpu"):
                for position in POSITIONS_M:
                    scan = scanned((file, scale, place), sensor, position, adapter)
                    shot = (scene, numpy.array(position), directions @ turned_to_target(position))
                    name = f"{file.name}, {sensor} at {position}, adapter {adapter}"
                    found, apart = compare(name, scan, *shot)
                    counts += found
                    worst = max(worst, apart)
    beams_cast, hits, silhouettes, others = counts
    print(
        f"open3d {open3d.__version__}: {beams_cast} beams, {hits} hits on both sides, "
        f"worst range difference {worst:.1e} m; {silhouettes} beams at silhouettes differ, "
        f"{others} others"
    )
    assert others == 0


def compare(name, scan, scene, position, directions):
    """How many beams, hits on both sides, and beams that differ at a silhouette or
    elsewhere; the worst difference of ranges."""
    ours = numpy.full(len(directions), numpy.inf)
    ours[scan["beam"].ravel()] = scan["range"].ravel()
    theirs = cast(scene, position, directions)
    both = numpy.isfinite(ours) & numpy.isfinite(theirs)
    apart = numpy.abs(numpy.subtract(ours, theirs, out=numpy.zeros_like(ours), where=both))
    differs = (numpy.isfinite(ours) != numpy.isfinite(theirs)) | (apart > TOLERANCE_M)
    assert both.sum() > 100, f"{name}: {both.sum()} hits on both sides"
    explained = at_silhouette(scene, position, directions[differs], ours[differs])
    for beam, found in zip(numpy.flatnonzero(differs), explained):
        if not found:
            print(f"  {name}: beam {beam}: {ours[beam]} m, Embree {theirs[beam]} m")
    silhouettes = int(explained.sum())
    counts = [len(directions), int(both.sum()), silhouettes, len(explained) - silhouettes]
    return numpy.array(counts), apart[~differs].max()


def at_silhouette(scene, position, directions, ours):
    """Whether Embree finds what we found, a hit or none, where a beam is turned a
    little; that it finds something else straight ahead is known."""
    other = numpy.where(numpy.abs(directions[:, 2:]) < 0.9, [0, 0, 1], [1, 0, 0])
    aside = numpy.cross(directions, other)
    aside /= numpy.linalg.norm(aside, axis=1, keepdims=True)
    upwards = numpy.cross(directions, aside)
    explained = numpy.zeros(len(directions), bool)
    for angle in numpy.arange(16) * numpy.pi / 8:
        turned = directions + TURN_RAD * (numpy.cos(angle) * aside + numpy.sin(angle) * upwards)
        near = cast(scene, position, turned)
        with numpy.errstate(invalid="ignore"):
            same = (near == ours) | (numpy.abs(near - ours) <= 2 * TOLERANCE_M)
        explained |= same
    return explained


def cast(scene, position, directions):
    rays = numpy.hstack([numpy.broadcast_to(position, directions.shape), directions])
    hits = scene.cast_rays(open3d.core.Tensor(rays.astype(numpy.float32)))
    return hits["t_hit"].numpy().astype(numpy.float64)


def scanned(placed_mesh, sensor, position, adapter):
    mesh, scale, place = placed_mesh
    scene, scan = OUT / "scene.toml", OUT / "scan.npz"
    scene.write_text(
        'attributes = ["range", "beam"]\n'
        f'[[object]]\nmesh = "{mesh}"\nup = "z"\nnormalize = "none"\n'
        f'scale = {float(scale)!r}\nposition_m = {[float(x) for x in place]}\n'
        f'[[sensor]]\nprofile = "{sensor}"\nposition_m = {position}\nlook_at_m = {TARGET_M}\n'
    )
    edgepuck("scan", scene, "--overwrite", "--out", scan, "--adapter", adapter)
    return numpy.load(scan)


def beams(profile):
    """Unit vectors in the sensor frame (x forward, y left), in firing order."""
    if "grid" in profile:
        return pixels(profile["grid"])
    head = profile["rotating"]
    lasers = sorted(head["beam"], key=lambda laser: laser["firing_us"])
    period_us = 60e6 / head["rpm"]
    n_rays = int(len(lasers) * period_us / head["sequence_us"])
    sequence, laser = numpy.divmod(numpy.arange(n_rays), len(lasers))
    column = lambda key: numpy.array([float(laser[key]) for laser in lasers])[laser]
    time_us = sequence * head["sequence_us"] + column("firing_us")
    clockwise = 2 * numpy.pi * time_us / period_us - numpy.radians(column("azimuth_offset_deg"))
    elevation = numpy.radians(column("elevation_deg"))
    level = numpy.cos(elevation)
    return numpy.column_stack(
        [level * numpy.cos(clockwise), -level * numpy.sin(clockwise), numpy.sin(elevation)]
    )


def pixels(grid):
    """Row by row from the top left, uniform in the tangent."""
    edge = [numpy.tan(numpy.radians(grid[key]) / 2) for key in ("fov_x_deg", "fov_y_deg")]
    left = numpy.linspace(edge[0], -edge[0], grid["width"])
    up = numpy.linspace(edge[1], -edge[1], grid["height"])
    up, left = (axis.ravel() for axis in numpy.meshgrid(up, left, indexing="ij"))
    directions = numpy.column_stack([numpy.ones_like(up), left, up])
    return directions / numpy.linalg.norm(directions, axis=1, keepdims=True)


def turned_to_target(position):
    """The sensor's axes in the world, one a row: forward, left (level), up."""
    forward = numpy.array(TARGET_M) - position
    forward /= numpy.linalg.norm(forward)
    left = numpy.cross([0, 0, 1], forward)
    left /= numpy.linalg.norm(left)
    return numpy.array([forward, left, numpy.cross(forward, left)])


def read_mesh(file):
    """Vertices and triangles of a file of triangles, OBJ or OFF."""
    lines = [line.split() for line in file.read_text().splitlines()]
    lines = [words for words in lines if words and not words[0].startswith("#")]
    if file.suffix == ".off":
        n_vertices, n_faces = int(lines[1][0]), int(lines[1][1])
        vertices = [words[:3] for words in lines[2 : 2 + n_vertices]]
        faces = [words for words in lines[2 + n_vertices : 2 + n_vertices + n_faces]]
        assert all(words[0] == "3" for words in faces)
        corners = [[int(word) for word in words[1:4]] for words in faces]
    else:
        vertices = [words[1:4] for words in lines if words[0] == "v"]
        faces = [words[1:] for words in lines if words[0] == "f"]
        assert all(len(words) == 3 for words in faces)
        corners = [[int(word.split("/")[0]) - 1 for word in words] for words in faces]
    return numpy.array(vertices, numpy.float64), numpy.array(corners, numpy.int64)


main()
