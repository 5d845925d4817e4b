"""The programs in drives: listed, compared with a file, saved to files, replaced by a file."""

from __future__ import annotations

import asyncio
import json

from multidrop.base.files import program_text_of
from multidrop.base.new_file import STANDARD_OUTPUT
from multidrop.drives.drive import Drive
from multidrop.shell import program_listing
from multidrop.shell.operations.argument_types import Downloading
from multidrop.shell.origin import Origin
from multidrop.shell.params.work import each, file_of, make_place, targets
from multidrop.shell.programs import transfers
from multidrop.shell.session import Session
from multidrop.shell.verbs.on_drives import OfUrl, OnDrives, R_co
from multidrop.shell.workspace import address_of

DIFFERS = 1
"""The exit code of a comparison where lines differ."""


def list_programs(drives: OfUrl, as_json: bool) -> int:
    """Print the program of each drive; with several the name of its drive is before each line."""

    async def show(session: Session, origin: Origin, drive: Drive) -> None:
        name = session.display_name(drive)
        if as_json:
            held = await program_listing.read(session, drive, "list")
            held.check_listed(name)
            if not held.lines:
                program_listing.say_none(session, drive)
            for at, text in held.lines:
                session.output(json.dumps({"drive": address_of(session, drive), "at": at, "text": text}), origin=origin)
            return
        lines = await program_listing.readable(session, drive)
        if not lines:
            program_listing.say_none(session, drive)
        for line in lines:
            session.output(f"{name}: {line}" if drives.several else line, origin=origin)

    return drives.each(show, unsolicited=not as_json)


def diff(file: str, drives: OfUrl, as_json: bool) -> int:
    """Print the lines that differ; the exit code says whether any does."""
    text, differ = drives.program_text(file), False

    async def compare(session: Session, origin: Origin, drive: Drive) -> None:
        nonlocal differ
        name, differences = session.display_name(drive), await transfers.differences(session, drive, file, text)
        for row in differences:
            facts = {
                "drive": address_of(session, drive),
                "line": row.number or None,
                "here": row.here,
                "at": row.at,
                "there": row.there,
            }
            session.output(json.dumps(facts) if as_json else transfers.in_words(file, row, name), origin=origin)
        differ = differ or bool(differences)
        if not differences:
            session.notify(f"{name} holds {file}", outcome=True)

    return drives.each(compare, unsolicited=False) or (DIFFERS if differ else 0)


def upload(drives: OnDrives[R_co], file: str, raw: bool) -> R_co:
    """Save the program to a new file that can be downloaded again; several to a folder."""
    drives.new_file(file)

    async def save(session: Session, origin: Origin, drive: Drive) -> None:
        lines = await program_listing.upload(session, drive, raw)
        own = file_of(session, drive, file, drives.target, drive.program_files.endings[0])
        make_place(own, drives.target)
        program_listing.save_new(session, drive, own, lines)

    return drives.each(save, unsolicited=file != STANDARD_OUTPUT)


def download(drives: OnDrives[R_co], file: str, wanted: Downloading) -> R_co:
    """Send a program file to each drive; see `OnDrives.run`. Every one gets the text that was checked at first."""
    text, later = drives.program_text(file), drives.several

    async def put(session: Session, origin: Origin) -> None:
        reached = targets(session, origin, drives.target, "programs")
        kept = await asyncio.to_thread(program_text_of, file) if text is None and later else text

        async def send(drive: Drive) -> None:
            await transfers.download(session, origin, drive, file, wanted, kept, later=later)

        await each(session, reached, send)
        if later and wanted.run:
            await each(session, reached, lambda drive: transfers.start(session, origin, drive, file, wanted, kept))

    return drives.run(put, unsolicited=True)
