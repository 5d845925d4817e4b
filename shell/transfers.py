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
    from shell.workspace import Workspace

TOLD = 2.0
"""Seconds between two words about how far it is."""


def source_of(workspace: Workspace, drive: Drive) -> Source:
    """How programs of a drive are written. Raises Inexpressible where its wire language takes none."""
    codec = drive.codec
    if codec.language not in SOURCES or codec.family != codec.language:
        spoken = NAMES.get(codec.language, codec.language)
        what = f"programs do not go over {codec.family}; open it over {spoken}/TCP for that"
        raise Inexpressible(f"{workspace.display_name(drive)}: {what}")
    return SOURCES[codec.language]


async def readable(workspace: Workspace, drive: Drive) -> list[str]:
    """The program in a drive, as readable as it can be made."""
    if drive.codec.family != drive.codec.language:
        return await drive.list_program()  # which says what there is to say
    return await _held(drive, source_of(workspace, drive).readable(drive.state))


async def upload(workspace: Workspace, drive: Drive, raw: bool) -> list[str]:
    """The lines of a file that can be downloaded again. Raises Refused where there is no program."""
    return await _held(drive, source_of(workspace, drive).upload(drive.state, raw))


async def _held(drive: Drive, talk: Procedure[tuple[str, ...]]) -> list[str]:
    drive.transferring = True
    try:
        return list(await drive.run(talk))
    finally:
        drive.transferring = False


def _loaded(workspace: Workspace, drive: Drive, file: str) -> Sequence[SourceLine]:
    """The file in the drive's language. Raises Diagnostic, also where it is right in another one only."""
    own = source_of(workspace, drive)
    try:
        return own.load(file)
    except Diagnostic:
        for language, other in SOURCES.items():
            if other is not own and not errors(other.check(text_of(file))):
                what = f"is {NAMES[language]}, and {workspace.display_name(drive)} runs {NAMES[drive.codec.language]}"
                raise Diagnostic(what, file) from None
        raise


async def download(workspace: Workspace, drive: Drive, file: str) -> None:
    """Send a program file to a drive. Raises Diagnostic for the file, and what `Drive.download` raises."""
    lines = _loaded(workspace, drive, file)
    for each in source_of(workspace, drive).check(text_of(file)):
        if each.warning:
            workspace.notify(f"{each.where(file)}: warning: {each.what}", warning=True)
    told = workspace.now()

    def progress(done: int, total: int) -> None:
        nonlocal told
        if workspace.now() - told >= TOLD:
            told = workspace.now()
            workspace.notify(f"{workspace.display_name(drive)}: line {done} of {total}")

    workspace.addressed.add((drive.link.name, drive.address))
    await drive.download(lines, progress)
    workspace.notify(f"{workspace.display_name(drive)}: {file} downloaded, {len(lines)} lines")
