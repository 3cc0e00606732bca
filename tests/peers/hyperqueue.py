"""Tasks of HyperQueue and jobs of GNU parallel make the dataset that one run makes.

HyperQueue runs in this process, on a cluster of this machine. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import shutil

from peer import EDGEPUCK, OUT, edgepuck, run, skipped_if_missing

with skipped_if_missing():
    import hyperqueue
    from hyperqueue import Job, LocalCluster
    from hyperqueue.cluster import WorkerConfig

PARTS = 4
WORDS = ["gen-dataset", str(OUT / "shapes"), "--layout", "webdataset", "--sensor", "vlp32c", "--views",
         "4", "--points", "128", "--adapter", "cpu", "--tar-clouds", "30", "--resume"]


def tars(folder):
    edgepuck("gen-dataset", "--verify", OUT / folder)
    return {tar.name: tar.read_bytes() for tar in (OUT / folder).glob("*.tar")}


def by_hyperqueue():
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig(cores=2))
        client = cluster.client()
        job = Job()
        for _ in range(PARTS):
            job.program([EDGEPUCK, *WORDS, "--shard", f"auto/{PARTS}", "--out", str(OUT / "hyperqueue")])
        client.wait_for_jobs([client.submit(job)])


def by_parallel():
    command = [EDGEPUCK, *WORDS, "--shard", f"{{}}/{PARTS}", "--out", str(OUT / "parallel")]
    run("parallel", "--will-cite", "--jobs", 2, *command, ":::", *range(1, PARTS + 1))


edgepuck("gen-shapes", "--out", OUT / "shapes", "--train", 4, "--test", 1)
edgepuck(*WORDS, "--out", OUT / "alone")
alone = tars("alone")
assert len(alone) > PARTS
by_hyperqueue()
assert tars("hyperqueue") == alone
said = f"HyperQueue {hyperqueue.__version__ if hasattr(hyperqueue, '__version__') else ''}".strip()
if shutil.which("parallel"):
    by_parallel()
    assert tars("parallel") == alone
    said += " and GNU parallel"
print(f"{said}: {len(alone)} tars of {PARTS} tasks are those of one run")
