"""The operation that stops one drive, or one of its axes, while everything else goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Call

Target = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,), omitted="")]


def _meant(call: Call, target: str) -> tuple[Drive, str]:
    """The drive and the axis of `ADDR`, `ADDR.AXIS`, or of nothing: the selected drive; no axis is all of them."""
    session, (address, _, axis) = call.session, target.rpartition(".")
    known = {
        name for bus in session.buses.values() for each in bus.drives.values() for name in (each.address, each.label)
    }
    if "." not in target or target.rpartition(":")[2] in known:
        address, axis = target, ""
    drive = call.drive(address)
    if drive not in session.bus(drive.link.name).drives.values():
        raise Diagnostic(f"no drive {target}; no stop was sent", "/halt", "/drives lists them; /stop stops everything")
    axes = [each for each in drive.family.units.axes() if each]
    if axis and axis.lower() not in axes:
        valid = ", ".join(f"{address}.{each}" for each in axes) or address
        raise Diagnostic(f"no axis {target}; no stop was sent", "/halt", f"valid: {valid}; /stop stops everything")
    return drive, axis.lower()


async def halt(call: Call, target: Target = "") -> None:
    """Write the stop before anything else, then wait until it is seen to work."""
    from multidrop.dialects import Started
    from multidrop.shell.automation import outcome, settled

    drive, axis = _meant(call, target)
    axes = frozenset({axis}) if axis else None
    bus = call.session.bus(drive.link.name)
    written = bus.halt([drive], started={drive: Started(axes, program=not axis, lasts=not axis)})
    bus.halted(written)
    drive.motions.stopped(None, axes)
    await settled(call.session)
    for line in outcome(call.session, [written]):
        call.output(line)


OPERATIONS = (
    Operation(
        halt,
        verb="/halt",
        group=Group.STOPS,
        after="/stop",
        concurrent=True,
        help="""
Stop one drive, or one axis of it, while everything else goes on: /halt, /halt a, /halt 00.x.

It is the hard stop of the drive. The stop of one axis leaves the program of a controller running. If a line has only
one stop for all its drives, the others stop too and are named. Afterwards every line is taken as before; /stop and
Ctrl+X stop everything.
""",
    ),
)
