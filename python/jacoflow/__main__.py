"""The command line: `python -m jacoflow` and the console script `jacoflow` are the binary of the same
name."""

import sys

from ._jacoflow import _run_command_line

__all__ = ["main"]


def main() -> int:
    """Runs the command line on `sys.argv`.

    Returns the exit code (no unit): 0 success, 1 failure, 2 wrong usage, 130 interrupted.
    """
    # Closed before the start. A file opened later would get its number and, with it, what is printed.
    if sys.__stdout__ is None:
        print("error: standard output: expected to be open, got it closed; to discard it use /dev/null", file=sys.stderr)
        return 1
    return _run_command_line(["jacoflow", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
