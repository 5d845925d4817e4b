"""Programs to drives, as the verb and the command line have it: progress told, interrupted as automation is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dialects import Diagnostic, Inexpressible, Procedure, SourceLine
from dialects.files import text_of
from dialects.problems import errors
from dialects.sources import NAMES, SOURCES, Source

if TYPE_CHECKING:
    from drives.drive import Drive
    from shell.session import Session

TOLD = 2.0
"""Seconds between two words about how far it is."""


def source_of(session: Session, drive: Drive) -> Source:
    """How programs of a drive are written. Raises Inexpressible where its wire language takes none."""
    codec = drive.codec
    if codec.language not in SOURCES or codec.family != codec.language:
        spoken = NAMES.get(codec.language, codec.language)
        raise Inexpressible(
            f"{session.display_name(drive)}: programs do not go over {codec.family}; open it over {spoken}/TCP for that"
        )
    return SOURCES[codec.language]


async def readable(session: Session, drive: Drive) -> list[str]:
    """The program in a drive, as readable as it can be made."""
    if drive.codec.family != drive.codec.language:
        return await drive.list_program()  # which says what there is to say
    return await _held(drive, source_of(session, drive).readable(drive.state))


async def upload(session: Session, drive: Drive, raw: bool) -> list[str]:
    """The lines of a file that can be downloaded again. Raises Refused where there is no program."""
    return await _held(drive, source_of(session, drive).upload(drive.state, raw))


async def _held(drive: Drive, talk: Procedure[tuple[str, ...]]) -> list[str]:
    drive.transferring = True
    try:
        return list(await drive.run(talk))
    finally:
        drive.transferring = False


def _loaded(session: Session, drive: Drive, file: str) -> Sequence[SourceLine]:
    """The file in the drive's language. Raises Diagnostic, also where it is right in another one only."""
    own = source_of(session, drive)
    try:
        return own.load(file)
    except Diagnostic:
        for language, other in SOURCES.items():
            if other is not own and not errors(other.check(text_of(file))):
                what = f"is {NAMES[language]}, and {session.display_name(drive)} runs {NAMES[drive.codec.language]}"
                raise Diagnostic(what, file) from None
        raise


async def download(session: Session, drive: Drive, file: str) -> None:
    """Send a program file to a drive. Raises Diagnostic for the file, and what `Drive.download` raises."""
    lines = _loaded(session, drive, file)
    for each in source_of(session, drive).check(text_of(file)):
        if each.warning:
            session.notify(f"{each.where(file)}: warning: {each.what}", warning=True)
    told = session.now()

    def progress(done: int, total: int) -> None:
        nonlocal told
        if session.now() - told >= TOLD:
            told = session.now()
            session.notify(f"{session.display_name(drive)}: line {done} of {total}")

    session.moved.add((drive.bus.name, drive.address))
    await drive.download(lines, progress)
    session.notify(f"{session.display_name(drive)}: {file} downloaded, {len(lines)} lines")
