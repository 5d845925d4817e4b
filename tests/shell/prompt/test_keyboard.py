"""The keys of a terminal that is held: a pty of our own, and the event loop of the test."""

from __future__ import annotations

import asyncio
import os
import struct
import threading

import pytest

from multidrop.shell.prompt.keyboard import Keyboard
from multidrop.shell.prompt.terminal_input import TYPING_PAUSE, at_keyboard
from tests.support.posix import fcntl, pty, termios
from tests.support.until import PATIENCE

pytestmark = pytest.mark.pty


def waiting(terminal):
    """The bytes that nobody has read."""
    return struct.unpack("i", fcntl.ioctl(terminal, termios.FIONREAD, bytes(4)))[0]


class Typed:
    """A keyboard on a pty, what it was told, and the end to type at."""

    def __init__(self, signals=False):
        self.master, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self.keyboard = Keyboard(self.terminal, signals)
        self.stops, self.gone, self.taken = [], [], ""
        self.keyboard.stop, self.keyboard.gone = self.stops.append, lambda: self.gone.append(True)
        self.keyboard.listen(self.take)

    def take(self):
        self.taken += self.keyboard.take()

    def type(self, data):
        os.write(self.master, data)

    async def until(self, condition):
        async with asyncio.timeout(PATIENCE):
            while not condition():
                await asyncio.sleep(0.001)  # the loop turns

    def close(self):
        for descriptor in (self.master, self.terminal):
            os.close(descriptor)


@pytest.fixture
async def typed():
    made = Typed()
    yield made
    made.close()


async def test_the_stop_is_written_while_the_event_loop_is_held_up(typed):
    written = threading.Event()
    typed.keyboard.stop_ahead = written.set
    with typed.keyboard:
        typed.type(b"MR 5\r\x18")
        assert written.wait(PATIENCE)  # and nothing else runs in the loop meanwhile
        assert typed.stops == []
        await typed.until(lambda: typed.stops)
    assert (typed.stops, typed.taken) == (["MR 5\r"], "")


async def test_the_loop_stops_where_the_thread_of_the_keys_cannot_and_later_keys_are_read(typed):
    def defective():
        raise ZeroDivisionError

    typed.keyboard.stop_ahead = defective
    with typed.keyboard:
        typed.type(b"\x18")
        await typed.until(lambda: len(typed.stops) == 1)
        typed.type(b"\x18")
        await typed.until(lambda: len(typed.stops) == 2)


async def test_what_came_before_the_last_stop_of_a_read_is_dropped_and_what_is_behind_it_kept(typed):
    typed.keyboard.listen(None)
    with typed.keyboard:
        typed.type(b"half a ")
        await typed.until(lambda: typed.keyboard.typed == "half a ")
        typed.type(b"line\x18MR 6\r\x18\xc3")
        await typed.until(lambda: typed.stops)
        typed.type(b"\xa9t\xc3\xa9")
        await typed.until(lambda: typed.keyboard.typed == "\xe9t\xe9")
    assert typed.stops == ["half a lineMR 6\r"]


async def test_what_was_typed_before_the_terminal_was_held_is_what_was_typed(typed):
    typed.keyboard.listen(None)
    typed.type(b"PR P\r\x04")
    await typed.until(lambda: waiting(typed.terminal) == 5)  # in a line that nobody has read
    with typed.keyboard:
        await typed.until(lambda: typed.keyboard.typed == "PR P\n\x04")
        typed.type(b"\0")
        await typed.until(lambda: typed.keyboard.typed.endswith("\0"))


async def test_keys_come_in_their_order_a_line_at_a_time_at_most(typed):
    pieces = []
    typed.keyboard.listen(lambda: pieces.append(typed.keyboard.take()))
    text = "PR P\r" + "x" * 200 + "\nMR"
    with typed.keyboard:
        typed.type(text.encode())
        await typed.until(lambda: "".join(pieces) == text)
    assert pieces[0] == "PR P\r" and all(piece.find("\n") in (-1, len(piece) - 1) for piece in pieces)


@pytest.mark.parametrize("signals", [False, True])
async def test_a_terminal_that_is_held_has_no_flow_control(signals):
    typed = Typed(signals)
    with typed.keyboard:
        held = termios.tcgetattr(typed.terminal)
        if not signals:  # automation leaves alone what is not the terminal in whose foreground it runs
            assert not held[0] & (termios.IXON | termios.IXOFF | termios.ICRNL)
            assert not held[3] & (termios.ECHO | termios.ICANON | termios.IEXTEN | termios.ISIG)
            assert held[6][termios.VSUSP] == held[6][termios.VQUIT] == b"\x00"
        else:
            assert held == typed.before
    typed.close()


async def test_a_terminal_that_hangs_up_is_told_once(typed):
    with typed.keyboard:
        os.close(typed.master)
        await typed.until(lambda: typed.gone)
        typed.master = os.dup(typed.terminal)
        assert typed.keyboard.closed
    assert typed.gone == [True]


async def test_a_question_takes_a_key_that_was_typed_after_it_was_shown(typed, capsys):
    with typed.keyboard:
        typed.type(b"y")
        await typed.until(lambda: typed.taken == "y")
        for key, expected in ((b"y", True), (b"\r", False)):
            asked = asyncio.create_task(at_keyboard(typed.keyboard, "FD erases the drive"))
            await asyncio.sleep(0)
            typed.type(b"yy")
            async with asyncio.timeout(PATIENCE):
                while not asked.done():
                    await asyncio.sleep(TYPING_PAUSE * 1.1)  # the pause itself: then a key counts
                    typed.type(key)
                    await asyncio.sleep(0.01)
            assert asked.result() is expected
    assert capsys.readouterr().err == "FD erases the drive. Go on? [y/N]\n" * 2
    assert typed.taken.strip("y\r") == ""
