"""The page of traffic: the bytes of the selected line, both ways, with times; paused, looked back, without polls."""

from __future__ import annotations

from itertools import islice

from multidrop.base.text import counted
from multidrop.tui.panels.table import piece_rows
from multidrop.tui.panels.view import View, names_on
from multidrop.tui.screen_model import TrafficStore
from multidrop.tui.screens.page import Page, PageHost
from multidrop.tui.text import visible
from multidrop.tui.widgets.lines import Row, spread

NO_TRAFFIC = TrafficStore()


class TrafficPage(Page):
    """The bytes. The view is anchored at its last piece, which is the newest one unless the reader went up."""

    SHEET = "traffic"
    WANTS = frozenset({"motion"})
    PARTS = {"heading": None, "traffic": "1fr"}

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._bottom: int | None = None
        """The number of the last piece in view; None: the newest."""
        self._polls, self._hex = False, True
        self._bus = ""
        self._shown = 1
        """Pieces in view."""

    def _store(self) -> TrafficStore:
        name = self.host.session.selected_bus
        if name != self._bus:
            self._bus, self._bottom = name, None
        return self.host.model.bus(name).traffic if name in self.host.session.buses else NO_TRAFFIC

    def show(self, view: View) -> None:
        store, part = self._store(), self.lines("traffic")
        height, rows, names = part.size.height, list[Row](), names_on(self.host.session, self._bus)
        self._shown = 0
        behind = 0 if self._bottom is None else store.taken - 1 - self._bottom
        for piece in islice(reversed(store.pieces), max(0, behind), None):
            if len(rows) >= height:
                break
            self._shown += 1
            if self._polls or not piece.poll:
                rows[:0] = piece_rows(piece, view.session.wall, self.size.width, names, self._hex)
        part.put(rows[-height:] if height else [])
        state = (
            "follows the newest" if self._bottom is None else f"paused; {counted(max(0, behind), 'piece')} came since"
        )
        heading: Row = (
            (f" TRAFFIC {visible(self._bus)}   ", "strong"),
            (state, "dim" if self._bottom is None else "motion"),
        )
        polls = "polls shown " if self._polls else "polls hidden "
        self.lines("heading").put([spread(heading, [(polls, "dim")], self.size.width)])

    # Keys

    def action_look(self, by: int) -> None:
        """Look back, or on; past the newest piece the view follows again."""
        store = self._store()
        bottom = (store.taken - 1 if self._bottom is None else self._bottom) + by
        oldest = store.taken - len(store.pieces)
        self._bottom = None if bottom >= store.taken - 1 else max(bottom, oldest)

    def action_page(self, by: int) -> None:
        self.action_look(by * max(1, self._shown - 1))

    def action_follow(self) -> None:
        self._bottom = None

    def action_pause(self) -> None:
        self._bottom = self._store().taken - 1 if self._bottom is None else None

    def action_polls(self) -> None:
        self._polls = not self._polls

    def action_hex(self) -> None:
        self._hex = not self._hex
