"""`multidrop program list|upload|download`, `params` and `snapshot`: what is in the drives of a URL."""

from __future__ import annotations

import argparse
import json
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.base.files import program_text_of
from multidrop.base.new_file import STANDARD_OUTPUT
from multidrop.dialects.families import correct_in, program_language_of, program_languages
from multidrop.shell import configuration, program_listing, snapshots
from multidrop.shell.batch import runner
from multidrop.shell.line_syntax import split_target
from multidrop.shell.params import file as files
from multidrop.shell.params import replacement, work
from multidrop.shell.params.work import Options, check_new, each, file_of, is_several, make_place, targets
from multidrop.shell.programs import transfers
from multidrop.shell.workspace import address_of
from multidrop.simulator import cells

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session

DIFFERS = 1
"""The exit code of a comparison where something differs, as where a drive did not reply or refused."""


def list_(chosen: argparse.Namespace) -> int:
    async def show(session: Session, drive: Drive) -> None:
        name = session.display_name(drive)
        if chosen.json:
            held = await program_listing.read(session, drive, "list")
            held.check_listed(name)
            if not held.lines:
                program_listing.say_none(session, drive)
            for at, text in held.lines:
                session.output(json.dumps({"drive": address_of(session, drive), "at": at, "text": text}))
            return
        own = f"{name}: " if is_several(chosen.drive) else ""
        lines = await program_listing.readable(session, drive)
        if not lines:
            program_listing.say_none(session, drive)
        for line in lines:
            session.output(f"{own}{line}")

    return _with_drive(chosen, show, unsolicited=not chosen.json)


def program_diff(chosen: argparse.Namespace) -> int:
    """Print the lines that differ; the exit code says whether any does."""
    text, differ = _checked(chosen.file), False

    async def compare(session: Session, drive: Drive) -> None:
        nonlocal differ
        name, found = session.display_name(drive), await transfers.differences(session, drive, chosen.file, text)
        for row in found:
            facts = {
                "drive": address_of(session, drive),
                "line": row.number or None,
                "here": row.here,
                "at": row.at,
                "there": row.there,
            }
            session.output(json.dumps(facts) if chosen.json else transfers.in_words(chosen.file, row, name))
        differ = differ or bool(found)
        if not found:
            session.notify(f"{name} holds {chosen.file}", outcome=True)

    return _with_drive(chosen, compare, unsolicited=False) or (DIFFERS if differ else 0)


def upload(chosen: argparse.Namespace) -> int:
    """Save the program to a new file that can be downloaded again; several to a folder."""
    check_new(chosen.file, chosen.drive)

    async def save(session: Session, drive: Drive) -> None:
        lines = await program_listing.upload(session, drive, chosen.raw)
        file = file_of(session, drive, chosen.file, chosen.drive, drive.program_files.endings[0])
        make_place(file, chosen.drive)
        program_listing.save_new(session, drive, file, lines)

    return _with_drive(chosen, save, unsolicited=chosen.file != STANDARD_OUTPUT)


def download(chosen: argparse.Namespace) -> int:
    """Send a file to the drive; report a wrong file before anything is opened.

    It is read once: each drive gets the text that was checked here, whatever becomes of the file.
    """
    text = _checked(chosen.file)
    later = is_several(chosen.drive)
    wanted = transfers.Wanted(not chosen.no_verify, chosen.save, chosen.only_changed, chosen.run, later)

    async def put(session: Session) -> None:
        drives = targets(session, chosen.drive, "programs")
        await each(session, drives, lambda drive: transfers.download(session, drive, chosen.file, wanted, text))
        if later and chosen.run:
            await each(session, drives, lambda drive: transfers.start(session, drive, chosen.file, wanted, text))

    return runner.run([chosen.url], put, agreed=chosen.yes, tried=chosen.drive.split(","))


def _checked(file: str) -> str:
    """Read a program file. Raises Diagnostic for one that is correct in no language, in the language of its name."""
    language, text = program_language_of(file), program_text_of(file)
    if not correct_in(text, language):
        program_languages()[language].language.read(text, file)
    return text


def _with_drive(
    chosen: argparse.Namespace,
    body: Callable[[Session, Drive], Awaitable[None]],
    unsolicited: bool,
) -> int:
    async def work(session: Session) -> None:
        await each(session, targets(session, chosen.drive, "programs"), lambda drive: body(session, drive))

    return runner.run([chosen.url], work, unsolicited=unsolicited, tried=chosen.drive.split(","))


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
