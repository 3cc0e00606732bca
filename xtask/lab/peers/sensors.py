"""Real captures beside the simulation of their sensor, ring by ring.

    python xtask/lab/peers/sensors.py vlp16 PACKETS [--out table.md]      # .pcap, or packets of 1,206 bytes without headers
    python xtask/lab/peers/sensors.py vlp32c ARGOVERSE2.npz...            # xyz_mm, laser
    python xtask/lab/peers/sensors.py hdl32e NUSCENES.f32x5.bin           # x, y, z, intensity, ring
    python xtask/lab/peers/sensors.py hdl64e KITTI.f32x4.bin              # ring after ring, from above

It needs the package edgepuck, NumPy and SciPy, and velodyne-decoder for packets, which that program decodes.

A capture does not tell what stood around the sensor, so the planes are taken from the capture itself, but never from the
ring that is judged: a facet is a plane through the returns of the rings above and below, in a window of azimuth, if
these lie on it. The profile's beams are then cast against all facets, with the profile's noise. Returns of both are
counted and measured in the same windows.
"""

import argparse
import tomllib
from pathlib import Path

import edgepuck as ep
import numpy as np

PROFILES = Path(__file__).resolve().parents[3] / "assets/sensors"
# Firings of a window: 2.4 degrees of the VLP-16.
WINDOW = 12
# The rings above and below lie on one plane by so much (root mean square, metres), and each has half of the window's firings.
FLAT_M = 0.02
# Beams that meet a facet more obliquely measure its tilt, cosine of the incidence.
LEAST_COSINE = 0.35
# A return so far from the facet is of something else: it counts as a return, and not as noise.
ELSEWHERE_M = 0.15
# How far a facet reaches towards the neighbours, of the gap. A profile whose elevations are wrong by more misses it.
REACH = 0.4
RANGES_M = [0, 5, 10, 20, 30, 50, 200]


def packets(file, _):
    """Turns of a capture of a Velodyne: points [n, 3] and rings, as velodyne-decoder makes them."""
    import velodyne_decoder

    config = velodyne_decoder.Config(model=velodyne_decoder.Model.VLP16)
    if file.suffix == ".pcap":
        turns = [points for _, points in velodyne_decoder.read_pcap(str(file), config)]
    else:
        decoder, turns = velodyne_decoder.StreamDecoder(config), []
        for number, packet in enumerate(np.fromfile(file, "u1").reshape(-1, 1206)):
            done = decoder.decode(number * 0.0013271, packet.tobytes())
            turns += [done[1]] if done is not None else []
    # The first and the last turn are parts; the decoder's turns overlap by some degrees.
    return [(turn[:, :3].astype(float), turn[:, 6].astype(int)) for turn in map(once_around, turns[1:])]


def once_around(turn):
    """A turn, in order of time, up to where it began."""
    turned = (np.arctan2(turn[0, 1], turn[0, 0]) - np.arctan2(turn[:, 1], turn[:, 0])) % (2 * np.pi)
    is_late = np.arange(len(turn)) > len(turn) / 2
    return turn[~(is_late & (turned < np.pi / 2))]


def argoverse2(file, wanted):
    """The two VLP-32Cs of a sweep, each turned so that its lasers draw cones around its axis."""
    from scipy.optimize import least_squares

    with np.load(file) as frame:
        points, laser = frame["xyz_mm"] / 1000.0, frame["laser"]
    for half in (laser < 32, laser >= 32):
        at, lasers = points[half], laser[half]

        def moved(guess, flip):
            tilt_x, tilt_y = guess[3:]
            axis = np.array([[1, 0, -tilt_y], [0, 1, tilt_x], [tilt_y, -tilt_x, 1]])
            return (at - guess[:3]) @ axis * [1, flip, flip]

        def off(guess, flip):
            ring, elevation = numbered(moved(guess, flip), lasers, wanted)
            return np.clip(elevation - wanted[ring], -0.02, 0.02)[::7]

        start = [1.35, 0, 1.6, 0, 0]
        best = min((1, -1), key=lambda flip: np.median(np.abs(off(start, flip))))
        fitted = least_squares(off, start, args=(best,), loss="soft_l1", f_scale=0.001)
        at = moved(fitted.x, best)
        yield at, lasers


def rows(file, _):
    """A file of rows of f32: with the ring in the fifth column, or ring after ring."""
    width = 5 if "f32x5" in file.name else 4
    points = np.fromfile(file, "f4").reshape(-1, width).astype(float)
    if width == 5:
        return [(points[:, :3], points[:, 4].astype(int))]
    azimuth = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
    return [(points[:, :3], -np.cumsum(np.diff(azimuth, prepend=azimuth[0]) < -np.pi))]


