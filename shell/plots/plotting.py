"""Plots as a session has them: begun by `/plot` or `multidrop plot`, ended by either or when the session closes."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Diagnostic, DriveError
from shell.events import SessionEvent, StateChanged
from shell.front import batch
from shell.lines import EVERYONE, split_target
from shell.output import report, write
from shell.plots.feed import Plot, PlotTarget, attach, parse_target

if TYPE_CHECKING:
    from shell.session import Session


@dataclass(eq=False)
class Plotting:
    """A plot that a session feeds."""

    session: Session
    plot: Plot
    detach: Callable[[], None]

    async def end(self) -> str:
        """End it; one line about what there is. Raises Diagnostic where it could not be written."""
        if self in self.session.plots:
            self.session.plots.remove(self)
        self.detach()
        return await self.plot.close()


async def begin(session: Session, target: PlotTarget, drives: Sequence[tuple[str, str]]) -> Plotting:
    """Begin to plot these drives (bus, address)."""
    if not drives:
        raise Diagnostic("there is no drive to plot", hint="/open URL opens a line of drives")
    plot = await Plot.open(target, clock=session.now, wall=session.wall)
    plotting = Plotting(session, plot, attach(session, plot, drives))
    session.plots.append(plotting)
    return plotting


def chosen(session: Session, targets: Sequence[str]) -> list[tuple[str, str]]:
    """The drives that `ADDR`, `BUS:ADDR` and `BUS:*` mean; all of every bus where none is named. Raises Diagnostic."""
    found: dict[tuple[str, str], None] = {}
    for target in targets:
        bus, address = split_target(target)
        drive = session.drive(bus, address)
        state = drive.bus.drives
        if address not in EVERYONE and drive.address not in state:
            raise Diagnostic(f"no drive {target} is known", hint=f"{drive.bus.name} has {', '.join(state) or 'none'}")
        found |= dict.fromkeys((drive.bus.name, each) for each in (state if address in EVERYONE else [drive.address]))
    if not targets:
        found = {(bus.name, each): None for bus in session.buses.values() for each in bus.drives}
    return list(found)


def run(url: str, drives: Sequence[str], *, to: str | None, serve: str | None) -> int:
    """`multidrop plot`: until a signal, which ends it well; the exit code."""
    try:
        target = parse_target(to, serve)
    except Diagnostic as problem:
        write(sys.stderr, report(problem))
        return 2
    return batch.run([url], lambda session: _until_ended(session, target, drives), interrupted=0)


async def _until_ended(session: Session, target: PlotTarget, drives: Sequence[str]) -> None:
    plotting = await begin(session, target, chosen(session, drives))
    write(sys.stderr, f"plotting to {plotting.plot.target.text}; Ctrl+C ends it")
    try:
        await _ended(session, plotting.plot)
    finally:
        write(sys.stderr, await plotting.end())


async def _ended(session: Session, plot: Plot) -> None:
    """Until the plot or a bus breaks. Raises what tells of it."""
    broken = asyncio.Event()

    def noticed(event: SessionEvent) -> None:
        if isinstance(event, StateChanged) and any(bus.lost for bus in session.buses.values()):
            broken.set()

    leave = session.subscribe(noticed)
    waits = [asyncio.create_task(plot.ended.wait()), asyncio.create_task(broken.wait())]
    try:
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    finally:
        leave()
        for each in waits:
            each.cancel()
    lost = next((bus.lost for bus in session.buses.values() if bus.lost), None)
    raise lost or DriveError(plot.failure)
