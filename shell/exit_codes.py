"""The exit codes of multidrop, by failure."""

from __future__ import annotations

from multidrop.base.errors import Diagnostic, DriveError, Stopped, TransportLost

CODES: tuple[tuple[type[BaseException], int], ...] = (
    (Stopped, 4),
    (DriveError, 1),
    (Diagnostic, 2),
    (TransportLost, 3),
)
"""Exit codes by failure; the first match counts. An interruption has 130."""
INTERRUPTED = 130
READER_GONE = 141
"""The exit code if the reader of standard output is gone: that of SIGPIPE."""


def exit_code(failure: BaseException) -> int:
    return next(code for kind, code in CODES if isinstance(failure, kind))
