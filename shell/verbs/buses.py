"""Verbs for open buses and their drives: open, close, select, list, status."""

from __future__ import annotations

from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, Inexpressible
from multidrop.shell import scanning
from multidrop.shell.connect.url_forms import table
from multidrop.shell.lines import split_target
from multidrop.shell.openings import model
from multidrop.shell.verbs.registry import Call, verb

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.shell.workspace import Workspace


@verb("/open URL [NAME]", table=table)
async def open_(call: Call) -> None:
    """Open a line of drives; moves nothing.

    NAME becomes the name of the bus. URL is a port, the name of a saved connection, or one of these:
    """
    words = call.words(1, 2)
    await call.commands.open(words[0], words[1] if len(words) > 1 else None)


@verb("/close BUS")
async def close(call: Call) -> None:
    """Close a bus; moves nothing and stops nothing."""
    (name,) = call.words(1, 1)
    await call.commands.close_bus(name)
    call.workspace.notify(f"{name} is closed")


@verb("/use ADDR|BUS[:ADDR]", immediate=True)
async def use(call: Call) -> None:
    """Select the drive or the bus for lines without an address.

    A drive of the selected bus takes precedence over a bus of the same name.
    """
    workspace = call.workspace
    (target,) = call.words(1, 1)
    bus, address = split_target(target)
    if not bus and target in workspace.buses and not _names_drive(workspace.buses.get(workspace.selected_bus), target):
        bus, address = target, ""
    workspace.select(address, bus)
    workspace.notify(f"lines go to {selection(call)}")


def _names_drive(bus: Bus | None, name: str) -> bool:
    """Whether a drive of the bus has this address or label."""
    return bus is not None and any(name in (drive.address, drive.label) for drive in bus.drives.values())


def selection(call: Call) -> str:
    """The selection, for a person."""
    drive = call.workspace.selected
    if drive is None:
        return f"{call.workspace.selected_bus}, where no drive has replied"
    return call.workspace.display_name(drive)


@verb("/drives", immediate=True)
async def drives(call: Call) -> None:
    """List the drives of every open bus; * marks the selected drive."""
    workspace = call.workspace
    call.words(0, 0)
    if not workspace.buses:
        raise Diagnostic("nothing is open", "/drives", "/open URL opens a line of drives")
    for bus in workspace.buses.values():
        if not bus.drives:
            workspace.output(f"  {bus.name}: no drive has replied")
        for drive in bus.drives.values():
            mark = "*" if drive is workspace.selected else " "
            mode = " (in program mode)" if drive.programming else ""
            mode += " (position not referenced)" if drive.state.unreferenced else ""
            words = (mark, workspace.display_name(drive), drive.label, model(drive))
            workspace.output(" ".join(word for word in words if word) + mode)


@verb("/scan [BUS]")
async def scan(call: Call) -> None:
    """Search an open line for drives that are not listed: every name or number, at its baud rate; moves nothing.

    `multidrop scan PORT` searches other baud rates and languages.
    """
    workspace = call.workspace
    words = call.words(0, 1)
    bus = workspace.bus(words[0] if words else "")
    found = await scanning.extend(workspace, bus)
    for address in found:
        workspace.output(f"{bus.name}: {address} {model(bus.drives[address])}")
    if not found:
        workspace.notify(f"{bus.name}: no other drive replies", outcome=True)


@verb("/referenced [ADDR]", immediate=True)
async def referenced(call: Call) -> None:
    """Take the position of a drive for right again after a restart; nothing is sent.

    A homing that ends well, or a position that is set, does the same. Until then `~` is before the position.
    """
    words = call.words(0, 1)
    drive = call.drive(words[0] if words else "")
    name = call.workspace.display_name(drive) or drive.shown
    if drive not in call.workspace.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {name}", hint="/drives lists them")
    lost = bool(drive.state.unreferenced)
    drive.state.referenced()
    call.workspace.notify(f"{name}: its position {'counts again' if lost else 'was not marked as not referenced'}")
    call.workspace.changed()


def _reports_status(workspace: Workspace) -> bool:
    return workspace.selected is not None and workspace.selected.family.status is not None


@verb("/status [ADDR]", fits=_reports_status)
async def status(call: Call) -> None:
    """Show the state of a drive in words: motion, program, errors, inputs, outputs."""
    words = call.words(0, 1)
    drive = call.drive(words[0] if words else "")
    if (read := drive.family.status) is None:
        raise Inexpressible(f"{call.workspace.display_name(drive)}: drives of this family do not report their state")
    for line in await drive.run(read(drive.state)):
        call.workspace.output(line)
