"""`multidrop sim`: a simulated cell for other programs."""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings
from multidrop.shell.output import finish, nonblocking
from multidrop.simulator.serving.command import serve


def run(chosen: argparse.Namespace) -> int:
    """Serve the cell until a signal, or until the reader of its output leaves."""
    return asyncio.run(_serve(chosen))


async def _serve(chosen: argparse.Namespace) -> int:
    with nonblocking() as streams:
        try:
            allow = (*map(Path, chosen.allow), *(settings.load().allowed if chosen.cell else ()))
            out = sys.stdout
            await serve(chosen.cell, json=chosen.json, speed=chosen.speed, stdin=sys.stdin, stdout=out, allow=allow)
        except Diagnostic as problem:
            return fail(problem)
        finally:
            await finish(streams, lambda: True)
    return 0
