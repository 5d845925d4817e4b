"""The page of plots: the same charts as the panel in all the room, with a cursor, pause, zoom and a way to rerun."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import BindingType

from multidrop.shell.roles import DIFFERENCE
from multidrop.tui.curves.chart import Look
from multidrop.tui.key_table import bound
from multidrop.tui.panels.plot import columns_of, cursor_row, plot_rows, plot_title
from multidrop.tui.panels.plotted import PLOTTED
from multidrop.tui.panels.view import View
from multidrop.tui.polling import plotted
from multidrop.tui.screens.page import Host, Page
from multidrop.tui.widgets.lines import Row

PORT = 9876
"""The port at which viewers of rerun connect by default."""


class PlotPage(Page):
    """Plots. Keys change how a person looks at them; what is plotted changes by lines that a person could type."""

    SHEET = "plot"
    BINDINGS: ClassVar[list[BindingType]] = bound("plot")
    WANTS = frozenset({"motion", "plot", "samples"})
    PARTS = {"heading": None, "charts": "1fr", "below": None}

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._columns = 1

    @property
    def _look(self) -> Look:
        return self.host.model.look

    def show(self, view: View) -> None:
        charts = self.lines("charts")
        size = charts.size
        self._columns = max(1, columns_of(size.width))
        _, *about = plot_title(view)
        self.lines("heading").put([((" PLOTS   ", "strong"), *about)])
        charts.put(plot_rows(view, size.width, size.height))
        self.lines("below").put([self._below(view)])

    def _below(self, view: View) -> Row:
        """The values at the cursor; without it, the last failure, or how to see what rerun shows."""
        if self._look.cursor is not None:
            return cursor_row(view, self.size.width)
        if self.host.model.trouble:
            return ((f" ✗ {self.host.model.trouble}", "error"),)
        served = [each for each in view.session.plots if each.desk]
        if served:
            return (
                (" at your desk: ", "dim"),
                (served[0].desk, "strong"),
                ("   c copies it; then: ", "dim"),
                (f"rerun {served[0].where}", "strong"),
            )
        others = [each.where for each in view.session.plots]
        return ((f" rerun: plotting to {others[0]}", "dim"),) if others else ()

    def _type(self, line: str) -> None:
        """Send a line as if a person had typed it; its failure is shown below the charts."""
        self.host.model.trouble = ""
        self.host.outbox.type(line)

    def action_pause(self) -> None:
        self._look.pause(self.host.session.now())

    def action_cursor(self, columns: int) -> None:
        """Move the cursor; that pauses."""
        self._look.move_cursor(columns, self.host.session.now(), self._columns)

    def action_shorter(self, by: int) -> None:
        self._look.shorter(by)

    def action_closer(self, by: int) -> None:
        """Magnify the values, or show more of them."""
        self._look.closer(by)

    def action_automatic(self) -> None:
        self._look.automatic()
        self._look.go_on()

    async def action_beside(self) -> None:
        """Show the plot beside the transcript, or hide it, and go there."""
        self.dismiss(None)
        await self.app.run_action("act.panel('plot')")

    def action_apart(self) -> None:
        """Give each drive charts of its own, or put all into one."""
        self._look.apart = not self._look.apart

    def action_hide(self, word: str) -> None:
        """Hide the charts of a quantity, or show them; one of the two stays."""
        hidden = self._look.hidden ^ {word}
        if hidden != set(PLOTTED):
            self._look.hidden = hidden

    def action_drive(self, number: int) -> None:
        """Plot a drive of the selected line, by its number in the list, or plot it no longer."""
        bus = self.host.session.buses.get(self.host.session.selected_bus)
        if bus is None or number > len(bus.drives):
            return
        address = list(bus.drives)[number - 1]
        named = list(plotted(self.host.session))
        mine = [each for each in named if (each.bus, each.address, each.word) == (bus.name, address, "")]
        texts = [each.text for each in named if each not in mine]
        texts += [] if mine else [f"{bus.name}:{address}"]
        if texts:  # one stays
            self._type(f"/plot {' '.join(texts)}")

    def action_all_drives(self) -> None:
        self._type(f"/plot {self.host.session.selected_bus}:*")

    def action_difference(self) -> None:
        """Plot the differences of the plotted drives from their twins, or plot them no longer."""
        named = list(plotted(self.host.session))
        texts = [each.text for each in named if each.word != DIFFERENCE]
        if len(texts) == len(named):
            texts += [each._replace(word=DIFFERENCE).text for each in named if not each.word]
        if texts:  # one stays
            self._type(f"/plot {' '.join(texts)}")

    def action_stream(self) -> None:
        """Serve what is plotted for viewers of rerun, or end all such plots."""
        if self.host.session.plots:
            self._type("/plot off")
            return
        texts = " ".join(each.text for each in plotted(self.host.session))
        self._type(f"/plot {texts} --serve {PORT}")

    def action_copy(self) -> None:
        served = [each.desk for each in self.host.session.plots if each.desk]
        if served:
            self.app.copy_to_clipboard(served[0])
            self.notify("Copied", timeout=2)

    def on_mount(self) -> None:
        self.host.model.trouble = ""

    def on_unmount(self) -> None:
        """Let the picture go on: only this page has keys for that."""
        self._look.go_on()

    def action_leave(self) -> None:
        """Remove the cursor and go on; then leave."""
        if self._look.cursor is not None or self._look.paused_at is not None:
            self._look.go_on()
            return
        super().action_leave()
