"""Open3D, NumPy, plyfile and laspy on every file that we write.

Each finds the numbers that the NPZ of the same scan holds. Run by `cargo xtask
test`; see xtask/src/test/peers.rs.
"""

from peer import EDGEPUCK, OUT, infer, run, skipped_if_missing

with skipped_if_missing("(Debian: apt-get install libusb-1.0-0 libgomp1)"):
    import laspy
    import numpy
    import open3d
    import plyfile

N_POINTS = 128
COLUMNS = {"range": "f4", "beam": "u4", "ring": "u2", "time": "f4", "triangle": "u4",
           "object": "u4", "intensity": "f4", "normal": "f4"}


def same(found, expected, what):
    found = numpy.asarray(found)
    assert found.shape == expected.shape, f"{what}: {found.shape}, not {expected.shape}"
    assert (found == expected).all(), f"{what}: numbers differ"


def write_meshes():
    """Two classes of boxes, split in two, as OFF."""
    for name, height in [("flat", 0.2), ("tall", 2.0)]:
        for number, split in [(1, "train"), (2, "train"), (3, "test")]:
            corners = [(x, y, height * z * number) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
            faces = ["0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3"]
            lines = ["OFF\n8 6 0", *(f"{x} {y} {z}" for x, y, z in corners)]
            folder = OUT / "meshes" / name / split
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{name}_{number:04}.off").write_text(
                "\n".join(lines + ["4 " + face for face in faces]) + "\n")


def write_dataset():
    run(EDGEPUCK, "gen-dataset", OUT / "meshes", "--out", OUT / "set", "--sensor", "vlp32c",
        "--views", 2, "--points", N_POINTS, "--noise", 0.01, "--format", "ply,csv", "--attributes",
        ",".join(COLUMNS), "--adapter", "cpu")


def numpy_reads_npz(path):
    """What all others are compared with: of the types that are documented."""
    with numpy.load(path, allow_pickle=False) as archive:
        scan = dict(archive)
    assert set(scan) == {"positions", *COLUMNS}, set(scan)
    n = len(scan["positions"])
    assert n > 500, n
    for key, kind in {"positions": "f4", **COLUMNS}.items():
        width = 3 if key in ("positions", "normal") else 1
        assert scan[key].dtype == numpy.dtype(kind) and scan[key].shape == (n, width), key
    lengths = numpy.linalg.norm(scan["normal"], axis=1)
    assert abs(lengths - 1).max() < 1e-6, "normals are of unit length"
    return scan


def names_and_columns(scan):
    """Each column by the name it has in PLY and CSV."""
    yield from zip("xyz", scan["positions"].T)
    for key in COLUMNS:
        if key == "normal":
            yield from zip(["nx", "ny", "nz"], scan[key].T)
        else:
            yield key, scan[key][:, 0]


def plyfile_reads_ply(path, scan):
    vertex = plyfile.PlyData.read(path)["vertex"]
    columns = list(names_and_columns(scan))
    assert [p.name for p in vertex.properties] == [name for name, _ in columns]
    for name, expected in columns:
        assert vertex[name].dtype == expected.dtype, name
        same(vertex[name], expected, f"plyfile, {name}")


def numpy_reads_csv(path, scan):
    table = numpy.genfromtxt(path, delimiter=",", names=True, dtype=float)
    columns = list(names_and_columns(scan))
    assert list(table.dtype.names) == [name for name, _ in columns]
    for name, expected in columns:
        # The shortest digits that read back as the same f32.
        same(table[name].astype(expected.dtype), expected, f"CSV, {name}")


def open3d_reads(path, scan):
    cloud = open3d.t.io.read_point_cloud(str(path))
    same(cloud.point.positions.numpy(), scan["positions"], f"Open3D, {path.suffix} positions")
    found = set()
    for key in cloud.point:
        if key in scan and key != "positions":
            same(cloud.point[key].numpy(), scan[key], f"Open3D, {path.suffix} {key}")
            found.add(key)
    if path.suffix == ".npz":
        assert found == set(COLUMNS), found
    else:
        same(cloud.point.normals.numpy(), scan["normal"], "Open3D, PLY normals")
        assert {"range", "time", "intensity"} <= found, "the attributes that are floats"
        legacy = open3d.io.read_point_cloud(str(path))
        same(numpy.asarray(legacy.points), scan["positions"].astype(float), "Open3D, legacy")


