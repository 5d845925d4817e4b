"""The settings of a terminal whose bytes are taken as they are typed: what is switched off, when, and until when."""

from __future__ import annotations

import fcntl
import os
import struct
import termios
from collections.abc import Callable
from typing import Any

import pytest

from multidrop.shell.prompt.raw_terminal import hold, in_foreground
from tests.support.cases import for_each

pytestmark = pytest.mark.fork

EVERY = ~0
KEYS = [bytes([number]) for number in range(32)]
COOKED = [EVERY, EVERY, EVERY, EVERY, 15, 15, KEYS]


class Terminal:
    """A terminal: its settings, and the process group in its foreground."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.settings: list[Any] = list(COOKED)
        self.group, self.waiting, self.is_one, self.hung_up = 5, 3, True, False
        self.puts = 0
        monkeypatch.setattr(termios, "tcgetattr", self.get)
        monkeypatch.setattr(termios, "tcsetattr", self.put)
        monkeypatch.setattr(fcntl, "ioctl", self.ioctl)
        monkeypatch.setattr(os, "fpathconf", lambda descriptor, name: {"PC_VDISABLE": 7}[name])
        monkeypatch.setattr(os, "isatty", lambda descriptor: self.is_one)
        monkeypatch.setattr(os, "tcgetpgrp", self.foreground)
        monkeypatch.setattr(os, "getpgrp", lambda: 5)

    def get(self, descriptor: int) -> list[Any]:
        if self.hung_up:
            raise termios.error(5, "Input/output error")
        return [*self.settings[:6], list(self.settings[6])]

    def put(self, descriptor: int, when: int, settings: list[Any]) -> None:
        assert (descriptor, when) == (9, termios.TCSANOW)
        if self.hung_up:
            raise termios.error(5, "Input/output error")
        self.settings, self.puts = settings, self.puts + 1

    def ioctl(self, descriptor: int, what: int, data: bytes) -> bytes:
        assert (descriptor, what, len(data)) == (9, termios.FIONREAD, 4)
        if self.hung_up:
            raise OSError(5, "Input/output error")
        return struct.pack("i", self.waiting)

    def foreground(self, descriptor: int) -> int:
        if self.hung_up:
            raise OSError(25, "Inappropriate ioctl for device")
        return self.group


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    return Terminal(monkeypatch)


class Continued:
    """Calls after each SIGCONT, until that is ended."""

    def __init__(self) -> None:
        self.call: Callable[[], None] | None = None

    def __call__(self, callback: Callable[[], None]) -> Callable[[], object]:
        self.call = callback

        def leave() -> None:
            self.call = None

        return leave

    def comes(self) -> None:
        assert self.call is not None
        self.call()


OFF_IN = termios.IXON | termios.IXOFF | termios.ICRNL | termios.INLCR | termios.IGNCR
OFF_LOCAL = termios.ECHO | termios.ICANON | termios.IEXTEN


@for_each("signals", [True, False])
def test_keys_come_one_by_one_without_echo_flow_control_or_suspension(terminal: Terminal, signals: bool) -> None:
    with hold(9, signals, Continued()) as waiting:
        keys = list(KEYS)
        keys[termios.VMIN], keys[termios.VTIME] = 1, 0  # type: ignore[call-overload]
        keys[termios.VSUSP] = keys[termios.VQUIT] = b"\x07"
        local = EVERY & ~OFF_LOCAL & (EVERY if signals else ~termios.ISIG)
        assert terminal.settings == [EVERY & ~OFF_IN, EVERY, EVERY, local, 15, 15, keys]
        assert waiting == 3
    assert terminal.settings == COOKED


def test_after_each_continuation_the_keys_are_held_again_until_the_end(terminal: Terminal) -> None:
    continued = Continued()
    with hold(9, True, continued):
        held = terminal.settings
        terminal.settings = list(COOKED)
        continued.comes()
        assert terminal.settings == held
    assert continued.call is None and terminal.settings == COOKED


def test_in_the_background_a_terminal_with_signals_stays_as_it_is(terminal: Terminal) -> None:
    continued = Continued()
    terminal.group = 6
    with hold(9, True, continued):
        assert terminal.settings == COOKED and terminal.puts == 0
        terminal.group = 5
        continued.comes()
        assert terminal.settings != COOKED
        terminal.group = 6
    assert terminal.puts == 1, "another process has it now, and it is not restored"


def test_without_signals_the_system_stops_a_process_in_the_background_there(terminal: Terminal) -> None:
    terminal.group = 6
    with hold(9, False, Continued()):
        assert terminal.puts == 1


def test_a_terminal_that_has_hung_up_has_nothing_to_read(terminal: Terminal) -> None:
    with hold(9, True, Continued()) as waiting:
        terminal.hung_up = True
        assert waiting == 3
    terminal.settings = list(COOKED)
    with pytest.raises(OSError, match="Inappropriate"):
        os.tcgetpgrp(9)
    assert not in_foreground(9)


@for_each("is_one, group, found", [(True, 5, True), (True, 6, False), (False, 5, False)])
def test_a_process_is_in_the_foreground_of_its_terminal_alone(
    terminal: Terminal, is_one: bool, group: int, found: bool
) -> None:
    terminal.is_one, terminal.group = is_one, group
    assert in_foreground(9) is found
