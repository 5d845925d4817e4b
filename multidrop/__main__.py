"""The command line's entry: `multidrop` and `python -m multidrop`."""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit code. What a person can cause is one line on standard error."""
    from multidrop.cli import parse, run
    from shell.output import silence, write

    try:
        chosen = parse(sys.argv[1:] if arguments is None else arguments)
        code = run(chosen)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    except KeyboardInterrupt:
        write(sys.stderr, "interrupted")
        code = 130
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        silence(sys.stdout)
    return code


if __name__ == "__main__":
    sys.exit(main())
