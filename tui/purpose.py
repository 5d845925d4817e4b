"""What a screen is for: it works on the drives of its session, or it only shows what is done elsewhere.

A screen that only shows something has a purpose of its own in place of this one. What differs is decided there, and the
app, its pages and its polls ask nothing else.
"""

from __future__ import annotations

from collections.abc import Coroutine
from typing import Any

from multidrop.shell.session import Session
from multidrop.tui.polling import Polling
from multidrop.tui.widgets.lines import Row


class Purpose:
    """The purpose of a screen that works: lines go to drives, what is shown is polled, every page is there."""

    works = True
    """Lines that are typed here go somewhere, so the screen says which to type: `/resume`, macros, `/open URL`."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.polling = Polling()

    def fill(self) -> Coroutine[Any, Any, object] | None:
        """What fills a screen for which no URL was named; None: a person is asked what to open."""
        return None

    def refused(self, page: str) -> str:
        """Why a page is not shown; empty: it is."""
        return ""

    def label(self) -> Row:
        """The row before the input line: the drive that the line goes to, with its bus if several are open.

        In raw mode it is the bus.
        """
        if self.session.selected_bus in self.session.raw:
            return ((f" {self.session.selected_bus} raw, /raw off ends ▸ ", "motion"),)
        drive = self.session.selected
        bus = self.session.selected_bus if len(self.session.tabs.shown) > 1 else ""
        where = ":".join(filter(None, (bus, drive.label or drive.address if drive is not None else "")))
        if drive is not None and drive.programming:
            return ((f" {where} ◆ stores ▸ ", "motion"),)
        return ((f" {where} ▸ " if where else " ▸ ", "accent"),)
