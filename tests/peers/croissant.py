"""What `edgepuck gen-dataset --card` writes, read by mlcroissant and by Hugging Face's datasets.

mlcroissant finds nothing amiss and reads the classes and the list of files; datasets finds the tars by
the card. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import os
from importlib.metadata import version

from peer import OUT, edgepuck, run, save_shapes, skipped_if_missing

# Nothing is asked of the Hub.
os.environ["HF_HUB_OFFLINE"] = "1"
with skipped_if_missing():
    import datasets
    import mlcroissant

FLAGS = ["--sensor", "vlp32c", "--points", "128", "--adapter", "cpu", "--noise", "0.01", "--attributes", "ring,normal"]
PUBLICATION = ["--name", "Some shapes", "--license", "MIT", "--url", "https://example.org/shapes",
               "--creator", "Ada", "--published", "2026-11-25"]


def described(folder, *words):
    """A dataset and what mlcroissant says of it."""
    edgepuck("gen-dataset", OUT / "shapes", "--out", folder, *FLAGS, *words)
    edgepuck("gen-dataset", "--card", folder, *PUBLICATION)
    dataset = mlcroissant.Dataset(jsonld=folder / "croissant.json")
    issues = dataset.metadata.ctx.issues
    assert not issues.errors and not issues.warnings, issues.report()
    classes = [row["classes/name"] for row in dataset.records("classes")]
    assert classes == sorted(path.name for path in (OUT / "shapes").iterdir())
    shapes = {field.id: field.source and field.array_shape
              for records in dataset.metadata.record_sets for field in records.fields}
    return dataset, shapes


def tars(sample):
    folder = OUT / sample
    dataset, shapes = described(folder, "--layout", "webdataset", "--sample", sample, "--tar-clouds", 50)
    records = list(dataset.records("tars"))
    found = {row["tars/file"].decode(): row["tars/bytes"] for row in records}
    assert found == {path.name: path.stat().st_size for path in folder.glob("*.tar")}
    # The card tells datasets which tars are to train with.
    for split in ["train", "test"]:
        stream = datasets.load_dataset(str(folder), split=split, streaming=True)
        samples = sum(1 for _ in stream)
        tars_of = [row for row in records if row["tars/file"].decode().startswith(split)]
        wanted = sum(row["tars/clouds"] for row in tars_of) if sample == "scan" else len(tars_of)
        assert samples == wanted, (split, samples, wanted)
    return shapes


save_shapes(3, 1)
assert tars("clouds")["clouds/points"] == "-1,128,3"
assert tars("scan")["scan/normal"] == "-1,3"
files, shapes = described(OUT / "files")
packed = {row["packed/file"].decode() for row in files.records("packed")}
assert packed == {f"packed/{path.name}" for path in (OUT / "files/packed").iterdir()}
manifest = json.loads((OUT / "files/croissant.json").read_text())["distribution"][0]
hashed = run("sha256sum", OUT / "files/manifest.json")
assert hashed.stdout.split()[0] == manifest["sha256"]
print(f"mlcroissant {version('mlcroissant')}, datasets {version('datasets')}: three datasets are described")
