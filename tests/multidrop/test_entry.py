"""The entry of the process: closed streams, output that cannot be written, its reader, the width and the version."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from multidrop import cli
from multidrop.__main__ import main
from multidrop.shell.streams import stdout
from tests.support.front_door import Command


@pytest.fixture
def standard_input() -> Iterator[None]:
    """Put the descriptor of standard input back."""
    kept = os.dup(0)
    yield
    os.dup2(kept, 0)
    os.close(kept)


@pytest.mark.usefixtures("standard_input")
@pytest.mark.parametrize("open_too", [True, False])
def test_a_closed_stream_is_the_null_device_with_its_own_number(
    monkeypatch: pytest.MonkeyPatch, open_too: bool
) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    if not open_too:
        os.close(0)  # then the null device gets the number at once
    assert main(["--version"]) == 0
    assert sys.stdin is not None and (sys.stdin.fileno(), sys.stdin.read()) == (0, "")


class Full(io.StringIO):
    """An output of which the first flush fails."""

    def __init__(self, *problems: OSError) -> None:
        super().__init__()
        self.problems = list(problems)

    def flush(self) -> None:
        if self.problems:
            raise self.problems.pop()


@pytest.mark.parametrize("fails_in", ["flush_printed", ""])
def test_a_full_disk_is_said_in_one_line_wherever_it_shows(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], fails_in: str
) -> None:
    monkeypatch.setattr(stdout, "dropped", [])
    if not fails_in:  # it shows only at the very end
        monkeypatch.setattr(stdout, "flush_printed", lambda: None)
        monkeypatch.setattr(cli, "run", lambda chosen: 0)
    monkeypatch.setattr(sys, "stdout", Full(OSError(errno.ENOSPC, "No space left on device")))
    assert main(["ports"]) == 1
    assert capsys.readouterr().err.splitlines() == ["the output cannot be written: No space left on device"]


def test_another_error_of_the_output_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stdout, "dropped", [])
    monkeypatch.setattr(stdout, "flush_printed", lambda: None)
    monkeypatch.setattr(cli, "run", lambda chosen: 0)
    monkeypatch.setattr(sys, "stdout", Full(OSError(errno.EBUSY, "busy")))
    with pytest.raises(OSError, match="busy"):
        main(["ports"])


@pytest.mark.parametrize(("own", "watched"), [(True, [signal.SIGINT]), (False, [])])
def test_the_command_of_the_process_is_interrupted_when_its_reader_leaves(
    monkeypatch: pytest.MonkeyPatch, own: bool, watched: list[signal.Signals]
) -> None:
    numbers = list[signal.Signals]()
    monkeypatch.setattr(stdout, "watch_reader", numbers.append)
    monkeypatch.setattr("gc.freeze", lambda: None)
    monkeypatch.setattr(sys, "argv", ["multidrop", "ports"])
    assert main(None if own else ["ports"]) == 0
    assert numbers == watched


@pytest.mark.parametrize(
    ("given", "terminal", "width"),
    [
        ("100", (60, 20), 100), ("", (60, 20), 60), ("0", (60, 20), 60), ("wide", (60, 20), 60),
        ("", (0, 0), 80), ("", None, 80),
    ],
)  # fmt: skip
def test_the_help_is_as_wide_as_columns_the_terminal_or_80(
    monkeypatch: pytest.MonkeyPatch, given: str, terminal: tuple[int, int] | None, width: int
) -> None:
    def size(descriptor: int) -> os.terminal_size:
        if terminal is None:
            raise OSError(errno.ENOTTY, "no terminal")
        return os.terminal_size(terminal)

    monkeypatch.setenv("COLUMNS", given)
    monkeypatch.setattr(os, "get_terminal_size", size)
    formatter = cli.Formatter("multidrop")
    formatter.add_text("a " * 200)
    assert max(map(len, formatter.format_help().splitlines())) == width - 3, "two columns are left, and a blank"


def test_the_version_takes_no_value_and_ends_well(multidrop: Command, tmp_path: Path) -> None:
    done = multidrop("--version")
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.startswith("multidrop ")
