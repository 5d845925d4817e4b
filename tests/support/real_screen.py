"""The app on a real session with a simulated cell, for tests from a key to the drive and back."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from textual.driver import Driver
from textual.pilot import Pilot

from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
from tests.support.until import PATIENCE


def real_app(
    folder: Path, url: str = "sim:#press", reconnect: bool = False, driver: type[Driver] | None = None
) -> MultidropApp:
    """An app that opens this URL; its settings and state are in the folder. Close its session in the end."""
    settings = Settings(folder=folder / "config", state=folder / "state", data=folder / "data")
    session = Session(settings, reconnect=reconnect)
    return MultidropApp(session, [url], Assist(session, settings), driver)


@asynccontextmanager
async def real_screen(
    folder: Path, url: str = "sim:#press", size: tuple[int, int] = (80, 24), reconnect: bool = False
) -> AsyncIterator[Pilot[int]]:
    app = real_app(folder, url, reconnect)
    try:
        async with app.run_test(size=size) as pilot:
            yield pilot
    finally:
        await app.session.close()


async def until(pilot: Pilot[int], true: Callable[[], object]) -> None:
    """Let the app work until a condition holds; look the less often, the longer it takes."""
    moment = 0.01
    async with asyncio.timeout(PATIENCE):
        while not true():
            await pilot.pause(moment)
            moment = min(moment * 1.1, 0.1)
            pilot.app.tick()  # type: ignore[attr-defined]
