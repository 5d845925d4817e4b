"""`multidrop program list|upload|download`: print, save and replace the program in a drive."""

from __future__ import annotations

import argparse
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING

from multidrop.commands.failure import fail
from multidrop.dialects import Diagnostic
from multidrop.dialects.families import program_language_of, program_languages
from multidrop.dialects.files import program_text_of
from multidrop.dialects.program_files import errors
from multidrop.shell import listings, transfers
from multidrop.shell.front import batch
from multidrop.shell.new_file import STANDARD_OUTPUT
from multidrop.shell.params.work import check_new, each, file_of, is_several, targets

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session


def list_(chosen: argparse.Namespace) -> int:
    """Print the program, a line each, in its most readable form."""

    async def show(session: Session, drive: Drive) -> None:
        own = f"{session.display_name(drive)}: " if is_several(chosen.drive) else ""
        for line in await listings.readable(session, drive):
            session.output(f"{own}{line}")

    return _with_drive(chosen, show)


def upload(chosen: argparse.Namespace) -> int:
    """Save the program to a new file that can be downloaded again; several to a folder."""
    try:
        check_new(chosen.file, chosen.drive)
    except Diagnostic as problem:
        return fail(problem)

    async def save(session: Session, drive: Drive) -> None:
        lines = await listings.upload(session, drive, chosen.raw)
        file = file_of(session, drive, chosen.file, chosen.drive, drive.program_files.endings[0])
        if is_several(chosen.drive):
            Path(file).parent.mkdir(parents=True, exist_ok=True)
        listings.save_new(session, drive, file, lines)

    return _with_drive(chosen, save, unsolicited=chosen.file != STANDARD_OUTPUT)


def download(chosen: argparse.Namespace) -> int:
    """Send a file to the drive; report a wrong file before anything is opened."""
    if (problem := _wrong(chosen.file)) is not None:
        return fail(problem)
    wanted = transfers.Wanted(not chosen.no_verify, chosen.save, chosen.only_changed, chosen.run)

    async def put(session: Session, drive: Drive) -> None:
        await transfers.download(session, drive, chosen.file, wanted)

    return _with_drive(chosen, put, agreed=chosen.yes)


def _wrong(file: str) -> Diagnostic | None:
    """Return the error of a file that is correct in no language, found in the language of its name."""
    own = program_languages()[program_language_of(file)]
    try:
        text = program_text_of(file)
        if all(errors(source.language.check(text)) for source in program_languages().values() if source is not own):
            own.language.load(file)
    except Diagnostic as problem:
        return problem
    return None


def _with_drive(
    chosen: argparse.Namespace,
    body: Callable[[Session, Drive], Awaitable[None]],
    agreed: bool = False,
    unsolicited: bool = True,
) -> int:
    async def work(session: Session) -> None:
        await each(session, targets(session, chosen.drive, "programs"), lambda drive: body(session, drive))

    return batch.run([chosen.url], work, agreed=agreed, unsolicited=unsolicited, tried=chosen.drive.split(","))
