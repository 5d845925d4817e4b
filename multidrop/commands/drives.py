"""`multidrop program list|upload|download`, `params` and `snapshot`: what is in the drives of a URL."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.shell import configuration, snapshots
from multidrop.shell.batch import runner
from multidrop.shell.line_syntax import split_target
from multidrop.shell.params import file as files
from multidrop.shell.params import replacement, work
from multidrop.shell.params.work import Options, each, is_several, targets
from multidrop.simulator import cells

if TYPE_CHECKING:
    from multidrop.shell.session import Session

DIFFERS = 1
"""The exit code of a comparison where something differs, as where a drive did not reply or refused."""


def params_backup(chosen: argparse.Namespace) -> int:
    work.check_new(chosen.file, chosen.drive)

    async def keep(session: Session) -> None:
        await work.backup(session, chosen.file, chosen.drive)

    return runner.run([chosen.url], keep, unsolicited=False, tried=chosen.drive.split(","))


def params_diff(chosen: argparse.Namespace) -> int:
    """Print what differs; the exit code says whether anything does."""
    if sum((bool(chosen.file), bool(chosen.against or chosen.other), chosen.defaults)) != 1:
        valid = "FILE, --against URL or --other ADDR, or --defaults"
        raise Diagnostic("params diff compares with one thing", hint=valid)
    loaded = files.load(chosen.file) if chosen.file and not work.is_several(chosen.drive) else None

    async def compare(session: Session) -> int:
        other = None
        if chosen.against or chosen.other:
            bus, address = split_target(chosen.other)
            if chosen.against and chosen.against != chosen.url:
                bus = (await session.open(chosen.against))[0].name
            other = session.drive(bus, address or None)
        given = {"name": chosen.file, "other": other, "as_json": chosen.json, "loaded": loaded}
        differs = await work.diff(session, chosen.drive, **given)
        return DIFFERS if differs else 0

    tried = [*chosen.drive.split(","), "" if chosen.against else chosen.other]
    return runner.run([chosen.url], compare, unsolicited=False, tried=tried)


def _named(chosen: argparse.Namespace) -> frozenset[str]:
    """The parameters that are named, with commas between several."""
    return frozenset(name.strip().upper() for name in ",".join(chosen.named).split(",") if name.strip())


def params_restore(chosen: argparse.Namespace) -> int:
    options = Options(
        named=_named(chosen),
        communication=chosen.communication,
        save=chosen.save,
        dry_run=chosen.dry_run,
        other_product=chosen.other_product,
    )
    loaded = None if work.is_several(chosen.drive) else files.load(chosen.file)

    async def put(session: Session) -> None:
        await work.restore_each(session, chosen.file, chosen.drive, options, loaded)

    return runner.run([chosen.url], put, agreed=chosen.yes, unsolicited=False, tried=chosen.drive.split(","))


def snapshot(chosen: argparse.Namespace) -> int:
    new_file.check(chosen.output, printed=True)
    printed = chosen.output == new_file.STANDARD_OUTPUT
    return runner.run(
        chosen.urls,
        lambda session: snapshots.save(session, chosen.output, session.units.scales),
        unsolicited=not printed,
    )


def apply(chosen: argparse.Namespace) -> int:
    """Put the state of one drive of a cell file onto a replacement; report a wrong file before anything is opened."""
    if chosen.source and is_several(chosen.drive):
        raise Diagnostic(f"--from {chosen.source} is for one drive", "snapshot apply", "--drive names one")
    cell = cells.load(chosen.file, configuration.load().allowed)
    wanted = Options(named=_named(chosen), dry_run=chosen.dry_run, other_product=chosen.other_product)

    async def work(session: Session) -> None:
        drives = [drive for each in session.buses.values() for drive in each.drives.values()]
        if not chosen.drive and len(drives) > 1:
            names = ", ".join(session.display_name(drive) for drive in drives)
            raise Diagnostic("several drives have replied", hint=f"--drive names one of {names}")
        drives = targets(session, chosen.drive)
        several = is_several(chosen.drive)
        # All are found in the file before the first one is written to.
        specs = {drive: replacement.chosen(cell, chosen.file, drive, chosen.source, several) for drive in drives}
        await each(session, drives, lambda drive: replacement.apply(session, drive, chosen.file, specs[drive], wanted))

    return runner.run([chosen.url], work, agreed=chosen.yes, tried=chosen.drive.split(","))
