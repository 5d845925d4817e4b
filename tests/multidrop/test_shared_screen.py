"""`tui --share` and `tui --join` from the command line, in real terminals."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from tests.support.front_door import Command, Home, read_to_end
from tests.support.ssh_server import fake_ssh, far_programs

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


def shows(child: Any, text: str) -> None:
    child.expect_exact(text)


@pytest.mark.process
@pytest.mark.pty
def test_terminals(home: Home, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A watcher here and one over ssh: one is killed, the other stops the host and leaves."""
    host = home.terminal("tui", "sim:#press", "--share")
    shows(host, "this screen is shared")
    here = home.terminal("tui", "--join")
    shows(here, "you watch the screen of")
    shows(host, "watches this screen")
    path = fake_ssh(
        tmp_path / "bin", f'PATH="{far_programs(tmp_path / "far", "multidrop")}:$PATH" exec /bin/sh -c "$last"'
    )
    far = home.terminal("tui", "--join", "ssh://pc", PATH=path)
    shows(far, "you watch the screen of")
    host.send("PR 4711\r")
    shows(far, "4711")
    shows(here, "4711")
    here.kill(signal.SIGKILL)
    shows(host, "no longer watches this screen")
    far.send("/resume\r")
    shows(far, "this screen only watches")
    far.send("\x18")
    shows(host, "STOPPED")
    shows(far, "STOPPED")
    far.send("\x03\x11")  # Ctrl+C only says how to leave
    assert read_to_end(far) == 0
    shows(host, "no longer watches this screen")
    host.send("PR 815\r")
    shows(host, "815")
