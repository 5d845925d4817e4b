"""The feed of a plot: samples of the chosen drives, and the lines typed and printed on their buses."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic
from multidrop.drives.events import Conditioned, Lost, Sample, Unsolicited, Valued
from multidrop.drives.telemetry import MODEST, USUAL, Subscription, Telemetry, Value
from multidrop.shell.events import (
    Diverged,
    Entered,
    Failed,
    Notified,
    OnBus,
    Predicted,
    Printed,
    SessionEvent,
    TwinEnded,
    TwinEvent,
)
from multidrop.shell.plots.layout import AGREES, DIFFERS, TWIN
from multidrop.shell.plots.plot import Plot
from multidrop.shell.plots.rate import shown
from multidrop.shell.plots.states import states_of
from multidrop.shell.plots.target import PlotTarget
from multidrop.shell.roles import DIFFERENCE, Series
from multidrop.transports.sockets import exposed

if TYPE_CHECKING:
    from multidrop.shell.workspace import Workspace


STATES, SPARING = 1.0, 2.0
"""Seconds between two readings of states on a bus, of one drive after the other; the second where all that the line
carries is asked for: a reading takes the time of four samples."""


@dataclass(eq=False)
class Plotting:
    """A plot and its feed from a workspace."""

    workspace: Workspace
    plot: Plot
    detach: Callable[[], None]
    period: float

    @property
    def where(self) -> str:
        """The file or address of the plot."""
        return self.plot.target.text

    @property
    def desk(self) -> str:
        """The line that a person types at another desk to see it."""
        return self.plot.target.desk

    @property
    def rate(self) -> str:
        """The rate of its samples that was asked for, in words."""
        return shown(self.period)

    async def end(self) -> str:
        """End the plot; return one line about the result. Raises Diagnostic where it could not be written."""
        if self in self.workspace.plots:
            self.workspace.plots.remove(self)
        self.detach()
        return await self.plot.close()


async def begin(workspace: Workspace, target: PlotTarget, series: Sequence[Series], period: float = MODEST) -> Plotting:
    """Begin to plot drives and values, each every `period` s; 0: as fast as the line allows."""
    if not series:
        raise Diagnostic("no drive to plot", hint="/open URL opens a line of drives")
    plot = await Plot.open(target, clock=workspace.now, wall=workspace.wall)
    plotting = Plotting(workspace, plot, attach(workspace, plot, series, period), period)
    workspace.plots.append(plotting)
    if target.serves and exposed(target.host):
        workspace.notify(f"other computers can read the plot at {target.text}; they need no password", warning=True)
    return plotting


def attach(workspace: Workspace, plot: Plot, series: Sequence[Series], period: float = MODEST) -> Callable[[], None]:
    """Feed the plot: poll drives and values every `period` s, and log the lines of their buses.

    The function returned ends the polling; so does the end of the plot. Raises Diagnostic for a bus that is not open.
    """
    for each in series:
        if each.bus not in workspace.buses:
            raise Diagnostic(f"no bus {each.bus!r}", hint=f"open: {', '.join(workspace.buses) or 'none'}")
    wanted, buses = set(series), {each.bus for each in series}
    for bus, address, _ in series:
        plot.label(bus, address, workspace.buses[bus].drives[address].label)
    ends: list[Callable[[], None]] = [workspace.subscribe(partial(_take, plot, wanted, buses))]
    for bus in sorted(buses):
        ends += _polls(
            workspace.buses[bus].telemetry, [each for each in dict.fromkeys(series) if each.bus == bus], period
        )

    def detach() -> None:
        while ends:
            ends.pop()()

    def failed(reason: str) -> None:
        detach()
        workspace.notify(reason, warning=True)

    plot.on_failure(failed)
    return detach


def _take(plot: Plot, wanted: set[Series], buses: set[str], event: SessionEvent) -> None:
    """Plot an event of a wanted series, or of one of the buses."""
    if not isinstance(event, OnBus):
        return _log(plot, buses, event)
    bus, inner = event
    if isinstance(inner, TwinEvent):
        return _twin(plot, wanted, bus, inner)
    if isinstance(inner, Sample) and Series(bus, inner.address) in wanted:
        plot.sample(bus, inner)
    elif isinstance(inner, Valued) and Series(bus, inner.address, inner.word) in wanted:
        plot.value(bus, inner)
    elif isinstance(inner, Conditioned) and Series(bus, inner.address) in wanted:
        for each in inner.conditions:
            for name, state in states_of(each):
                plot.state(bus, inner.address, each.axis, name, inner.at, state)
    elif isinstance(inner, Lost) and bus in buses:
        plot.gap(bus, inner.at)
    elif isinstance(inner, Unsolicited) and bus in buses:
        for text in inner.lines:
            plot.text(bus, "", inner.at, text, "reply")


def _polls(telemetry: Telemetry, series: Sequence[Series], period: float) -> Iterator[Callable[[], None]]:
    """Begin to poll drives and values of a bus; the functions that end that."""
    if addresses := list(dict.fromkeys(each.address for each in series if each.of_motion)):
        yield telemetry.subscribe(addresses, period).close
        if period:
            yield telemetry.watch(addresses, len(addresses) * STATES).close
        else:
            yield from _sparing(telemetry, addresses)
    if values := [Value(each.address, each.word) for each in series if not each.of_motion]:
        yield telemetry.read(values, max(period, USUAL)).close


def _sparing(telemetry: Telemetry, addresses: Sequence[str]) -> Iterator[Callable[[], None]]:
    """Begin to read the states of one drive after the other, as a first reading takes the time of many samples."""
    loop, pause = asyncio.get_running_loop(), SPARING * len(addresses)
    watches: list[Subscription[str]] = []
    for place, address in enumerate(addresses, 1):
        yield loop.call_later(
            place * SPARING, lambda each: watches.append(telemetry.watch([each], pause)), address
        ).cancel

    def close() -> None:
        for watch in watches:
            watch.close()

    yield close


def _twin(plot: Plot, wanted: set[Series], bus: str, event: TwinEvent) -> None:
    """Plot the predictions of a wanted drive's twin, or only the difference, and whether they agree."""
    whole = Series(bus, event.address) in wanted
    if not whole and Series(bus, event.address, DIFFERENCE) not in wanted:
        return
    if isinstance(event, Predicted):
        plot.predicted(bus, event, alone=not whole)
    elif isinstance(event, TwinEnded):
        plot.twin_ended(bus, event.address, event.at)
    else:
        said = DIFFERS if isinstance(event, Diverged) else AGREES
        plot.state(bus, event.address, event.axis, TWIN, event.at, said)


def _log(plot: Plot, buses: set[str], event: SessionEvent) -> None:
    """Log an event of these buses, or of no bus (a verb)."""
    if not isinstance(event, Entered | Printed | Failed | Notified) or event.bus not in {*buses, ""}:
        return
    if isinstance(event, Entered):
        plot.text(event.bus, event.address, event.at, event.line, "command")
    elif isinstance(event, Printed):
        plot.text(event.bus, event.address, event.at, event.text, "reply")
    elif isinstance(event, Failed):
        plot.text(event.bus, event.address, event.at, event.text, "error")
    else:
        plot.text(event.bus, "", event.at, event.text, "note")
