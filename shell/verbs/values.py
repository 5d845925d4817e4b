"""Operations on values of drives: plots, and the raw registers of the selected drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from multidrop.shell.operations import arguments, conditions
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed

if TYPE_CHECKING:
    from multidrop.shell.session import Call

Plotted = Annotated[str, Argument(metavar="ADDR", listed=(Listed.DRIVE,))]
Access = Annotated[
    arguments.Accessed,
    Argument(metavar="ADDRESS [COUNT|=VALUE]", rest=True, read=arguments.register_access),
]
Output = Annotated[int, Argument(metavar="N", read=arguments.output_number)]
Level = Annotated[str, Argument(metavar="0|1", words={"0": "", "1": ""})]


async def plot(call: Call, *texts: Plotted) -> None:
    from multidrop.shell.verbs import plotting

    await plotting.plot(call, texts)


async def end_plots(call: Call) -> None:
    from multidrop.shell.verbs import plotting

    await plotting.end(call.session)


async def register(call: Call, wanted: Access) -> None:
    from multidrop.shell.verbs import register_access

    await register_access.register(call, wanted)


async def coil(call: Call, number: Output, level: Level = "") -> None:
    from multidrop.shell.verbs import register_access

    await register_access.coil(call, number, level)


async def device(call: Call) -> None:
    from multidrop.shell.verbs import register_access

    await register_access.device(call)


OPERATIONS = (
    Operation(
        plot,
        verb="/plot",
        group=Group.VALUES,
        recorded=typed,
        help="""
Plot drives and values on the screen, until /plot off.

ADDR is a drive (position and velocity): `b`, `press:b`, `press:*`; or a value that a drive prints: `VM`, `b.I1`.
It reads only while a plot is shown, each drive 50 times a second; `/plot` alone says what is plotted.
""",
    ),
    Operation(end_plots, verb="/plot off", recorded=typed, help="end all plots"),
    Operation(
        register,
        verb="/register",
        group=Group.VALUES,
        recorded=typed,
        fits=conditions.has_registers,
        changes=True,
        help="""
Read or write raw registers of the selected drive: /register 0x57, /register 0x57 =-500.

Numbers are decimal or hexadecimal. Without COUNT it reads the whole value that begins at ADDRESS. A VALUE fills all
registers of its value, low word first; =LOW,HIGH writes two words. It transfers at most two registers.
""",
    ),
    Operation(
        coil,
        verb="/coil",
        group=Group.VALUES,
        recorded=typed,
        fits=conditions.has_registers,
        changes=True,
        help="Read or switch output N of the selected drive; N is the number in O1, O2, O3.",
    ),
    Operation(
        device,
        verb="/device",
        group=Group.VALUES,
        fits=conditions.has_registers,
        help="Show vendor, part number, revision, serial number and version of the selected drive.",
    ),
)
