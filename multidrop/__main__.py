"""The command line's entry: `multidrop` and `python -m multidrop`."""

from __future__ import annotations

import errno
import gc
import os
import signal
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code. An error that a person can cause is one line on standard error.

    Without `arguments` it is the command of this process, which ends next. Files and ports are closed by then. So the
    collector need not visit every object again: that takes longer than the rest of the end.
    """
    if arguments is not None:
        return _guarded(arguments, own=False)
    code = _guarded(sys.argv[1:], own=True)
    gc.freeze()
    return code


def _guarded(arguments: Sequence[str], own: bool) -> int:
    """Run a command. `own`: it is the one of this process, whose reader is watched."""
    try:
        _complete_streams()
        code = _run(arguments, own)
        sys.stdout.flush()
    except KeyboardInterrupt:
        from multidrop.shell.exit_codes import INTERRUPTED
        from multidrop.shell.streams.stdout import final

        return final(INTERRUPTED)
    except BrokenPipeError:  # the reader of the output is gone
        from multidrop.shell.exit_codes import READER_GONE
        from multidrop.shell.streams.stdout import silence

        silence(sys.stdout)
        return READER_GONE
    except OSError as problem:
        if problem.errno != errno.ENOSPC:
            raise
        return _unwritten(problem)
    return code


def _complete_streams() -> None:
    """Open the null device in place of a closed standard stream: else a port would take its number."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def _run(arguments: Sequence[str], own: bool) -> int:
    from multidrop.cli import parse, run

    try:
        chosen = parse(arguments)
        from multidrop.shell.streams import output_streams, stdout

        output_streams.as_json = getattr(chosen, "json", False) is True
        if own and not chosen.run_by.connection:
            stdout.watch_reader(signal.SIGINT)
        code = run(chosen)
        stdout.flush_printed()
        unwritten = _unwritten()
        return stdout.final(code) or unwritten
    except SystemExit as end:  # --help, --version, and wrong usage
        return end.code if isinstance(end.code, int) else 0


def _unwritten(problem: OSError | None = None) -> int:
    """Return 1, and report it, if output could not be written (a full disk)."""
    from multidrop.shell.streams import stdout

    if problem is not None:
        stdout.lose(sys.stdout, problem)
    if stdout.dropped:
        stdout.write(sys.stderr, stdout.dropped[0])
    return int(bool(stdout.dropped))


if __name__ == "__main__":
    sys.exit(main())
