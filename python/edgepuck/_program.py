"""The console command `edgepuck`."""

import signal
import sys

from . import _edgepuck


def main() -> int:
    """Run the program `edgepuck` with this process's words, and return its exit code."""
    # As in any program of the shell, Ctrl+C ends it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _edgepuck.main(["edgepuck", *sys.argv[1:]])
