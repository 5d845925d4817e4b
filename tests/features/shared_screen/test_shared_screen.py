"""`tui --share` and `tui --join` from the command line, in real terminals."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path
from typing import Any

import pyte
import pytest

from tests.support.front_door import Command, Home, read_to_end
from tests.support.posix import pexpect
from tests.support.ssh_server import fake_ssh, far_programs
from tests.support.until import PATIENCE

pytestmark = pytest.mark.AF_UNIX


@pytest.mark.process
def test_what_cannot_be_joined_is_one_line(multidrop: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    done = multidrop("tui", "--join")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (3, "", 1)
    assert "no screen is shared by this account on " in done.stderr
    monkeypatch.setenv("PATH", fake_ssh(tmp_path / "bin", "echo 'no route to host' >&2; exit 255"))
    done = multidrop("tui", "--join", "ssh://pc")
    assert (done.returncode, done.stderr.count("\n")) == (3, 1)
    assert "no route to host; check the address" in done.stderr
    for arguments in (("--join", "", "sim:"), ("--share", "--join"), ("--join", "tcp://pc")):
        done = multidrop("tui", *arguments)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert multidrop("relay", "screen:").returncode == 3


class Seen:
    """A terminal in the test: what is painted on it, in whatever order and pieces the program paints."""

    def __init__(self, child: Any) -> None:
        self.child, self.screen = child, pyte.Screen(80, 24)
        self.stream = pyte.Stream(self.screen)

    def shows(self, text: str, times: int = 1) -> None:
        until = time.monotonic() + PATIENCE
        while "\n".join(self.screen.display).count(text) < times:
            assert time.monotonic() < until, f"{text!r} is not on\n" + "\n".join(self.screen.display)
            with contextlib.suppress(pexpect.TIMEOUT):
                self.stream.feed(self.child.read_nonblocking(65536, 1))


@pytest.mark.process
@pytest.mark.pty
def test_terminals(home: Home, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A watcher here and one over ssh: one is killed, the other stops the host and leaves."""
    host = Seen(home.terminal("tui", "sim:#press", "--share"))
    host.shows("this screen is shared")
    here = Seen(home.terminal("tui", "--join"))
    here.shows("you watch the screen of")
    host.shows("watches this screen")
    path = fake_ssh(
        tmp_path / "bin", f'PATH="{far_programs(tmp_path / "far", "multidrop")}:$PATH" exec /bin/sh -c "$last"'
    )
    far = Seen(home.terminal("tui", "--join", "ssh://pc", PATH=path))
    far.shows("you watch the screen of")
    host.child.send("PR 4711\r")
    far.shows("4711")
    here.shows("4711")
    here.child.kill(signal.SIGKILL)
    host.shows("no longer watches this screen")
    far.child.send("/resume\r")
    far.shows("this screen only watches")
    far.child.send("\x18")
    host.shows("STOPPED")
    far.shows("STOPPED")
    far.child.send("\x03\x11")  # Ctrl+C only says how to leave
    assert read_to_end(far.child) == 0
    host.shows("no longer watches this screen", 2)
    host.child.send("PR 815\r")
    host.shows("815")
