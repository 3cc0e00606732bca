"""velodyne-decoder, a driver of real sensors, on packets that we write and read.

It decodes `--format pcap` to the points of the NPZ of the same scan, and what `detect --segment-only` reads
of a capture, also of a real VLP-16's, to the same points. Run by
`cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import struct
from pathlib import Path

from peer import OUT, ROOT, edgepuck, skipped_if_missing

with skipped_if_missing():
    import numpy
    import plyfile
    import velodyne_decoder

# Half a unit of 4 mm. f32 holds 16 m to 9.6e-7 m; coordinates, in the world
# and in the decoder, are each off by half of that, three at a time.
RANGE_M = 0.002 + 5e-6
# Half a unit of 0.01 degree, and what `formats::vlp32c` derives for the rate of
# turning: 0.0057 degree, 0.0063 with both returns. Points 0.5 m from the axis
# are off by 1e-6 m, or 1.2e-4 degree. The promise is:
AZIMUTH_DEG = 0.01
# Packets have whole microseconds; the decoder takes the difference of two Unix
# times, which f64 holds to 1.2e-7 s, half of that off each; f32 holds 0.2 s to
# 1.5e-8 s.
TIME_S = 0.5e-6 + 1.2e-7 + 3e-8

# The decoder subtracts this times tan(elevation) from z.
CROSSING_M = 0.0424
# By ring: the VLP-32C's elevations from below, degrees (User Manual 63-9325).
ELEVATIONS_DEG = numpy.array([
    -25, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4, -3.667, -3.333, -3, -2.667,
    -2.333, -2, -1.667, -1.333, -1, -0.667, -0.333, 0, 0.333, 0.667, 1, 1.333, 1.667, 2.333,
    3.333, 4.667, 7, 10.333, 15,
])

# What the decoder calls the return of a beam.
KINDS = {
    "strongest": velodyne_decoder.ReturnMode.STRONGEST.value,
    "last": velodyne_decoder.ReturnMode.LAST.value,
    "dual": velodyne_decoder.ReturnMode.BOTH.value,
}

ATTRIBUTES = ["range", "ring", "time", "intensity"]


def torus(segments, thickness):
    """A torus of radius 1 as OFF."""
    angles = numpy.arange(segments) * 2 * numpy.pi / segments
    u, v = [grid.ravel() for grid in numpy.meshgrid(angles, angles, indexing="ij")]
    radius = 1 + thickness * numpy.cos(v)
    vertices = numpy.stack([radius * numpy.cos(u), radius * numpy.sin(u), thickness * numpy.sin(v)])
    i, j = [grid.ravel() for grid in numpy.indices((segments, segments))]
    corner = lambda i, j: (i % segments) * segments + j % segments
    quads = zip(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1))
    lines = [f"OFF\n{segments ** 2} {segments ** 2} 0"]
    lines += [f"{x} {y} {z}" for x, y, z in vertices.T]
    lines += [f"4 {a} {b} {c} {d}" for a, b, c, d in quads]
    return "\n".join(lines) + "\n"


def room(half_m):
    """A closed box as OFF."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = ["0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3"]
    lines = ["OFF\n8 6 0"]
    lines += [" ".join(str(half_m * c) for c in corner) for corner in corners]
    return "\n".join(lines + ["4 " + quad for quad in quads]) + "\n"


def rotation(quaternion_xyzw):
    """The matrix of a unit quaternion."""
    x, y, z, w = quaternion_xyzw
    return numpy.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def decode(pcap):
    """The points of a capture, f64 [n, 8], and the number of scans in it."""
    # Times from the first packet on, not back from the last.
    config = velodyne_decoder.Config(timestamp_first_packet=True)
    scans = [points for _, points in velodyne_decoder.read_pcap(pcap, config)]
    assert scans, f"{pcap}: the decoder finds no scan"
    return numpy.concatenate(scans).astype(float), len(scans)


