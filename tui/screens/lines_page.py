"""Pages of rows that each have a line: Enter shows it, and a second Enter sends it, as it may move something."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.values import Conditions
from multidrop.tui.panels.view import Glance, View, name_of
from multidrop.tui.screens.page import PageHost, SendingPage, note_painted
from multidrop.tui.text import at_words, fit
from multidrop.tui.widgets.lines import ActionText, Row, Span, grouped_rows, spread

LABEL, STATE, LINE = 14, 18, 16


class LineRow(NamedTuple):
    """A row with the line that it sends."""

    label: str
    line: str = ""
    state: str = ""
    about: str = ""
    absent: str = ""
    """Why it sends nothing."""
    group: str = ""
    """A heading above it, where it differs from that of the row before."""
    live: bool = False
    """Its state is shown as of something that is on, or runs."""


class LinesPage(SendingPage):
    """Rows with lines for the selected drive. A subclass makes the rows."""

    WANTS = frozenset({"motion", "conditions"})
    PARTS = {"heading": None, "rows": "1fr", "said": None}
    TITLE = ""

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self._at = 0
        self._place = host.session.place
        self._glance: Glance | None = None

    @abstractmethod
    def made(self, by_hand: ByHand, conditions: Conditions | None) -> Sequence[LineRow]:
        """Return the rows of a drive, as its conditions are known."""

    @abstractmethod
    def missing(self, by_hand: ByHand) -> str:
        """Return why a drive has no rows."""

    def rows(self) -> Sequence[LineRow]:
        drive = self.host.session.selected
        return () if drive is None else self.made(drive.family.values.by_hand, self._conditions())

    def _conditions(self) -> Conditions | None:
        """What was read of the first axis, which has what is of the whole drive."""
        return self._glance.readout.axes[0].conditions if self._glance is not None else None

    # What is shown

    def on_mount(self) -> None:
        """What failed before is not the page's."""
        self.host.model.trouble = ""
        self.field.display = False

    def show(self, view: View) -> None:
        self._glance = view.chosen
        session, width = self.host.session, self.size.width
        if view.session.place != self._place:
            self._place, self._at, self.begun = view.session.place, 0, None
            self.say("")
        if self.begun is not None and self.begun.overtaken(session):
            self.begun = None
            self.say("stopped; nothing was sent")
        if view.model.trouble:
            self.say(f"✗ {view.model.trouble}")
            view.model.trouble, self.begun = "", None
        rows = self.rows()
        self._at = min(self._at, max(0, len(rows) - 1))
        name = f"{session.selected_bus}:{name_of(view.chosen)}" if view.chosen is not None else "no drive selected"
        left: list[Span] = [(f" {self.TITLE}   ", "strong"), (name, "accent")]
        self.lines("heading").put([spread(left, [("Enter shows the line, Enter again sends it ", "dim")], width)])
        part = self.lines("rows")
        if rows:
            painted = [(row.group, self._painted(row, number, width)) for number, row in enumerate(rows)]
            part.put(grouped_rows(painted, self._at, width, max(1, part.size.height)))
        else:
            drive = session.selected
            why = "^O chooses a drive" if drive is None else self.missing(drive.family.values.by_hand)
            part.put([((f" {line}", "dim"),) for line in at_words(why, width - 2)])
        said = at_words(self.said[0], width - 2)[:3] or [""]
        self.lines("said").put_all([((f" {line}", self.said[1]),) for line in said])
        note_painted(self)

    def _painted(self, row: LineRow, number: int, width: int) -> Row:
        chosen = number == self._at
        link = ActionText("▸ " if chosen else "  ", f"screen.clicked({number})")
        left: list[Span] = [
            (link, "accent"),
            (f"{fit(row.label, LABEL)} ", "dim" if row.absent else "accent" if chosen else "text"),
            (f"{fit(row.state, STATE)} ", "motion" if row.live else "text"),
        ]
        room = max(0, width - LABEL - STATE - 5)
        if row.absent:
            return (*left, (fit(row.absent, room), "dim"))
        line = fit(row.line, min(LINE, room))
        return (*left, (line, "strong" if chosen else "text"), (fit(f" {row.about}", max(0, room - LINE)), "dim"))

    # Keys

    def action_step(self, by: int) -> None:
        self._drop()
        self._at = min(max(self._at + by, 0), max(0, len(self.rows()) - 1))

    async def action_clicked(self, at: int) -> None:
        """Choose a row. A click sends nothing."""
        self._drop()
        self._at = at

    def action_enter(self) -> None:
        """Show the line of the chosen row, or send the one that is shown."""
        if self.begun is not None:
            if (begun := self.accepted()) is not None:
                self.send(begun.lines)
            return
        rows = self.rows()
        if rows:
            self.offer_row(rows[min(self._at, len(rows) - 1)])

    def offer_row(self, row: LineRow) -> None:
        """Show the line of a row: Enter sends it."""
        if row.absent:
            self.say(f"nothing was sent: {row.label}: {row.absent}")
            return
        self.offer(row.label, (row.line,))
        self.say(f"Enter sends {row.line}{f' - {row.about}' if row.about else ''}   Esc: nothing")

    def choose(self, at: int) -> None:
        self._at = at

    def _drop(self) -> None:
        if self.begun is not None:
            self.begun = None
            self.say("nothing was sent")

    def action_leave(self) -> None:
        """Drop the line that waits for Enter, then leave the page."""
        if self.begun is not None:
            self._drop()
        else:
            super().action_leave()
