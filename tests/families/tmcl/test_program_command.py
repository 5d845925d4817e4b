"""TMCL program files on the command line: check, test, download, list and upload, on a simulated module."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.front_door import Command

CELL = '[[bus]]\nname = "slide"\n[[bus.drive]]\npersonality = "TMCM"\nname = "1"\nset = { 4 = 100000, 5 = 1000000 }\n'
FILE = """// there and back
Far = 20000
Loop: MVP ABS, 0, Far   // far end
    WAIT POS, 0, 0
    MVP ABS, 0, 0
    WAIT POS, 0, 0
    JA Loop
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "shuttle.tmc").write_text(FILE)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_check_has_a_line_for_each_fault(multidrop: Command) -> None:
    assert multidrop("program", "check", "shuttle.tmc").stdout == "shuttle.tmc: nothing wrong, 5 of 2048 lines\n"
    Path("wrong.tmc").write_text("Loop: MVP ABS, 0\n  WAIT POSS, 0, 0\n  STOP\n")
    done = multidrop("program", "check", "wrong.tmc")
    assert done.returncode == 1 and done.stderr.splitlines() == [
        "wrong.tmc:1:7: MVP takes 3 fields; write MVP ABS|REL|COORD, motor, value",
        "wrong.tmc:2:8: condition cannot be 'POSS'; valid: TICKS, POS, REFSW, LIMSW, RFS",
    ]


@pytest.mark.usefixtures("folder")
def test_a_file_of_another_language_is_named(multidrop: Command) -> None:
    Path("turn.mxt").write_text(FILE)
    done = multidrop("program", "check", "turn.mxt")
    assert done.returncode == 1 and "this is TMCL, not MCode" in done.stderr
    done = multidrop("program", "test", "turn.mxt")
    assert done.returncode != 0 and done.stderr == (
        "turn.mxt:1:1: this is TMCL, not MCode; name it .tmc or .tmcl, or give --language tmcl\n"
    )
    assert multidrop("program", "test", "turn.mxt", "--language", "tmcl", "--until", "2").returncode == 0


@pytest.mark.usefixtures("folder")
def test_a_file_without_a_command_is_no_program(multidrop: Command) -> None:
    Path("empty.tmc").write_text("// soon\nFar = 500\n")
    assert "empty.tmc:1:1: warning: holds no program" in multidrop("program", "check", "empty.tmc").stderr


@pytest.mark.usefixtures("folder")
def test_a_test_runs_in_virtual_time(multidrop: Command) -> None:
    done = multidrop("program", "test", "shuttle.tmc", "--until", "2", "--json")
    (fact,) = [json.loads(line) for line in done.stdout.splitlines()]
    summary = fact["summary"]
    assert (done.returncode, summary["ended"], summary["moves"]) == (0, "until", 2)
    traced = multidrop("program", "test", "shuttle.tmc", "--until", "2", "--trace", "--break", "Loop,2").stdout
    assert "shuttle.tmc:3: Loop: MVP ABS, 0, Far" in traced and "break" not in traced


@pytest.mark.usefixtures("folder")
def test_a_refused_line_fails_the_test_and_names_its_line(multidrop: Command) -> None:
    Path("over.tmc").write_text("  SAP 140, 0, 9\n  CALC DIV, 0\n  64 1, 0, 5\n  STOP\n")
    done = multidrop("program", "test", "over.tmc")
    assert done.returncode == 1 and done.stderr.splitlines() == [
        "over.tmc:1: SAP 140, 0, 9 at 0.0010 s: refused with status 4; the line is passed over",
        "over.tmc:2: CALC DIV, 0 at 0.0020 s: division by 0; the line is passed over",
        "over.tmc:3: 64 1, 0, 5 at 0.0030 s: the simulated module does not have it; the program ends",
    ]


def test_a_module_of_a_cell_holds_a_program_and_a_raw_upload_gives_its_lines(multidrop: Command, folder: Path) -> None:
    (folder / "cell.toml").write_text(CELL.replace('name = "1"', 'name = "1"\nprogram = "shuttle.tmc"'))
    done = multidrop("program", "upload", "sim:cell.toml", "-", "--raw")
    assert done.stdout == "MVP ABS, 0, 20000\nWAIT POS, 0, 0\nMVP ABS, 0, 0\nWAIT POS, 0, 0\nJA 0\n"
    made = multidrop("program", "upload", "sim:cell.toml", "-").stdout
    assert made.splitlines()[0] == "Line0:" and made.splitlines()[-1] == "    JA Line0"
    (folder / "shuttle.tmc").write_text("JA Nowhere\n")
    done = multidrop("program", "list", "sim:cell.toml")
    assert done.returncode == 2 and "program has an error in line 1: no label Nowhere" in done.stderr


def test_a_snapshot_keeps_the_program(multidrop: Command, folder: Path) -> None:
    (folder / "cell.toml").write_text(CELL.replace('name = "1"', 'name = "1"\nprogram = "shuttle.tmc"'))
    assert multidrop("snapshot", "sim:cell.toml", "-o", "kept.toml").returncode == 0
    done = multidrop("program", "upload", "sim:kept.toml", "-", "--raw")
    assert done.stdout.splitlines() == [
        "MVP ABS, 0, 20000",
        "WAIT POS, 0, 0",
        "MVP ABS, 0, 0",
        "WAIT POS, 0, 0",
        "JA 0",
    ]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("personality", ["TMCM", "TMCM-1140", "TMCM-3110"])
def test_a_personality_without_a_cell_runs_a_file(multidrop: Command, personality: str) -> None:
    Path("short.tmc").write_text("  MVP ABS, 0, 10\n  WAIT POS, 0, 0\n  STOP\n")
    done = multidrop("program", "test", "short.tmc", "--personality", personality)
    assert done.returncode == 0 and "position 10, 1 motion" in done.stdout, done