def compare(pcap, npz, pose, returns):
    """That `pcap` decodes to the points of `npz`."""
    points, scans = decode(pcap)
    scan = numpy.load(npz)
    n = len(scan["positions"])
    assert scans == 1, f"{pcap}: {scans} scans in one revolution"
    assert len(points) == n, f"{pcap}: {len(points)} points of {n}"
    # The decoder makes one point of two returns that are the same.
    assert (points[:, 7] == KINDS[returns]).all(), f"{pcap}: kinds {numpy.unique(points[:, 7])}"
    range_m, azimuth_deg, time_s, apart_m = differences(points, scan, pose)
    print(f"{Path(pcap).name}, {returns}: {n} points; largest differences: range "
          f"{range_m * 1e3:.4f} mm, azimuth {azimuth_deg:.5f} deg, time {time_s * 1e6:.3f} us, "
          f"position {apart_m * 1e3:.2f} mm")
    assert range_m <= RANGE_M and azimuth_deg <= AZIMUTH_DEG and time_s <= TIME_S
    return n


def differences(points, scan, pose):
    """The largest of range, azimuth, time and position; the rest is equal."""
    ring = points[:, 6].astype(int)
    assert (ring == scan["ring"][:, 0]).all(), "rings differ"
    # In percent, multiplied in f32 as we do: 0.5 is at stake.
    percent = scan["intensity"][:, 0] * numpy.float32(100)
    reflectivity = numpy.floor(percent.astype(float) + 0.5)
    assert (points[:, 3] == reflectivity).all(), "intensities differ"
    position_m, world_from_sensor = pose
    expected = (scan["positions"].astype(float) - position_m) @ world_from_sensor
    found = points[:, :3]
    from_start = found.copy()
    from_start[:, 2] += CROSSING_M * numpy.tan(numpy.radians(ELEVATIONS_DEG[ring]))
    range_m = numpy.linalg.norm(from_start, axis=1) - scan["range"][:, 0]
    azimuth = numpy.arctan2(found[:, 1], found[:, 0]) - numpy.arctan2(expected[:, 1], expected[:, 0])
    azimuth = (azimuth + numpy.pi) % (2 * numpy.pi) - numpy.pi
    time_s = points[:, 4] - scan["time"][:, 0]
    apart_m = numpy.linalg.norm(found - expected, axis=1)
    # Along the beam and across it, no further.
    across_m = numpy.radians(AZIMUTH_DEG) * scan["range"][:, 0]
    assert (apart_m <= numpy.hypot(RANGE_M, across_m)).all(), "positions differ"
    return [abs(d).max() for d in (range_m, numpy.degrees(azimuth), time_s, apart_m)]


def datasets():
    """Every scan of a dataset, clean and noisy, in its two formats."""
    meshes = OUT / "meshes/torus/train"
    meshes.mkdir(parents=True)
    (meshes / "torus_0001.off").write_text(torus(64, 0.3))
    for returns in KINDS:
        out = OUT / f"set-{returns}"
        edgepuck("gen-dataset", OUT / "meshes", "--out", out, "--sensor", "vlp32c", "--format",
                 "pcap", "--returns", returns, "--views", 3, "--distance", 2.5, "--noise", 0.02,
                 "--dropout", 0.1, "--attributes", ",".join(ATTRIBUTES), "--adapter", "cpu")
        edgepuck("gen-dataset", "--verify", out)
        manifest = json.loads((out / "manifest.json").read_text())
        poses = manifest["poses"][0]["every_mesh"]
        for view, pose in enumerate(poses):
            for variant in ["clean", "noisy"]:
                npz = out / f"rotational/{variant}/torus/train/torus_0001_v{view}.npz"
                where = numpy.array(pose["position_m"]), rotation(pose["quaternion_xyzw"])
                n = compare(str(npz.with_suffix(".pcap")), npz, where, returns)
                assert n > 1000, f"{npz}: {n} points prove little"


