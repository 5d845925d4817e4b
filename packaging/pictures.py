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
from collections.abc import Callable, Coroutine, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "packaging")]

from film import moving
from textual import _time
from textual.pilot import Pilot

from multidrop.shell.configuration import Settings
from multidrop.shell.session import Session
from multidrop.tui.app import MultidropApp
from multidrop.tui.assist import Assist
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


Step = str | tuple[str, float] | list[str] | float
"""A line, a line and the seconds after it, or a page; keys; seconds."""
WORK = ("VM=180000", "PR P", "@b PR VX", "@b SL 20000", ("MR 1024000", 1.6))
"""Ask, err, and move two drives of the party line."""
SCENES: dict[str, tuple[tuple[int, int], Sequence[Step]]] = {
    "demo-80x24": (SMALL, WORK),
    "demo-120x40": (LARGE, WORK),
    "macro-80x24": (SMALL, ("VM=180000", ("/play shuttle steps=900000", 1.2))),
    "stopped-80x24": (SMALL, (*WORK, ["ctrl+x"], 1.5)),
    "drives-80x24": (SMALL, (*WORK, "page drives", [], 1.2)),
    "plot-120x40": (LARGE, (*WORK, "page plot", [], 3.0)),
    "parameters-120x40": (LARGE, (*WORK, "page parameters", ["r"], 8.0)),
    "controls-80x24": (SMALL, (*WORK, "page controls", [], 1.2)),
    "macros-80x24": (SMALL, ("page macros", 1.2)),
    "program-120x40": (
        LARGE,
        (
            *(("/download shuttle.mxt", 6.0), "R1=9", ("EX GO", 2.2)),
            *("page program", [*"shuttle.mxt", "enter"], 1.0),
        ),
    ),
    "twin-120x40": (
        LARGE,
        ("EE=1", ("/twin on a", 6.0), "VM=20000", ("MR 60000", 1.6), ("/sim push a -20000", 0.9)),
    ),
}
"""Each picture's size in cells, and what is done before it is taken: lines, pages, keys, seconds."""


MOVING = "tour"
TOUR: Sequence[tuple[str, float]] = (
    ("PR VR", 0.6),
    ("MR {12.5 mm}", 1.4),
    ("@b SL 200000", 1.2),
    ("VM=5", 1.6),
    ("SL 100000", 1.4),
    ("", 2.4),
)
"""The moving picture: lines, each with the seconds after it; an empty one is the stop."""
TYPED, FRAME = 0.1, 0.25
"""Seconds between two typed characters, and between two other frames."""


def filmed() -> str:
    """The moving picture as SVG."""
    return _run(_work(SMALL, _film))


async def _film(app: MultidropApp, pilot: Pilot[int]) -> str:
    frames = list[tuple[float, str]]()
    at = 0.0

    async def frame(seconds: float) -> None:
        nonlocal at
        await asyncio.sleep(seconds)
        await pilot.pause()
        at = round(at + seconds, 2)
        frames.append((at if frames else 0.0, _steady(app.export_screenshot(title="multidrop"))))

    await frame(0.0)
    for line, seconds in TOUR:
        for length in range(len(line)):
            app.main.entry.value = line[: length + 1]
            app.main.entry.cursor_position = length + 1
            await frame(TYPED)
        await pilot.press("enter" if line else "ctrl+x")
        for _ in range(round(seconds / FRAME)):
            await frame(FRAME)
    return moving(frames)


def taken(name: str) -> str:
    """The picture as SVG."""

    async def still(app: MultidropApp, pilot: Pilot[int]) -> str:
        for step in SCENES[name][1]:
            await _do(app, pilot, step)
        await pilot.pause()
        return _steady(app.export_screenshot(title="multidrop"))

    return _run(_work(SCENES[name][0], still))


def _run(work: Coroutine[None, None, str]) -> str:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        loop = runner.get_loop()
        with mock.patch.object(_time, "get_time", loop.time):
            return runner.run(work)


async def _work(size: tuple[int, int], take: Callable[[MultidropApp, Pilot[int]], Coroutine[None, None, str]]) -> str:
    """Open the program on the demo cell, and take its picture."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        settings = _settings(Path(name))
        session = Session(settings)
        try:
            with mock.patch.object(Session, "wall", _wall):
                app = MultidropApp(session, ["sim:"], Assist(session, settings))
                app.theme = "multidrop-dark"
                async with app.run_test(size=size) as pilot:
                    while len(session.buses) < 3 or not all(bus.drives for bus in session.buses.values()):
                        await asyncio.sleep(0.05)
                    await asyncio.sleep(2.0)
                    return await take(app, pilot)
        finally:
            await session.close()


async def _do(app: MultidropApp, pilot: Pilot[int], step: Step) -> None:
    if isinstance(step, list):
        await pilot.press(*step)
    elif isinstance(step, float):
        await asyncio.sleep(step)
    elif isinstance(step, str) and step.startswith(
        "page "
    ):  # as its key does: a page that a line opens takes no keys for half a second
        await app.run_action(f"act.page('{step.removeprefix('page ')}')")
        await asyncio.sleep(0.2)
    else:
        app.main.entry.value, seconds = (step, 0.6) if isinstance(step, str) else step
        await pilot.press("enter")
        await asyncio.sleep(seconds)


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
    for name in sys.argv[1:] or (MOVING, *SCENES):
        (PICTURES / f"{name}.svg").write_text(filmed() if name == MOVING else taken(name))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
