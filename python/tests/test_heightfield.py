"""Height fields against planes, ramps and the cap of a sphere."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

import edgepuck as ep

SENSOR = ep.Sensor("vlp16")


def cast(heights, pose: np.ndarray, **settings) -> np.ndarray:
    scene = ep.Scene()
    scene.add(ep.Mesh(*ep.heightfield(heights, **settings), normalize="none", units="m"))
    return scene.cast(SENSOR, pose[None]).ranges[0]


def test_a_ramp_is_a_plane() -> None:
    """z = 0.3 x - 0.1 y + 1: a beam d from (0, 0, h) ends at (h - 1) / (0.3 dx - 0.1 dy - dz)."""
    x, y = np.meshgrid(-20 + 0.5 * np.arange(81), -10 + 0.25 * np.arange(81))
    pose = np.eye(4)
    pose[2, 3] = 3.0
    ranges = cast(0.3 * x - 0.1 * y + 1, pose, cell=(0.5, 0.25), origin=(-20, -10, 0))
    dx, dy, dz = SENSOR.directions.T
    expected = 2.0 / (0.3 * dx - 0.1 * dy - dz)
    within = (expected > 0) & (np.abs(expected * dx) < 19.99) & (np.abs(expected * dy) < 9.99)
    outside = (expected <= 0) | (np.abs(expected * dx) > 20.01) | (np.abs(expected * dy) > 10.01)
    assert within.sum() > 5000
    np.testing.assert_allclose(ranges[within], expected[within], rtol=1e-6)
    assert np.isinf(ranges[outside]).all()


def test_a_cap_of_a_sphere_has_the_error_of_its_chords() -> None:
    """A chord of length l lies at most l^2 / 8 / r below a sphere of radius r, to leading order. The longest
    is the diagonal of a cell c, c sqrt(2), on a slope of at most 45 degrees: 2 c."""
    cell, radius = 0.25, 12.0
    x, y = np.meshgrid(*[cell * np.arange(-24, 25)] * 2)
    # The axis of the sensor lies along x, so that its beams sweep from below to above.
    pose = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, radius + 2], [0, 0, 0, 1]])
    ranges = cast(np.sqrt(radius**2 - x**2 - y**2), pose, cell=cell, origin=(-6, -6, 0))
    hit = np.isfinite(ranges)
    points = ranges[hit, None] * SENSOR.directions[hit] @ pose[:3, :3].T + pose[:3, 3]
    depth = radius - np.linalg.norm(points, axis=1)
    assert hit.sum() > 5000
    # Cells on the top, which is level, have a chord of c sqrt(2).
    assert -1e-6 < depth.min() and 0.95 * cell**2 / 4 / radius < depth.max() < 1.05 * cell**2 / 2 / radius


def test_a_corner_without_a_height_is_a_hole() -> None:
    heights = np.zeros((5, 5))
    heights[2, 2] = np.nan
    vertices, faces = ep.heightfield(heights, cell=1.0)
    assert len(faces) == 2 * (16 - 4) and len(vertices) == 24
    middles = vertices[faces].mean(axis=1)
    assert not ((np.abs(middles[:, 0] - 2) < 1) & (np.abs(middles[:, 1] - 2) < 1)).any()


def png(values: np.ndarray, bits: int = 16) -> bytes:
    """A grey PNG, as its specification (ISO 15948) lays it out, without filters."""
    rows = values.astype(f">u{bits // 8}")
    header = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], bits, 0, 0, 0, 0)
    pixels = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    chunks = [(b"IHDR", header), (b"IDAT", pixels), (b"IEND", b"")]
    framed = [struct.pack(">I", len(of)) + name + of + struct.pack(">I", zlib.crc32(name + of)) for name, of in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def test_a_png_has_y_upwards(tmp_path: Path) -> None:
    values, file = np.random.default_rng(0).integers(0, 65536, (7, 5)), tmp_path / "terrain.png"
    file.write_bytes(png(values))
    found = ep.heightfield(file, cell=0.5, height=40.0, origin=(1, 2, 3))
    expected = ep.heightfield(values[::-1] * (40 / 65535), cell=0.5, origin=(1, 2, 3))
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])
    corner = found[0][-5]
    np.testing.assert_allclose(corner, [1, 2 + 6 * 0.5, 3 + values[0, 0] * 40 / 65535])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0, 1.0], {"cell": 1}), "heights: expected shape [rows, columns] of two or more each, found [2]"),
        (([[0.0, 1.0]], {"cell": 1}), "found [1, 2]"),
        (([[0.0, 1.0], [2.0, np.inf]], {"cell": 1}), "heights[1, 1]: expected metres, or NaN for a hole, found inf"),
        (([[0.0, np.nan], [2.0, 1.0]], {"cell": 1}), "expected a cell with four heights, found none"),
        ((np.zeros((2, 2)), {"cell": 0}), "cell: expected a number of metres above 0, found 0"),
        ((np.zeros((2, 2)), {"cell": [1, 2, 3]}), "cell: expected one number or two"),
        ((np.zeros((2, 2)), {"cell": 1, "origin": 5.0}), "origin: expected three finite metres, found 5.0"),
        ((np.zeros((2, 2)), {"cell": 1, "height": 3}), "height: expected none beside heights in metres, found 3"),
        (("terrain.png", {"cell": 1}), "height: expected the height of white in metres, found None"),
        (("missing.png", {"cell": 1, "height": 1}), "missing.png: cannot be read"),
        (("text.png", {"cell": 1, "height": 1}), "text.png: expected a PNG"),
        (("cut.png", {"cell": 1, "height": 1}), "cut.png: expected a PNG"),
        (("bytes.png", {"cell": 1, "height": 1}), "bytes.png: expected a picture in grey with 16 bits a pixel, found"),
    ],
)
def test_wrong_terrain_is_named(tmp_path: Path, monkeypatch, arguments, message: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.png").write_text("heights")
    Path("cut.png").write_bytes(png(np.full((99, 99), 7))[:60])
    Path("bytes.png").write_bytes(png(np.zeros((3, 3)), bits=8))
    heights, settings = arguments
    with pytest.raises(ep.Error) as caught:
        ep.heightfield(heights, **settings)
    assert message in str(caught.value)