def two_returns():
    """Wide beams, of which some have two returns."""
    # Half of each beam at the edge of the torus sees the wall behind it.
    (OUT / "edges/torus/train").mkdir(parents=True)
    (OUT / "edges/torus/train/torus_0001.off").write_text(torus(64, 0.3))
    (OUT / "dual.toml").write_text('[effects]\nreturns = "dual"\nnoise = { sigma_m = 0.02 }\n'
                                   "footprint = { samples = 19, divergence_deg = [0.6, 0.3], separation_m = 0.2 }\n")
    out = OUT / "set-two-returns"
    edgepuck("gen-dataset", OUT / "edges", "--out", out, "--sensor", "vlp32c", "--format", "pcap",
             "--effects", OUT / "dual.toml", "--views", 1, "--distance", 4, "--adapter", "cpu",
             "--attributes", ",".join(ATTRIBUTES + ["return"]))
    edgepuck("gen-dataset", "--verify", out)
    pose = json.loads((out / "manifest.json").read_text())["poses"][0]["every_mesh"][0]
    npz = out / "rotational/noisy/torus/train/torus_0001_v0.npz"
    points, _ = decode(str(npz.with_suffix(".pcap")))
    scan = {name: values for name, values in numpy.load(npz).items()}
    assert len(points) == len(scan["positions"]), f"{len(points)} of {len(scan['positions'])}"
    # By firing sequence, laser and range: packets have the farther return first.
    sequence = lambda time_s: numpy.floor(time_s / 55.296e-6 + 0.02)
    order = numpy.lexsort((numpy.linalg.norm(points[:, :3], axis=1), points[:, 6], sequence(points[:, 4])))
    points = points[order]
    order = numpy.lexsort((scan["range"][:, 0], scan["ring"][:, 0], sequence(scan["time"][:, 0])))
    scan = {name: values[order] if len(values) == len(order) else values for name, values in scan.items()}
    where = numpy.array(pose["position_m"]), rotation(pose["quaternion_xyzw"])
    range_m, azimuth_deg, time_s, _ = differences(points, scan, where)
    assert range_m <= RANGE_M and azimuth_deg <= AZIMUTH_DEG and time_s <= TIME_S
    beam = numpy.stack([sequence(points[:, 4]), points[:, 6]])
    same = (beam[:, 1:] == beam[:, :-1]).all(axis=0)
    nearer, farther = numpy.append(same, False), numpy.append(False, same)
    kinds = points[:, 7]
    assert (kinds[nearer] == velodyne_decoder.ReturnMode.STRONGEST.value).all()
    assert (kinds[farther] == velodyne_decoder.ReturnMode.LAST.value).all()
    assert (kinds[~nearer & ~farther] == velodyne_decoder.ReturnMode.BOTH.value).all()
    print(f"two returns: {len(points)} points, of which {nearer.sum()} pairs")
    assert nearer.sum() > 20


def scene(name, mesh, sensor, rpm):
    """A scene's packets, against its NPZ with a profile that says what packets ask for."""
    profile = (ROOT / "assets/sensors/vlp32c.toml").read_text().replace("rpm = 600.0", f"rpm = {rpm}")
    assert f"rpm = {rpm}" in profile
    told = profile.replace("[rotating]\n", "[rotating]\nsequence_quantum_deg = 0.01\nbeam_crossing_m = 0.0424\n")
    (OUT / f"{name}.off").write_text(mesh)
    for extension, text in [("pcap", profile), ("npz", told)]:
        (OUT / f"{name}-{extension}-sensor.toml").write_text(text)
        (OUT / f"{name}-{extension}.toml").write_text(
            f"attributes = {json.dumps(ATTRIBUTES)}\n"
            f"effects = {{ intensity = true }}\n"
            f"[[object]]\nmesh = \"{name}.off\"\nreflectivity = 0.9\n"
            f"[[sensor]]\nprofile = \"./{name}-{extension}-sensor.toml\"\n{sensor}\n")
        done = edgepuck("scan", OUT / f"{name}-{extension}.toml", "--overwrite", "--out",
                        OUT / f"{name}.{extension}", "--adapter", "cpu", check=False)
        # A scan without a point ends with 3.
        assert done.returncode == (3 if name == "nothing" else 0), done.stderr
    return str(OUT / f"{name}.pcap"), OUT / f"{name}.npz"


