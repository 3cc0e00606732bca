"""What the scripts of tests/peers share. xtask/src/test/peers.rs puts this folder on PYTHONPATH."""

import os
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
