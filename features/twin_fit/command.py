"""`multidrop twin fit`: fit a cell to a log, in virtual time."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.features.twin_fit.work import fit
from multidrop.shell.batch import runner
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.shell.log import steps
from multidrop.shell.streams import stdout

if TYPE_CHECKING:
    from multidrop.shell.session import Session


def run(log_file: str, cell_file: str, as_json: bool) -> int:
    """Fit a cell to a log, in virtual time; report a wrong file before anything is opened.

    The cell is written once all output is. Raises Diagnostic.
    """
    log, cell = Path(log_file), Path(cell_file.removeprefix("sim:"))
    steps.read(log)
    changes: list[Callable[[], None]] = []

    async def body(session: Session) -> None:
        changes.append(await fit(session, log, cell, as_json))

    code = runner.run([f"sim:{cell}"], body, unsolicited=False, replies=False, loop=VirtualLoop)
    if not code and stdout.dropped:
        stdout.write(sys.stderr, f"{cell} is unchanged: its values could not be shown")
    elif not code:
        changes[0]()
    return code
