"""Operations on units: scales given, confirmed and listed; the display in units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.shell.verbs.scales import axes_of, described, meant

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
        (drive, axis)
        for bus in session.buses.values()
        for drive in bus.drives.values()
        for axis in axes_of(call, drive)
    ]
    for drive, axis in axes:
        call.output(described(call, drive, axis))
    if not axes:
        session.notify("no axis has a scale: /units ADDR 5 mm/turn gives it one", outcome=True)


def show(call: Call, shown: Shown) -> None:
    call.session.units.shown = shown == "on"
    call.session.changed()


async def here(call: Call, target: MaybeAxis, number: Number, unit: Unit) -> None:
    drive, axis = meant(call, target)
    await call.session.units.here(drive, axis, f"{number} {unit}")
    call.output(described(call, drive, axis))


async def confirm(call: Call, target: Axis) -> None:
    drive, axis = meant(call, target)
    if axis not in axes_of(call, drive):
        raise Diagnostic(f"{target} has no scale", "/units", f"/units {target} 5 mm/turn gives it one")
    await call.session.units.confirm(drive)
    call.output(described(call, drive, axis))


async def give(call: Call, target: MaybeAxis, number: Number, unit: PerTurn) -> None:
    drive, axis = meant(call, target)
    await _give(call, drive, axis, f"{number} {unit}")
    call.output(described(call, drive, axis))


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
