"""Tars of `gen-dataset --layout webdataset`, read by webdataset and by Hugging Face's datasets.

Both give each sample as it was written, and the labels are the classes of the list. Run by
`cargo xtask test`; see xtask/src/test/peers.rs.
"""

import io
import json
import os

from peer import OUT, edgepuck, save_shapes, skipped_if_missing

# Nothing is asked of the Hub.
os.environ["HF_HUB_OFFLINE"] = "1"
with skipped_if_missing():
    import datasets
    import numpy
    import webdataset

FLAGS = ["--layout", "webdataset", "--sensor", "vlp32c", "--views", "8", "--points", "128",
         "--adapter", "cpu", "--azimuth-jitter", "180", "--noise", "0.01"]


def arrays(npz):
    """The arrays of an NPZ file, which webdataset has decoded and datasets has not."""
    if isinstance(npz, (bytes, bytearray)):
        npz = numpy.load(io.BytesIO(npz))
    return {key: numpy.asarray(npz[key]) for key in npz}


def clouds(folder, files, n_classes):
    edgepuck("gen-dataset", OUT / "shapes", "--out", folder, "--tar-clouds", 100, *FLAGS)
    tars = sorted(map(str, folder.glob("train-*.tar")))
    assert len(tars) == files, tars
    by_webdataset = [arrays(s["npz"]) for s in webdataset.WebDataset(tars, shardshuffle=False).decode()]
    stream = datasets.load_dataset("webdataset", data_files=tars, split="train", streaming=True)
    by_datasets = [arrays(s["npz"]) for s in stream]
    for a, b in zip(by_webdataset, by_datasets, strict=True):
        assert a["points"].shape == (len(a["labels"]), 128, 3)
        assert numpy.array_equal(a["points"], b["points"]) and numpy.array_equal(a["labels"], b["labels"])
        # Every tar has all classes.
        assert set(a["labels"].tolist()) == set(range(n_classes))
        # In the unit sphere.
        assert numpy.allclose(numpy.linalg.norm(a["points"], axis=2).max(axis=1), 1, atol=1e-6)
    return sum(len(a["labels"]) for a in by_webdataset)


def scans(folder, classes):
    flags = ["--sample", "scan", "--tar-clouds", 50, "--attributes", "ring,range", *FLAGS]
    edgepuck("gen-dataset", OUT / "shapes", "--out", folder, *flags)
    tars = sorted(map(str, folder.glob("train-*.tar")))
    n = 0
    for sample in webdataset.WebDataset(tars, shardshuffle=False).decode():
        told, scan = sample["json"], arrays(sample["npz"])
        assert classes[sample["cls"]] == told["class"]
        assert told["mesh"].startswith(told["class"])
        assert len(scan["positions"]) == len(scan["ring"]) == told["points"]
        n += 1
    stream = datasets.load_dataset("webdataset", data_files=tars, split="train", streaming=True)
    assert n == sum(1 for _ in stream)
    return n


save_shapes(5, 1)
n_classes = len(list((OUT / "shapes").iterdir()))
n = n_classes * 5 * 8
assert clouds(OUT / "clouds", -(-n // 100), n_classes) == n
classes = json.loads((OUT / "clouds/dataset.json").read_text())["classes"]
assert scans(OUT / "scans", classes) == n
print(f"webdataset {webdataset.__version__}, datasets {datasets.__version__}: {n} clouds and {n} scans agree")
