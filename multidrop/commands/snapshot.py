"""`multidrop snapshot`: a machine as a cell file, and one of its drives onto a replacement."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.shell import new_file, replacement, snapshots
from multidrop.shell.connect import settings
from multidrop.shell.front import batch
from multidrop.shell.params.work import each, is_several, targets
from multidrop.simulator import cells

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session


def take(chosen: argparse.Namespace) -> int:
    """Read every drive of the URLs into one new file."""
    try:
        new_file.check(chosen.output, printed=True)
    except Diagnostic as problem:
        return fail(problem)
    printed = chosen.output == new_file.STANDARD_OUTPUT
    return batch.run(chosen.urls, lambda session: snapshots.save(session, chosen.output), unsolicited=not printed)


def apply(chosen: argparse.Namespace) -> int:
    """Put the state of one drive of a cell file onto a replacement; report a wrong file before anything is opened."""
    try:
        if chosen.source and is_several(chosen.drive):
            raise Diagnostic(f"--from {chosen.source} is for one drive", "snapshot apply", "--drive names one")
        cell = cells.load(chosen.file, settings.load().allowed)
    except Diagnostic as problem:
        return fail(problem)
    wanted = replacement.Wanted(
        named=frozenset(name.strip().upper() for name in ",".join(chosen.named).split(",") if name.strip()),
        dry=chosen.dry_run,
        other_product=chosen.other_product,
    )

    async def work(session: Session) -> None:
        drives = _drives(session, chosen.drive)
        several = is_several(chosen.drive)
        # All are found in the file before the first one is written to.
        specs = {drive: replacement.chosen(cell, chosen.file, drive, chosen.source, several) for drive in drives}
        await each(session, drives, lambda drive: replacement.apply(session, drive, chosen.file, specs[drive], wanted))

    return batch.run([chosen.url], work, agreed=chosen.yes, tried=chosen.drive.split(","))


def _drives(session: Session, target: str) -> list[Drive]:
    """Find the replacements. Raises Diagnostic where one of several drives can be meant."""
    drives = [drive for each in session.buses.values() for drive in each.drives.values()]
    if not target and len(drives) > 1:
        names = ", ".join(session.display_name(drive) for drive in drives)
        raise Diagnostic("several drives have replied", hint=f"--drive names one of {names}")
    return targets(session, target)
