"""The drives to poll and their periods: exactly what is on the screen.

The selected drive is polled at the rate of its display, and faster while its plot is shown. The others have only a sign
on their tabs: they are polled every two seconds, and more often while they move or after a line was sent to them. If
polling is off, nothing is polled, and the screen says so.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from tui.screen_model import ScreenModel
from tui.session_view import Closable, SessionView

PLOT = 0.02
"""Seconds between the samples of a plotted drive; a slow wire gives fewer."""
STATUS = 0.1
LIVELY = 0.25
OTHERS = 2.0


@dataclass
class _Held:
    period: float
    subscription: Closable


class Polling:
    """Holds the subscriptions that the screen needs."""

    def __init__(self) -> None:
        self.on = True
        self._held: dict[tuple[str, int, tuple[str, ...]], _Held] = {}

    def update(self, session: SessionView, model: ScreenModel, wants: Container[str]) -> None:
        """Subscribe to what is shown, and end all other subscriptions. `wants`: as panels name it."""
        wanted = self._wanted(session, model, "plot" in wants) if self.on else {}
        for key, held in list(self._held.items()):
            if wanted.get(key) != held.period:
                held.subscription.close()
                del self._held[key]
        for key, period in wanted.items():
            bus, _, addresses = key
            for address in addresses:
                model.bus(bus).readout(address).period = period
            if key not in self._held:
                telemetry = session.buses[bus].telemetry
                self._held[key] = _Held(period, telemetry.subscribe(addresses, period))

    def end(self) -> None:
        """End all subscriptions."""
        for held in self._held.values():
            held.subscription.close()
        self._held.clear()

    @staticmethod
    def _wanted(session: SessionView, model: ScreenModel, plot: bool) -> dict[tuple[str, int, tuple[str, ...]], float]:
        wanted: dict[tuple[str, int, tuple[str, ...]], float] = {}
        for name, bus in session.buses.items():
            if bus.lost is not None:
                continue
            chosen = session.selected.address if name == session.selected_bus and session.selected is not None else None
            others = [address for address in bus.drives if address != chosen]
            lively = tuple(address for address in others if model.bus(name).readout(address).busy(session.now()))
            quiet = tuple(address for address in others if address not in lively)
            if chosen is not None:
                wanted[name, id(bus), (chosen,)] = PLOT if plot else STATUS
            if lively:
                wanted[name, id(bus), lively] = LIVELY
            if quiet:
                wanted[name, id(bus), quiet] = OTHERS
        return wanted
