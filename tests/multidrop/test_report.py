"""`multidrop report`: shown first, written on request, without secrets."""

import argparse
import io
import sys
from datetime import date

import pytest

from multidrop import cli
from multidrop.commands import machine
from multidrop.shell.operations.table import COMMANDS


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    return tmp_path


def run(monkeypatch, output="", yes=False, typed=None):
    """Run the command, in a terminal where something is `typed`; what it printed."""
    printed = Terminal() if typed is not None else io.StringIO()
    monkeypatch.setattr(sys, "stdin", Terminal(typed) if typed is not None else io.StringIO())
    monkeypatch.setattr(sys, "stdout", printed)
    code = cli.run(argparse.Namespace(run_by=COMMANDS["report"], output=output, yes=yes))
    return code, printed.getvalue()


def test_in_a_pipe_it_is_printed_and_not_written(folder, monkeypatch):
    code, printed = run(monkeypatch)
    assert code == 0 and [f"== {title}" in printed for title in machine.SECTIONS] == [True] * len(machine.SECTIONS)
    assert list(folder.iterdir()) == []


def test_it_has_the_versions_and_the_problems_and_no_secret(folder, monkeypatch):
    (folder / "config" / "macros").mkdir(parents=True)
    (folder / "config" / "multidrop.toml").write_text(
        '[connections.a]\nurl = "tcp://me:pw@h:1"\npassword = "pw2"\n\x1b[2J'
    )
    (folder / "config" / "macros" / "bad.toml").write_text("=")
    (folder / "state").mkdir()
    (folder / "state" / "history").write_text("typed")
    printed = run(monkeypatch)[1]
    assert "textual " in printed and "bad.toml" in printed and "history" in printed
    assert "problem" in printed and "typed" not in printed
    assert "pw" not in printed and "\x1b" not in printed


@pytest.mark.parametrize(
    ("typed", "written"), [("y\n", True), ("yes\n", True), ("\n", False), ("n\n", False), ("", False)]
)
def test_in_a_terminal_it_asks_before_it_writes(folder, monkeypatch, capsys, typed, written):
    code, printed = run(monkeypatch, typed=typed)
    file = folder / f"multidrop-report-{date.today().isoformat()}.txt"
    assert code == 0 and file.exists() is written
    if written:
        assert printed == file.read_text()
    assert "[y/N]" in capsys.readouterr().err


def test_without_a_terminal_a_file_needs_yes_and_an_existing_one_stays(folder, monkeypatch, capsys):
    assert run(monkeypatch, "r.txt")[0] == 2 and "--yes" in capsys.readouterr().err
    assert run(monkeypatch, "r.txt", yes=True)[0] == 0
    before = (folder / "r.txt").read_text()
    assert run(monkeypatch, "r.txt", yes=True)[0] == 2 and "exists already" in capsys.readouterr().err
    assert (folder / "r.txt").read_text() == before
    assert run(monkeypatch, "no/r.txt", yes=True)[0] == 2
