"""CPU time of plots on the screen: 2 series of 600 points, 120 x 36, a sample of each and a picture 20 times a second.

Virtual time: one process makes samples and pictures as fast as it can. A row is the share of a core that 20 pictures a
second take: the rows of text alone, and with Textual's painting. The peer draws everything again for each picture.

Run: python bench/bench_plots.py
"""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent))

from report import Row, alone, compared, main
from textual.app import App, ComposeResult

from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus
from multidrop.shell.roles import Series
from multidrop.tui.panels.plot import plot_rows
from multidrop.tui.panels.view import View, glances_of
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.widgets.lines import Lines, Roles
from multidrop.tui.widgets.theme import DARK, DEFAULTS
from tests.support.fake_session import FakeSession, demo_session

AIM = 0.05
"""The share of a core."""
RATE = 20
SPAN = 30
"""Seconds of samples: 600 points of a series."""
ROUNDS = 5
PICTURES = 200
WIDTH, HEIGHT = 120, 36


def rows(full: bool) -> Iterator[Row]:
    """The share of a core for the rows, and for the rows on a screen."""
    kept, again = [], []
    for _ in range(ROUNDS):
        kept.append(share(keep=True))
        again.append(share(keep=False))
    yield compared("plot, 2 x 600 points, rows of text", "of a core", kept, again, "drawn again", aim=AIM)
    yield alone("plot, 2 x 600 points, painted", "of a core", [asyncio.run(painted()) for _ in range(ROUNDS)], aim=AIM)


class Moving:
    """Two drives that move, and their plot."""

    def __init__(self) -> None:
        self.session: FakeSession = demo_session()
        self.session.plotted = (Series("press", "a"), Series("press", "b"))
        self.model = ScreenModel(lambda: "press", lambda: self.session.buses)
        self.model.look.hidden = {"position"}
        self.model.look.shorter(-1)
        self.count = 0
        for _ in range(SPAN * RATE):
            self.step()

    def step(self) -> None:
        """One sample of each drive."""
        self.session.time += 1 / RATE
        self.count += 1
        for address, turn in (("a", self.count / 40), ("b", self.count / 25)):
            sample = Sample(self.session.time, address, self.count, int(1000 * math.sin(turn)))
            self.model.take(OnBus("press", sample))

    def rows(self) -> list[tuple[tuple[str, str], ...]]:
        """The picture now."""
        glances = glances_of(self.session, self.model, self.session.buses["press"])
        return plot_rows(View(self.session, self.model, glances, self.session.time, True), WIDTH, HEIGHT)


def share(*, keep: bool) -> float:
    """The share of a core of samples and rows."""
    moving = Moving()
    moving.rows()
    begun = time.process_time()
    for _ in range(PICTURES):
        moving.step()
        if not keep:
            moving.model.look.charts.clear()
        moving.rows()
    return (time.process_time() - begun) / PICTURES * RATE


class Screen(App[None]):
    """One part of the screen, alone."""

    CSS_PATH = str(Path(__file__).parent.parent / "tui" / "multidrop.tcss")

    def __init__(self) -> None:
        super().__init__()
        self.register_theme(DARK)
        self.theme = DARK.name
        self.lines = Lines(id="charts")
        self.lines.styles.height = "1fr"

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Give the colours."""
        return DEFAULTS

    def compose(self) -> ComposeResult:
        """Make the part, and what has the styles of its roles, as on the main screen."""
        yield Roles()
        yield self.lines


async def painted() -> float:
    """The share of a core of samples, rows and painting, less what an unchanged screen takes."""
    moving, app = Moving(), Screen()
    async with app.run_test(size=(WIDTH, HEIGHT)) as pilot:
        app.lines.put(moving.rows())
        await pilot.pause()
        spent = []
        for moves in (False, True):
            begun = time.process_time()
            for _ in range(PICTURES):
                if moves:
                    moving.step()
                    app.lines.put(moving.rows())
                    app.screen._on_timer_update()
                await asyncio.sleep(0)
            spent.append(time.process_time() - begun)
    return (spent[1] - spent[0]) / PICTURES * RATE


if __name__ == "__main__":
    main(rows)
