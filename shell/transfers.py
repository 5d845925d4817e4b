"""Programs between files and drives, for verbs and the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dialects import Diagnostic, Procedure, SourceLine
from dialects.families import program_languages
from dialects.files import text_of
from dialects.problems import errors

if TYPE_CHECKING:
    from drives.drive import Drive
    from shell.workspace import Workspace

PERIOD = 2.0
"""The time between two progress notices, s."""


async def readable(workspace: Workspace, drive: Drive) -> list[str]:
    """Read the program of a drive in its most readable form."""
    return await _held(drive, drive.programs.readable(drive.state))


async def upload(workspace: Workspace, drive: Drive, raw: bool) -> list[str]:
    """Read the program of a drive as the lines of a file. Raises Refused where there is no program."""
    return await _held(drive, drive.programs.upload(drive.state, raw))


async def _held(drive: Drive, talk: Procedure[tuple[str, ...]]) -> list[str]:
    drive.transferring = True
    try:
        return list(await drive.run(talk))
    finally:
        drive.transferring = False


def _loaded(workspace: Workspace, drive: Drive, file: str) -> Sequence[SourceLine]:
    """Load a file in the drive's language. Raises Diagnostic, which names the language if it is another one."""
    own = drive.program_files
    try:
        return own.language.load(file)
    except Diagnostic:
        for other in program_languages().values():
            if other is not own and not errors(other.language.check(text_of(file))):
                what = f"is {other.title}, and {workspace.display_name(drive)} runs {own.title}"
                raise Diagnostic(what, file) from None
        raise


async def download(workspace: Workspace, drive: Drive, file: str) -> None:
    """Send a program file to a drive. Raises Diagnostic for the file, and the failures of `Drive.download`."""
    lines = _loaded(workspace, drive, file)
    for each in drive.program_files.language.check(text_of(file)):
        if each.warning:
            workspace.notify(f"{each.where(file)}: warning: {each.what}", warning=True)
    notified = workspace.now()

    def progress(done: int, total: int) -> None:
        nonlocal notified
        if workspace.now() - notified >= PERIOD:
            notified = workspace.now()
            workspace.notify(f"{workspace.display_name(drive)}: line {done} of {total}")

    workspace.addressed.add((drive.link.name, drive.address))
    await drive.download(lines, progress)
    workspace.notify(f"{workspace.display_name(drive)}: {file} downloaded, {len(lines)} lines")
