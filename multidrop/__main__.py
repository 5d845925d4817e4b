"""The command line's entry: `multidrop` and `python -m multidrop`."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit code. What a person can cause is one line on standard error."""
    _complete_streams()
    try:
        code = _run(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # whoever read the output is gone
        from shell.output import silence

        silence(sys.stdout)
        return 0
    except OSError as problem:
        if problem.errno != errno.ENOSPC:
            raise
        return _unwritten(problem)
    return code


def _complete_streams() -> None:
    """Put the null device where a standard stream is closed: a port that is opened would else take its number."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def _run(arguments: Sequence[str]) -> int:
    from multidrop.cli import parse, run

    try:
        code = run(parse(arguments))
        sys.stdout.flush()
        return code or _unwritten()
    except SystemExit as end:  # --help, --version, and what is no command line at all
        return end.code if isinstance(end.code, int) else 0


def _unwritten(problem: OSError | None = None) -> int:
    """1 where what was to be printed could not be (a full disk), which is told."""
    from shell import output

    if problem is not None:
        output.lose(sys.stdout, problem)
    if output.dropped:
        output.write(sys.stderr, output.dropped[0])
    return int(bool(output.dropped))


if __name__ == "__main__":
    sys.exit(main())
