"""Lines above the prompt: a terminal that takes them gets all of them, one that takes none gets their number."""

from __future__ import annotations

import asyncio

import pytest

from multidrop.shell.prompt.view import (
    BURST,
    CHUNK,
    LONG_PAUSE,
    MANY,
    MOST_HELD_LINES,
    STUCK_AFTER,
    UPDATE_PAUSE,
    LinesAbove,
    PromptStream,
)
from multidrop.shell.streams.output_streams import Colour

pytestmark = pytest.mark.virtual


class Output:
    """An application's output that keeps what is written, in the pieces in which it came."""

    stdout = None

    def __init__(self):
        self.pieces = []
        self.times = set()

    def write_raw(self, text):
        self.pieces.append(text)
        self.times.add(round(asyncio.get_running_loop().time(), 3))

    def encoding(self):
        return "utf-8"

    def enable_autowrap(self):
        pass

    def flush(self):
        pass


class Above(LinesAbove):
    """Lines above an application that draws nothing."""

    class App:
        """The application."""

        is_running = is_done = False

        def __init__(self):
            self.output = Output()

    class Writer:
        """A writer whose reader keeps up, or not."""

        behind = False

        def __init__(self):
            self.kept = b""

        def put(self, data, keep):
            assert keep
            self.kept += data

    def end(self):
        """Write what is left, as at the end of the program."""
        self._write_rest()

    def __init__(self):
        super().__init__(self.App())
        self._writer = self.Writer()
        self._task = asyncio.create_task(self._show())

    @property
    def lines(self):
        return "".join(self.app.output.pieces).splitlines()

    @property
    def writer(self):
        return self._writer


async def test_a_flood_is_shown_whole_and_in_chunks():
    above = Above()
    flood = [f"{n:062}" for n in range(5000)]
    stream = PromptStream(above, keep=False)
    stream.write("\n".join(flood[:9]) + "\nhalf")
    stream.lines(flood[9:], spare=True)
    await asyncio.sleep(10)
    assert above.lines == [*flood[:9], "half", *flood[9:]]
    assert max(map(len, above.app.output.pieces)) < CHUNK + 1000
    assert len(above.app.output.pieces) > 10


async def test_many_lines_have_the_prompt_drawn_less_often():
    updates = []
    for lines in (1, MANY):
        above = Above()
        for _ in range(200):
            above.add(["x"] * lines, keep=False)
            await asyncio.sleep(0.02)
        updates.append(len(above.app.output.times))
    assert updates[0] == pytest.approx(updates[1] * LONG_PAUSE / UPDATE_PAUSE, rel=0.2)


async def test_of_more_than_a_burst_the_oldest_are_counted_and_warnings_stay_in_their_place():
    above = Above()
    above.add(["lost"] * 3, keep=False)
    above.add(["a warning"], keep=True)
    above.add(["lost"] * 4, keep=False)
    above.add([str(n) for n in range(BURST)], keep=False)
    await asyncio.sleep(10)
    assert above.lines[:3] == ["a warning", "7 lines are missing here: the terminal did not take them", "0"]
    assert len(above.lines) == BURST + 2
    assert above.lines[-1] == str(BURST - 1)
    above.add(["again"], keep=False)
    await asyncio.sleep(10)
    assert above.lines[-1] == "again"


async def test_few_lines_wait_for_a_terminal_that_takes_none():
    above = Above()
    above.writer.behind = True
    above.add(["first"], keep=False)
    await asyncio.sleep(STUCK_AFTER + 1)
    above.add(["x"] * (MOST_HELD_LINES + 5), keep=False)
    await asyncio.sleep(100)
    assert above.lines == []
    above.writer.behind = False
    await asyncio.sleep(10)
    assert above.lines == ["6 lines are missing here: the terminal did not take them", *["x"] * MOST_HELD_LINES]


async def test_the_end_does_not_wait_for_a_flood_and_loses_no_warning():
    above = Above()
    above.add(["STILL MOVING"], keep=True)
    above.add(["x" * 62] * 5000, keep=False)
    above.add(["STOPPED"], keep=True)
    above.end()
    lines = above.writer.kept.decode().splitlines()
    missing = f"{5000 - (len(lines) - 3)} lines are missing here: the terminal did not take them"
    assert (lines[:3], lines[-1]) == (["STILL MOVING", missing, "x" * 62], "STOPPED")
    assert len(above.writer.kept) < 2 * CHUNK


async def test_failures_are_coloured_where_the_terminal_shows_colours():
    above = Above()
    stream = PromptStream(above, keep=True)
    assert stream.coloured(Colour.FAILURE) is stream
    above.coloured = True
    stream.coloured(Colour.FAILURE).lines(["a refused 'VM=5'"], spare=False)
    stream.lines(["plain"], spare=False)
    await asyncio.sleep(10)
    assert above.lines == ["\x1b[31ma refused 'VM=5'\x1b[m", "plain"]
