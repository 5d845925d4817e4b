"""A terminal that is not read, or is stopped by Ctrl+S, keeps no stop from a drive: real processes on real ptys.

The judge is the simulated drive, which a second process asks.
"""

from __future__ import annotations

import os
import re
import signal
import struct

import pytest

from tests.support.front_door import read_to_end
from tests.support.posix import fcntl, termios
from tests.support.served_cell import FLOOD, LOG, ends, until

pytestmark = [pytest.mark.process, pytest.mark.pty]
FULL = 4000
"""Bytes that wait in a terminal when it is full, as far as the master can see."""


def waiting(child):
    """Bytes that wait to be read from a terminal."""
    return struct.unpack("i", fcntl.ioctl(child.fileno(), termios.FIONREAD, b"\0" * 4))[0]


def full(shop, child):
    """Until the terminal takes nothing more, and the session has worked off much more; the drive moves."""
    until(lambda: waiting(child) >= FULL, "the terminal never filled")
    until(lambda: shop.has_seen(FLOOD), "it takes no more from the drive")
    until(lambda: shop.velocity() == 100000, "it does not move")


def missing(child):
    """How many lines it says to be missing, once it is read again."""
    seen = b""
    while not (found := re.search(rb"(\d+) lines are missing here: the terminal did not take them\r\n", seen)):
        seen = seen[-100:] + os.read(child.fileno(), 65536)
    return int(found[1])


RUNAWAY = f"/log {LOG}\n@press:b SL 100000\n@noisy:a EX G1\n/sleep 1000\n"
STOPS = {
    "Ctrl+X": (lambda child: child.send("\x18"), 4),
    "Ctrl+C": (lambda child: child.send("\x03"), 130),
    "SIGINT": (lambda child: child.kill(signal.SIGINT), 130),
    "SIGTERM": (lambda child: child.kill(signal.SIGTERM), 130),
    "SIGHUP": (lambda child: child.kill(signal.SIGHUP), 130),
}
UNUSUAL = [pytest.param(name, marks=pytest.mark.nightly) for name in ("SIGINT", "SIGHUP")]


@pytest.mark.parametrize("stop", ["Ctrl+X", "Ctrl+C", "SIGTERM", *UNUSUAL])
def test_every_stop_ends_a_script_whose_terminal_is_not_read(shop, stop):
    child = shop.terminal("run", shop.script(RUNAWAY), "--on", "press", "--on", "noisy")
    full(shop, child)
    act, code = STOPS[stop]
    act(child)
    assert ends(child) == code
    until(lambda: shop.velocity() == 0, "it was not stopped")


def test_ctrl_s_stops_no_output_while_a_script_runs_and_the_terminal_is_given_back_as_it_was(shop):
    child = shop.terminal(
        "run", shop.script('@b PR "begun"\n/wait stopped\n@b PR "more"\n/sleep 1000\n'), "--on", "press"
    )
    before = termios.tcgetattr(child.fileno())
    child.send("\x13")
    child.expect("begun")
    child.send("\x13")
    child.expect("more")
    assert not termios.tcgetattr(child.fileno())[0] & termios.IXON
    child.send("\x18")
    until(lambda: not child.isalive(), "it does not end")
    assert child.exitstatus == 4 and termios.tcgetattr(child.fileno()) == before


def test_a_terminal_that_is_read_again_is_told_how_much_it_missed(shop):
    child = shop.terminal("run", shop.script(RUNAWAY), "--on", "press", "--on", "noisy")
    full(shop, child)
    assert missing(child) > 1
    child.expect("noise noise")
    child.send("\x18")
    assert read_to_end(child) == 4
    until(lambda: shop.velocity() == 0, "it was not stopped")


RUNS_AWAY = f"/log {LOG}\r@press:b SL 100000\r@noisy:a EX G1\r"


def prompt(shop, *urls):
    child = shop.terminal("shell", *urls)
    child.expect("b>")
    return child


@pytest.mark.parametrize("stop", ["Ctrl+X", "SIGTERM"])
def test_every_stop_reaches_the_drives_from_a_prompt_whose_terminal_is_not_read(shop, stop):
    child = prompt(shop, "press", "noisy")
    child.send(RUNS_AWAY)
    full(shop, child)
    STOPS[stop][0](child)
    until(lambda: shop.velocity() == 0 or stop != "Ctrl+X", "the drive was not stopped")
    if stop == "Ctrl+X":
        child.send("/quit\r")  # typed blindly, it is obeyed all the same
    assert ends(child) == (0 if stop == "Ctrl+X" else 130)


def test_a_prompt_whose_terminal_is_read_again_says_what_is_missing_and_goes_on(shop):
    child = prompt(shop, "press", "noisy")
    child.send(RUNS_AWAY)
    full(shop, child)
    assert missing(child) > 1
    child.send("\x18")
    child.expect("press: b: stopped, velocity 0")
    child.send('@press:b PR "go","ing on"\r')
    child.expect("going on")
    child.send("/quit\r")
    assert read_to_end(child) == 0


def test_what_became_of_a_stop_is_not_among_the_lines_that_are_missing(shop):
    child = prompt(shop, "press", "noisy")
    child.send(RUNS_AWAY)
    full(shop, child)
    child.send("\x18")
    until(lambda: shop.velocity() == 0, "the drive was not stopped")
    child.expect("press: b: stopped, velocity 0")


def test_ctrl_s_stops_no_output_of_the_prompt(shop):
    child = prompt(shop, "press")
    child.send("\x13")
    child.send('PR "go","ing on"\r\x13')
    child.expect("going on")
