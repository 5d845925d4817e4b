"""The drives to poll and their periods: exactly what is on the screen.

While the selected drive moves, or after a line was sent to it, it is polled at the rate of its display, faster while
its plot is shown; at rest, twice a second. The others have only a sign on their tabs: they are polled every two
seconds, and more often while they move. If polling is off, nothing is polled, and the screen says so.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from tui.screen_model import ScreenModel
from tui.session_view import Closable, SessionView

PLOT = 0.02
"""Seconds between the samples of a plotted drive; a slow wire gives fewer."""
STATUS = 0.05
REST = 0.5
LIVELY = 0.25
OTHERS = 2.0
CONDITIONS = 1.0
"""Seconds between two readings of the conditions of the selected drive."""
CONDITIONS_OF_OTHERS = 5.0
"""The same of the others of its line; a second for each where there are more."""


@dataclass
class _Held:
    period: float
    subscription: Closable


class Polling:
    """Holds the subscriptions that the screen needs."""

    def __init__(self) -> None:
        self.on = True
        self._held: dict[tuple[str, int, tuple[str, ...]], _Held] = {}
        self._watched: dict[tuple[str, int, tuple[str, ...]], _Held] = {}

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
        self._watch(session, model, conditions=self.on and "conditions" in wants)

    def _watch(self, session: SessionView, model: ScreenModel, *, conditions: bool) -> None:
        """Watch the conditions of the drives of the selected line, and end all other watches."""
        wanted = self._watches(session) if conditions else {}
        for key, held in list(self._watched.items()):
            if wanted.get(key) != held.period:
                held.subscription.close()
                del self._watched[key]
        for key, period in wanted.items():
            bus, _, addresses = key
            for address in addresses:
                model.bus(bus).readout(address).watched = period
            if key not in self._watched:
                self._watched[key] = _Held(period, session.buses[bus].telemetry.watch(addresses, period))

    @staticmethod
    def _watches(session: SessionView) -> dict[tuple[str, int, tuple[str, ...]], float]:
        name = session.selected_bus
        bus, chosen = session.buses.get(name), session.selected
        if bus is None or bus.lost is not None or chosen is None:
            return {}
        others = tuple(address for address in bus.drives if address != chosen.address)
        wanted: dict[tuple[str, int, tuple[str, ...]], float] = {(name, id(bus), (chosen.address,)): CONDITIONS}
        if others:
            wanted[name, id(bus), others] = max(CONDITIONS_OF_OTHERS, float(len(others)))
        return wanted

    def end(self) -> None:
        """End all subscriptions."""
        for held in (*self._held.values(), *self._watched.values()):
            held.subscription.close()
        self._held.clear()
        self._watched.clear()

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
                busy = model.bus(name).readout(chosen).busy(session.now())
                wanted[name, id(bus), (chosen,)] = REST if not busy else PLOT if plot else STATUS
            if lively:
                wanted[name, id(bus), lively] = LIVELY
            if quiet:
                wanted[name, id(bus), quiet] = OTHERS
        return wanted
