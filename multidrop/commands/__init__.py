"""The commands: one file per group. Each takes the parsed arguments and returns the exit code."""

from __future__ import annotations

import sys

from multidrop.shell.streams.stdout import exit_code, report, write


def fail(failure: BaseException) -> int:
    """Print one line about a failure; return its exit code."""
    write(sys.stderr, report(failure))
    return exit_code(failure)
