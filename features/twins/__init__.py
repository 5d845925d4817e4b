"""Twins: simulated drives that run beside real ones, and every difference between the two."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multidrop.base.feature import Feature
from multidrop.shell.hooks import AtSession, Options, Predicting, Switch
from multidrop.shell.operations.operation import Operation

if TYPE_CHECKING:
    from multidrop.shell.session import Session
    from multidrop.shell.verbs.call import Call


TWIN = {"--twin": "run a simulated twin beside each drive; warn of differences"}


async def _twin(call: Call) -> None:
    from multidrop.features.twins.verb import twin

    await twin(call)


def _begin(session: Session) -> None:
    from multidrop.features.twins.twins import begin

    begin(session)


def _runs(session: Session) -> bool:
    """Whether twins run beside drives of the selected line."""
    return session.buses.get(session.selected_bus) in session.predicted


def _want(session: Session, chosen: argparse.Namespace) -> None:
    """Let each bus whose drives are found get twins."""
    if chosen.twin:
        from multidrop.features.twins.twins import Twins

        session.hooks.part(Twins).wanted = True


async def _start(session: Session, chosen: argparse.Namespace) -> None:
    """Begin twins before the first line of a stream."""
    if chosen.twin:
        from multidrop.features.twins.twins import Twins

        for bus in list(session.buses.values()):
            await session.hooks.part(Twins).start(bus)


FEATURE = Feature(
    "twins",
    "a simulated drive beside each real one",
    adds=(
        Operation(
            usage="/twin [on [ADDR ...] | off | limit STEPS]",
            help="""Run a simulated drive beside a real one, and warn where the two differ.

`/twin on` reads each drive of the selected bus once, as a snapshot does, and sets a simulated one like it; ADDR is
one drive: `b`, `press:b`. From then on the twin gets what the drive takes, and its inputs as they are read. A
difference above the limit is a warning with its time and cause candidates, the likeliest first. The limit holds at
rest; a move adds 30 ms of its velocity. After a homing, a limit switch or a push by hand the twin takes the position
of the drive, and says so. Only position, velocity and inputs are read, and once the lamps of a drive that stands while
its twin moves on. `/twin` alone lists the twins.
""",
            work=_twin,
            recorded="typed",
            words={
                "on": "run a twin beside each drive; read a drive again that has one",
                "off": "end all twins",
                "limit": "the steps by which a drive at rest may differ",
            },
            after="/plot",
            group="Settings and values",
        ),
        AtSession(_begin),
        Predicting("no twin runs that it could differ from", "/twin on begins one"),
        Switch(
            "twin",
            "/twin",
            "simulated drives that run beside those of this line; every difference shows",
            "a twin beside each drive of the line, or none",
            _runs,
        ),
        Options("tui", TWIN, "--raw", prepare=_want),
        Options("shell", TWIN, "--raw", prepare=_want, opened=_start),
    ),
)
