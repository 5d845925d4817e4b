"""The command line in the test's own process: arguments in; exit code and output out."""

from __future__ import annotations

import contextlib
import functools
import io
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import pytest

from multidrop.__main__ import main
from tests.support.processes import environment


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Done]


def command(folder: Path, *arguments: str, stdin: str = "") -> Done:
    """Run a command of the front door in a folder that has a configuration and a state of its own."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, environment(folder)),
        mock.patch("sys.stdin", io.TextIOWrapper(io.BytesIO(stdin.encode()), "utf-8")),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        code = main(arguments)
    return Done(code, out.getvalue(), err.getvalue())


@pytest.fixture
def multidrop(tmp_path: Path) -> Command:
    """Run commands in the folder of the test."""
    return functools.partial(command, tmp_path)
