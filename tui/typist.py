"""Typed lines on their way into the outbox: the drive that they are for, and what becomes of those that are not sent.

A line is for the drive that was shown when it was typed. If the selection changes by itself, the half-typed line stays
with the page of the drive before, and keys do not count until the person pauses. If a typed `/use` changed it, the line
was typed for the new drive and goes with it. `/stop` waits for nothing. What was typed and never sent is kept for the
history, and reported, so that a stop loses nothing silently.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from multidrop.base.files import split_lines
from multidrop.base.text import counted
from multidrop.shell.events import FAILURES
from multidrop.shell.line_syntax import Place
from multidrop.shell.session import Session
from multidrop.tui.assist import Assist
from multidrop.tui.outbox import Outbox, not_sent
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.questions import ScreenQuestions
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.widgets.entry import LONGEST_COMPLETED_LINE
from multidrop.tui.widgets.lines import Row


@dataclass(eq=False, repr=False)
class Selection:
    """Makes the main screen follow the session's selection."""

    _session: Session
    _model: ScreenModel
    _main: MainScreen
    _label: Callable[[], Row]
    """Returns the row before the input line."""
    _turn_deaf: Callable[[], None]
    """Drops keys until a pause."""
    _show_line: Callable[[str, str], None]
    shown: Place = Place("", "")
    """The drive that the screen shows."""
    _meant: bool = False
    """A typed `/use` selected another drive than the one that is shown."""

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus; show why that is not possible."""
        try:
            self._session.select(address, bus)
        except FAILURES as failure:
            self._show_line(str(failure), "x")
        self.follow()
        self._model.changed = True

    @property
    def changed(self) -> bool:
        """True if another drive is selected than the one that is shown."""
        return self.shown != self._session.place

    @property
    def unexpected(self) -> bool:
        """True if the selection changed by itself, and the screen does not show it yet."""
        return bool(self.shown.bus) and self.changed and not self._meant

    def expect(self, by_use: bool) -> None:
        """Note that the selection changed, and whether a typed `/use` did it."""
        self._meant = self._meant or by_use

    def rename(self, before: str, now: str) -> None:
        self._model.rename(before, now)
        self._main.rename_page(before, now)
        if self.shown.bus == before:
            self.shown = self.shown._replace(bus=now)

    def follow(self) -> None:
        """Show the page of the selected bus with its line, and the label of the selected drive."""
        main, current = self._main, self._session.selected_bus
        self.shown = self._session.place
        if current != main.current or current not in main.pages:
            if main.current == "" and current:
                early = [*main.pages[""].records] if "" in main.pages else []
                if "" in self._model.buses:
                    early += self._model.buses.pop("").fresh  # no frame has shown these
                self._model.bus(current).fresh.extendleft(reversed(early))
                main.adopt_page(current)
            main.show_page(current)
        main.set_label(self._label())

    def catch_up(self) -> None:
        """Follow a selection that changed; see the module for what becomes of the half-typed line.

        On a page, a single key may move the drive that is selected. So a page takes no keys until a pause, either.
        """
        meant, self._meant = self._meant, False
        if not self.changed:
            return
        if meant:
            draft = self._main.entry.exchange()
            self.follow()
            self._main.entry.take_in(draft)
            return
        if self.shown.bus and (self._main.entry.unsent or self._main.app.screen is not self._main):
            self._turn_deaf()
        self.follow()


MOST_KEPT_LINES = 20
"""Greatest number of lines that go into the history of those that a stop dropped before their Enter counted."""
NOT_TEXT = r"[^\t\r\n -~\xa0-\U0010ffff]"
"""A key that is not text."""


@dataclass(eq=False, repr=False)
class Unsent:
    """The lines of one main screen that a stop drops. `_keep` stores a line in the history, `_warn` shows one."""

    _main: MainScreen
    _model: ScreenModel
    _clock: Callable[[], float]
    _keep: Callable[[str], None]
    _warn: Callable[[str], None]
    _half: str | None = None
    """The text of the line when the last stop came, until it is reported; None while a dialog was open."""
    _cut: list[str] = field(default_factory=lambda: [""])
    """Text that was typed after it and dropped, by stop; it arrives in pieces."""
    _gathering: bool = False
    """A stop came, and the lines are not emptied yet: more pieces may come."""

    def stopped(self, half: str | None) -> None:
        """Note the half-typed line when a stop comes; None if a dialog had the keys."""
        if self._gathering:
            self._cut.append("")
        else:
            self._half = half

    def gather(self) -> None:
        """Report the pieces as one, when the lines are emptied."""
        self._gathering = True

    def dropped(self, text: str) -> None:
        """Take a text that was typed before the stop, after the half-typed line."""
        self._cut[-1] += text
        if not self._gathering:
            self._report()

    def empty(self) -> None:
        """Empty the lines that are being edited, and keep those that were not reported yet."""
        self._gathering = False
        reported = self._report()
        for bus, text in self._main.take_lines():
            if bus != self._main.current or not reported:
                self.keep(text, bus)
        self._half = "" if self._half is not None else None

    def _report(self) -> bool:
        """Report the half-typed line and the text that followed it; return whether there was any such text.

        Text typed into a dialog is not a line, and text after a key that is not text has an unknown meaning.
        """
        cut, self._cut = self._cut, [""]
        if self._half is None or not any(cut):
            return False
        plain = [re.split(NOT_TEXT, text)[0] for text in [self._half + cut[0], *cut[1:]]]
        lines = [line.strip() for text in plain for line in split_lines(text) if line.strip()]
        self._half = ""
        for line in lines[-MOST_KEPT_LINES:]:
            self._keep(line)
        if lines:
            self._warn(f"stopped; {not_sent(lines)}")
        return True

    def keep(self, text: str, bus: str) -> None:
        """Keep a line in the history and show on the page of its bus that it was not sent."""
        self._keep(text)
        self._model.page(bus).append(Record(self._clock(), "", "!", f"not sent: {text}"))


@dataclass(eq=False, repr=False)
class Typist:
    """Takes the lines of the main screen."""

    _session: Session
    _main: MainScreen
    _assist: Assist
    _outbox: Outbox
    _selection: Selection
    _unsent: Unsent
    _keyboard: Keyboard
    _questions: ScreenQuestions
    _meaning: str = ""

    def edited(self) -> None:
        text = self._main.entry.value
        self._meaning = self._assist.hint(text) if len(text) <= LONGEST_COMPLETED_LINE else ""
        self.show_hint()
        self._main.show_menu()

    def show_hint(self) -> None:
        """Show how many lines wait, and the meaning of the typed text."""
        waiting = self._outbox.waiting
        waits = counted(waiting, "line waits", "lines wait")
        self._main.set_hint(self._meaning, f"{waits} for the one before" if waiting else "")

    async def typed(self, text: str, empty: Callable[[], object]) -> None:
        """Send a line on behalf of a person; `empty` empties the input line, which waits until the line is sent.

        In raw mode a line goes out with its spaces, and Enter alone sends the end of a line.
        """
        line = text.strip() or self._session.enter_alone()
        if self._session.selected_bus in self._session.raw and not line.startswith("/"):
            line = text
        if not line:
            empty()
        elif self._selection.changed or line == "/stop":
            empty()
            await self._typed_meanwhile(line)
        else:
            await self._send(line)
            empty()
            self._follow(line)

    async def _send(self, line: str) -> None:
        """Send a line, and let it take its first step: it is written, it has its drive, what is immediate is done."""
        self._outbox.type(line)
        await asyncio.sleep(0)

    def _follow(self, line: str) -> None:
        self._assist.keep(line)
        self._main.page(self._main.current).look_end(newest=True)
        self._selection.follow()

    async def _typed_meanwhile(self, line: str) -> None:
        """Send a line that stops, or before which another drive was selected."""
        selection = self._selection
        if selection.unexpected:
            self._unsent.keep(line, selection.shown.bus)  # it was for the drive that is still shown
            self._keyboard.turn_deaf()
            selection.catch_up()
            return
        selection.catch_up()
        if line == "/stop":
            self._assist.keep(line)
            await self._session.run(line)
            return
        await self._send(line)
        self._follow(line)

    async def pasted(self, lines: list[str]) -> None:
        """Ask before several lines are sent one after the other."""
        await self._questions.paste(lines, self._outbox.paste)
