"""Operations on units: scales given, confirmed and listed; the display in units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Call


Shown = Annotated[str, Argument(words={"on": "show positions in units", "off": "show the drive's own numbers"})]
Axis = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,))]
MaybeAxis = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,), omitted="")]
Number = Annotated[str, Argument(metavar="NUMBER")]
Unit = Annotated[str, Argument(metavar="UNIT")]
PerTurn = Annotated[str, Argument(metavar="UNIT/turn|UNIT/step", read=arguments.per_turn)]


def list_(call: Call) -> None:
    session = call.session
    axes = [
        (drive, axis) for bus in session.buses.values() for drive in bus.drives.values() for axis in _axes(call, drive)
    ]
    for drive, axis in axes:
        call.output(_described(call, drive, axis))
    if not axes:
        session.notify("no axis has a scale: /units ADDR 5 mm/turn gives it one", outcome=True)


def show(call: Call, shown: Shown) -> None:
    call.session.units.shown = shown == "on"
    call.session.changed()


async def here(call: Call, target: MaybeAxis, number: Number, unit: Unit) -> None:
    drive, axis = _meant(call, target)
    await call.session.units.here(drive, axis, f"{number} {unit}")
    call.output(_described(call, drive, axis))


async def confirm(call: Call, target: Axis) -> None:
    drive, axis = _meant(call, target)
    if axis not in _axes(call, drive):
        raise Diagnostic(f"{target} has no scale", "/units", f"/units {target} 5 mm/turn gives it one")
    await call.session.units.confirm(drive)
    call.output(_described(call, drive, axis))


async def give(call: Call, target: MaybeAxis, number: Number, unit: PerTurn) -> None:
    drive, axis = _meant(call, target)
    await _give(call, drive, axis, f"{number} {unit}")
    call.output(_described(call, drive, axis))


async def _give(call: Call, drive: Drive, axis: str, text: str) -> None:
    """Give an axis a scale; zero and travel of one of the same kind stay, but its places then need a reference."""
    from dataclasses import replace

    from multidrop.dialects.units import scale

    units = call.session.units
    given, before = scale(text, units.own), units.of(drive, axis)
    if before is not None and before.scale.kind == given.kind:
        given = replace(
            given, **{key: getattr(before.scale, key) for key in ("zero", "travel", "full_steps", "anchored")}
        )
        if given.anchored and given != before.scale:
            drive.state.reference_lost([axis])
    units.set(drive, axis, given)
    await units.confirm(drive)
    scaled = units.of(drive, axis)
    if scaled is not None and scaled.measure is None:
        raise Diagnostic(scaled.problem, "/units")


def _axes(call: Call, drive: Drive) -> list[str]:
    return sorted(call.session.units.axes(drive))


def _meant(call: Call, target: str) -> tuple[Drive, str]:
    """The drive and the axis of `ADDR`, `ADDR.AXIS`, or of nothing: the selected drive. Raises Diagnostic."""
    session, (address, _, axis) = call.session, target.rpartition(".")
    known = {
        name for bus in session.buses.values() for each in bus.drives.values() for name in (each.address, each.label)
    }
    if not address or target.rpartition(":")[2] in known:
        address, axis = target, ""
    drive = call.drive(address)
    if drive not in session.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {target}", "/units", "/drives lists them")
    axes = drive.family.units.axes()
    if axis.lower() not in axes:
        names = ", ".join(f"{drive.address}.{each}" for each in axes if each)
        raise Diagnostic(f"no axis {target}", "/units", f"valid: {names or drive.address}")
    return drive, axis.lower()


def _described(call: Call, drive: Drive, name: str) -> str:
    """A scale in one line: `a: 5 mm/turn, 51200 a turn (MS=256, EE=0), travel 0 mm to 300 mm`."""
    from multidrop.dialects.units import Takes

    session = call.session
    axis = session.units.of(drive, name)
    assert axis is not None  # it was listed
    shown = session.display_name(drive) or drive.shown
    parts = [f"{shown}.{name}" if name else shown, str(axis.scale)]
    if axis.measure is not None:
        basis = axis.measure.basis
        turn = f"{float(basis.turn):g} steps a turn" if basis.turn else ""
        parts += [turn, f"one step is {axis.measure.shown(1, Takes.DISTANCE)}", str(basis), basis.assumed]
    else:
        parts.append(axis.problem)
    if axis.scale.anchored:
        parts.append(f"zero {axis.scale.shown(axis.scale.zero)}")
    if axis.scale.travel is not None:
        parts.append("travel {} to {}".format(*map(axis.scale.shown, axis.scale.travel)))
    if not session.units.referenced(drive, name):
        parts.append("not referenced")
    if changes := drive.counting.changes(name):
        parts.append(
            f"not shown in units, as {', '.join(changes)}: /units {session.units.typed(drive, name)} accepts that"
        )
    elif not axis.holds:
        parts.append("not shown in units, as what it rests on may have changed and was not read since")
    elif axis.measure is not None and not axis.sure:
        parts.append("not confirmed since a program ran")
    return f"{parts[0]}: {', '.join(filter(None, parts[1:]))}"


OPERATIONS = (
    Operation(
        list_,
        verb="/units",
        group=Group.LINES,
        after="/status",
        help="""
Give an axis a scale, or list the scales; on and off: show positions in units, or in the drive's numbers.

/units a 5 mm/turn: the motor's turn; /units 00.x 0.4 um/step: the drive's count. A line then takes {12.5 mm},
{50 mm/s}, {2 m/s2}. /units a takes the scale with the settings as they are now. /units here a 0 mm: the position
at rest is 0 mm in this session.
""",
    ),
    Operation(show, verb="/units"),
    Operation(here, verb="/units here", help="the position at rest is this place from now on"),
    Operation(confirm, verb="/units"),
    Operation(give, verb="/units"),
)
