"""Operations on simulated drives from outside: inputs, loads, power, cables.

The floor of the cell reads the same words from the standard input of `multidrop sim`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from multidrop.base.errors import Diagnostic
from multidrop.shell.operations import conditions
from multidrop.shell.operations.argument_types import BusName
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument, Listed
from multidrop.simulator import MEANINGS, table

if TYPE_CHECKING:
    from multidrop.shell.session import Call
    from multidrop.simulator.serving.running import RunningFloor

DriveName = Annotated[str, Argument(metavar="DRIVE", listed=(Listed.SIMULATED_DRIVE,))]
Input = Annotated[str, Argument(metavar="N")]
Level = Annotated[str, Argument(metavar="0|1|open", words={"0": "", "1": "", "open": ""}, read=str)]
Counts = Annotated[str, Argument(metavar="COUNTS")]
Steps = Annotated[str, Argument(metavar="STEPS")]
State = Annotated[str, Argument(metavar="on|off", words={"on": "", "off": ""}, read=str)]


def cell_of(call: Call) -> RunningFloor:
    """The simulated cell of the selected bus, or the only one. Raises Diagnostic."""
    cell = conditions.simulated_cell(call.session)
    if cell is None:
        raise Diagnostic("no simulated bus is selected", "/sim", "/open sim: opens the demo cell")
    return cell


def input_(cell: RunningFloor, drive: DriveName, number: Input, level: Level) -> None:
    cell.command(f"input {drive} {number} {level}")


def analog(cell: RunningFloor, drive: DriveName, counts: Counts) -> None:
    cell.command(f"analog {drive} {counts}")


def push(cell: RunningFloor, drive: DriveName, steps: Steps) -> None:
    cell.command(f"push {drive} {steps}")


def power(cell: RunningFloor, drive: DriveName, state: State) -> None:
    cell.command(f"power {drive} {state}")


def supply(cell: RunningFloor, drive: DriveName, state: State) -> None:
    cell.command(f"supply {drive} {state}")


def lock(cell: RunningFloor, drive: DriveName, state: State) -> None:
    cell.command(f"lock {drive} {state}")


def unplug(cell: RunningFloor, bus: BusName) -> None:
    cell.command(f"unplug {bus}")


def plug(cell: RunningFloor, bus: BusName) -> None:
    cell.command(f"plug {bus}")


def _words() -> Sequence[str]:
    return table()


FORMS: Mapping[str, Callable[..., None]] = {
    "input": input_,
    "analog": analog,
    "push": push,
    "power": power,
    "supply": supply,
    "lock": lock,
    "unplug": unplug,
    "plug": plug,
}
OPERATIONS = (
    Operation(
        verb="/sim",
        group=Group.SIMULATED,
        rows=_words,
        fits=conditions.is_simulated,
        help="Act on simulated drives from outside: inputs, loads, power, cables.",
    ),
    *(
        Operation(do, verb=f"/sim {word}", at=cell_of, recorded=typed, immediate=True, help=MEANINGS[word])
        for word, do in FORMS.items()
    ),
)
