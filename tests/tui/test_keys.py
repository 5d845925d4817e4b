"""Keys count in the order of their bytes, however many arrive in one read: through the real driver, on a pty."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import AsyncExitStack

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from textual import constants

from multidrop.tui.app import MultidropApp
from multidrop.tui.terminal import keyboard
from multidrop.tui.widgets.entry import LineDraft
from multidrop.tui.widgets.lines import width_of
from tests.support.examples import examples
from tests.support.fake_session import FakeAssist, demo_session
from tests.support.pty_screen import PtyScreen, on_a_pty

pytestmark = [pytest.mark.tui, pytest.mark.pty]
HOME, UP, DOWN, LEFT = b"\x1b[H", b"\x1b[A", b"\x1b[B", b"\x1b[D"
BACKSPACE, CTRL_U, TAB, ENTER = b"\x7f", b"\x15", b"\t", b"\r"
SELECTOR, HISTORY, PALETTE, QUIT, PLOT = b"\x0f", b"\x12", b"\x10", b"\x11", b"\x14"
ESCAPE_M = b"\x1bM"
"""Escape and a letter: a terminal sends both in one read."""
BUS_1, BUS_2, NEXT_BUS = b"\x1b1", b"\x1b2", b"\x1b[6;5~"
F1, F3, F7 = b"\x1bOP", b"\x1bOR", b"\x1b[18~"
LINES = b"\x1b[200~MR 1\rMR 2\rMR 3\r\x1b[201~"
LINE = b"\x1b[200~MR 7\r\x1b[201~"
CLICK_ON_TAB = b"\x1b[<0;19;1M\x1b[<0;19;1m"
# Not among the keys below: where it lands depends on what is painted by then, and the prompt's width on the tab.
CLICK_IN_LINE = b"\x1b[<0;12;23M\x1b[<0;12;23m"
LETTERS = [*(bytes([letter]) for letter in b"MPR 5120"), "é".encode()]
WHOLE = [b"MR 5", b"/use eth", b"/use press", b"@b PR P", b"/stop", b"record"]
OTHERS = [HOME, UP, DOWN, LEFT, BACKSPACE, CTRL_U, TAB, ENTER, ENTER, ENTER, SELECTOR, HISTORY, PALETTE, QUIT, PLOT]
OTHERS += [ESCAPE_M, BUS_1, BUS_2, NEXT_BUS, F1, F3, F7, LINES, LINE, CLICK_ON_TAB]


class Bench:
    """One app on one pty for many examples."""

    def __init__(self) -> None:
        self.runner = asyncio.Runner()
        self._stack = AsyncExitStack()
        self.session = demo_session()
        self.assist = FakeAssist()
        terminal = on_a_pty(lambda driver: MultidropApp(self.session, [], self.assist, driver))
        self.screen: PtyScreen = self.runner.run(self._stack.enter_async_context(terminal))

    def close(self) -> None:
        self.runner.run(self._stack.aclose())
        self.runner.close()

    async def _afresh(self, busy: bool) -> None:
        app, session = self.screen.app, self.session
        while len(app.screen_stack) > 1:
            app.screen.dismiss(None)
        await self.screen.rest()
        session.select("a", "press")
        session.busy, session.latched, session.recording = busy, False, ""
        session.time += 1  # a key pressed again is no held key
        app.leaving.over = app.keyboard._closed = app.outbox._closed = session.quitting = (
            False  # no exit is carried out
        )
        app.keyboard.hear()
        app.selection.follow()
        app.main.take_lines()
        app.outbox.drop()
        await self.screen.rest()
        label = app.main.lines("label")
        await self.screen.until(lambda: label.size.width == width_of(label.rows[0]))  # where a click goes is settled
        self.assist.kept = ["VM=600000", "MR 512000", "PR P"]
        session.sent.clear()
        self.screen.exits.clear()
        self.stops_before = session.stops

    async def _typed(self, groups: list[bytes], busy: bool, slow: int) -> dict[str, object]:
        await self._afresh(busy)
        self.session.slow = slow
        await self.screen.type(*groups)
        return self._state()

    async def _key_by_key(self, keys: list[bytes], busy: bool) -> dict[str, object]:
        await self._afresh(busy)
        self.session.slow = 0
        for key in keys:
            await self.screen.type(key)
        return self._state()

    def _state(self) -> dict[str, object]:
        main = self.screen.app.main
        before: LineDraft = main.entry.exchange()
        main.entry.exchange(before)
        return {
            "sent": list(self.session.sent),
            "line": (before.text, before.selection),
            "all lines": main.take_lines(),
            "selected": (self.session.selected_bus, self.session.addresses[self.session.selected_bus]),
            "screens": [type(screen).__name__ for screen in self.screen.app.screen_stack],
            "exits": list(self.screen.exits),
            "stops": self.session.stops - self.stops_before,
            "kept": list(self.assist.kept),
        }

    def typed(self, *groups: bytes, busy: bool = False, slow: int = 0) -> dict[str, object]:
        """The result of groups of bytes, one read each; lines take `slow` turns of the loop."""
        return self.runner.run(self._typed(list(groups), busy, slow))

    def key_by_key(self, *keys: bytes, busy: bool = False) -> dict[str, object]:
        """The result of keys, each of which is complete before the next one is typed."""
        return self.runner.run(self._key_by_key(list(keys), busy))


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    before = constants.ESCAPE_DELAY
    constants.ESCAPE_DELAY = 60.0  # type: ignore[misc]  # a busy machine makes no Escape of a divided sequence
    pause, keyboard.DEAF_TIME = keyboard.DEAF_TIME, 1e6  # nor a pause after a question
    made = Bench()
    yield made
    made.close()
    keyboard.DEAF_TIME = pause
    constants.ESCAPE_DELAY = before  # type: ignore[misc]


def cut(data: bytes, sizes: list[int]) -> list[bytes]:
    """The bytes in groups of these sizes, repeatedly."""
    groups, at, n = [], 0, 0
    while at < len(data):
        groups.append(data[at : at + sizes[n % len(sizes)]])
        at, n = at + sizes[n % len(sizes)], n + 1
    return groups


KEYS = st.lists(st.sampled_from(LETTERS + WHOLE + OTHERS), max_size=14)


@examples(5, nightly=200)
@given(KEYS, st.lists(st.integers(1, 9), min_size=1, max_size=6), st.booleans(), st.integers(0, 9))
@example([b"MR 100", ENTER, b"0"], [99], False, 3)
@example([b"M", TAB, TAB, ENTER, b"PR", BACKSPACE, HOME, b"@b ", ENTER], [99], False, 3)
@example([SELECTOR, DOWN, ENTER, b"MR 5", ENTER, NEXT_BUS, b"MR 6", ENTER], [99], False, 3)
@example([b"MR 5", BUS_2, b"PR P", ENTER, BUS_1, b"12", ENTER], [99], False, 3)
@example([LINES, ENTER, b"PR P", ENTER, LINES, DOWN, ENTER, b"PR V", ENTER], [99], False, 3)
@example([QUIT, DOWN, ENTER, b"MR 5", ENTER, QUIT, ENTER, b"PR P", ENTER], [99], True, 3)
@example([PALETTE, b"play sh", ENTER, PALETTE, b"record a", ENTER, b"go", ENTER, b"MR 5", ENTER], [99], False, 3)
@example([HISTORY, b"m", HISTORY, DOWN, ENTER, b"0", ENTER, UP, UP, ENTER], [99], False, 3)
@example([b"MR 5", ENTER, b"/stop", ENTER, b"PR P", ENTER, b"MR"], [99], False, 3)
@example([b"MR 5", CLICK_ON_TAB, b"PR P", ENTER], [99], False, 3)
@example([b"@b PR P", CLICK_IN_LINE, b"0", ENTER], [99], False, 3)
@example([F3, b"MR 5", ENTER, F1, ESCAPE_M, b"A 0", ENTER], [99], False, 3)
@example([PALETTE, b"open", ENTER, TAB, b"nowhere", ENTER, ESCAPE_M, b"R 5", ENTER], [99], False, 3)
def test_what_is_typed_does_not_depend_on_how_it_is_grouped(
    bench: Bench, keys: list[bytes], sizes: list[int], busy: bool, slow: int
) -> None:
    grouped = bench.typed(*cut(b"".join(keys), sizes), busy=busy, slow=slow)
    assert grouped == bench.key_by_key(*keys, busy=busy)


def test_an_enter_and_the_next_character_in_one_read_are_a_line_and_the_beginning_of_the_next(bench: Bench) -> None:
    state = bench.typed(b"MR 100\r0")
    assert state["sent"] == ["press:a MR 100"]
    assert state["line"][0] == "0"  # type: ignore[index]


@pytest.mark.parametrize(
    "size", [2, pytest.param(3, marks=pytest.mark.nightly), 7, pytest.param(100, marks=pytest.mark.nightly), 4000]
)
def test_of_hundreds_of_lines_at_once_each_is_whole_and_in_its_place(bench: Bench, size: int) -> None:
    lines = [f"MR {number}" for number in range(200)]
    state = bench.typed(*cut("".join(f"{line}\r" for line in lines).encode(), [size]))
    assert state["sent"] == [f"press:a {line}" for line in lines]
