"""Write the pictures of the README and the docs: the program on the demo cell, in virtual time, as a person uses it.

Nothing in a picture is drawn by hand. The clock is set, so that the same program makes the same pictures, byte by byte.

Run: python packaging/pictures.py [NAME...]        (make pictures)
"""

from __future__ import annotations

import asyncio
import contextlib
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

from multidrop.shell.connect.settings import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import ShellAssist
from tests.support.virtual import VirtualLoop

PICTURES = ROOT / "docs" / "pictures"
BEGUN = datetime(2026, 11, 2, 12, 40, 50)
"""The time of day at which each picture's session begins."""
MACROS = {
    "home-all": ('key = "F2"\nnote = "every axis to its switch"\n', ["@a HM 1", "@b HM 1", "/wait stopped"]),
    "shuttle": ('key = "F3"\nnote = "one way, and wait"\n', ["MR {steps:int=512000,1..9999999}", "/wait stopped"]),
}
PROGRAM = """\
PG 1
' to the far end and back, until R1 is 0
LB GO
  MA 512000
  H
  MA 0
  H
  R1=R1-1
  BR GO,R1>0
  PR "done"
E
PG
"""
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

    async def page(self, name: str) -> None:
        """Open a page as its key does; a page that a line opens takes no keys for half a second of real time."""
        await self.app.run_action(f"page('{name}')")
        await self.look(0.2)

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
    await hand.line("MR 1024000", 1.6)


def page(name: str, *keys: str, seconds: float = 1.2) -> Scene:
    """A page that is opened during the work, and keys typed there."""

    async def scene(hand: Hand) -> None:
        await work(hand)
        await hand.page(name)
        await hand.press(*keys)
        await hand.look(seconds)

    return scene


async def macros(hand: Hand) -> None:
    """The page of macros, where no drive moves: its words are the same every time."""
    await hand.page("macros")
    await hand.look(1.2)


async def plays(hand: Hand) -> None:
    """A macro plays, and its steps show."""
    await hand.line("VM=180000")
    await hand.line("/play shuttle steps=900000", 1.2)


async def stopped(hand: Hand) -> None:
    """Everything was stopped."""
    await work(hand)
    await hand.press("ctrl+x")
    await hand.look(1.5)


async def program(hand: Hand) -> None:
    """A program was downloaded, and runs."""
    await hand.line("/download shuttle.mxt", 6.0)
    await hand.line("R1=9")
    await hand.line("EX GO", 2.2)
    await hand.page("program")
    await hand.press(*"shuttle.mxt", "enter")
    await hand.look(1.0)


async def twin(hand: Hand) -> None:
    """A drive is pushed while it moves beside its twin."""
    await hand.line("EE=1")
    await hand.line("/twin on a", 6.0)
    await hand.line("VM=20000")
    await hand.line("MR 60000", 1.6)
    await hand.line("/sim push a -20000", 0.9)


SCENES: dict[str, Picture] = {
    "demo-80x24": Picture(SMALL, work),
    "demo-120x40": Picture(LARGE, work),
    "macro-80x24": Picture(SMALL, plays),
    "stopped-80x24": Picture(SMALL, stopped),
    "drives-80x24": Picture(SMALL, page("drives")),
    "plot-120x40": Picture(LARGE, page("plot", seconds=3.0)),
    "parameters-120x40": Picture(LARGE, page("parameters", "r", seconds=8.0)),
    "controls-80x24": Picture(SMALL, page("controls")),
    "macros-80x24": Picture(SMALL, macros),
    "program-120x40": Picture(LARGE, program),
    "twin-120x40": Picture(LARGE, twin),
}


def taken(name: str) -> str:
    """The picture as SVG."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        loop = runner.get_loop()
        with mock.patch.object(_time, "get_time", loop.time):
            return runner.run(_take(SCENES[name]))


async def _take(picture: Picture) -> str:
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        settings = _settings(Path(name))
        session = Session(settings)
        try:
            with mock.patch.object(Session, "wall", _wall):
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


def _settings(folder: Path) -> Settings:
    """A configuration with two macros, and a program in the current folder."""
    settings = Settings({}, folder / "config", folder / "state")
    macros = folder / "config" / "macros"
    macros.mkdir(parents=True)
    for name, (head, lines) in MACROS.items():
        steps = "".join(f"\n[[step]]\nafter = 0.0\nline = '{line}'\n" for line in lines)
        (macros / f"{name}.toml").write_text(f'name = "{name}"\n{head}{steps}')
    (folder / "shuttle.mxt").write_text(PROGRAM)
    return settings


def _wall(session: Session, at: float) -> datetime:
    return BEGUN + timedelta(seconds=at)


def _steady(svg: str) -> str:
    """Give the picture's identifiers a name that does not differ from run to run, and no font of another host."""
    without_fonts = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)
    return re.sub(r"terminal-\d+", "terminal", without_fonts).replace("Fira Code,", "").replace("Fira Code, ", "")


def main() -> int:
    """Write the named pictures, or all."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or SCENES:
        (PICTURES / f"{name}.svg").write_text(taken(name))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
