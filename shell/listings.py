"""What a drive holds of programs: read, listed, made into a file, with the remarks of the file that it came from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, SourceLine
from multidrop.dialects.program_files import Held
from multidrop.shell import new_file, sources
from multidrop.shell.channel import running, transferring
from multidrop.shell.lines import EVERYONE
from multidrop.shell.program_listing import Listing, Sight

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.workspace import Workspace


async def readable(workspace: Workspace, drive: Drive) -> list[str]:
    """List the program of a drive, with the remarks of the file that it came from where that is known.

    Raises Refused where it is locked.
    """
    held = await read(workspace, drive, "list")
    held.check_listed(workspace.display_name(drive))
    return remarked(workspace, drive, held) or list(drive.programs.readable(held))


async def upload(workspace: Workspace, drive: Drive, raw: bool = False) -> list[str]:
    """Read the program of a drive as the lines of a file. Raises Refused where there is no program, or it is locked.

    The lines are those of the downloaded file that it came from, with the present values of variables, where that is
    known. `raw`: as they are stored.
    """
    name = workspace.display_name(drive)
    held = await read(workspace, drive, "upload")
    held.check_program(name)
    source = sources.recall(workspace.settings.state, held)
    if raw or source is None or not _is_of(drive, source, held):
        return list(drive.programs.file(drive.state, held, raw))
    workspace.notify(f"{name}: remarks and layout are those of {source.file}, downloaded {source.at}", outcome=True)
    return list(drive.programs.refreshed(source.text, held))


def remarked(workspace: Workspace, drive: Drive, held: Held) -> list[str]:
    """The listing with the remarks and the layout of the file that it came from; empty where that is not known."""
    source = sources.recall(workspace.settings.state, held) if held.lines else None
    if source is None or not _is_of(drive, source, held):
        return []
    return list(drive.programs.annotated(source.text, held))


def _is_of(drive: Drive, source: sources.Source, held: Held) -> bool:
    """Whether a kept file has exactly the lines of the drive."""
    try:
        lines = drive.program_files.language.read(source.text, source.file)
    except Diagnostic:
        return False
    programs = drive.programs
    return not programs.differences(drive.state, lines, held, None) and programs.size(lines) == len(held.lines)


async def read(workspace: Workspace, drive: Drive, what: str, lines: Sequence[SourceLine] = ()) -> Held:
    """Read what a drive holds, with progress. `lines`: of a file that is to go there.

    Raises Diagnostic for an address that means several drives.
    """
    check_one(drive)
    with running(workspace, f"{workspace.display_name(drive)}: {what}") as job:
        held = await transferring(drive, drive.programs.read(drive.state, lines, job))
    workspace.names.learn(drive, held)
    if drive.family.debugging is not None and not held.locked:
        listing = Listing(workspace.settings.state, drive.programs, drive.family.debugging.rows(held))
        Sight(workspace, drive).read(listing)
    return held


def check_one(drive: Drive) -> None:
    """Raise Diagnostic for an address that means several drives."""
    if drive.address in EVERYONE:
        raise Diagnostic("programs are those of one drive (nothing was sent)", drive.address, "name one")


def save_new(workspace: Workspace, drive: Drive, file: str, lines: Sequence[str]) -> None:
    """Write the lines of a drive to a new file (`-`: standard output), or raise Diagnostic: then there is none."""
    new_file.write(file, "".join(f"{line}\n" for line in lines), workspace.output)
    workspace.notify(f"{workspace.display_name(drive)}: {len(lines)} lines{new_file.place(file)}", outcome=True)
