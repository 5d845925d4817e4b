"""Paints the screen model onto the main screen: all that is shown is computed here, from facts and the time."""

from __future__ import annotations

from tui.function_keys import FunctionKeys
from tui.panels.plot import plot_rows
from tui.panels.status import Glance, narrow_rows, wide_rows
from tui.polling import Polling
from tui.screen_model import ScreenModel, bus_old, bus_state
from tui.screens.main_screen import MainScreen
from tui.session_view import BusView, SessionView
from tui.widgets.banner import banner_row
from tui.widgets.footer import footer_row
from tui.widgets.lines import Row
from tui.widgets.topline import Tab, top_row

FLOOD = 3
"""The number of lines in one frame that are too many to read."""
FLOOD_PERIOD = 0.1
"""Seconds between two paints of a transcript that gets as many."""


class Presenter:
    """Computes the rows of the main screen, and puts them there."""

    def __init__(self, session: SessionView, model: ScreenModel, polling: Polling, macros: FunctionKeys) -> None:
        self.session, self.model, self.polling, self.macros = session, model, polling, macros
        self._shown_at = float("-inf")
        self._flooded = False

    def glances(self, bus: BusView) -> list[Glance]:
        """The drives of a bus, as they are shown."""
        facts = self.model.bus(bus.name)
        chosen = self.session.selected if bus.name == self.session.selected_bus else None
        return [
            Glance(
                address=drive.address,
                label=drive.label,
                product=drive.product,
                version=drive.version,
                readout=facts.readout(address),
                selected=chosen is not None and drive.address == chosen.address,
                storing=drive.programming,
                lost=bus.lost is not None,
            )
            for address, drive in bus.drives.items()
        ]

    def shown_glances(self) -> list[Glance]:
        """The drives of the selected bus."""
        bus = self.session.buses.get(self.session.selected_bus)
        return [] if bus is None else self.glances(bus)

    def tabs(self, now: float) -> list[Tab]:
        """A tab for each bus."""
        return [
            Tab(
                number,
                bus.name,
                bus_state(self.model.buses.get(bus.name), list(bus.drives), bus.lost is not None),
                bus.name == self.session.selected_bus,
                bus_old(self.model.buses.get(bus.name), list(bus.drives), now),
            )
            for number, bus in enumerate(self.session.buses.values(), 1)
        ]

    def paint(self, main: MainScreen, now: float, beat: int) -> None:
        """Paint frame number `beat`: new records always, all else in every third frame."""
        self._show_records(main, now)
        if beat % 3 == 0:
            self._paint_frame(main, now)
            self._paint_status(main, now)
            self._paint_plot(main, now)

    def take_records(self, main: MainScreen) -> None:
        """Pass new records on to the transcripts, whether the terminal accepts a frame or not."""
        self._flooded = any(len(facts.fresh) >= FLOOD for facts in self.model.buses.values())
        for name, facts in list(self.model.buses.items()):
            if facts.fresh:
                main.page(name).take(facts.fresh)
                facts.fresh.clear()

    def _show_records(self, main: MainScreen, now: float) -> None:
        """Show new records: few of them, or the first of many, in every frame; a flood ten times a second."""
        if self._flooded:
            if now - self._shown_at < FLOOD_PERIOD:
                return
            self._shown_at = now
        for page in main.pages.values():
            page.show_new()

    def banner(self, width: int) -> Row:
        """The red line: what is known since a stop that is latched, and why a bus is lost."""
        bus = self.session.buses.get(self.session.selected_bus)
        lost = self._loss(bus) if bus is not None else ""
        if self.session.latched and not lost:
            lost = next(filter(None, map(self._loss, self.session.buses.values())), "")
        return banner_row(self.session.tally() if self.session.latched else None, lost, width)

    def _loss(self, bus: BusView) -> str:
        """The reason of a loss, and whether the bus is being tried again; empty while it is not lost."""
        if bus.lost is None:
            return ""
        return f"{bus.lost}; trying again" if bus.name in self.session.reconnections.trying else str(bus.lost)

    def _paint_frame(self, main: MainScreen, now: float) -> None:
        """Paint top line, footer and label."""
        width = main.size.width
        clock = f"{self.session.wall(now):%H:%M:%S}"
        row = top_row(self.tabs(now), self.session.recording, clock, width, self.session.log is not None)
        main.lines("top").put([row])
        main.lines("footer").put([self._footer(width)])
        main.set_label(self.label())

    def _footer(self, width: int) -> Row:
        recording = bool(self.session.recording)
        return footer_row(self.macros.shown, recording, self.session.latched, width, self.model.progress)

    def label(self) -> Row:
        """The row before the input line: the drive that the line goes to, with its bus if several are open.

        In raw mode it is the bus.
        """
        if self.session.selected_bus in self.session.raw:
            return ((f" {self.session.selected_bus} raw ▸ ", "motion"),)
        drive = self.session.selected
        bus = self.session.selected_bus if len(self.session.buses) > 1 else ""
        where = ":".join(filter(None, (bus, drive.address if drive is not None else "")))
        if drive is not None and drive.programming:
            return ((f" {where} ◆ stores ▸ ", "motion"),)
        return ((f" {where} ▸ " if where else " ▸ ", "accent"),)

    def _paint_status(self, main: MainScreen, now: float) -> None:
        """The two status lines of a narrow screen."""
        if not main.wide:
            rows = narrow_rows(self.shown_glances(), now, main.size.width, self.polling.on)
            main.lines("status").put(rows)

    def _paint_plot(self, main: MainScreen, now: float) -> None:
        """Paint the side panel, or the plot above the transcript; whichever is shown."""
        glances = self.shown_glances()
        if main.wide:
            size = main.size_of("side")
            rows = wide_rows(glances, now, (size.width, size.height), self.polling.on, main.plot_shown)
            main.lines("side").put(rows)
        elif main.plot_shown:
            size = main.size_of("plot")
            chosen = next((glance for glance in glances if glance.selected), None)
            if chosen is None or size.height < 6:
                main.lines("plot").put([((" no drive selected", "dim"),)])
            else:
                main.lines("plot").put(plot_rows(chosen.readout, now, size.width, size.height, chosen.unit))
