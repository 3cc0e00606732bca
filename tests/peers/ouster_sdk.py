"""ouster-sdk, Ouster's own programs, on packets that it writes and on real ones.

`detect --segment-only` reads the first whole frame of a capture to the points that ouster-sdk makes of it.
Beams of our profiles, and of metadata taken for a profile, lie where it puts them.
Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import tomllib
import warnings

from peer import OUT, ROOT, edgepuck, skipped_if_missing

with skipped_if_missing():
    import numpy
    import plyfile
    from ouster.sdk import core, open_source, pcap

# Formats of older firmware are what this is about.
warnings.simplefilter("ignore")

# Both compute in f64, and we round to f32: half of 2^-23 of a coordinate, and for f64, which holds
# 1 km to 1.1e-13 m, a few dozen roundings.
RELATIVE = 2.0 ** -24
ABSOLUTE_M = 1e-11

PROFILES = ["LEGACY", "RNG19_RFL8_SIG16_NIR16", "RNG19_RFL8_SIG16_NIR16_DUAL", "RNG15_RFL8_NIR8"]
COLUMNS = 1024

random = numpy.random.default_rng(7)


def metadata(product, rows, altitude_deg, origin_mm, profile):
    """What a sensor tells of itself, in the layout of older firmware; its beams are jittered."""
    jitter = random.uniform(-0.1, 0.1, [2, rows])
    return {
        "beam_altitude_angles": list(numpy.linspace(altitude_deg, -altitude_deg, rows) + jitter[0]),
        "beam_azimuth_angles": list(numpy.tile([4.2, 1.4, -1.4, -4.2], rows // 4) + jitter[1]),
        "build_rev": "v2.4.0",
        "data_format": {
            "column_window": [0, COLUMNS - 1], "columns_per_frame": COLUMNS,
            "columns_per_packet": 16, "pixel_shift_by_row": [0] * rows, "pixels_per_column": rows,
            "udp_profile_imu": "LEGACY", "udp_profile_lidar": profile,
        },
        "imu_to_sensor_transform": [1, 0, 0, 6.253, 0, 1, 0, -11.775, 0, 0, 1, 7.645, 0, 0, 0, 1],
        "initialization_id": 7,
        "lidar_mode": "1024x10",
        "lidar_origin_to_beam_origin_mm": origin_mm,
        "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1],
        "prod_line": product, "prod_pn": "840-103575-06", "prod_sn": "122201000998",
        "status": "RUNNING",
    }


def random_frame(info, number):
    """A frame of random ranges; a quarter of the pixels and some columns saw nothing."""
    frame = core.LidarFrame(info)
    frame.frame_id = number
    packet_format = core.PacketFormat.from_info(info)
    for name in frame.fields:
        field = frame.field(name)
        mask = packet_format.field_value_mask(name)
        field[:] = (random.integers(0, 1 << 32, field.shape) & mask).astype(field.dtype)
        if name.startswith("RANGE"):
            field[random.random(field.shape) < 0.25] = 0
    frame.measurement_id[:] = numpy.arange(frame.w)
    frame.timestamp[:] = (number * frame.w + numpy.arange(frame.w)) * 97_656 + 1
    frame.status[:] = 0xFFFFFFFF if "LEGACY" in str(info.format.udp_profile_lidar) else 1
    frame.status[5::97] = 0
    return frame


def points(frame, info):
    """The points that ouster-sdk makes of a frame, in the order of measuring."""
    names = [name for name in ["RANGE", "RANGE2"] if name in frame.fields]
    to_points = core.XYZLut(info)
    ranges = numpy.stack([frame.field(name) for name in names], -1)
    found = numpy.stack([to_points(frame.field(name)) for name in names], 2)
    seen = (ranges != 0) & (frame.status & 1 == 1)[None, :, None]
    return found.swapaxes(0, 1)[seen.swapaxes(0, 1)]


def compare(name, capture, text, expected):
    """That `detect --segment-only` reads `expected` from a capture, by the metadata `text`."""
    told = OUT / "metadata.json"
    told.write_text(text)
    edgepuck("detect", capture, "--segment-only", "--metadata", told, "--overwrite", "--out", OUT / "clusters")
    vertices = plyfile.PlyData.read(str(OUT / "clusters/sweep.ply"))["vertex"]
    ours = numpy.stack([vertices[axis] for axis in "xyz"], 1).astype(float)
    assert ours.shape == expected.shape, f"{name}: {len(ours)} points of {len(expected)}"
    apart_m = numpy.abs(ours - expected)
    print(f"{name}: {len(ours)} points as far as {numpy.abs(expected).max():.1f} m; "
          f"largest difference {1e6 * apart_m.max():.3f} um", flush=True)
    assert (apart_m <= RELATIVE * numpy.abs(expected) + ABSOLUTE_M).all(), name
    assert len(ours) > 5_000, f"{name}: {len(ours)} points prove little"


def written():
    """Frames whose packets ouster-sdk writes, the first of which is not whole."""
    sensors = [("OS-0-128", 128, 45, 27.67), ("OS-0-32-U1", 32, 45, 27.67),
               ("OS-1-128", 128, 21.2, 15.806), ("OS-2-64", 64, 11, 13.762)]
    for sensor in sensors:
        for profile in PROFILES:
            flat = json.dumps(metadata(*sensor, profile))
            info = core.SensorInfo(flat)
            frames = [random_frame(info, number) for number in (65535, 0, 1)]
            layout = core.PacketFormat.from_info(info)
            packets = [packet for frame in frames
                       for packet in core.frame_to_packets(frame, layout, 7, int(info.sn))]
            capture = OUT / "written.pcap"
            pcap.record(packets[9:], str(capture))
            expected = points(frames[1], info)
            for text, words in [(flat, "flat"), (info.to_json_string(), "nested")]:
                compare(f"{sensor[0]}, {profile}, {words}", capture, text, expected)


def real():
    """The first whole frame of each real capture, whose metadata lie beside it."""
    captures = sorted(ROOT.parent.glob("shared/data/real_scans/ouster/*.pcap"))
    if not captures:
        print("real Ousters' packets are not here")
    for capture in captures:
        told = capture.with_suffix(".json")
        source = open_source(str(capture), meta=[str(told)])
        info = source.sensor_info[0]
        frames = (frame for frames in source for frame in frames if frame is not None)
        frame = next(frame for frame in frames if frame.complete(info.format.column_window))
        compare(capture.name, capture, told.read_text(), points(frame, info))


def beams():
    """Every beam of a turn, where ouster-sdk puts a point of 10 m that it measures."""
    identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    for name in ["os0-128", "os1-128", "os2-128"]:
        profile = tomllib.loads((ROOT / f"assets/sensors/{name}.toml").read_text())["rotating"]
        start_mm = 1000 * profile["beam_start_m"]
        told = metadata("OS-1-128", 128, 0, start_mm, "LEGACY") | {
            "beam_altitude_angles": [beam["elevation_deg"] for beam in profile["beam"]],
            "beam_azimuth_angles": [-beam["azimuth_offset_deg"] for beam in profile["beam"]],
            # Our sensor frame is the lidar's.
            "lidar_to_sensor_transform": identity,
        }
        text = json.dumps(told)
        (OUT / "unit.json").write_text(text)
        range_mm = numpy.full([128, COLUMNS], 10_000, numpy.uint32)
        expected = core.XYZLut(core.SensorInfo(text))(range_mm).swapaxes(0, 1).reshape(-1, 3)
        for sensor in [name, OUT / "unit.json"]:
            edgepuck("profile", sensor, "--overwrite", "--beams", OUT / "beams.csv")
            rows = numpy.loadtxt(OUT / "beams.csv", delimiter=",", skiprows=1)
            azimuth, elevation = numpy.radians(rows[:, 2:4].T)
            level = numpy.cos(elevation)
            directions = numpy.stack(
                [level * numpy.cos(azimuth), level * numpy.sin(azimuth), numpy.sin(elevation)], 1)
            # Ouster's ranges count from the axis, ours from where the beam begins.
            ours = rows[:, 4:7] + directions * (10 - start_mm / 1000)
            apart_m = numpy.linalg.norm(ours - expected, axis=1).max()
            print(f"{sensor}: {len(ours)} beams, farthest from ouster-sdk's {apart_m:.1e} m", flush=True)
            # Angles of degrees in f64, ours through a decimal of 17 digits: some 1e-15 of 10 m.
            assert len(ours) == len(expected) and apart_m < 1e-11, sensor


beams()
written()
real()
