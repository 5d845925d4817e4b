"""Pages that are forms: rows of values to edit, what they come to, and the lines that Enter sends in the end.

Nothing is sent while values are edited. A wrong value is refused with one line and leaves the row as it was.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.tui.panels.view import View, name_of
from multidrop.tui.screens.page import PageHost, SendingPage, note_painted
from multidrop.tui.text import at_words, fit, visible
from multidrop.tui.widgets.lines import ActionText, Row, Span, grouped_rows, spread

LABEL, VALUE = 16, 24


class FormRow(NamedTuple):
    """One value of a form. With `choices`, Enter takes the next of them."""

    key: str
    label: str
    value: str
    """As it is now; empty: there is none."""
    about: str = ""
    """What is valid, and what it does."""
    choices: Sequence[str] = ()
    group: str = ""
    """A heading above it, where it differs from that of the row before."""
    missing: str = "–"
    """What is shown instead of an empty value."""


class Form(ABC):
    """What a page edits: its rows, what they come to, and the lines that they need."""

    title = ""
    """The word in the heading of the page."""

    def __init__(self, host: PageHost) -> None:
        self.host = host
        self.edits: dict[str, str] = {}
        """The values that were edited, by the keys of their rows."""

    @abstractmethod
    def rows(self) -> Sequence[FormRow]:
        """Return the rows with their present values, where there are any."""

    @abstractmethod
    def nothing(self) -> str:
        """Return why there are no rows; empty: there are."""

    @abstractmethod
    def check(self, key: str, text: str) -> str:
        """Return a typed value as it is taken. Raises Diagnostic for a wrong one."""

    @abstractmethod
    def made(self) -> Sequence[str]:
        """Return the lines that the edited values need; none where nothing differs. Raises Diagnostic."""

    @abstractmethod
    def preview(self) -> Sequence[Span]:
        """Return what the values come to, a line each."""

    def anew(self) -> None:
        """Forget what belongs to the drive that was selected before."""
        self.edits = {}

    def sent(self) -> None:
        """Do what follows the lines that were sent."""
        return

    def heading(self) -> str:
        """Return what is at the right of the heading."""
        return ""

    def put(self, row: FormRow, value: str) -> None:
        """Take a value of a row, and forget one that is as it was."""
        self.edits.pop(row.key, None)
        if value != row.value:
            self.edits[row.key] = value

    def prune(self, rows: Sequence[FormRow]) -> None:
        """Forget the values that the rows have by now; what could not be written stays edited."""
        values = {row.key: row.value for row in rows}
        self.edits = {key: text for key, text in self.edits.items() if key in values and values[key] != text}


SENT = "form"


class FormPage(SendingPage):
    """A form for the selected drive."""

    WANTS = frozenset({"motion"})
    PARTS = {"heading": None, "form": "1fr", "preview": None, "about": None, "asked": None, "said": None}
    FIELD = "asked"
    FORM: ClassVar[type[Form]]

    def __init__(self, host: PageHost) -> None:
        super().__init__(host)
        self.form = self.FORM(host)
        self._at = 0
        self._place = host.session.place
        self._leaving = False
        """Escape was pressed once, and edited values are lost at the second time."""

    # What is shown

    def on_mount(self) -> None:
        """What failed before is not the page's."""
        self.host.model.trouble = ""

    def show(self, view: View) -> None:
        place, session = view.session.place, self.host.session
        if place != self._place:
            self._place, self._at = place, 0
            self.form.anew()
            self._close("another drive is selected" if self.begun or self.asked else "")
        begun = [each for each in (self.asked, self.begun) if each is not None]
        if any(each.overtaken(session) for each in begun):
            self._close("stopped; nothing was sent")
        if view.model.trouble:
            self.say(f"✗ {view.model.trouble}")
            view.model.trouble = ""
        width = self.size.width
        rows = self._rows()
        self.form.prune(rows)
        self._at = min(self._at, max(0, len(rows) - 1))
        chosen = view.chosen
        name = f"{session.selected_bus}:{name_of(chosen)}" if chosen is not None else "no drive selected"
        left: list[Span] = [(f" {self.form.title}   ", "strong"), (name, "accent")]
        if self.form.edits:
            left.append((f"   {len(self.form.edits)} changed, not saved", "motion"))
        self.lines("heading").put([spread(left, [(f"{self.form.heading()} ", "dim")], width)])
        self._put_rows(rows, width)
        shown = [((f" {fit(visible(text), width - 2)}", role),) for text, role in self.form.preview()] if rows else []
        self.lines("preview").put_all([(("─" * width, "rule"),), *shown])
        about = rows[self._at].about if rows else ""
        self.lines("about").put_all([((f" {line}", "dim"),) for line in at_words(about, width - 2)[:2] or [""]])
        self.lines("said").put_all(
            [((f" {line}", self.said[1]),) for line in at_words(self.said[0], width - 2)[:3] or [""]]
        )
        note_painted(self)

    def _rows(self) -> Sequence[FormRow]:
        return () if self.form.nothing() else self.form.rows()

    def _put_rows(self, rows: Sequence[FormRow], width: int) -> None:
        """Put the rows with headings around the chosen one."""
        part = self.lines("form")
        if not rows:
            part.put([((f" {line}", "dim"),) for line in at_words(self.form.nothing(), width - 2)])
            return
        painted = [(row.group, self._row(row, number, width)) for number, row in enumerate(rows)]
        part.put(grouped_rows(painted, self._at, width, max(1, part.size.height)))

    def _row(self, row: FormRow, number: int, width: int) -> Row:
        chosen, edited = number == self._at, row.key in self.form.edits
        value = self.form.edits.get(row.key, row.value)
        sign = ActionText("▸" if chosen else " ", f"screen.clicked({number})")
        before = f"was {row.value or row.missing}" if edited else ""
        about = before or (f"↵ {' | '.join(row.choices)}" if row.choices and chosen else "")
        return (
            (sign, "accent"),
            ("● " if edited else "  ", "motion"),
            (f"{fit(row.label, LABEL)} ", "accent" if chosen else "text"),
            (fit(visible(value or row.missing), VALUE), "strong" if edited or chosen else "text"),
            (fit(f" {visible(about)}", max(0, width - LABEL - VALUE - 4)), "dim"),
        )

    # Keys

    def action_step(self, by: int) -> None:
        if self.asked is None and self.begun is None:
            self._at = min(max(self._at + by, 0), max(0, len(self._rows()) - 1))

    async def action_clicked(self, at: int) -> None:
        """Choose a row and edit it. A click sends nothing."""
        if self.asked is None and self.begun is None and not self.form.nothing():
            self._at = at
            self.action_enter()

    def action_enter(self) -> None:
        """Edit the chosen row, or send the lines that are shown."""
        if self.begun is not None:
            if (begun := self.accepted()) is not None:
                self.send(begun.lines)
                self.form.sent()
            return
        if self.form.nothing():
            self.say(self.form.nothing())
            return
        row = self._rows()[self._at]
        value = self.form.edits.get(row.key, row.value)
        if row.choices:
            at = row.choices.index(value) + 1 if value in row.choices else 0
            self._put(row, row.choices[at % len(row.choices)])
        else:
            self.ask_for(row.key, value, row.about.partition(";")[0], row.key)
            self.field.select_all()
            self.say(f"{row.label}: {row.about}", "dim")

    def action_save(self) -> None:
        """Show the lines that save the form; Enter sends them."""
        if self.asked is not None or self.begun is not None:
            return
        if self.form.nothing():
            self.say(self.form.nothing())
            return
        try:
            lines = tuple(self.form.made())
        except Diagnostic as failure:
            self.say(f"nothing was sent: {failure}")
            return
        if not lines:
            self.say("nothing was changed, so nothing is to be saved")
            return
        self.offer(SENT, lines)
        self.say(f"Enter sends {', '.join(lines)}   Esc: nothing")

    def action_leave(self) -> None:
        """Leave the field or the lines that wait, then the page; edited values are lost only at a second Escape."""
        if self.asked is not None or self.begun is not None:
            self._close("nothing was sent")
        elif self.form.edits and not self._leaving:
            self._leaving = True
            self.say("the form is not saved: ^S saves it, Esc again leaves it")
        else:
            super().action_leave()

    # What is typed

    def typed(self, text: str) -> None:
        asked = self.asked
        if asked is None:
            return
        if asked.overtaken(self.host.session):
            self._close("it was not used")
            return
        try:
            taken = self.form.check(asked.name, text.strip())
        except Diagnostic as failure:
            self.say(f"nothing was changed: {failure}")
            return
        row = next((row for row in self._rows() if row.key == asked.name), None)
        self._close("")
        if row is not None:
            self._put(row, taken)

    def _put(self, row: FormRow, value: str) -> None:
        self._leaving = False
        self.form.put(row, value)

    def _close(self, said: str) -> None:
        self.begun = None
        if self.asked is not None:
            self.end_asking()
        self.say(said, "strong" if said else "dim")
