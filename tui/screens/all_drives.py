"""The page of all drives of all lines: a row each, worst first."""

from __future__ import annotations

from collections.abc import Awaitable
from dataclasses import replace

from multidrop.shell.roles import Series
from multidrop.tui.panels.drive_columns import ALL_DRIVES
from multidrop.tui.panels.facts import selected_rows
from multidrop.tui.panels.machine import summary, worst_first
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.panels.table import panel, title_row
from multidrop.tui.panels.view import View
from multidrop.tui.screens.page import ListPage, PageHost
from multidrop.tui.widgets.lines import Row, beside, spread

WIDE_FROM, LEAST_ROOM = 110, 16
"""Least width of the page, and least rows below the list, with the chosen drive there."""
HEAD_ROWS, FEWEST = 7, 8
"""Rows of the page that neither list drives nor show the chosen one, and the least rows of the list."""


class AllDrives(ListPage):
    """All drives. Enter selects one; what is typed filters."""

    SHEET = "drives"
    WANTS = frozenset({"motion", "conditions"})
    PARTS = {"heading": None, "filter": None, "columns": None, "drives": "1fr", "chosen": 0}
    FIELD, LIST = "filter", "drives"

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._chosen: tuple[str, str] | None = None
        """The drive that a person chose; None: the worst one is chosen."""
        # Known from the beginning: keys of the read that opened the page count, too.
        self._view = View(host.session, host.model, (), host.session.now(), True)
        self._places = worst_first(self._view, "")

    def show(self, view: View) -> None:
        self._view = view
        self._places = worst_first(view, self.words)
        at = self._at()  # what a person chose stays chosen when another gets worse
        width = self.size.width
        part = self.lines("chosen")
        drives = sum(len(bus.drives) for bus in view.session.tabs.shown)
        room = self.size.height - HEAD_ROWS - max(FEWEST, drives)
        room = room if width >= WIDE_FROM and room >= LEAST_ROOM else 0
        part.styles.height = room
        part.put(self._chosen_rows(view, at, width, room) if room and self._places else [])
        below = self.put_rows(
            self._places, at, lambda place, chosen: ALL_DRIVES.row(place, view, width, chosen), [_NOTHING]
        )
        heading: Row = ((" ALL DRIVES   ", "strong"), (summary(self._places), "text"))
        self.lines("heading").put([spread(heading, [below, ("worst first ", "dim")], width)])
        self.lines("columns").put([ALL_DRIVES.heads(width)])

    def _chosen_rows(self, view: View, at: int, width: int, height: int) -> list[Row]:
        """The panel of the chosen drive beside its curves."""
        place, half = self._places[at], width // 2
        glance = replace(place.glance, selected=True)
        one = replace(view, glances=(glance,), only=(Series(place.bus, glance.address),))
        titles = [title_row(panel(name), one, wide, "─") for name, wide in (("drive", half), ("plot", width - half))]
        curves = plot_rows(one, width - half, height - 1)
        return [(*titles[0], *titles[1]), *beside(selected_rows(one, half - 1, height - 1), curves, half)]

    def _at(self) -> int:
        """The place of the chosen drive in the list; the first one if it is not there."""
        keys = [(place.bus, place.glance.address) for place in self._places]
        return keys.index(self._chosen) if self._chosen in keys else 0

    def action_step(self, by: int) -> None:
        if self._places:
            self.choose(min(max(self._at() + by, 0), len(self._places) - 1))

    def choose(self, at: int) -> None:
        if at < len(self._places):
            self._chosen = (self._places[at].bus, self._places[at].glance.address)

    def typed(self, text: str) -> Awaitable[None]:
        return self.action_take()

    def edited(self, text: str) -> None:
        """Narrow the list at once: Enter may follow in the same read. An address that is typed is the chosen drive."""
        self._places = worst_first(self._view, text)
        named = [
            place for place in self._places if text in (place.glance.address, f"{place.bus}:{place.glance.address}")
        ]
        chosen = (named or self._places)[:1]
        self._chosen = (chosen[0].bus, chosen[0].glance.address) if chosen and text else None

    async def action_take(self) -> None:
        """Select the drive; one in trouble is shown with the reason, any other on the main screen."""
        if self._places:
            place = self._places[self._at()]
            self.host.select(place.glance.address, place.bus)
            if place.in_trouble and self.host.session.selected is not None:
                await self.run_action("act.page('why')")
            else:
                self.dismiss(None)


_NOTHING: Row = ((" no drive", "dim"),)
