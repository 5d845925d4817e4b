"""`multidrop program test` from outside: output, JSON, exit codes, where the drive comes from."""

from __future__ import annotations

import json
import os
import signal
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.support.cell_session import bus, drive
from tests.support.front_door import Command, Done, Home
from tests.support.processes import Running
from tests.support.until import PATIENCE

GOOD = '\' a remark\nVM=200000\nPG 1\nLB SU\n MR 51200\n H\n PR "at ",P\n E\nLB K1\n PR "k1"\n E\nPG\nS\n'
BAD = GOOD.replace(" H\n", " H\n VM=5\n")
ENDLESS = 'PG 1\nLB K1\n H 1000\n PR "tick"\n BR K1\nPG\n'
B = drive("LMDCM", "b", "[bus.drive.world]", "inputs = [[1.5, 1, 0]]", party=True, VI=2000)
CELL = bus("line", drive("LMDOM", "a", party=True), B, baud=0) + bus("pmx", drive("PMX"), baud=0)


FILES = {"good.mxt": GOOD, "bad.mxt": BAD, "endless.mxt": ENDLESS, "cell.toml": CELL}


@pytest.fixture
def program(home: Home) -> Command:
    """Run `program test` in a folder with some files."""
    for name, text in FILES.items():
        home.file(name, text)
    return partial(home.run, "program", "test")


def objects(done: Done) -> list[dict[str, Any]]:
    assert done.stderr == ""
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_prints_and_summary_go_to_standard_output(program: Command) -> None:
    done = program("good.mxt")
    printed, summary = done.stdout.splitlines()
    assert printed.split(None, 1)[1] == "at 51200" and float(printed.split()[0]) > 0.2
    assert summary.startswith("ended at E after 0.") and "position 51200, 1 motion, 4 lines, no errors" in summary
    assert (done.returncode, done.stderr) == (0, "")


def test_an_error_is_one_line_with_file_and_line_and_exit_1(program: Command) -> None:
    done = program("bad.mxt")
    (told,) = done.stderr.splitlines()
    assert told.startswith("bad.mxt:7: VM=5: at 0.") and "error 23, VM must be above VI" in told
    assert done.returncode == 1 and "errors 23" in done.stdout


def test_json_is_one_object_a_line(program: Command) -> None:
    done = program("bad.mxt", "--json")
    failed, printed, last = objects(done)
    assert done.returncode == 1
    assert list(failed) == ["t", "error", "line"] and (failed["error"], failed["line"]) == (23, 7)
    assert list(printed) == ["t", "print"] and printed["print"] == "at 51200" and printed["t"] > failed["t"]
    summary = last["summary"]
    assert list(summary) == ["position", "moves", "errors", "instructions", "virtual_s", "real_s", "ended"]
    assert {key: summary[key] for key in ("position", "moves", "errors", "instructions", "ended")} == {
        "position": 51200,
        "moves": 1,
        "errors": [23],
        "instructions": 5,
        "ended": "E",
    }
    assert summary["virtual_s"] > printed["t"] and summary["real_s"] < PATIENCE


def test_a_file_that_is_refused_tells_every_line_and_is_not_run(program: Command, tmp_path: Path) -> None:
    (tmp_path / "wrong.mxt").write_text("MS=7\nPG 1\nQQ=1\nE\nPG\n")
    done = program("wrong.mxt")
    first, second = done.stderr.splitlines()
    assert first.startswith("wrong.mxt:1: MS=7: refused: error 21, ")
    assert second.startswith("wrong.mxt:3: QQ=1: refused: error 20, ")
    assert done.stdout.startswith("not run") and done.returncode == 1
    *failed, last = objects(program("wrong.mxt", "--json"))
    assert failed == [{"t": 0.0, "error": 21, "line": 1}, {"t": 0.0, "error": 20, "line": 3}]
    assert last["summary"]["ended"] == "error"


def test_run_names_what_is_executed(program: Command) -> None:
    assert program("good.mxt", "--run", "k1").stdout.splitlines()[0].endswith("  k1")


