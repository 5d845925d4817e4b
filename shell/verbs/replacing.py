"""Drives of a cell file put onto replacements."""

from __future__ import annotations

from multidrop.base.errors import Diagnostic
from multidrop.shell import configuration
from multidrop.shell.operations.argument_types import Restoring
from multidrop.shell.origin import Origin
from multidrop.shell.params import replacement
from multidrop.shell.params.work import each, targets
from multidrop.shell.session import Session
from multidrop.shell.verbs.on_drives import OfUrl
from multidrop.simulator import cells


def apply_each(drives: OfUrl, file: str, source: str, wanted: Restoring) -> int:
    """Put drives of a cell file onto replacements, and return the exit code.

    `source`: the name of the only drive in the file. Raises Diagnostic for a wrong file, before anything is opened.
    """
    if source and drives.several:
        raise Diagnostic(f"--from {source} is for one drive", "snapshot apply", "--drive names one")
    cell = cells.load(file, configuration.load().allowed)

    async def put(session: Session, origin: Origin) -> None:
        there = [drive for bus in session.buses.values() for drive in bus.drives.values()]
        if not drives.target and len(there) > 1:
            names = ", ".join(session.display_name(drive) for drive in there)
            raise Diagnostic("several drives have replied", hint=f"--drive names one of {names}")
        reached = targets(session, origin, drives.target)
        # All are found in the file before the first one is written to.
        specs = {drive: replacement.chosen(cell, file, drive, source, drives.several) for drive in reached}
        await each(
            session, reached, lambda drive: replacement.apply(session, origin, drive, file, specs[drive], wanted)
        )

    return drives.run(put, unsolicited=True)
