"""An array of Slurm makes the dataset that one machine makes, though two of its tasks are killed midway
and queued again.

Debian's slurm-wlm and munge, on one node, without systemd. It needs root, since slurmd does; without
root or Slurm it is skipped. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import atexit
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from peer import OUT, edgepuck, job_file, program_on_path, run, save_shapes, skip, tars

PARTS = 8
# /usr/sbin may not be on the path.
os.environ["PATH"] += ":/usr/sbin"
WORDS = [OUT / "shapes", "--layout", "webdataset", "--sensor", "vlp32c", "--views", "24",
         "--points", "256", "--azimuth-jitter", "180", "--adapter", "cpu", "--tar-clouds", "400"]

missing = [name for name in ("munged", "slurmctld", "slurmd", "sbatch") if not shutil.which(name)]
if missing or os.getuid() != 0:
    skip(f"{' and '.join(missing)} are missing" if missing else "slurmd needs root")

# Paths of sockets must be short, which those in OUT may not be.
SPOOL = Path(tempfile.mkdtemp())
atexit.register(shutil.rmtree, SPOOL, ignore_errors=True)
HOST = socket.gethostname().split(".")[0]
CONF = f"""
ClusterName=edgepuck
SlurmctldHost={HOST}(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={SPOOL}/munge.socket
CryptoType=crypto/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmctldPort=26817
SlurmdPort=26818
StateSaveLocation={SPOOL}/state
SlurmdSpoolDir={SPOOL}/spool
SlurmctldPidFile={SPOOL}/slurmctld.pid
SlurmdPidFile={SPOOL}/slurmd.pid
SchedulerParameters=sched_interval=1
NodeName={HOST} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def wait_for(what, seconds, condition):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.05)
    return found


def start():
    for folder in ("state", "spool", "munge"):
        (SPOOL / folder).mkdir(mode=0o755)
    os.chmod(SPOOL, 0o755)
    (SPOOL / "slurm.conf").write_text(CONF)
    os.environ["SLURM_CONF"] = str(SPOOL / "slurm.conf")
    (SPOOL / "munge/munge.key").write_bytes(os.urandom(128))
    os.chmod(SPOOL / "munge/munge.key", 0o600)
    munged = ["munged", "--foreground", "--force", f"--key-file={SPOOL}/munge/munge.key",
              f"--socket={SPOOL}/munge.socket", f"--pid-file={SPOOL}/munge/munged.pid",
              f"--seed-file={SPOOL}/munge/seed"]
    daemons = []
    try:
        for command in (munged, ["slurmctld", "-D"], ["slurmd", "-D"]):
            log = OUT / f"{command[0]}.log"
            daemons.append(subprocess.Popen(command, stderr=log.open("w")))
            # The others ask it when they start.
            wait_for("munged's socket", 20, (SPOOL / "munge.socket").exists)
        wait_for("an idle node", 60, is_idle)
        run("srun", "true", timeout=60)
    except (AssertionError, OSError, subprocess.SubprocessError) as error:
        # A container may not be allowed what Slurm does.
        stop(daemons)
        skip(f"Slurm does not run here: {error};", *log.read_text().splitlines()[-1:])
    return daemons


def is_idle():
    return "idle" in run("sinfo", "-h", "-o", "%t", check=False).stdout


def stop(daemons):
    # What is started first is used by the others.
    for daemon in reversed(daemons):
        daemon.terminate()
        daemon.wait(20)


def array():
    """Submits the job file, kills two tasks midway, and waits for all."""
    shared = OUT / "shared"
    file = job_file("job.sh", PARTS, [*WORDS, "--out", shared]).replace("per-task=4", "per-task=1")
    # Of this machine's memory nothing is told to Slurm.
    file = "\n".join(line for line in file.splitlines() if "--mem=" not in line) + "\n"
    (OUT / "job.sh").write_text(file)
    said = run("sbatch", "--parsable", OUT / "job.sh", env=program_on_path(), cwd=OUT).stdout
    job = said.strip().split(";")[0]
    killed = set()

    def queue():
        shown = run("squeue", "-h", "-r", "-j", job, "-o", "%K %t %r").stdout
        return [line.split(maxsplit=2) for line in shown.splitlines()]

    def work_is_done():
        for process in Path("/proc").iterdir():
            try:
                words = (process / "cmdline").read_bytes().split(b"\0")
                environment = (process / "environ").read_bytes().split(b"\0")
            except (OSError, NotADirectoryError):
                continue
            if b"gen-dataset" not in words or not words[0].endswith(b"edgepuck") or len(killed) == 2:
                continue
            task = next((v for v in environment if v.startswith(b"SLURM_ARRAY_TASK_ID=")), b"")
            # By SIGTERM, as Slurm does before it preempts a task or its time is up.
            is_midway = any((OUT / "shared").glob(".*")) or any((OUT / "shared").glob("*.tar"))
            if task and task not in killed and is_midway:
                os.kill(int(process.name), signal.SIGTERM)
                killed.add(task)
        for task, state, reason in queue():
            # Slurm lets a task wait for two minutes that is queued again.
            if state == "PD" and reason == "BeginTime":
                run("scontrol", "update", f"jobid={job}_{task}", "StartTime=now")
        return not queue()

    wait_for("the array", 240, work_is_done)
    assert len(killed) == 2, f"{len(killed)} tasks were killed"
    return killed


save_shapes(16, 4)
edgepuck("gen-dataset", *WORDS, "--out", OUT / "alone")
daemons = start()
try:
    killed = array()
finally:
    stop(daemons)
alone, shared = tars("alone"), tars("shared")
assert len(alone) > PARTS and alone == shared, (sorted(alone), sorted(shared))
edgepuck("gen-dataset", "--verify", OUT / "shared")
version = run("sinfo", "--version").stdout.strip()
print(f"{version}: {len(shared)} tars of {PARTS} tasks, {len(killed)} of them killed, are those of one run")
