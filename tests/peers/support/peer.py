"""What the scripts of tests/peers share. xtask/src/test/peers.rs puts this folder on PYTHONPATH."""

import os
import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[1]
# Scripts are named after packages, and must not be imported in their place.
sys.path = [entry for entry in sys.path if Path(entry).resolve() != SCRIPTS]

EDGEPUCK = os.environ["EDGEPUCK_PROGRAM"]
OUT = Path(os.environ["EDGEPUCK_OUT"])
ROOT = SCRIPTS.parents[1]


def skip(*cause):
    """Ends a script that cannot run here."""
    print("SKIPPED:", *cause)
    sys.exit(77)


def job_file(name, parts, words):
    """A job file of docs/src/many-machines.md, for another number of tasks and other arguments of gen-dataset."""
    page = (ROOT / "docs/src/many-machines.md").read_text()
    (file,) = re.findall(rf"^cat > {re.escape(name)} <<'JOB'\n(.*?)^JOB$", page, re.DOTALL | re.MULTILINE)
    for shown, wanted in (("0-63", f"0-{parts - 1}"), ("auto/64", f"auto/{parts}"),
                          ("meshes --layout webdataset --sensor vlp32c --noise 0.01 --out lidar", " ".join(map(str, words)))):
        file = file.replace(shown, wanted)
    return re.sub(r"(completions|parallelism): 64", rf"\1: {parts}", file)


def program_on_path():
    """The environment of a program that finds `edgepuck` on its path, as users' scripts do."""
    folder = OUT / "bin"
    folder.mkdir()
    (folder / "edgepuck").symlink_to(EDGEPUCK)
    return {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}


@contextmanager
def skipped_if_missing(*remedy):
    """Skips the script if an import in the block fails."""
    try:
        yield
    except (ImportError, OSError) as error:
        # A library that a package needs may be what is missing.
        skip(error, *remedy)


def run(*words, check=True, **more):
    """Runs a program to its end; what it wrote is shown if it fails."""
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, **more)
    if check and done.returncode != 0:
        print(done.stdout, done.stderr, sep="", flush=True)
        done.check_returncode()
    return done


def edgepuck(*words, check=True):
    return run(EDGEPUCK, *words, check=check)


def infer(*words):
    return run(os.environ["EDGEPUCK_INFER"], *words)


def save_shapes(train, test, folder="shapes"):
    """Saves built-in meshes of each class, `train` and `test` of them, into a folder of OUT."""
    edgepuck("gen-dataset", "--save-meshes", OUT / folder, "--train", train, "--test", test)


def tars(folder):
    """The bytes of the tars of a data set in OUT, by name."""
    return {tar.name: tar.read_bytes() for tar in (OUT / folder).glob("*.tar")}