def scenes():
    # Of unit length, about an axis like no other.
    turned = [0.1, -0.5, 0.7, 0.5]
    keys = f"position_m = [0.4, -0.2, 0.3]\nquaternion_xyzw = {turned}"
    where = numpy.array([0.4, -0.2, 0.3]), rotation(numpy.array(turned) / numpy.linalg.norm(turned))
    # 300 and 1200 revolutions a minute: the slowest and fastest there are.
    for rpm, beams in [(300.0, 115_740), (600.0, 57_870), (1200.0, 28_935)]:
        n = compare(*scene(f"room-{rpm:.0f}", room(6.0), keys, rpm), where, "strongest")
        assert n == beams, f"every one of {beams} beams sees a wall, not {n}"
    keys = "position_m = [0, 0, 50]\nquaternion_xyzw = [0, 0, 0, 1]"
    pcap, npz = scene("nothing", torus(8, 0.3), keys, 600.0)
    points, _ = decode(pcap)
    assert len(points) == len(numpy.load(npz)["positions"]) == 0
    print("nothing.pcap: no return, no point")


# Half a unit of azimuth, which the decoder rounds and we do not, and what the rates of turning
# differ by within a packet.
READ_AZIMUTH_DEG = 0.02


def reading():
    """`detect --segment-only` reads the first turn of a capture as the decoder does."""
    captures = [OUT / f"room-{rpm}.pcap" for rpm in (300, 600, 1200)]
    packets = ROOT.parent / "shared/data/real_scans/vlp16_packets_1206B.bin"
    if packets.is_file():
        captures.append(capture_of(packets.read_bytes()))
    else:
        print("a real VLP-16's packets are not here")
    config = velodyne_decoder.Config(timestamp_first_packet=True, min_range=0, max_range=1000)
    for pcap in captures:
        edgepuck("detect", pcap, "--segment-only", "--overwrite", "--out", OUT / "clusters")
        vertices = plyfile.PlyData.read(str(OUT / "clusters/sweep.ply"))["vertex"]
        ours = numpy.stack([vertices[axis] for axis in "xyz"], 1).astype(float)
        scans = [points for _, points in velodyne_decoder.read_pcap(str(pcap), config)]
        theirs = numpy.concatenate(scans)[: len(ours), :3].astype(float)
        assert len(ours) == len(theirs) and len(ours) > 10_000, f"{pcap}: {len(ours)} points"
        apart_m = numpy.linalg.norm(ours - theirs, axis=1)
        apart_deg = numpy.degrees(apart_m / numpy.linalg.norm(theirs, axis=1)).max()
        print(f"{pcap.name}, read: {len(ours)} points; largest difference {apart_deg:.4f} deg")
        assert apart_deg < READ_AZIMUTH_DEG


def capture_of(payloads):
    """Payloads of 1206 bytes as a capture, without checksums."""
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    frames = [header]
    for i in range(0, len(payloads), 1206):
        payload = payloads[i : i + 1206]
        udp = struct.pack(">HHHH", 2368, 2368, 8 + len(payload), 0) + payload
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, bytes(4), bytes(4))
        frame = bytes(12) + b"\x08\x00" + ip + udp
        frames += [struct.pack("<IIII", i, 0, len(frame), len(frame)), frame]
    path = OUT / "vlp16.pcap"
    path.write_bytes(b"".join(frames))
    return path


datasets()
two_returns()
scenes()
reading()
