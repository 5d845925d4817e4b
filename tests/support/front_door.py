"""The command line in the test's own process: arguments in; exit code and output out."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from multidrop.__main__ import main


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Done]


@pytest.fixture
def multidrop(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run a command of the front door in a folder, configuration and state of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))

    def run(*arguments: str, stdin: str = "") -> Done:
        monkeypatch.setattr(sys, "stdin", io.StringIO(stdin))
        code = main(arguments)
        return Done(code, *capsys.readouterr())

    return run
