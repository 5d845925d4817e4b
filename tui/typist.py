"""Typed lines on their way into the outbox, and the meaning of what is being typed.

A line is for the drive that was shown when it was typed. `/stop` waits for nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from multidrop.tui.assist import Assist
from multidrop.tui.outbox import Outbox
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.questions import Questions
from multidrop.tui.selection import Selection
from multidrop.tui.session_view import SessionView
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.unsent import Unsent
from multidrop.tui.widgets.entry import LONGEST


class Typist:
    """Takes the lines of the main screen."""

    def __init__(
        self,
        session: SessionView,
        main: MainScreen,
        assist: Assist,
        outbox: Outbox,
        selection: Selection,
        unsent: Unsent,
        keyboard: Keyboard,
        questions: Questions,
    ) -> None:
        self._session, self._main, self._assist = session, main, assist
        self._outbox, self._selection, self._unsent = outbox, selection, unsent
        self._keyboard, self._questions = keyboard, questions
        self._meaning = ""

    def edited(self) -> None:
        """Show the meaning of the typed text and its completions."""
        text = self._main.entry.value
        self._meaning = self._assist.hint(text) if len(text) <= LONGEST else ""
        self.show_hint()
        self._main.show_menu()

    def show_hint(self) -> None:
        """Show how many lines wait, and the meaning of the typed text."""
        waiting = self._outbox.waiting
        waits = f"{waiting} lines wait" if waiting > 1 else "a line waits"
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
        """Follow a line that was sent."""
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