def elevations(sensor):
    """The elevation of each ring of a profile, from below, rad."""
    elevation = np.arcsin(sensor.directions[:, 2])
    return np.array([np.median(elevation[sensor.rings == ring]) for ring in range(sensor.rings.max() + 1)])


def numbered(points, laser, wanted):
    """The ring of each point, from below, and its elevation, rad. Lasers are told by the order of their mean elevations
    or, if some saw nothing, by the nearest elevation of the profile."""
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    names, number = np.unique(laser, return_inverse=True)
    middle = np.array([np.median(elevation[number == one]) for one in range(len(names))])
    ring = np.argsort(np.argsort(middle))
    if len(names) < len(wanted):
        ring = np.abs(middle[:, None] - wanted).argmin(1)
    return ring[number], elevation


class Turn:
    """The returns of each ring, sorted by azimuth, rad."""

    def __init__(self, points, ring, n_rings):
        range_m, azimuth = np.linalg.norm(points, axis=1), np.arctan2(points[:, 1], points[:, 0])
        elevation = np.arcsin(points[:, 2] / range_m)
        order = np.argsort(azimuth)
        rows = [order[ring[order] == one] for one in range(n_rings)]
        self.rings = [(azimuth[row], range_m[row], points[row]) for row in rows]
        self.elevation = np.array([np.median(elevation[row]) if len(row) else np.nan for row in rows])
        self.step = np.array([step_of(azimuth[row]) for row in rows])

    def window(self, ring, first, last):
        azimuth, range_m, points = self.rings[ring]
        rows = slice(*np.searchsorted(azimuth, [first, last]))
        return azimuth[rows], range_m[rows], points[rows]


def step_of(azimuth):
    """The angle from one firing to the next, rad: the mean of the gaps that are no holes. Some sensors' angles are coarse."""
    gaps = np.diff(azimuth)
    return gaps[gaps < 1.5 * np.median(gaps)].mean() if len(gaps) > 50 else np.nan


def facets(turn):
    """Windows in which the rings above and below lie on one plane: ring, azimuths and the plane (n . p = 1)."""
    width = WINDOW * np.nanmedian(turn.step)
    for ring in range(1, len(turn.rings) - 1):
        for first in np.arange(-np.pi, np.pi - width, width):
            sides = [turn.window(side, first, first + width)[2] for side in (ring - 1, ring + 1)]
            if min(map(len, sides)) < WINDOW / 2:
                continue
            around = np.concatenate(sides)
            plane, *_ = np.linalg.lstsq(around, np.ones(len(around)), rcond=None)
            distance = 1 / np.linalg.norm(plane)
            apart = (around @ plane - 1) * distance
            cosine = distance / np.linalg.norm(around, axis=1)
            if np.sqrt(np.mean(apart**2)) < FLAT_M and cosine.min() > LEAST_COSINE:
                yield ring, first, first + width, plane


def along(plane, azimuth, elevation):
    """Where beams meet the plane, metres from the sensor."""
    level = np.cos(elevation)
    direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation) + 0 * azimuth], -1)
    return direction, 1 / (direction @ plane)


