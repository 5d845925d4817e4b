"""Operations on ports and buses: open, close, select, list, name, search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic, Inexpressible, NoAnswer
from multidrop.shell.operations import conditions
from multidrop.shell.operations.argument_types import Address, BusName, UrlForm
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Call

NewBusName = Annotated[str, Argument(metavar="NAME")]
Selected = Annotated[str, Argument(metavar="ADDR|BUS[:ADDR]", listed=(Listed.DRIVE, Listed.BUS))]
Side = Annotated[str, Argument(words={"left": "before its neighbour", "right": "after its neighbour"})]


async def open_(call: Call, url: UrlForm, name: NewBusName = "") -> None:
    from multidrop.shell.events import By

    for bus in await call.session.open(url, name or None):
        if bus.silent and call.by is not By.OPERATOR:
            await call.session.forget(bus)
            raise NoAnswer(bus.silent)


def urls() -> Sequence[str]:
    from multidrop.shell.connect.schemes import table

    return table()


async def close(call: Call, name: BusName) -> None:
    bus, session = call.bus(name), call.session
    selected = session.selected_bus == bus.name
    if selected:  # what follows was written for this bus, and never goes to another one
        session.selected_bus, session.deselected = "", True
    try:
        await session.forget(bus)
    finally:
        if selected and session.front.before_quit is not None and session.buses:  # a person sees which one is next
            session.select("", next(iter(session.buses)))
        session.changed()
    session.notify(f"{name} is closed")


def use(call: Call, target: Selected) -> None:
    workspace = call.session
    bus, address = call.origin.target(target)
    if not bus and target in workspace.buses:
        selected = workspace.buses.get(workspace.selected_bus)
        if not selected or all(target not in (drive.address, drive.label) for drive in selected.drives.values()):
            bus, address = target, ""
    workspace.select(address, bus)
    drive = workspace.selected
    empty = f"{workspace.selected_bus}, where no drive has replied"
    workspace.notify(f"lines go to {workspace.display_name(drive) if drive else empty}")


def drives(call: Call) -> None:
    from multidrop.shell.openings import model

    workspace = call.session
    if not workspace.buses:
        raise Diagnostic("nothing is open", "/drives", "/open URL opens a line of drives")
    for bus in workspace.buses.values():
        if not bus.drives:
            call.output(f"  {bus.name}: no drive has replied")
        for drive in bus.drives.values():
            mark = "*" if drive is workspace.selected else " "
            mode = " (in program mode)" if drive.programming else ""
            mode += " (position not referenced)" if drive.state.unreferenced else ""
            mode += " (not identified)" if drive.state.stranger else ""
            words = (mark, workspace.display_name(drive), drive.label, model(drive))
            call.output(" ".join(word for word in words if word) + mode)


async def scan(call: Call, bus_name: BusName = "") -> None:
    from multidrop.shell.events import By
    from multidrop.shell.finding import scanning
    from multidrop.shell.openings import model

    workspace = call.session
    bus = call.bus(bus_name)
    if call.by is By.OPERATOR and workspace.openings.searches(bus):
        return await workspace.openings.search(bus)
    lines = await scanning.extend(workspace, bus)
    if lines and workspace.of(bus).selected is None:
        workspace.identified(bus)
    for address in lines:
        call.output(f"{bus.name}: {address} {model(bus.drives[address])}")
    if not lines:
        workspace.notify(f"{bus.name}: no other drive replies", outcome=True)


def referenced(call: Call, address: Address = "") -> None:
    drive = call.drive(address)
    name = call.session.display_name(drive) or drive.shown
    if drive not in call.session.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {name}", hint="/drives lists them")
    lost = bool(drive.state.unreferenced)
    drive.state.referenced()
    call.session.notify(f"{name}: its position {'counts again' if lost else 'was not marked as not referenced'}")
    call.session.changed()


async def status(call: Call, address: Address = "") -> None:
    drive = call.drive(address)
    if not drive.family.offers("status"):
        raise Inexpressible(f"{call.session.display_name(drive)}: drives of this family do not report their state")
    for line in await drive.run(drive.family.status()):
        call.output(line)
    await _show_in_units(call, drive)


async def _show_in_units(call: Call, drive: Drive) -> None:
    from multidrop.dialects.units import Takes

    units = call.session.units if call.session.scaled else None
    if units is None or not units.shown or not units.axes(drive) or drive.programming:
        return
    await units.look(drive)
    for motion in await drive.motion():
        place = units.words(drive, motion.axis, motion.position, Takes.PLACE)
        speed = units.words(drive, motion.axis, motion.velocity, Takes.VELOCITY)
        if place:
            lost = "" if units.referenced(drive, motion.axis) else ", not referenced"
            shown = ", ".join(filter(None, (part.strip(" ()") for part in (place, speed))))
            call.output(f"{motion.axis} in units: {shown}{lost}".lstrip())


def rename(call: Call, name: NewBusName, bus: BusName = "") -> None:
    call.session.rename_bus(call.bus(bus), name)


def tab(call: Call, where: Side, bus: BusName = "") -> None:
    call.session.move_bus(call.bus(bus), 1 if where == "right" else -1)


def keep(call: Call, name: NewBusName, bus: BusName = "") -> None:
    from multidrop.shell import configuration

    url = call.session.openings.url_of(call.bus(bus))
    path = configuration.save(name, url)
    call.session.notify(f"{path}: connection {name} is saved: {url}", outcome=True)


OPERATIONS = (
    Operation(
        open_,
        verb="/open",
        group=Group.LINES,
        rows=urls,
        help="""
Open a line of drives; moves nothing.

NAME becomes the name of the bus. URL is a port, the name of a saved connection, or one of these:
""",
    ),
    Operation(close, verb="/close", group=Group.LINES, help="Close a bus; moves nothing and stops nothing."),
    Operation(
        use,
        verb="/use",
        group=Group.LINES,
        immediate=True,
        help="""
Select the drive or the bus for lines without an address.

A drive of the selected bus takes precedence over a bus of the same name.
""",
    ),
    Operation(
        drives,
        verb="/drives",
        group=Group.LINES,
        immediate=True,
        help="List the drives of every open bus; * marks the selected drive.",
    ),
    Operation(
        scan,
        verb="/scan",
        group=Group.LINES,
        help="""
Search an open line for drives that are not listed: every name or number, at its baud rate; moves nothing.

`multidrop scan PORT` searches other baud rates and languages.
""",
    ),
    Operation(
        status,
        verb="/status",
        group=Group.LINES,
        fits=conditions.reports_status,
        help="Show the state of a drive in words: motion, program, errors, inputs, outputs.",
    ),
    Operation(
        referenced,
        verb="/referenced",
        group=Group.LINES,
        immediate=True,
        help="""
Take the position of a drive for right again after a restart; nothing is sent.

A homing that ends well, or a position that is set, does the same. Until then `~` is before the position.
""",
    ),
    Operation(
        rename,
        verb="/rename",
        group=Group.LINES,
        immediate=True,
        help="""
Give an open bus (by default the selected one) another name; moves nothing.

/keep saves it under that name. A macro that names the bus keeps the name before.
""",
    ),
    Operation(
        tab,
        verb="/tab",
        group=Group.LINES,
        immediate=True,
        help="Move the tab of a bus, by default of the selected one; no drive moves.",
    ),
    Operation(
        keep,
        verb="/keep",
        group=Group.LINES,
        immediate=True,
        help="""
Save an open bus (by default the selected one) as a connection: /open NAME opens it again.

The configuration file keeps its remarks. A serial port is saved by its stable name.
""",
    ),
)
