"""An array of Slurm makes the dataset that one machine makes, though two of its tasks are killed midway
and queued again.

Debian's slurm-wlm and munge, on one node, without systemd. It needs root, since slurmd does; without
root or Slurm it is skipped. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

EDGEPUCK = os.environ["EDGEPUCK_PROGRAM"]
OUT = Path(os.environ["EDGEPUCK_OUT"])
PARTS = 8
SPOOL = Path("/tmp/edgepuck-slurm")
# /usr/sbin may not be on the path.
os.environ["PATH"] += ":/usr/sbin"
WORDS = [str(OUT / "shapes"), "--layout", "webdataset", "--sensor", "vlp32c", "--views", "24",
         "--points", "256", "--azimuth-jitter", "180", "--adapter", "cpu", "--tar-clouds", "400"]

missing = [name for name in ("munged", "slurmctld", "slurmd", "sbatch") if not shutil.which(name)]
if missing or os.getuid() != 0:
    print(f"SKIPPED: {' and '.join(missing) + ' are missing' if missing else 'slurmd needs root'}")
    sys.exit(77)

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
SlurmctldLogFile={SPOOL}/slurmctld.log
SlurmdLogFile={SPOOL}/slurmd.log
SchedulerParameters=sched_interval=1
NodeName={HOST} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def run(*words, **kwargs):
    return subprocess.run([*map(str, words)], check=True, text=True, **kwargs)


def wait_for(what, seconds, condition):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.05)
    return found


def start():
    shutil.rmtree(SPOOL, ignore_errors=True)
    for folder in ("state", "spool", "munge"):
        (SPOOL / folder).mkdir(parents=True, mode=0o755)
    os.chmod(SPOOL, 0o755)
    (SPOOL / "slurm.conf").write_text(CONF)
    os.environ["SLURM_CONF"] = str(SPOOL / "slurm.conf")
    (SPOOL / "munge/munge.key").write_bytes(os.urandom(128))
    os.chmod(SPOOL / "munge/munge.key", 0o600)
    daemons = []
    try:
        run("munged", "--force", f"--key-file={SPOOL}/munge/munge.key", f"--socket={SPOOL}/munge.socket",
            f"--pid-file={SPOOL}/munge/munged.pid", f"--log-file={SPOOL}/munge/munged.log",
            f"--seed-file={SPOOL}/munge/seed")
        for name in ("slurmctld", "slurmd"):
            daemons.append(subprocess.Popen([name, "-D"], stderr=subprocess.DEVNULL))
        wait_for("an idle node", 60, is_idle)
        run("srun", "true", timeout=60, stderr=subprocess.DEVNULL)
    except (AssertionError, OSError, subprocess.SubprocessError) as error:
        # A container may not be allowed what Slurm does.
        stop(daemons)
        log = SPOOL / "slurmd.log"
        last = log.read_text().splitlines()[-1:] if log.exists() else []
        print(f"SKIPPED: Slurm does not run here: {error}; {' '.join(last)}")
        sys.exit(77)
    return daemons


def is_idle():
    return "idle" in subprocess.run(["sinfo", "-h", "-o", "%t"], capture_output=True, text=True).stdout


def stop(daemons):
    for daemon in daemons:
        daemon.terminate()
    for daemon in daemons:
        daemon.wait(20)
    pid = SPOOL / "munge/munged.pid"
    if pid.exists():
        os.kill(int(pid.read_text()), signal.SIGTERM)


def array():
    """Submits the job file, kills two tasks midway, and waits for all."""
    shared = OUT / "shared"
    file = run(EDGEPUCK, "cluster", "slurm", "--parts", PARTS, "--cpus", 1, "--memory", 1, "--", *WORDS,
               "--out", shared, stdout=subprocess.PIPE).stdout
    bin_folder = OUT / "bin"
    bin_folder.mkdir()
    (bin_folder / "edgepuck").symlink_to(EDGEPUCK)
    # Of this machine's memory nothing is told to Slurm.
    file = "\n".join(line for line in file.splitlines() if "--mem=" not in line) + "\n"
    (OUT / "job.sh").write_text(file)
    env = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}"}
    told = run("sbatch", "--parsable", OUT / "job.sh", stdout=subprocess.PIPE, env=env, cwd=OUT).stdout
    job = told.strip().split(";")[0]
    killed = set()

    def queue():
        shown = run("squeue", "-h", "-r", "-j", job, "-o", "%K %t %r", stdout=subprocess.PIPE).stdout
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


run(EDGEPUCK, "gen-shapes", "--out", OUT / "shapes", "--train", 16, "--test", 4, stderr=subprocess.DEVNULL)
run(EDGEPUCK, "gen-dataset", *WORDS, "--out", OUT / "alone", stderr=subprocess.DEVNULL)
daemons = start()
try:
    killed = array()
finally:
    stop(daemons)
alone = {tar.name: tar.read_bytes() for tar in (OUT / "alone").glob("*.tar")}
shared = {tar.name: tar.read_bytes() for tar in (OUT / "shared").glob("*.tar")}
assert len(alone) > PARTS and alone == shared, (sorted(alone), sorted(shared))
run(EDGEPUCK, "gen-dataset", "--verify", OUT / "shared", stderr=subprocess.DEVNULL)
version = run("sinfo", "--version", stdout=subprocess.PIPE).stdout.strip()
print(f"{version}: {len(shared)} tars of {PARTS} tasks, {len(killed)} of them killed, are those of one run")
