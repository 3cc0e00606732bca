"""The console command `edgepuck`."""

import signal
import sys

from . import _edgepuck


def main() -> int:
    """Run the program `edgepuck` with this process's arguments, and return its exit code."""
    # Ctrl+C ends the program, as in a shell.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _edgepuck.main(["edgepuck", *sys.argv[1:]])
