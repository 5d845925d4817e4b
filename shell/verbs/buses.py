"""Verbs for what is open: buses, drives and which of them is selected."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dialects import Diagnostic, Inexpressible, Stated
from shell.connect.url_forms import table
from shell.lines import split_target
from shell.naming import model
from shell.verbs.registry import Call, verb

if TYPE_CHECKING:
    from shell.session import Session


@verb("/open URL [NAME]", table=table)
async def open_(call: Call) -> None:
    """Open a line of drives; moves nothing.

    NAME is what the bus is called here. URL is the name of a saved connection, a port, or one of these:
    """
    words = call.words(1, 2)
    await call.session.open(words[0], words[1] if len(words) > 1 else None)


@verb("/close BUS")
async def close(call: Call) -> None:
    """Close a bus; moves nothing and stops nothing."""
    (name,) = call.words(1, 1)
    await call.session.close_bus(name)
    call.session.notify(f"{name} is closed")


@verb("/use ADDR|BUS[:ADDR]", immediate=True)
async def use(call: Call) -> None:
    """Select the drive, or the bus, that plain lines go to.

    A drive of the selected bus goes before a bus of the same name.
    """
    session = call.session
    (target,) = call.words(1, 1)
    bus, address = split_target(target)
    here = session.buses.get(session.selected_bus)
    known = here is not None and any(target in (drive.address, drive.label) for drive in here.drives.values())
    if not bus and not known and target in session.buses:
        bus, address = target, ""
    session.select(address, bus)
    session.notify(f"lines go to {selection(call)}")


def selection(call: Call) -> str:
    """What is selected, for a person."""
    drive = call.session.selected
    return call.session.display_name(drive) if drive else f"{call.session.selected_bus}, where no drive is known"


@verb("/drives", immediate=True)
async def drives(call: Call) -> None:
    """List the drives of every open bus; the selected one is marked."""
    session = call.session
    call.words(0, 0)
    if not session.buses:
        raise Diagnostic("nothing is open", "/drives", "/open URL opens a line of drives")
    for bus in session.buses.values():
        if not bus.drives:
            session.output(f"  {bus.name}: no drive has answered")
        for drive in bus.drives.values():
            mark = "*" if drive is session.selected else " "
            state = " (in program mode)" if drive.programming else ""
            words = (mark, session.display_name(drive), drive.label, model(drive))
            session.output(" ".join(word for word in words if word) + state)


def _states(session: Session) -> bool:
    return session.selected is not None and isinstance(session.selected.codec, Stated)


@verb("/status [ADDR]", fits=_states)
async def status(call: Call) -> None:
    """Show the state of the selected drive, or of another one, in words: motion, program, errors, inputs, outputs."""
    words = call.words(0, 1)
    drive = call.drive(words[0] if words else "")
    if not isinstance(drive.codec, Stated):
        where = call.session.display_name(drive)
        raise Inexpressible(f"{where}: drives of this family do not tell their state")
    for line in await drive.run(drive.codec.status(drive.state)):
        call.session.output(line)
