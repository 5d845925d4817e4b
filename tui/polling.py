"""Which drives are polled and how often: what is on the screen, and no more.

The selected drive is polled at the rate of its display, faster while its plot is shown; the others, whose signs
stand on the tabs, once in two seconds, and more often while they move or have just been sent a line. Switched off,
nothing is polled, and the screen says so.
"""

from __future__ import annotations

from dataclasses import dataclass

from tui.screen_model import ScreenModel
from tui.session_view import Closable, SessionView

PLOT = 0.024
"""Seconds between the samples of a plotted drive; a slow wire gives fewer."""
STATUS = 0.1
LIVELY = 0.25
OTHERS = 2.0


@dataclass
class _Held:
    period: float
    subscription: Closable


class Polling:
    """Keeps the subscriptions that the screen needs."""

    def __init__(self) -> None:
        self.on = True
        self._held: dict[tuple[str, int, tuple[str, ...]], _Held] = {}

    def update(self, session: SessionView, model: ScreenModel, *, plot: bool) -> None:
        """Subscribe to what is shown, end what is not."""
        wanted = self._wanted(session, model, plot) if self.on else {}
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
        """End all of it."""
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
