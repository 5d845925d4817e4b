"""The feed of a plot: samples of the chosen drives, and the lines typed and printed on their buses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Diagnostic
from drives.events import Lost, Sample, Unsolicited
from drives.telemetry import MODEST
from shell.events import Entered, Failed, Notified, OnBus, Printed, SessionEvent
from shell.lines import EVERYONE, split_target
from shell.plots.plot import Plot
from shell.plots.rate import shown
from shell.plots.target import PlotTarget
from transports.exposure import exposed

if TYPE_CHECKING:
    from shell.workspace import Workspace


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
    def rate(self) -> str:
        """The rate of its samples that was asked for, in words."""
        return shown(self.period)

    async def end(self) -> str:
        """End the plot; return one line about the result. Raises Diagnostic where it could not be written."""
        if self in self.workspace.plots:
            self.workspace.plots.remove(self)
        self.detach()
        return await self.plot.close()


async def begin(
    workspace: Workspace, target: PlotTarget, drives: Sequence[tuple[str, str]], period: float = MODEST
) -> Plotting:
    """Begin to plot these drives (bus, address), each every `period` s; 0: as fast as the line allows."""
    if not drives:
        raise Diagnostic("no drive to plot", hint="/open URL opens a line of drives")
    plot = await Plot.open(target, clock=workspace.now, wall=workspace.wall)
    plotting = Plotting(workspace, plot, attach(workspace, plot, drives, period), period)
    workspace.plots.append(plotting)
    if target.serves and exposed(target.host):
        workspace.notify(f"other computers can read the plot at {target.text}; they need no password", warning=True)
    return plotting


def chosen(workspace: Workspace, targets: Sequence[str]) -> list[tuple[str, str]]:
    """The drives that `ADDR`, `BUS:ADDR` and `BUS:*` name; without targets, all drives of all buses.

    Raises Diagnostic for an unknown drive.
    """
    found: dict[tuple[str, str], None] = {}
    for target in targets:
        bus, address = split_target(target)
        drive = workspace.drive(bus, address)
        name = drive.link.name
        known = workspace.buses[name].drives
        if address not in EVERYONE and drive.address not in known:
            raise Diagnostic(f"no drive {target}", hint=f"valid on {name}: {', '.join(known) or 'none'}")
        found |= dict.fromkeys((name, each) for each in (known if address in EVERYONE else [drive.address]))
    if not targets:
        found = {(bus.name, each): None for bus in workspace.buses.values() for each in bus.drives}
    return list(found)


def attach(
    workspace: Workspace, plot: Plot, drives: Sequence[tuple[str, str]], period: float = MODEST
) -> Callable[[], None]:
    """Feed the plot: poll these drives (bus, address) every `period` s, and log the lines of their buses.

    The function returned ends the polling; so does the end of the plot. Raises Diagnostic for a bus that is not open.
    """
    for bus, _ in drives:
        if bus not in workspace.buses:
            raise Diagnostic(f"no bus {bus!r}", hint=f"open: {', '.join(workspace.buses) or 'none'}")
    wanted, buses = set(drives), {bus for bus, _ in drives}

    def take(event: SessionEvent) -> None:
        if isinstance(event, OnBus):
            if isinstance(event.event, Sample) and (event.bus, event.event.address) in wanted:
                plot.sample(event.bus, event.event)
            elif isinstance(event.event, Lost) and event.bus in buses:
                plot.gap(event.bus, event.event.at)
            elif isinstance(event.event, Unsolicited) and event.bus in buses:
                for text in event.event.lines:
                    plot.text(event.bus, "", event.event.at, text, "reply")
        else:
            _log(plot, buses, event)

    ends: list[Callable[[], None]] = [workspace.subscribe(take)]
    for bus in sorted(buses):
        addresses = [address for each, address in dict.fromkeys(drives) if each == bus]
        ends.append(workspace.buses[bus].telemetry.subscribe(addresses, period).close)

    def detach() -> None:
        while ends:
            ends.pop()()

    def failed(reason: str) -> None:
        detach()
        workspace.notify(reason, warning=True)

    plot.on_failure(failed)
    return detach


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
