"""What the terminal shows after its size or the signs have changed: all, whatever it has cut. It is pyte's."""

from __future__ import annotations

import asyncio
from itertools import zip_longest

import pyte
import pytest

from multidrop.tui.widgets.theme import Signs
from tests.support.fake_session import demo_session, painted
from tests.support.pty_screen import PtyScreen, demo
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui


class Shown:
    """A pyte terminal that gets the app's output, and cuts what does not fit, as terminals do."""

    def __init__(self, screen: PtyScreen) -> None:
        self.screen = screen
        self.terminal = pyte.Screen(80, 24)
        self.stream, self.fed = pyte.ByteStream(self.terminal), 0

    def resize(self, columns: int, lines: int) -> None:
        """Change the size; the app learns of it later."""
        self.feed()
        self.terminal.resize(lines, columns)
        self.screen.resize(columns, lines)

    def feed(self) -> None:
        """Take the output."""
        data, self.fed = bytes(self.screen.shown[self.fed :]), len(self.screen.shown)
        self.stream.feed(data)

    def wrong(self) -> list[tuple[str, str]]:
        """The rows that differ: as the app has them, as the terminal shows them."""
        self.feed()
        app = self.screen.app
        with app._context():
            strips = painted(app.screen)
        rows = ["".join(segment.text for segment in strip).rstrip() for strip in strips]
        shown = [row.rstrip() for row in self.terminal.display]
        return [pair for pair in zip_longest(rows, shown, fillvalue="no row") if pair[0] != pair[1]]

    async def agrees(self) -> None:
        """Wait until the terminal shows what the app has."""
        try:
            await asyncio.wait_for(self.screen.until(lambda: not self.wrong()), PATIENCE)
        except TimeoutError:
            assert self.wrong() == []


@pytest.mark.parametrize(
    "sizes", [[(60, 15), (80, 24)], [(40, 10), (120, 40), (40, 10)]], ids=["as before", "too small"]
)
async def test_a_size_that_changes_and_changes_back_at_once_leaves_no_gap(sizes: list[tuple[int, int]]) -> None:
    session = demo_session()
    async with demo(session) as (screen, _, _):
        shown = Shown(screen)
        await shown.agrees()
        shown.resize(*sizes[-1])
        await shown.agrees()
        for size in sizes:
            shown.resize(*size)
        await shown.agrees()


async def test_other_signs_are_painted_at_once() -> None:
    session = demo_session()
    async with demo(session) as (screen, _, _):
        shown = Shown(screen)
        for signs in (Signs.ASCII, Signs.FULL, Signs.BOXES):
            screen.app.act.show_signs(signs)
            await screen.rest()
            await shown.agrees()