def scans():
    """Every scan of the dataset, in every format."""
    paths = sorted(OUT.glob("set/rotational/*/*/*/*.npz"))
    assert len(paths) == 2 * 6 * 2, len(paths)
    for path in paths:
        scan = numpy_reads_npz(path)
        plyfile_reads_ply(path.with_suffix(".ply"), scan)
        numpy_reads_csv(path.with_suffix(".csv"), scan)
        open3d_reads(path, scan)
        open3d_reads(path.with_suffix(".ply"), scan)
    print(f"{len(paths)} scans: NumPy reads NPZ and CSV, plyfile PLY, Open3D NPZ and PLY")
    return paths[0]


def packed_sets():
    for variant in ["clean", "noisy"]:
        for split, m in [("train", 8), ("test", 4)]:
            name = f"rotational-{variant}"
            with numpy.load(OUT / f"set/packed/{name}-{split}.npz", allow_pickle=False) as archive:
                check_packed(dict(archive), m)
    print("4 packed sets: NumPy reads NPZ")


def check_packed(packed, m):
    assert packed["points"].shape == (m, N_POINTS, 3) and packed["points"].dtype == "f4"
    assert packed["labels"].shape == (m,) and packed["labels"].dtype == "i8"
    assert packed["n_raw"].dtype == "u4" and (packed["n_raw"] > 500).all()
    assert list(packed["classes"]) == ["flat", "tall"]
    prefixes = [name.split("/")[0] for name in packed["names"]]
    same(packed["classes"][packed["labels"]], numpy.array(prefixes), "labels")
    # Sums of 128 numbers of up to 1, rounded to 6e-8 each.
    assert abs(packed["points"].mean(axis=1)).max() < 1e-5, "centred"
    radii = numpy.linalg.norm(packed["points"], axis=2).max(axis=1)
    assert abs(radii - 1).max() < 1e-6, "in the unit sphere"


def clouds(npz):
    """What `infer-cpu sample` writes of one scan, in every format of clouds."""
    expected = numpy.load(npz)["positions"]
    in_format = lambda extension: OUT / f"cloud.{extension}"
    for extension in ["npz", "npy", "ply", "pcd", "xyz", "csv"]:
        infer("sample", "--sampler", "all", npz, in_format(extension))
    read = {
        "npz": lambda path: numpy.load(path)["positions"],
        "npy": numpy.load,
        "csv": lambda path: numpy.genfromtxt(path, delimiter=",", names=True, dtype="f4")
        .view("f4").reshape(-1, 3),
        "xyz": lambda path: numpy.loadtxt(path, dtype="f4"),
        "ply": lambda path: numpy.stack([plyfile.PlyData.read(path)["vertex"][c] for c in "xyz"], 1),
    }
    for extension, reader in read.items():
        same(reader(in_format(extension)), expected, f"cloud.{extension}")
    for extension in ["npz", "ply", "pcd"]:
        found = open3d.t.io.read_point_cloud(str(in_format(extension))).point.positions.numpy()
        same(found, expected, f"Open3D, cloud.{extension}")
    print(f"{len(expected)} points in 6 formats of clouds: NumPy, plyfile and Open3D read them")
    las(expected)


def las(expected):
    """What laspy writes."""
    theirs = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    theirs.header.scales, theirs.header.offsets = [1e-5] * 3, [100.0, -200.0, 0.0]
    theirs.xyz = expected.astype(float)
    theirs.write(OUT / "peer.las")
    infer("sample", "--sampler", "all", OUT / "peer.las", OUT / "from_las.npy")
    found = numpy.load(OUT / "from_las.npy")
    # Both multiply and add in f64; 200 m are held to 2.8e-14 m.
    assert abs(found - laspy.read(OUT / "peer.las").xyz).max() <= 1e-13, "LAS, laspy's"
    print(f"LAS: we read {len(expected)} points of laspy's")


# That it passes over what is no float in PLY is known, and documented.
open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
write_meshes()
write_dataset()
first = scans()
packed_sets()
clouds(first)
