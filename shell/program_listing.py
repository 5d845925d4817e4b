"""The programs of a drive: read, listed with the remarks of their file, made into a file; what is observed of one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic
from multidrop.base.files import SourceLine
from multidrop.base.text import counted
from multidrop.dialects.family import Programs
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.values import Readings
from multidrop.drives.drive import Drive
from multidrop.shell.channel import Channel, running, transferring
from multidrop.shell.events import Phase, ProgramRead, ProgramSeen, SettingsRead
from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.state.backups import Copy, Sources
from multidrop.shell.workspace import Workspace

AROUND = 3
"""Lines that are shown before and after the current one."""
_LISTED = re.compile(r"\s*(\d+)\s+(\S.*)")


class ProgramListing:
    """The lines of the program in a drive. `state`: the folder with the copies of downloaded files."""

    def __init__(self, state: Path, programs: Programs, rows: Sequence[Stored] = ()) -> None:
        self.rows = tuple(rows)
        held = Held(self.rows)
        source = Sources(state).find(held) if rows else None
        lines = () if source is None else programs.annotated(source.text, held)
        self._remarks = {int(match[1]): match[2] for line in lines if (match := _LISTED.fullmatch(line))}

    def row(self, address: int) -> Stored:
        """The line at an address, or the one whose compiled lines hold that address."""
        return next((listed for listed in reversed(self.rows) if listed.at <= address), Stored(address, ""))

    @property
    def lines(self) -> tuple[tuple[int, str], ...]:
        """Every line with its address, and with its remark."""
        return tuple((row.at, self._text(row)) for row in self.rows)

    def shown(self, row: Stored) -> str:
        """A line with its address and its remark."""
        return f"{row.at}  {self._text(row)}".rstrip()

    def around(self, address: int | None) -> list[str]:
        """The lines around one, which an arrow marks; none where there is no such line."""
        current = None if address is None else self.row(address)
        if current not in self.rows:
            return []
        at = self.rows.index(current)
        shown = self.rows[max(at - AROUND, 0) : at + AROUND + 1]
        width = len(str(shown[-1].at))
        return [f"{'->' if row == current else '  '} {row.at:{width}}  {self._text(row)}" for row in shown]

    def _text(self, row: Stored) -> str:
        """The text of a line, with its remark if it is of this program."""
        return self._remarks.get(row.at, row.text) if row in self.rows else row.text


class ListingSight:
    """Publishes what is seen of the program of a drive."""

    def __init__(self, channel: Channel, drive: Drive) -> None:
        self._channel, self._drive = channel, drive
        self._last: tuple[int | None, Phase] = (None, Phase.EXECUTES)
        self._break_point = ""

    def read(self, listing: ProgramListing) -> None:
        self._channel.publish(ProgramRead(*self._place(), listing.lines))

    def changes(self) -> None:
        """Publish that lines are sent that change the program: what was read of it is not what it holds."""
        self._channel.publish(ProgramRead(*self._place(), (), known=False))

    def seen(self, line: int | None, phase: Phase = Phase.EXECUTES) -> None:
        """Publish where the program is; None: no program runs, or its place is not known."""
        self._last = line, phase
        self._channel.publish(ProgramSeen(*self._place(), line, phase, self._break_point))

    def breaks(self, place: str) -> None:
        """Publish the place of the break point; empty: there is none."""
        self._break_point = place
        self.seen(*self._last)

    def _place(self) -> tuple[float, str, str]:
        return self._channel.now(), self._drive.link.name, self._drive.address


def say_none(workspace: Workspace, drive: Drive) -> None:
    """Say that a listing is empty because the drive holds no program."""
    workspace.notify(f"{workspace.display_name(drive)}: no program", outcome=True)


def forget(workspace: Workspace, drive: Drive) -> None:
    """Take nothing of what was read of a drive that was restarted, or may have been, for what it holds."""
    workspace.names.forget(drive)
    sight = ListingSight(workspace, drive)
    sight.changes()
    sight.breaks("")
    at, bus, address = workspace.now(), drive.link.name, drive.address
    workspace.publish(SettingsRead(at, bus, address, Readings(), known=False))


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
    source = None if raw else _source(workspace, drive, held)
    if source is None:
        return list(drive.programs.file(held, raw))
    workspace.notify(f"{name}: remarks and layout are those of {source.file}, downloaded {source.at}", outcome=True)
    return list(drive.programs.refreshed(source.text, held))


def remarked(workspace: Workspace, drive: Drive, held: Held) -> list[str]:
    """The listing with the remarks and the layout of the file that it came from; empty where that is not known."""
    source = _source(workspace, drive, held) if held.lines else None
    return [] if source is None else list(drive.programs.annotated(source.text, held))


def _source(workspace: Workspace, drive: Drive, held: Held) -> Copy | None:
    """The kept file that has exactly the lines of the drive; None without one."""
    source, programs = Sources(workspace.settings.state).find(held), drive.programs
    if source is None:
        return None
    try:
        lines = drive.program_files.language.read(source.text, source.file)
    except Diagnostic:
        return None
    same = not programs.differences(lines, held, None) and programs.size(lines) == len(held.lines)
    return source if same else None


async def read(workspace: Workspace, drive: Drive, what: str, lines: Sequence[SourceLine] = ()) -> Held:
    """Read what a drive holds, with progress. `lines`: of a file that is to go there.

    Raises Diagnostic for an address that means several drives.
    """
    check_one(drive)
    with running(workspace, f"{workspace.display_name(drive)}: {what}") as job:
        held = await transferring(drive, drive.programs.read(lines, job))
    workspace.names.learn(drive, held)
    if drive.family.debugging is not None and not held.locked:
        listing = ProgramListing(workspace.settings.state, drive.programs, drive.family.debugging.rows(held))
        ListingSight(workspace, drive).read(listing)
    return held


def check_one(drive: Drive) -> None:
    """Raise Diagnostic for an address that means several drives."""
    if drive.address in EVERYONE:
        raise of_one(drive.address)


def of_one(target: str) -> Diagnostic:
    """The error for a target that means several drives."""
    return Diagnostic("programs are those of one drive (nothing was sent)", target, "name one")


def save_new(workspace: Workspace, drive: Drive, file: str, lines: Sequence[str]) -> None:
    """Write the lines of a drive to a new file (`-`: standard output), or raise Diagnostic: then there is none."""
    new_file.write(file, "".join(f"{line}\n" for line in lines), workspace.output)
    workspace.notify(
        f"{workspace.display_name(drive)}: {counted(len(lines), 'line')}{new_file.place(file)}", outcome=True
    )
