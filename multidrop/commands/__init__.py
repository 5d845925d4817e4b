"""The commands: one file per group. Each takes the parsed arguments and returns the exit code."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from multidrop.shell.exit_codes import exit_code
from multidrop.shell.streams.stdout import report, write

if TYPE_CHECKING:
    from multidrop.dialects import Diagnostic
    from multidrop.shell.batch.report import Report


def fail(failure: BaseException) -> int:
    """Print one line about a failure, or about each of its problems; return its exit code."""
    write(sys.stderr, *map(report, getattr(failure, "problems", (failure,))))
    return exit_code(failure)


def refused(reports: Report, failure: Diagnostic) -> int:
    """Report a script that is not executed, with each of its errors; return the exit code."""
    reports.wrong(getattr(failure, "problems", (failure,)))
    return fail(failure)