def test_until_is_enough_for_a_program_without_an_end(program: Command) -> None:
    done = program("endless.mxt", "--until", "2.5", "--json")
    events = objects(done)
    assert [each.get("print") for each in events] == ["tick", "tick", None]
    summary = events[-1]["summary"]
    assert (summary["ended"], summary["virtual_s"], done.returncode) == ("until", 2.5, 0)


def test_without_until_a_program_without_an_end_is_given_up_and_that_is_said(program: Command) -> None:
    done = program("endless.mxt")
    (told,) = done.stderr.splitlines()
    assert told.startswith("endless.mxt:") and "still runs" in told and "--until" in told
    assert done.returncode == 1 and done.stdout.count("tick") == 3598


def test_a_cell_gives_the_drive_its_settings_and_its_world(program: Command, tmp_path: Path) -> None:
    (tmp_path / "wait.mxt").write_text("IS=1,0,0\nPG 1\nPR VI,VR\nLB K1\nBR K1,I1=0\nE\nPG\n")
    first, last = objects(program("wait.mxt", "--cell", "cell.toml#line:b", "--json"))
    assert first["print"].startswith("2000LMDCM")
    assert 1.5 <= last["summary"]["virtual_s"] < 1.51
    first, last = objects(program("wait.mxt", "--cell", "cell.toml#:a", "--until", "3", "--json"))
    assert first["print"].startswith("1000LMDOM") and last["summary"]["ended"] == "until"


def test_the_demo_cell_is_meant_where_no_file_stands_before_the_number_sign(program: Command) -> None:
    assert program("good.mxt", "--cell", "#eth").returncode == 0


def test_personality_goes_before_the_cells(program: Command, tmp_path: Path) -> None:
    (tmp_path / "who.mxt").write_text("PG 1\nPR VR\nE\nPG\n")
    done = program("who.mxt", "--cell", "cell.toml#line:a", "--personality", "mdi")
    assert done.stdout.splitlines()[0].endswith("  3.010")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["gone.mxt"], "gone.mxt: cannot be read"),
        (["cell.toml"], "cell.toml"),
        (["good.mxt", "--run", "Zz"], "good.mxt: nothing to run at Zz"),
        (["good.mxt", "--cell", "cell.toml"], "valid for --cell: cell.toml#line:a, cell.toml#line:b"),
        (["good.mxt", "--cell", "cell.toml#line:q"], "no such drive"),
        (["good.mxt", "--cell", "gone.toml"], "gone.toml"),
        (["good.mxt", "--cell", "cell.toml#pmx"], "PMX"),
        (["good.mxt", "--personality", "PMX"], "PMX"),
        (["good.mxt", "--until", "0"], "0 is not a number of seconds"),
        ([], "FILE"),
    ],
)
def test_what_cannot_be_tested_is_one_line_and_exit_2(program: Command, arguments: list[str], says: str) -> None:
    done = program(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1 and says in done.stderr


def test_several_files_are_each_tested_and_the_worst_decides(program: Command) -> None:
    done = program("good.mxt", "bad.mxt", "good.mxt", "--json")
    events = objects(done)
    assert [each["file"] for each in events if "summary" in each] == ["good.mxt", "bad.mxt", "good.mxt"]
    assert done.returncode == 1
    assert program("good.mxt", "gone.mxt", "bad.mxt").returncode == 2


def test_what_would_act_on_a_terminal_is_shown_instead(program: Command, tmp_path: Path) -> None:
    (tmp_path / "bell.mxt").write_text('PG 1\nPR "\\g\\e[2J"\nE\nPG\n')
    assert "\\x07\\x1b[2J" in program("bell.mxt").stdout


@pytest.mark.process
def test_an_interruption_is_exit_130(program: Command, tmp_path: Path) -> None:
    (tmp_path / "loud.mxt").write_text('PG 1\nPR "begun"\nLB K1\nIC R1\nBR K1\nPG\n')
    running = Running("program", "test", "loud.mxt", "--until", "1e7", folder=tmp_path)
    running.until("    0.0000  begun")
    os.kill(running.process.pid, signal.SIGINT)
    assert running.end() == 130
    assert running.errors == ["loud.mxt: interrupted"]
