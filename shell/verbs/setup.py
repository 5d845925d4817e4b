"""The operation that changes the set-up of a drive in the configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic, DriveError, Stopped, TransportLost
from multidrop.shell.operations.operation import Group, Operation
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Call

Target = Annotated[str, Argument(metavar="ADDR[.AXIS]", listed=(Listed.DRIVE,))]
Name = Annotated[str | None, Argument("the name of the drive; '' removes it", metavar="NAME")]
Scale = Annotated[str | None, Argument("how far one turn or one step goes; '' removes it", metavar="'5 mm/turn'")]
Travel = Annotated[str | None, Argument("where the axis may move; '' removes it", metavar="'0..300 mm'")]
Zero = Annotated[str | None, Argument("the place of position 0; '' removes it", metavar="'120 mm'")]
FullSteps = Annotated[str | None, Argument("full steps of the motor's turn; '' removes them", metavar="200")]
Guard = Annotated[
    str | None,
    Argument(
        "of every drive: ask before a move that leaves its travel",
        metavar="on|off",
        words={"on": "ask before a move that leaves the travel", "off": "do not ask"},
    ),
]
AskBefore = Annotated[
    str | None, Argument("of every drive: further commands that ask first; '' removes them", metavar="WORD,...")
]
SaveAs = Annotated[str, Argument("save the line as this connection, if it is not saved", metavar="NAME")]


async def setup(
    call: Call,
    target: Target = "",
    *,
    name: Name = None,
    scale: Scale = None,
    travel: Travel = None,
    zero: Zero = None,
    full_steps: FullSteps = None,
    guard: Guard = None,
    ask_before: AskBefore = None,
    save_as: SaveAs = "",
) -> None:
    from multidrop.shell import drive_setup
    from multidrop.shell.events import By
    from multidrop.shell.verbs.scales import meant

    drive, axis = meant(call, target)
    wanted = drive_setup.SetupChange(name, scale, zero, travel, full_steps, guard, ask_before, save_as)
    if wanted.anything:
        if call.by is not By.OPERATOR:
            raise Stopped("/setup changes the configuration only when a person types it")
        saved = await drive_setup.change(call.session, drive, axis, wanted)
        call.session.notify(f"{call.session.units.name(drive, axis)} is set up as follows; saved in {saved}")
    for line in [line async for line in _lines(call, drive, axis if target else None)]:
        call.output(line)


async def _lines(call: Call, drive: Drive, axis: str | None) -> AsyncIterator[str]:
    """The set-up in words, of one axis, or of all of them."""
    from multidrop.dialects.written_scales import preview
    from multidrop.shell.configuration import TRAVEL
    from multidrop.shell.drive_setup import connection_of
    from multidrop.shell.verbs.scales import described

    session, units = call.session, call.session.units
    saved = connection_of(session, drive)
    yield f"{units.name(drive, '')}: " + (f"connection {saved.name}" if saved is not None else "not saved")
    for each in drive.family.units.axes() if axis is None else (axis,):
        scaled = units.of(drive, each)
        try:
            basis = await units.read(drive, each, scaled.scale.full_steps if scaled is not None else None)
        except (DriveError, TransportLost) as failure:
            yield f"{units.name(drive, each)}: what its counts rest on is not read: {failure}"
            continue
        if scaled is None:
            turn = f"one turn = {float(basis.turn):.9g} steps ({basis})" if basis.turn else basis.missing
            yield f"{units.name(drive, each)}: no scale; {turn}"
            continue
        yield described(call, drive, each)
        try:
            yield f"{units.name(drive, each)}: {preview(scaled.scale, basis)}"
        except Diagnostic as problem:
            yield f"{units.name(drive, each)}: {problem}"
    guards = session.settings.guards
    also = f"; also before {', '.join(sorted(guards.also))}" if guards.also else ""
    yield f"every drive: moves that leave their travel {'do not ask' if TRAVEL in guards.off else 'ask'} first{also}"


OPERATIONS = (
    Operation(
        setup,
        verb="/setup",
        group=Group.LINES,
        after="/units",
        help="""
Set up a drive in the configuration: its name, and for an axis its scale, travel and zero.

/setup a --name gantry --scale '5 mm/turn' --travel '0..300 mm'. Only what is given changes, and an empty value removes.
The file keeps its comments, and the change applies at once. A line that is not saved yet needs --save-as NAME. Without
options it shows the set-up. On the screen the page of the same name is a form for it.
""",
    ),
)
