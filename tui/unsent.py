"""What was typed and never sent: kept for the history, and reported, so that a stop loses nothing silently."""

from __future__ import annotations

import re
from collections.abc import Callable

from multidrop.dialects.files import split_lines
from multidrop.tui.outbox import not_sent
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.screens.main_screen import MainScreen

KEPT = 20
"""Greatest number of lines that go into the history of those that a stop dropped before their Enter counted."""
NOT_TEXT = r"[^\t\r\n -~\xa0-\U0010ffff]"
"""A key that is not text."""


class Unsent:
    """The lines of one main screen that a stop drops. `keep` stores a line in the history, `warn` shows one."""

    def __init__(
        self,
        main: MainScreen,
        model: ScreenModel,
        clock: Callable[[], float],
        keep: Callable[[str], None],
        warn: Callable[[str], None],
    ) -> None:
        self._main, self._model, self._clock = main, model, clock
        self._keep, self._warn = keep, warn
        self._half: str | None = None
        """The text of the line when the last stop came, until it is reported; None while a dialog was open."""
        self._cut: list[str] = [""]
        """Text that was typed after it and dropped, by stop; it arrives in pieces."""
        self._gathering = False
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
        for line in lines[-KEPT:]:
            self._keep(line)
        if lines:
            self._warn(f"stopped; {not_sent(lines)}")
        return True

    def keep(self, text: str, bus: str) -> None:
        """Keep a line in the history and show on the page of its bus that it was not sent."""
        self._keep(text)
        self._model.page(bus).append(Record(self._clock(), "", "!", f"not sent: {text}"))
