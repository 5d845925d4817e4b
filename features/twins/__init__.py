"""Twins: simulated drives that run beside real ones, and every difference between the two."""

from __future__ import annotations

from argparse import ArgumentTypeError
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from multidrop.base.feature import Feature
from multidrop.base.text import whole
from multidrop.shell.at_session import AtSession
from multidrop.shell.hooks import Options, Predicting, Switch
from multidrop.shell.operations.argument_types import RAW, Address
from multidrop.shell.operations.operation import Group, Operation, typed
from multidrop.shell.operations.parameter import Argument

if TYPE_CHECKING:
    from multidrop.shell.session import Call, Session


@dataclass(frozen=True, kw_only=True)
class TwinOptions:
    """What a command is asked for."""

    twin: Annotated[bool, Argument("run a simulated twin beside each drive; warn of differences", one_of=RAW)] = False


LARGEST_LIMIT = 1_000_000_000
"""The largest limit of twins, steps."""


def _steps(text: str) -> int:
    if (steps := whole(text, 1, LARGEST_LIMIT)) is None:
        raise ArgumentTypeError(f"no limit {text!r}: steps from 1 to {LARGEST_LIMIT}")
    return steps


Steps = Annotated[int, Argument(metavar="STEPS", read=_steps)]


def _list(call: Call) -> None:
    from multidrop.features.twins import verb

    verb.list_twins(call)


async def _on(call: Call, *targets: Address) -> None:
    from multidrop.features.twins import verb

    await verb.on(call, targets)


def _off(call: Call) -> None:
    from multidrop.features.twins import verb

    verb.off(call)


def _limit(call: Call, steps: Steps) -> None:
    from multidrop.features.twins import verb

    verb.limit(call, steps)


def _begin(session: Session) -> None:
    from multidrop.features.twins.twins import begin

    begin(session)


def _runs(session: Session) -> bool:
    """Whether twins run beside drives of the selected line."""
    return session.buses.get(session.selected_bus) in session.predicted


def _want(session: Session, asked: TwinOptions) -> None:
    """Let each bus whose drives are found get twins."""
    if asked.twin:
        from multidrop.features.twins.twins import Twins

        session.hooks.part(Twins).wanted = True


async def _start(session: Session, asked: TwinOptions) -> None:
    """Begin twins before the first line of a stream."""
    if asked.twin:
        from multidrop.features.twins.twins import Twins

        for bus in list(session.buses.values()):
            await session.hooks.part(Twins).start(bus)


FEATURE = Feature(
    "twins",
    "a simulated drive beside each real one",
    adds=(
        Operation(
            _list,
            verb="/twin",
            group=Group.VALUES,
            after="/plot",
            recorded=typed,
            help="""Run a simulated drive beside a real one, and warn where the two differ.

`/twin on` reads each drive of the selected bus once, as a snapshot does, and sets a simulated one like it; ADDR is
one drive: `b`, `press:b`. From then on the twin gets what the drive takes, and its inputs as they are read. A
difference above the limit is a warning with its time and cause candidates, the likeliest first. The limit holds at
rest; a move adds 30 ms of its velocity. After a homing, a limit switch or a push by hand the twin takes the position
of the drive, and says so. Only position, velocity and inputs are read, and once the lamps of a drive that stands while
its twin moves on. `/twin` alone lists the twins.
""",
        ),
        Operation(
            _on, verb="/twin on", recorded=typed, help="run a twin beside each drive; read a drive again that has one"
        ),
        Operation(_off, verb="/twin off", recorded=typed, help="end all twins"),
        Operation(_limit, verb="/twin limit", recorded=typed, help="the steps by which a drive at rest may differ"),
        AtSession(_begin),
        Predicting("no twin runs that it could differ from", "/twin on begins one"),
        Switch(
            "twin",
            "/twin",
            "simulated drives that run beside those of this line; every difference shows",
            "a twin beside each drive of the line, or none",
            _runs,
        ),
        Options("tui", TwinOptions, prepare=_want),
        Options("shell", TwinOptions, prepare=_want, opened=_start),
    ),
)
