"""Snapshots: every drive that is open, as one cell file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from multidrop.base import new_file
from multidrop.base.errors import Diagnostic, DriveError, Stopped
from multidrop.base.text import counted
from multidrop.dialects.program_files import Held, Stored
from multidrop.dialects.units import Scale
from multidrop.dialects.values import Snapshot
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.shell import program_listing
from multidrop.shell.channel import running, transferring
from multidrop.shell.workspace import Workspace
from multidrop.simulator import cells
from multidrop.simulator.cell.writer import BusText, DriveText, write
from multidrop.simulator.families import FAMILIES
from multidrop.simulator.floor import Floor

FORBIDDEN = "#@:/ "
"""Characters that the name of a bus in a cell file lacks."""

Scales = Callable[[Drive], Mapping[str, Scale]]
"""The scales of a drive by axis."""


async def save(workspace: Workspace, file: str, scales: Scales = lambda drive: {}) -> None:
    """Read every drive of every bus, and write one cell file. Raises Diagnostic, DriveError or TransportLost.

    A drive that cannot be read is named in the file and raised when the file is written.
    """
    new_file.check(file, printed=True)
    failures: list[DriveError] = []
    buses = [await _bus(workspace, bus, failures, scales) for bus in workspace.buses.values()]
    text = write(buses)
    new_file.write(file, text, workspace.output)
    for bus in buses:
        for drive in bus.drives:
            place = f"{bus.name}:{drive.name}"
            for remark in drive.remarks:
                workspace.notify(f"{place}: {remark}", warning=True)
            if drive.unread:
                names = ", ".join(name for name, _ in drive.unread)
                workspace.notify(f"{place}: not read: {names}; the file says why", warning=True)
    count = sum(len(bus.drives) for bus in buses)
    opens = "" if file == new_file.STANDARD_OUTPUT else f"; sim:{file} opens it"
    workspace.notify(f"{counted(count, 'drive')}{new_file.place(file)}{opens}", outcome=True)
    if failures:
        raise failures[0]
    try:
        Floor(cells.read(text, file))  # as the simulator opens it
    except Diagnostic as problem:
        raise Diagnostic(f"it is written, but the simulator does not open it: {problem}", file) from None


async def read(workspace: Workspace, drive: Drive) -> Snapshot:
    """Read one drive. Raises DriveError."""
    with running(workspace, f"{workspace.display_name(drive)}: snapshot") as progress:
        snapshot = await transferring(drive, drive.family.values.snapshot(progress))
    program = Held(tuple(Stored(at, text) for at, text in snapshot.program))
    if not program.lines:
        return snapshot
    return replace(snapshot, remarked=tuple(program_listing.remarked(workspace, drive, program)))


def described(snapshot: Snapshot) -> DriveText:
    """The table of a drive in a cell file."""
    return FAMILIES[snapshot.kind].describe(snapshot)


async def _bus(workspace: Workspace, bus: Bus, failures: list[DriveError], scales: Scales) -> BusText:
    drives: list[DriveText] = []
    missing: list[str] = []
    for drive in bus.drives.values():
        try:
            drives.append(replace(described(await read(workspace, drive)), units=scales(drive)))
        except Stopped:
            raise
        except DriveError as failure:
            failures.append(failure)
            missing.append(f"not in this file: {failure}")
    name = "".join(
        "-" if character in FORBIDDEN or not character.isprintable() else character for character in bus.name
    )
    return BusText(name, drives, bus.line.baud, missing)
