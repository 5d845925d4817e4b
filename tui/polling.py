"""The drives to poll and their periods: exactly what is on the screen.

The selected drive is polled at the rate of its display while it moves and after a line was sent to it, at rest twice a
second. A plotted drive is polled as often as the plot can show: once for each column of dots. The page of plots and a
trigger read it as fast as people measure. The others have only a sign on their tabs: they are polled every two seconds,
and more often while they move. If polling is off, nothing is polled, and the screen says so.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from typing import Any

from multidrop.drives.bus import Bus
from multidrop.drives.telemetry import DriveValue, Subscription, Telemetry
from multidrop.shell.roles import Series
from multidrop.shell.session import Session
from multidrop.tui.curves.samples import PREDICTED as MEASURED
from multidrop.tui.curves.trigger import TriggerState
from multidrop.tui.screen_model import ScreenModel

PLOT = 0.02
"""Least seconds between the samples of a plotted drive; a slow wire gives fewer."""
VALUES = 0.1
"""Seconds between two readings of a plotted value."""
STATUS = 0.05
REST_PERIOD = 0.5
LIVELY = 0.25
OTHERS_PERIOD = 2.0
CONDITIONS = 1.0
"""Seconds between two readings of the conditions of the selected drive, and of each that is plotted."""
CONDITIONS_OF_OTHERS = 5.0
"""The same of the others of its line; a second for each where there are more."""
ELSEWHERE = 10.0
"""The same of the drives of other lines: their tabs show errors."""


Wanted = dict[tuple[str, int, tuple[Any, ...]], float]
"""Periods, by bus, its identity, and its drives or values."""
BEGIN: tuple[Callable[[Telemetry], Callable[[Sequence[Any], float], Subscription[Any]]], ...] = (
    lambda telemetry: telemetry.subscribe,
    lambda telemetry: telemetry.watch,
    lambda telemetry: telemetry.read,
)
"""What polls drives, watches their conditions, and reads values."""


class Polling:
    """Holds the subscriptions that the screen needs."""

    def __init__(self) -> None:
        self.on = True
        self._held: dict[object, Subscription[Any]] = {}
        """By what begins them, by bus, drives or values, and period."""

    def update(self, session: Session, model: ScreenModel, wants: Container[str]) -> None:
        """Subscribe to what is shown, and end all other subscriptions. `wants`: as panels name it."""
        shown, awaited = plotted(session) if "plot" in wants else [], _awaited(session, model)
        chosen = list(dict.fromkeys([*shown, *awaited]))
        measured = chosen if "samples" in wants else awaited
        drives = (
            _drives(session, model, shown, measured, PLOT if "samples" in wants else REST_PERIOD) if self.on else {}
        )
        watches = _watches(session, plotted(session)) if self.on else {}
        values = _values(session, chosen) if self.on else {}
        for (bus, _, addresses), period in drives.items():
            for address in addresses:
                model.bus(bus).readout(address).period = period
        for (bus, _, addresses), period in watches.items():
            for address in addresses:
                model.bus(bus).readout(address).watched = period
        kinds = zip(BEGIN, (drives, watches, values), strict=True)
        wanted = [(begin, place, period) for begin, places in kinds for place, period in places.items()]
        for gone in [subscription for subscription in self._held if subscription not in wanted]:
            self._held.pop(gone).close()
        for wanted_by in wanted:
            if wanted_by not in self._held:
                begin, (bus, _, members), period = wanted_by
                self._held[wanted_by] = begin(session.buses[bus].telemetry)(members, period)

    def end(self) -> None:
        for subscription in self._held.values():
            subscription.close()
        self._held.clear()


def plotted(session: Session) -> Sequence[Series]:
    """The plotted series: those that were named, as far as they are open; else the selected drive."""
    named = [series for series in session.plotted if series.bus in session.buses]
    named = [series for series in named if series.address in session.buses[series.bus].drives]
    if named or session.selected is None:
        return named
    return [Series(session.selected_bus, session.selected.address)]


def moved_lately(session: Session, model: ScreenModel, since: float) -> Sequence[Series]:
    """The drives of all lines that were read in motion since a time."""
    return [
        Series(bus.name, address)
        for bus in session.buses.values()
        for address in bus.drives
        if model.bus(bus.name).readout(address).moved_at >= since
    ]


def _awaited(session: Session, model: ScreenModel) -> list[Series]:
    """What a trigger waits for: it is read as what is plotted, also while another page is shown."""
    trigger = model.look.trigger
    if trigger.setting is None or trigger.state in (TriggerState.OFF, TriggerState.HELD):
        return []
    bus, address, _, word = trigger.setting.quantity
    there = bus in session.buses and address in session.buses[bus].drives
    return [Series(bus, address, "" if word in MEASURED else word)] if there else []


def _open(session: Session) -> list[Bus]:
    return [bus for bus in session.tabs.shown if bus.lost is None]


def _drives(
    session: Session, model: ScreenModel, shown: Sequence[Series], measured: Sequence[Series], rest: float
) -> Wanted:
    """The periods of drives: of those that a plot shows, and of those that a person measures in one.

    `rest` is the period of measured drives that are at rest.
    """
    wanted: Wanted = {}
    for bus in _open(session):
        chosen = session.selected.address if bus.name == session.selected_bus and session.selected is not None else None
        drawn, fast = _motions(bus, shown), _motions(bus, measured)
        by_period: dict[float, list[str]] = {}
        for address in bus.drives:
            busy = model.bus(bus.name).readout(address).busy(session.now())
            usual = STATUS if address == chosen else LIVELY
            moving = PLOT if address in fast else min(usual, max(PLOT, model.look.dot)) if address in drawn else usual
            still = rest if address in fast else REST_PERIOD if address in drawn | {chosen} else OTHERS_PERIOD
            by_period.setdefault(moving if busy else still, []).append(address)
        for period, addresses in by_period.items():
            wanted[bus.name, id(bus), tuple(addresses)] = period
    return wanted


def _motions(bus: Bus, series: Sequence[Series]) -> set[str]:
    """The drives of a bus that have their motion among these series."""
    return {each.address for each in series if each.bus == bus.name and each.of_motion}


def _watches(session: Session, plotted: Sequence[Series]) -> Wanted:
    """The periods at which conditions are read: of the selected and plotted drives, others of the line, other lines.

    They are read on every page: each shows drives, if only as tabs.
    """
    wanted: Wanted = {}
    for bus in _open(session):
        here, chosen = bus.name == session.selected_bus, session.selected
        named = {series.address for series in plotted if series.bus == bus.name}
        named |= {chosen.address} if here and chosen is not None else set()
        for address in bus.drives:
            if address in named:
                wanted[bus.name, id(bus), (address,)] = CONDITIONS
        others = tuple(address for address in bus.drives if address not in named)
        if others:
            wanted[bus.name, id(bus), others] = max(CONDITIONS_OF_OTHERS if here else ELSEWHERE, float(len(others)))
    return wanted


def _values(session: Session, plotted: Sequence[Series]) -> Wanted:
    wanted: Wanted = {}
    for bus in _open(session):
        values = tuple(
            DriveValue(series.address, series.word)
            for series in plotted
            if series.bus == bus.name and not series.of_motion
        )
        if values:
            wanted[bus.name, id(bus), values] = VALUES
    return wanted
