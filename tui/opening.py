"""The opening of connections: those named at the start, and those chosen on the start page."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual.app import App

from dialects import Diagnostic, DriveError
from transports import TransportLost
from tui.assist import Assist
from tui.screens.start import Start
from tui.session_view import SessionView
from tui.terminal.keyboard import Keyboard

FAILURES = (DriveError, Diagnostic, TransportLost)


class Opener:
    """Opens connections. `show_line` writes to the transcript."""

    def __init__(
        self,
        app: App[int],
        session: SessionView,
        assist: Assist,
        keyboard: Keyboard,
        show_line: Callable[[str, str], None],
    ) -> None:
        self._app, self._session, self._assist, self._keyboard = app, session, assist, keyboard
        self._show_line = show_line

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
        if not self._session.buses:
            self._keyboard.turn_deaf()
            await self.ask(failures[-1])

    async def connect(self, url: str) -> str:
        """Open a URL; return an empty string, or one line with the reason of the failure."""
        try:
            await self._session.open(url)
        except FAILURES as failure:
            if self._session.buses:
                self._show_line(str(failure), "x")
            return str(failure)
        return ""

    async def ask(self, trouble: str = "") -> None:
        """Show what can be opened. Keys wait while a connection opens, as their meaning is unknown until then."""

        def opening(begun: bool) -> None:
            if begun:
                self._keyboard.hold()
            else:
                self._keyboard.release()

        only = not self._session.buses
        assist = self._assist
        screen = Start(self.connect, assist.saved(), assist.ports, opening, only=only, trouble=trouble)
        await self._app.push_screen(screen)
