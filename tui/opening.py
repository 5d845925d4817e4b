"""The opening of connections: those named at the start, and those chosen on the start page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from textual.app import App

from multidrop.dialects import Diagnostic, DriveError
from multidrop.transports import TransportLost
from multidrop.tui.assist import Assist
from multidrop.tui.screens.start import DEMO, TOUR, Start
from multidrop.tui.session_view import SessionView
from multidrop.tui.terminal.keyboard import Keyboard

FAILURES = (DriveError, Diagnostic, TransportLost)
TRY = "try PR P, MR 51200 and @b PR P, each with Enter; /tour walks through everything"
"""What an empty demo cell offers."""


class Opener:
    """Opens connections. `show_line` writes to the transcript, `begin_tour` begins the tour."""

    def __init__(
        self,
        app: App[int],
        session: SessionView,
        assist: Assist,
        keyboard: Keyboard,
        show_line: Callable[[str, str], None],
        begin_tour: Callable[[], Awaitable[None]],
    ) -> None:
        self._app, self._session, self._assist, self._keyboard = app, session, assist, keyboard
        self._show_line, self._begin_tour = show_line, begin_tour

    async def open_all(self, urls: Sequence[str]) -> None:
        """Open what was named at the start, side by side; ask if nothing could be opened."""
        failures: list[str] = []

        def failed(number: int, failure: BaseException) -> None:
            if not isinstance(failure, FAILURES):
                raise failure
            failures.append(str(failure))
            self._show_line(failures[-1], "x")

        for url in urls:
            self._show_line(f"opening {url} …", ".")
        await self._session.open_all(urls, failed)
        if DEMO.url in urls:
            self._show_line(TRY, ".")
        if not self._session.buses:
            self._keyboard.turn_deaf()
            await self.ask(failures[-1])

    async def connect(self, url: str, raw: bool = False) -> str:
        """Open a URL; return an empty string, or one line with the reason of the failure.

        `tour` opens the demo cell, and the tour on it.
        """
        tour = url == TOUR.url
        try:
            if tour:
                await self._begin_tour()
            else:
                await self._session.open(url, raw=raw)
        except FAILURES as failure:
            if self._session.buses:
                self._show_line(str(failure), "x")
            return str(failure)
        if url == DEMO.url:
            self._show_line(TRY, ".")
        elif not tour:
            await self._assist.opened(url)
        return ""

    async def ask(self, trouble: str = "") -> None:
        """Show what can be opened. Keys wait while a connection opens, as their meaning is unknown until then."""

        def opening(begun: bool) -> None:
            if begun:
                self._keyboard.hold()
            else:
                self._keyboard.release()

        only = not self._session.buses
        await self._app.push_screen(Start(self.connect, self._assist, opening, only=only, trouble=trouble))
