"""Search and copy in a terminal multiplexer: keys in, the screen and the clipboard out."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import SUPPORT
from tests.support.until import PATIENCE

pytestmark = [pytest.mark.process, pytest.mark.needs("tmux"), pytest.mark.tmux]


class Tmux:
    """A server of its own, with the screen on a small session in its only pane."""

    def __init__(self, folder: Path) -> None:
        self._socket = str(folder / "tmux")
        command = shlex.join([sys.executable, str(SUPPORT / "screen_program.py"), str(folder / "told"), "idle"])
        self.run("-f", os.devnull, "new-session", "-d", "-x", "80", "-y", "24", command)
        self.run("set", "-s", "set-clipboard", "on")

    def run(self, *words: str) -> str:
        done = subprocess.run(["tmux", "-S", self._socket, *words], capture_output=True, text=True, check=False)
        return done.stdout

    def shows(self, text: str, *, gone: str = "\0") -> str:
        """Wait until the pane shows a text and another one is gone; return what it shows."""
        until = time.monotonic() + PATIENCE
        while text not in (shown := self.run("capture-pane", "-p")) or gone in shown:
            assert time.monotonic() < until, shown
            time.sleep(0.05)
        return shown


@pytest.fixture
def tmux(tmp_path: Path) -> Iterator[Tmux]:
    shown = Tmux(tmp_path)
    yield shown
    shown.run("kill-server")


def test_lines_are_found_and_copied_by_keys(tmux: Tmux) -> None:
    tmux.shows("STOP ALL")
    for line in ("PR P", "MR 5", "PR V"):
        tmux.run("send-keys", "-l", line)
        tmux.run("send-keys", "Enter")
    tmux.shows("› PR V")
    tmux.run("send-keys", "C-f")
    tmux.run("send-keys", "-l", "pr")
    shown = tmux.shows("2 of 2")
    assert [row[0] for row in shown.split("\n") if "› PR" in row] == ["•", "►"]
    tmux.run("send-keys", "Escape")
    tmux.shows("press:gantry ▸", gone="find ▸")
    tmux.run("send-keys", "S-Up", "S-Up")
    tmux.shows("2 lines, 9 characters")
    tmux.run("send-keys", "Enter")
    tmux.shows("Sent 2 lines, 9 characters")
    assert tmux.run("show-buffer") == "MR 5\nPR V"
