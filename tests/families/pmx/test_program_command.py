"""`multidrop program test` on A-SCRIPT: the programs of the manual's shapes on the simulated controller, and output."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from multidrop.families.pmx.manual import program_file
from multidrop.families.pmx.simulator.program_run import AScriptRun
from multidrop.simulator.cell.spec import DriveSpec
from multidrop.simulator.cells import read
from multidrop.simulator.program_events import ProgramEvent, Summary
from tests.support import pmx_programs as shapes
from tests.support.cell_session import bus, drive, pmx
from tests.support.front_door import Command, Done

pytestmark = pytest.mark.slow

CELL = bus("line", drive("LMDCM"), baud=0) + bus("pmx", pmx("07", "[bus.drive.world]", "inputs = {inputs}"), baud=0)
LIMIT = "limit_plus = 500\n"


@pytest.fixture
def program(multidrop: Command) -> Command:
    return partial(multidrop, "program", "test")


def tried(text: str, until: float, inputs: str = "[]", more: str = "") -> tuple[list[ProgramEvent], Summary]:
    (_, bus) = read(CELL.format(inputs=inputs) + more, "cell").buses
    trial = AScriptRun(bus.drives[0], program_file.read(text, "a.prg"), "a.prg")
    *events, end = trial.run("", until)
    assert isinstance(end, Summary)
    return [each for each in events if not isinstance(each, Summary)], end


def test_there_and_back() -> None:
    events, end = tried(shapes.THERE_AND_BACK, 10.0)
    assert events == [] and (end.ended, end.position, end.moves) == ("END", (0, 0), 2)
    assert 0.2 < end.t < 2.0


def test_for_ever() -> None:
    _, end = tried(shapes.FOREVER, 60.0)
    assert end.ended == "until" and end.moves > 100 and 0 <= end.position[0] <= 1000 and not end.errors


def test_ten_times() -> None:
    _, end = tried(shapes.TEN_TIMES, 60.0)
    assert (end.ended, end.position[0], end.moves) == ("END", 1000, 20)


def test_only_while_an_input_is_on() -> None:
    _, off = tried(shapes.ON_INPUT, 5.0)
    assert off.moves == 0
    _, on = tried(shapes.ON_INPUT, 5.0, "[[1.0, 1, 0], [2.0, 1, 1]]")
    assert on.moves > 5 and on.position[0] == 1000 and not on.moving


def test_a_step_for_each_edge_of_an_input() -> None:
    edges = "[[0.5, 1, 0], [1.0, 1, 1], [1.5, 1, 0], [2.0, 1, 1], [2.5, 1, 0], [3.5, 1, 1]]"
    _, end = tried(shapes.STEP_PER_EDGE, 5.0, edges)
    assert (end.moves, end.position[0]) == (3, 2000)


def test_inputs_choose_where_it_goes() -> None:
    for number, target in ((1, 1000), (2, 2000), (3, 3000)):
        _, end = tried(shapes.CHOOSER, 2.0, f"[[0.1, {number}, 0]]")
        assert end.position[0] == target
    _, homed = tried(shapes.CHOOSER, 3.0, "[[0.1, 5, 0], [0.2, 5, 1]]", "home = -300\n")
    assert homed.position[0] == 0 and homed.moves >= 1 and not homed.errors


def test_one_program_controls_the_other() -> None:
    _, end = tried(shapes.TWO, 6.0, "[[2.03, 1, 0], [4.0, 1, 1]]")
    assert end.ended == "until" and not end.errors and end.moving
    _, held = tried(shapes.TWO, 3.9, "[[2.03, 1, 0], [4.0, 1, 1]]")
    assert not held.moving and 0 < held.position[0] < 1000


def test_a_watchdog_stops_the_motor_and_starts_it_again() -> None:
    _, before = tried(shapes.WATCHDOG, 4.9)
    assert before.moving
    events, held = tried(shapes.WATCHDOG, 7.0)
    assert not held.moving and not held.errors
    events, _ = tried(shapes.WATCHDOG, 9.0)  # the alarm stands, as no host speaks to it: 1 for a moment
    assert [(round(each.t), each.facts["outputs"]) for each in events if "outputs" in each.facts] == [(8, 1), (8, 0)]


def test_a_limit_calls_sub_31_and_without_it_ends_the_program() -> None:
    text = "HSPD=5000\nACC=50\nEO=1\nX1000\nWAITX\nV1=1\nEND\n"
    events, end = tried(text, 10.0, more=LIMIT)
    (failed,) = events
    assert (failed.line, "handled" in failed.facts) == (5, False) and "axis X" in failed.facts["error"]
    assert end.ended == "error" and 490 <= end.position[0] <= 520
    events, end = tried(text + "SUB 31\nECLEARX\nX0\nWAITX\nENDSUB\n", 10.0, more=LIMIT)
    assert [each.facts["handled"] for each in events if "error" in each.facts] == [True]
    assert end.ended == "END" and end.position[0] == 0 and not end.errors


def objects(done: Done) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_json_and_exit_codes(program: Command, tmp_path: Path) -> None:
    (tmp_path / "a.prg").write_text("EO=1\nDO=5\nX100Y-200\nWAITX\nWAITY\nEND\n")
    done = program("a.prg", "--json")
    switched, last = objects(done)
    assert done.returncode == 0 and switched["outputs"] == 5 and switched["program"] == 0
    summary = last["summary"]
    assert list(summary) == ["position", "moves", "errors", "instructions", "virtual_s", "real_s", "ended"]
    assert summary["position"] == {"X": 100, "Y": -200} and summary["ended"] == "END"
    (tmp_path / "b.asc").write_text("EO=1\nX100\nX0\nEND\n")
    done = program("b.asc")
    assert done.returncode == 1 and done.stderr.startswith("b.asc:3: program 0 at ") and "?Moving" in done.stderr
    assert "1 error" in done.stdout
    (tmp_path / "c.prg").write_text("FROB\n")
    assert program("c.prg").returncode == 2


def test_a_program_without_end_is_given_up_and_that_is_said(program: Command, tmp_path: Path) -> None:
    (tmp_path / "a.prg").write_text("WHILE 1=1\nDELAY=1000\nENDWHILE\nEND\n")
    done = program("a.prg")
    assert done.returncode == 1 and "still runs" in done.stderr
    assert program("a.prg", "--until", "5").returncode == 0


def test_one_of_two_programs_can_be_chosen(program: Command, tmp_path: Path) -> None:
    (tmp_path / "a.prg").write_text("PRG 0\nDO=1\nEND\nPRG 1\nDO=2\nEND\n")
    assert [each.get("outputs") for each in objects(program("a.prg", "--run", "1", "--json"))] == [2, None]
    done = program("a.prg", "--run", "2")
    assert done.returncode == 2 and "no program 2" in done.stderr


def test_the_controller_comes_from_a_cell(program: Command, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(CELL.format(inputs="[[0.5, 1, 0]]"))
    (tmp_path / "a.prg").write_text("WHILE DI1=0\nENDWHILE\nEND\n")
    (last,) = objects(program("a.prg", "--cell", "cell.toml#pmx", "--json"))
    assert 0.5 <= last["summary"]["virtual_s"] < 0.51
    assert program("a.prg", "--cell", "cell.toml#line").returncode == 2


def test_another_personality_is_refused() -> None:
    with pytest.raises(Exception, match="does not run A-SCRIPT"):
        AScriptRun(replace(DriveSpec(), personality="LMM"), [], "a.prg")