def simulated(turn, found, sensor, sigma_m, seed):
    """The turn that the sensor sees of the facets."""
    vertices = []
    for ring, first, last, plane in found:
        low, middle, high = turn.elevation[ring - 1:ring + 2]
        reach = np.array([middle + REACH * (low - middle), middle + REACH * (high - middle)])
        corners, range_m = along(plane, np.array([first, last, last, first]), reach[[0, 0, 1, 1]])
        vertices.append(corners * range_m[:, None])
    faces = 4 * np.arange(len(vertices))[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    scene = ep.Scene()
    scene.add(ep.Mesh(np.concatenate(vertices), faces.reshape(-1, 3)))
    scan = scene.scan(sensor, pose=np.eye(4), noise=sigma_m, seed=seed, attributes=["ring"])
    return scan.positions.astype(float), scan.ring


def measured(turn, found, step):
    """What a turn shows in the facets' windows: ring, range, firings, returns, deviations, and that along the ring."""
    for ring, first, last, plane in found:
        azimuth, range_m, points = turn.window(ring, first, last)
        off = range_m - 1 / (points / range_m[:, None] @ plane)
        middle = np.median(range_m) if len(range_m) else np.nan
        off = off[np.abs(off) < ELSEWHERE_M]
        yield ring, middle, (last - first) / step[ring], len(range_m), off, from_return_to_return(azimuth, range_m)


def from_return_to_return(azimuth, range_m):
    """The standard deviation along one ring: 1 / range of a plane is linear in cos, sin and 1. NaN of too few returns."""
    if len(azimuth) < WINDOW * 0.7:
        return np.nan
    around = azimuth - azimuth.mean()
    basis = np.stack([np.ones_like(around), np.sin(around), 1 - np.cos(around)], 1)
    fitted, *_ = np.linalg.lstsq(basis, 1 / range_m, rcond=None)
    off = (1 / range_m - basis @ fitted) * range_m**2
    return np.sqrt((off**2).sum() / (len(off) - 3)) if np.abs(off).max() < ELSEWHERE_M else np.nan


def line(name, real, ours, steps):
    """A line of the table: of the captured and of the simulated returns in these windows."""
    cells = [name, f"{len(real)}"]
    for rows in (real, ours):
        firings, returns = sum(row[2] for row in rows), sum(row[3] for row in rows)
        cells += [f"{returns}", f"{100 * (1 - returns / firings):.1f}"]
    cells += ["-" if np.isnan(step) else f"{np.degrees(step):.4f}" for step in steps]
    for rows in (real, ours):
        off, along = np.concatenate([row[4] for row in rows]), [row[5] for row in rows if not np.isnan(row[5])]
        if not along:
            cells += ["-"] * 3
            continue
        cells.append(f"{1000 * np.median(off):+.0f}")
        cells.append(f"{1000 * 1.4826 * np.median(np.abs(off - np.median(off))):.1f}")
        cells.append(f"{1000 * np.median(along):.1f}")
    return "| " + " | ".join(cells) + " |"


def main():
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("sensor", help="a built-in sensor, or a profile")
    flags.add_argument("capture", type=Path, nargs="+")
    flags.add_argument("--noise", type=float, default=None, metavar="M", help="sigma of the simulation [default: the profile's repeatability, else accuracy]")
    asked = flags.parse_args()
    file = Path(asked.sensor) if asked.sensor.endswith(".toml") else PROFILES / f"{asked.sensor}.toml"
    sensor, stated = ep.Sensor(str(file)), tomllib.loads(file.read_text())
    stated, least_m = stated["noise"], stated["range"]["min_m"]
    sigma_m = asked.noise if asked.noise is not None else stated.get("repeatability_m", stated["typical_sigma_m"])
    profile, turns = elevations(sensor), []
    for file in asked.capture:
        read = argoverse2 if file.suffix == ".npz" else rows if ".f32x" in file.name else packets
        for points, laser in read(file, profile):
            seen = np.linalg.norm(points, axis=1) > least_m
            points, laser = points[seen], laser[seen]
            turns.append(Turn(points, numbered(points, laser, profile)[0], len(profile)))
    real, ours, seen = [], [], []
    for number, turn in enumerate(turns):
        found = list(facets(turn))
        mine = Turn(*simulated(turn, found, sensor, sigma_m, number), len(profile))
        real += measured(turn, found, turn.step)
        # A ring with few facets does not tell its step.
        ours += measured(mine, found, np.where(np.isnan(mine.step), np.nanmedian(mine.step), mine.step))
        seen.append((turn.step, mine.step, turn.elevation))
    print(f"{asked.sensor}, simulated with {1000 * sigma_m:g} mm of noise: {len(turns)} turns, {sum(len(ring[0]) for turn in turns for ring in turn.rings)} returns, {len(real)} facets")
    step, mine, elevation = (np.ma.median(np.ma.masked_invalid([one[at] for one in seen]), axis=0).filled(np.nan)
                             for at in range(3))
    print("| | facets | returns, real | missing, % | simulated | missing, % | step, deg | simulated "
          "| off the plane, mm | noise | from return to return | simulated: off | noise | from return to return |")
    print("|" + " --- |" * 14)
    for ring in sorted({row[0] for row in real}):
        pick = [row for row in real if row[0] == ring], [row for row in ours if row[0] == ring]
        name = f"ring {ring}, {np.degrees(elevation[ring]):.2f} (profile {np.degrees(profile[ring]):.2f})"
        print(line(name, *pick, (step[ring], mine[ring])))
    for low, high in zip(RANGES_M, RANGES_M[1:]):
        pick = [[row for row in rows if low <= row[1] < high] for rows in (real, ours)]
        if len(pick[0]) >= 20:
            print(line(f"{low} to {high} m", *pick, (np.nanmedian(step), np.nanmedian(mine))))
    print(line("all", real, ours, (np.nanmedian(step), np.nanmedian(mine))))


if __name__ == "__main__":
    main()
