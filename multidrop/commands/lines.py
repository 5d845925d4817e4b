"""`multidrop shell`, `multidrop send` and `multidrop run`: lines from a prompt, the command line, or a script."""

from __future__ import annotations

import argparse
import sys
from functools import partial

from dialects import Diagnostic
from dialects.on_demand import importing
from multidrop.commands.failure import fail


def shell(chosen: argparse.Namespace) -> int:
    """Show the prompt, or run lines from standard input."""
    if sys.stdin.isatty():
        with importing():
            from shell.front.prompt import run
        return run(chosen.urls, reconnect=not chosen.no_reconnect, agreed=chosen.yes, raw=chosen.raw)
    from shell.front import batch
    from shell.front.scripts import run_stream

    lines = partial(run_stream, descriptor=sys.stdin.fileno())
    return batch.run(chosen.urls, lines, watch_keys=False, agreed=chosen.yes, asks=False, raw=chosen.raw)


def send(chosen: argparse.Namespace) -> int:
    """Run lines and print the replies."""
    with importing():
        from shell.front import batch
        from shell.front.scripts import run_lines
        from shell.lines import each_names_one_drive

    lazy = each_names_one_drive(chosen.lines)
    lines = partial(run_lines, lines=chosen.lines)
    return batch.run([chosen.url], lines, lazy=lazy, agreed=chosen.yes, asks=False)


def run(chosen: argparse.Namespace) -> int:
    """Run a script."""
    from shell.front import batch
    from shell.front.scripts import read_script, run_script

    try:
        lines = read_script(chosen.script, dict(chosen.set))
    except Diagnostic as problem:
        return fail(problem)
    return batch.run(chosen.on, partial(run_script, lines=lines), agreed=chosen.yes, asks=False)
