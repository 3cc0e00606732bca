"""Tasks of HyperQueue and jobs of GNU parallel, two of which are killed midway, make the dataset that one
run makes.

HyperQueue runs in this process, on a cluster of this machine. Run by `cargo xtask test`; see
xtask/src/test/peers.rs.
"""

import shutil

from peer import EDGEPUCK, OUT, edgepuck, job_file, run, save_shapes, skipped_if_missing, tars

with skipped_if_missing():
    import hyperqueue
    from hyperqueue import Job, LocalCluster
    from hyperqueue.cluster import WorkerConfig

PARTS = 4
WORDS = ["gen-dataset", str(OUT / "shapes"), "--layout", "webdataset", "--sensor", "vlp32c", "--views",
         "4", "--points", "128", "--adapter", "cpu", "--tar-clouds", "30", "--resume"]


def verified(folder):
    edgepuck("gen-dataset", "--verify", OUT / folder)
    return tars(folder)


def killed_once(task, scheduler):
    """What two tasks do with their first tar: they are killed, and their next attempt is not."""
    mark = f"{OUT}/{scheduler}-{task}"
    return f"test {task} -gt 2 || test -e {mark} || {{ touch {mark}; kill -KILL $PPID; }}"


def killed(scheduler):
    return len(list(OUT.glob(f"{scheduler}-[0-9]")))


def by_hyperqueue():
    task = f"'{killed_once('$((HQ_TASK_ID + 1))', 'hq')}'"
    words = [*WORDS[1:-1], "--out", OUT / "hyperqueue", "--on-shard", task]
    script = OUT / "task.sh"
    script.write_text(job_file("task.sh", PARTS, words).replace("edgepuck gen-dataset", f"{EDGEPUCK} gen-dataset", 1))
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig(cores=2))
        client = cluster.client()

        def submitted():
            # What tasks print lies there.
            job = Job(default_workdir=OUT)
            for _ in range(PARTS):
                job.program(["sh", str(script)])
            return client.submit(job)

        assert not client.wait_for_jobs([submitted()], raise_on_error=False)
        assert killed("hq") == 2
        client.wait_for_jobs([submitted()])


def by_parallel():
    words = ["--shard", f"{{}}/{PARTS}", "--out", OUT / "parallel", "--on-shard", killed_once("{}", "parallel")]
    options = ["--will-cite", "--quote", "--jobs", 2, "--retries", 2]
    run("parallel", *options, EDGEPUCK, *WORDS, *words, ":::", *range(1, PARTS + 1))
    assert killed("parallel") == 2


save_shapes(4, 1)
edgepuck(*WORDS, "--out", OUT / "alone")
alone = verified("alone")
assert len(alone) > PARTS
by_hyperqueue()
assert verified("hyperqueue") == alone
said = f"HyperQueue {hyperqueue.__version__ if hasattr(hyperqueue, '__version__') else ''}".strip()
if shutil.which("parallel"):
    by_parallel()
    assert verified("parallel") == alone
    said += " and GNU parallel"
print(f"{said}: {len(alone)} tars of {PARTS} tasks, two of which were killed, are those of one run")
