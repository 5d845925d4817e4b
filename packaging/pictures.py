"""Write the pictures of the README and the docs: the program on the demo cell, in virtual time, as a person uses it.

Nothing in a picture is drawn by hand. The clock is set, so that the same program makes the same pictures, byte by byte.

Run: python packaging/pictures.py [NAME...]        (make pictures)
"""

from __future__ import annotations

import asyncio
import re
import sys
import tempfile
from collections.abc import Awaitable, Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple
from unittest import mock

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from textual import _time
from textual.pilot import Pilot

from shell.connect.settings import Settings
from shell.session import Session
from tests.support.virtual import VirtualLoop
from tui.app import MultidropApp
from tui.assist import ShellAssist

PICTURES = ROOT / "docs" / "pictures"
BEGUN = datetime(2026, 11, 2, 12, 40, 50)
"""The time of day at which each picture's session begins."""
SMALL, LARGE = (80, 24), (120, 40)


class Hand:
    """A person at the keyboard."""

    def __init__(self, app: MultidropApp, pilot: Pilot[int]) -> None:
        self.app, self._pilot = app, pilot

    async def line(self, text: str, seconds: float = 0.6) -> None:
        """Type a line, press Enter, and look for some time."""
        self.app.main.entry.value = text
        await self.press("enter")
        await self.look(seconds)

    async def press(self, *keys: str) -> None:
        """Press keys one after the other."""
        await self._pilot.press(*keys)

    async def look(self, seconds: float) -> None:
        """Let virtual time pass."""
        await asyncio.sleep(seconds)


Scene = Callable[[Hand], Awaitable[None]]


class Picture(NamedTuple):
    """A picture: its size in cells, and what is done before it is taken."""

    size: tuple[int, int]
    scene: Scene


async def work(hand: Hand) -> None:
    """Ask, err, and move two drives of the party line."""
    await hand.line("VM=180000")
    await hand.line("PR P")
    await hand.line("@b PR VX")
    await hand.line("@b SL 20000")
    await hand.line("MR 512000", 1.6)


def page(name: str, seconds: float = 1.2) -> Scene:
    """A page, opened during the work."""

    async def scene(hand: Hand) -> None:
        await work(hand)
        await hand.line(f"/page {name}", seconds)

    return scene


SCENES: dict[str, Picture] = {
    "demo-80x24": Picture(SMALL, work),
    "demo-120x40": Picture(LARGE, work),
    "drives-80x24": Picture(SMALL, page("drives")),
    "plot-120x40": Picture(LARGE, page("plot", 3.0)),
    "parameters-120x40": Picture(LARGE, page("parameters", 6.0)),
    "controls-80x24": Picture(SMALL, page("controls")),
    "macros-80x24": Picture(SMALL, page("macros")),
}


def taken(name: str) -> str:
    """The picture as SVG."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        loop = runner.get_loop()
        with mock.patch.object(_time, "get_time", loop.time):
            return runner.run(_take(SCENES[name]))


async def _take(picture: Picture) -> str:
    with tempfile.TemporaryDirectory() as folder:
        session = Session(Settings({}, Path(folder) / "config", Path(folder) / "state"))
        try:
            with mock.patch.object(Session, "wall", _wall):
                settings = Settings({}, Path(folder) / "config", Path(folder) / "state")
                app = MultidropApp(session, ["sim:"], ShellAssist(session, settings))
                app.theme = "multidrop-dark"
                async with app.run_test(size=picture.size) as pilot:
                    while len(session.buses) < 3 or not all(bus.drives for bus in session.buses.values()):
                        await asyncio.sleep(0.05)
                    hand = Hand(app, pilot)
                    await hand.look(2.0)
                    await picture.scene(hand)
                    await pilot.pause()
                    return _steady(app.export_screenshot(title="multidrop"))
        finally:
            await session.close()


def _wall(session: Session, at: float) -> datetime:
    return BEGUN + timedelta(seconds=at)


def _steady(svg: str) -> str:
    """Give the picture's identifiers a name that does not differ from run to run."""
    return re.sub(r"terminal-\d+", "terminal", svg)


def main() -> int:
    """Write the named pictures, or all."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or SCENES:
        (PICTURES / f"{name}.svg").write_text(taken(name))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
