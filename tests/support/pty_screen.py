"""The app on a pseudo-terminal within the test: bytes in at the real driver, and the app's own objects to check."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any
from unittest import mock

from textual import events
from textual.driver import Driver
from textual.geometry import Size

from multidrop.tui.app import MultidropApp
from tests.support.fake_session import FakeAssist, FakeSession, demo_session, driver_of
from tests.support.posix import pty, tty
from tests.support.until import PATIENCE

if sys.platform != "win32":
    from multidrop.tui.terminal.driver import Terminal


class PtyScreen:
    """A terminal with an app in it. Made by `on_a_pty`."""

    def __init__(self, app: MultidropApp, master: int) -> None:
        self.app, self._master = app, master
        self.shown = bytearray()
        self.written = self.taken = 0
        self.exits: list[Any] = []

    def read(self) -> None:
        """Take the app's output, as a terminal does."""
        self.shown += os.read(self._master, 65536)

    def count(self, data: bytes) -> None:
        self.taken += len(data)

    @property
    def at_rest(self) -> bool:
        """True if everything written has been done."""
        app, keys = self.app, driver_of(self.app).keys
        done = app.keyboard.idle and app.outbox.idle and not app.message_queue_size and not app.leaving.undecided
        return bool(self.taken >= self.written and keys.idle and done)

    def write(self, data: bytes) -> None:
        """Type bytes in one go."""
        self.written += len(data)
        os.write(self._master, data)

    def resize(self, columns: int, lines: int) -> None:
        """Change the size of the terminal."""
        size = Size(columns, lines)
        self.app.post_message(events.Resize(size, size))

    async def until(self, true: Callable[[], bool]) -> None:
        """Run the app until a condition holds."""
        async with asyncio.timeout(PATIENCE):
            while not true():
                await asyncio.sleep(0.001)

    async def shows(self, text: str, bus: str = "press") -> None:
        """Wait until a line of a transcript contains this text: a terminal that answers no query gets frames slowly."""
        await self.until(lambda: any(text in record.text for record in self.app.main.page(bus).records))

    async def read_all(self) -> None:
        """Wait until the driver has read what was written."""
        async with asyncio.timeout(PATIENCE):
            while self.taken < self.written:
                await asyncio.sleep(0)

    async def rest(self) -> None:
        """Wait until everything typed has been done."""
        quiet = 0
        async with asyncio.timeout(PATIENCE):
            while quiet < 12:
                await asyncio.sleep(0)
                quiet = quiet + 1 if self.at_rest else 0

    async def type(self, *groups: bytes) -> None:
        """Type groups of bytes, each of which is one read; wait until all is done."""
        for group in groups:
            self.write(group)
            await self.read_all()
        await self.rest()


def _driver_on(terminal: int) -> type[Driver]:
    class OnPty(Terminal):
        def __init__(self, *arguments: Any, **named: Any) -> None:
            super().__init__(*arguments, **named)
            self.fileno, self.input_tty = terminal, True
            self._file = os.fdopen(os.dup(terminal), "w", encoding="utf-8")

        def start_application_mode(self) -> None:
            with mock.patch("sys.__stdout__", self._file):  # else the screen is drawn on the terminal of the tests
                super().start_application_mode()

        def close(self) -> None:
            super().close()
            self._file.close()

    return OnPty


@asynccontextmanager
async def on_a_pty(make: Callable[[type[Driver]], MultidropApp]) -> AsyncIterator[PtyScreen]:
    """Run an app on a terminal of 80 x 24. Its exits are recorded, not carried out."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    app = make(_driver_on(slave))
    screen = PtyScreen(app, master)
    loop = asyncio.get_running_loop()
    loop.add_reader(master, screen.read)
    leave, app.exit = app.exit, screen.exits.append  # type: ignore[assignment,method-assign]
    running = loop.create_task(app.run_async())
    try:
        await screen.until(lambda: running.done() or app.keyboard._awake)
        if running.done():
            running.result()
        keys = driver_of(app).keys
        take = keys.take

        def counted(data: bytes) -> None:
            take(data)
            screen.count(data)

        keys.take = counted
        await screen.rest()
        yield screen
    finally:
        leave(0)
        async with asyncio.timeout(PATIENCE):
            await running
        loop.remove_reader(master)
        os.close(master)
        os.close(slave)


@asynccontextmanager
async def demo(session: FakeSession | None = None) -> AsyncIterator[tuple[PtyScreen, FakeSession, FakeAssist]]:
    """The app on a session, that of the demo unless another is given."""
    session, assist = session or demo_session(), FakeAssist()
    async with on_a_pty(lambda driver: MultidropApp(session, [], assist, driver)) as screen:
        yield screen, session, assist
