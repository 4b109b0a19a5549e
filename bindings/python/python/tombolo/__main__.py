"""The program `tombolo`, as `tombolo` and `python -m tombolo` run it."""

import signal
import sys

from . import _native


def main() -> int:
    """Do what the arguments of this process ask for, and return the exit code."""
    # The program ends at once with Ctrl-C, as it does where it is not run by Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.program(["tombolo", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
