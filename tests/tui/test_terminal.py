"""The app on a real pseudo-terminal: bytes in, bytes out, signals, a terminal that goes away."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.front_door import read_to_end
from tests.support.paths import SUPPORT
from tests.support.posix import pexpect, termios
from tests.support.until import PATIENCE

pytestmark = pytest.mark.pty
PROGRAM = SUPPORT / "screen_program.py"
STOP = "\x18"


class Screen:
    def __init__(self, told: Path, busy: bool = False) -> None:
        self.told = told
        environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": ""}
        environment.pop("NO_COLOR", None)
        arguments = ["-W", "error", str(PROGRAM), str(told), "busy" if busy else "idle"]
        self.child = pexpect.spawn(
            sys.executable, arguments, dimensions=(24, 80), env=environment, encoding="utf-8", timeout=PATIENCE
        )
        self.child.expect("STOP ALL")
        self.before = self.child.before + self.child.after

    def stops(self) -> list[str]:
        return self.told.read_text().split("\n")[:-1] if self.told.exists() else []

    def ends(self) -> int:
        return read_to_end(self.child)


@pytest.fixture
def screen(tmp_path: Path) -> Iterator[Screen]:
    shown = Screen(tmp_path / "told")
    yield shown
    if not shown.child.closed:
        shown.child.close(force=True)


@pytest.fixture
def busy(tmp_path: Path) -> Iterator[Screen]:
    shown = Screen(tmp_path / "told", busy=True)
    yield shown
    if not shown.child.closed:
        shown.child.close(force=True)


@pytest.mark.process
def test_the_stop_byte_stops_whatever_came_before_it(screen: Screen) -> None:
    screen.child.send(STOP)
    screen.child.expect("✗ STOP SENT")
    for number, before in enumerate(("MR 5", "\x1b", "\x1b[", "\x1b[200~a paste that never ends "), 2):
        screen.child.send(before + STOP)
        deadline = time.monotonic() + PATIENCE
        while len(screen.stops()) < number and time.monotonic() < deadline:
            screen.child.expect([pexpect.TIMEOUT, "."], timeout=0.02)
        assert len(screen.stops()) == number, f"after {before!r}"


@pytest.mark.process
def test_the_stop_stays_one_byte_as_the_keyboard_is_left_as_it_is(screen: Screen) -> None:
    assert "\x1b[?1049h" in screen.before
    assert not any(f"\x1b[>{flags}u" in screen.before for flags in range(32))


@pytest.mark.process
def test_quitting_gives_the_terminal_back(screen: Screen) -> None:
    screen.child.send("\x11")
    screen.child.expect_exact("\x1b[?1049l")
    assert screen.ends() == 0
    assert screen.stops() == []


@pytest.mark.process
def test_bytes_that_are_no_text_do_no_harm(screen: Screen) -> None:
    os.write(screen.child.fileno(), b"\xff\xfe\x80")
    screen.child.send("F1" + STOP)
    screen.child.expect("✗ STOP SENT")


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_stops_running_automation_and_ends(busy: Screen, number: signal.Signals) -> None:
    busy.child.kill(number)
    assert busy.ends() == 130
    assert busy.stops() == ["interrupted"]


@pytest.mark.process
def test_a_terminal_that_goes_away_stops_running_automation(busy: Screen) -> None:
    busy.child.ptyproc.fileobj.close()
    os.waitpid(busy.child.pid, 0)
    busy.child.closed = True
    assert busy.stops() == ["interrupted"]


@pytest.mark.process
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="threads are counted in /proc")
def test_after_sigstop_and_sigcont_one_thread_reads_a_terminal_that_is_raw_again(screen: Screen) -> None:
    def local() -> int:
        return termios.tcgetattr(screen.child.fileno())[3]

    tasks = Path(f"/proc/{screen.child.pid}/task")
    before = len(list(tasks.iterdir()))
    for _ in range(3):
        screen.child.kill(signal.SIGSTOP)
        os.waitpid(screen.child.pid, os.WUNTRACED)
        shells = termios.tcgetattr(screen.child.fileno())
        shells[3] |= termios.ICANON | termios.ECHO | termios.ISIG
        termios.tcsetattr(screen.child.fileno(), termios.TCSANOW, shells)
        screen.child.kill(signal.SIGCONT)
        screen.child.expect_exact("\x1b[?1049h")
        screen.child.expect("STOP ALL")
        assert not local() & (termios.ICANON | termios.ECHO | termios.ISIG)
    assert len(list(tasks.iterdir())) == before
    screen.child.send("MR 5" + STOP)
    screen.child.expect("✗ STOP SENT")
    assert screen.stops() == ["stop"]


def test_escape_and_a_digit_is_alt_and_that_digit():
    from textual._xterm_parser import XTermParser

    from multidrop.tui.terminal.keystream import know_alt_digits

    know_alt_digits()
    keys = [event.key for digit in "19" for event in XTermParser().feed(f"\x1b{digit}")]
    assert keys == ["alt+1", "alt+9"]
