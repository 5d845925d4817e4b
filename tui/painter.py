"""Puts what the board knows onto the main screen. Everything shown is made here from facts and the time."""

from __future__ import annotations

from tui.board import Board, bus_old, bus_state
from tui.desk import BusView, Desk
from tui.footer import footer_row
from tui.lines import Row
from tui.macrokeys import MacroKeys
from tui.main import Main
from tui.plot import plot_rows
from tui.polling import Polling
from tui.status import Glance, narrow_rows, wide_rows
from tui.topline import Tab, top_row


class Painter:
    """See the module."""

    def __init__(self, desk: Desk, board: Board, polling: Polling, macros: MacroKeys) -> None:
        self.desk, self.board, self.polling, self.macros = desk, board, polling, macros

    def glances(self, bus: BusView) -> list[Glance]:
        """The drives of a bus, as they are shown."""
        facts = self.board.bus(bus.name)
        chosen = self.desk.selected if bus.name == self.desk.selected_bus else None
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
        bus = self.desk.buses.get(self.desk.selected_bus)
        return [] if bus is None else self.glances(bus)

    def tabs(self, now: float) -> list[Tab]:
        """A tab for each bus."""
        return [
            Tab(
                number,
                bus.name,
                bus_state(self.board.buses.get(bus.name), list(bus.drives), bus.lost is not None),
                bus.name == self.desk.selected_bus,
                bus_old(self.board.buses.get(bus.name), list(bus.drives), now),
            )
            for number, bus in enumerate(self.desk.buses.values(), 1)
        ]

    def paint_frame(self, main: Main, now: float) -> None:
        """Top line, footer and label."""
        width = main.size.width
        clock = f"{self.desk.wall(now):%H:%M:%S}"
        row = top_row(self.tabs(now), self.desk.recording, clock, width)
        main.lines("top").put([row])
        recording = bool(self.desk.recording)
        main.lines("footer").put([footer_row(self.macros.shown, recording, self.desk.latched, width)])
        main.set_label(self.label())

    def label(self) -> Row:
        """What stands before the input line: the drive that it goes to, with its bus where several are open."""
        drive = self.desk.selected
        bus = self.desk.selected_bus if len(self.desk.buses) > 1 else ""
        where = ":".join(filter(None, (bus, drive.address if drive is not None else "")))
        if drive is not None and drive.programming:
            return ((f" {where} ◆ stores ▸ ", "motion"),)
        return ((f" {where} ▸ " if where else " ▸ ", "accent"),)

    def paint_status(self, main: Main, now: float) -> None:
        """The two status lines of a narrow screen."""
        if not main.wide:
            rows = narrow_rows(self.shown_glances(), now, main.size.width, self.polling.on)
            main.lines("status").put(rows)

    def paint_plot(self, main: Main, now: float) -> None:
        """The side panel, or the plot above the transcript; whichever is shown."""
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
