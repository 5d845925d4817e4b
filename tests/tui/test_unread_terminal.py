"""The screen on a terminal that is not read: every stop works, and the screen is complete when it is read again."""

from __future__ import annotations

import signal

import pyte
import pytest

from tests.support.front_door import read_to_end
from tests.support.served_cell import FLOOD, LOG, SIGNALS, Shop, ends, until

pytestmark = [pytest.mark.process, pytest.mark.pty]
F3 = "\x1bOR"
LINES = (f"/log {LOG}", "@press:b SL 100000", "@noisy:a EX G1", "/sleep 1000")


@pytest.fixture(scope="module")
def floor(tmp_path_factory):
    made = Shop(tmp_path_factory.mktemp("shop"))
    made.macro("go", *LINES, key="F3")
    yield made
    made.close()


def shows(child, true) -> None:
    """Read the terminal until its screen is as wanted: only the cells that differ are written to it."""
    screen = pyte.Screen(80, 24)
    stream = pyte.Stream(screen)
    until(lambda: stream.feed(child.read_nonblocking(65536, timeout=10)) or true(screen.display), "it is not shown")


@pytest.fixture
def stuck(shop):
    """A screen that shows a flood on an unread terminal, while a drive moves."""
    child = shop.terminal("tui", "noisy", "press")
    shows(child, lambda screen: screen[0].count("at rest") == 2)
    child.send(F3)
    until(lambda: shop.has_seen(FLOOD), "it takes no more from the drive")
    until(lambda: shop.velocity() == 100000, "it does not move")
    return child


def test_the_stop_key_stops_and_the_screen_ends_though_nobody_reads_it(shop, stuck):
    stuck.send("\x18")
    until(lambda: shop.velocity() == 0, "the drive was not stopped")
    stuck.kill(signal.SIGTERM)
    assert ends(stuck) == 130


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_stops_what_a_macro_moves_and_ends_it_though_nobody_reads(shop, stuck, number):
    stuck.kill(number)
    assert ends(stuck) == 130
    until(lambda: shop.velocity() == 0, "it was not stopped")


def test_the_screen_is_whole_when_it_is_read_again(shop, stuck):
    stuck.send("\x18")
    until(lambda: shop.velocity() == 0, "the drive was not stopped")
    shows(stuck, lambda screen: any("velocity 0 was read from both" in line for line in screen))
    stuck.send("\x11")
    assert read_to_end(stuck) == 0
