"""`multidrop program sweep` from outside: cases, JSON, the table and its command lines, JUnit, wrong usage."""

from __future__ import annotations

import json
import shlex
import signal
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.features.sweeps import trial
from multidrop.shell.batch.report import Case, JUnitFile
from tests.support.cell_session import bus, drive
from tests.support.front_door import Command, Done

GO = 'PG 1\nLB SU\n MR 51200\n H\n PR "at ",P\nE\nLB K1\n PR "k1"\nE\nPG\nS\n'
ENDLESS = "PG 1\nLB SU\n H 30000\n BR SU\nE\nPG\n"
CELL = bus("line", drive("LMDCM", "a", party=True), drive("LMDCM", "b", party=True, EE=1), baud=0)
CELL += bus("stage", drive("PMX"), baud=0)
WALLS = ("--vary", "b.load=0..0.9:0.1", "--vary", "b.stall_at=100000,200000,700000", "--vary", "seed=1..2")
"""With an encoder, MR 51200 turns the motor by 655360 motor steps."""


@pytest.fixture
def sweep(multidrop: Command, tmp_path: Path):
    """Runs `program sweep go.mxt` in a folder with some files, in this process."""
    for name, text in {"go.mxt": GO, "endless.mxt": ENDLESS, "cell.toml": CELL}.items():
        (tmp_path / name).write_text(text)

    def run(*arguments: str, file: str = "go.mxt") -> Done:
        return multidrop("program", "sweep", file, *arguments, "--jobs", "1")

    return run


def objects(done: Done) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_the_example_of_the_contract(sweep) -> None:
    done = sweep("--cell", "cell.toml", *WALLS, "--expect", "errors == []", "--expect", "position == 51200", "--json")
    *cases, last = objects(done)
    assert done.returncode == 1 and done.stderr == ""
    assert [each["case"] for each in cases] == list(range(1, 61))
    assert cases[0] == {
        "case": 1,
        "set": {"b.load": 0, "b.stall_at": 100000, "seed": 1},
        "ok": False,
        "why": "errors == [86]",
    }
    assert cases[4] == {"case": 5, "set": {"b.load": 0, "b.stall_at": 700000, "seed": 1}, "ok": True, "why": ""}
    assert [each["set"]["b.load"] for each in cases[::6]] == [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
    assert list(last) == ["summary"] and list(last["summary"]) == ["cases", "failed", "seconds"]
    assert (last["summary"]["cases"], last["summary"]["failed"]) == (60, 40)


def test_a_stall_is_seen_with_an_encoder_only(sweep) -> None:
    vary = ("--vary", "EE=0,1", "--vary", "stall_at=10000")
    *cases, _ = objects(sweep("--cell", "cell.toml#:b", *vary, "--expect", "errors == []", "--json"))
    assert [(each["set"]["EE"], each["ok"], each["why"]) for each in cases] == [
        (0, True, ""),
        (1, False, "errors == [86]"),
    ]


def test_the_table_has_one_row_for_each_cause_and_its_command_repeats_it(sweep, multidrop: Command) -> None:
    done = sweep("--cell", "cell.toml", *WALLS, "--expect", "errors == []", "--expect", "virtual_s > 1")
    *_, head, row, command, last = done.stdout.splitlines()
    assert head.split() == ["cases", "first", "seen", "simplest", "world", "that", "fails", "so"]
    assert row.split() == ["40", "1", "errors", "==", "[86]", "b.stall_at=100000"]
    assert command.strip() == (
        "multidrop program sweep go.mxt --cell 'cell.toml#line:b' --vary b.stall_at=100000 --expect 'errors == []'"
    )
    assert last.startswith("60 cases, 40 failed, ") and done.returncode == 1
    again = multidrop(*shlex.split(command)[1:], "--json")
    assert again.returncode == 1
    assert objects(again)[0] == {"case": 1, "set": {"b.stall_at": 100000}, "ok": False, "why": "errors == [86]"}


def test_a_failure_in_the_cells_own_world_needs_no_value(sweep, multidrop: Command) -> None:
    done = sweep("--vary", "VM=100000..700000:100000", "--expect", "position == 5 +- 1", "--until", "20.5")
    *_, row, command, _ = done.stdout.splitlines()
    assert row.endswith("the cell's own")
    assert command.strip() == "multidrop program sweep go.mxt --expect 'position == 5 +- 1' --until 20.5"
    assert multidrop(*shlex.split(command)[1:]).returncode == 1


def test_all_is_well(sweep) -> None:
    done = sweep("--vary", "A=500000..1000000:100000", "--expect", "prints == ['at 51200']", "--expect", "ended == 1")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1].startswith("6 cases, 0 failed, ")
    assert sweep("--run", "k1", "--expect", 'prints == ["k1"]').stdout.startswith("1 case, 0 failed, ")


def test_draws_are_repeatable_and_their_seed_is_said(sweep) -> None:
    vary = ("--vary", "A=500000..1000000", "--vary", "load=0..0.9", "--random", "5", "--json")
    first, again, other = (objects(sweep(*vary, *more))[:-1] for more in ((), ("--seed", "1"), ("--seed", "2")))
    assert first == again != other and len(first) == 5
    assert "5 draws with --seed 1" in sweep(*vary[:-1]).stderr


def test_a_program_that_does_not_end_fails_unless_a_time_is_given(sweep) -> None:
    done = sweep("--vary", "load=0,0.5", "--expect", "position == 0", file="endless.mxt")
    assert done.returncode == 1 and "still running after 60 s; --until SECONDS" in done.stdout
    assert sweep("--until", "90", "--expect", "ended == until", file="endless.mxt").returncode == 0


def test_settings_that_are_refused_together_fail_the_case(sweep) -> None:
    *cases, _ = objects(sweep("--vary", "VM=2000,9000", "--vary", "VI=1500,5000", "--json"))
    assert [each["ok"] for each in cases] == [True, False, True, True]
    assert cases[1]["why"].startswith("drive !: set: ") and "refused by an LMDCM" in cases[1]["why"]


def test_a_value_that_needs_another_one_is_not_refused_beforehand(sweep) -> None:
    assert sweep("--vary", "VM=900,9000", "--vary", "VI=500,600", "--expect", "errors == []").returncode == 0


def test_a_controller_is_swept_too(sweep, tmp_path: Path) -> None:
    (tmp_path / "go.prg").write_text("EO=1\nHSPD=5000\nX500Y-200\nWAITX\nWAITY\nEND\n")
    vary = ("--vary", "x.limit_plus=300,9000", "--vary", "00.IERR=0")
    done = sweep("--cell", "cell.toml#stage", *vary, "--expect", "position == [500, -200]", "--json", file="go.prg")
    first, second, _ = objects(done)
    assert first["why"].startswith("position == [3") and second["ok"]


def test_junit_has_a_case_for_each_and_the_command(sweep, tmp_path: Path) -> None:
    sweep("--cell", "cell.toml", *WALLS[2:4], "--expect", "errors == []", "--junit", "sweep.xml")
    (suite,) = ElementTree.parse(tmp_path / "sweep.xml").getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("go.mxt", "3", "2")
    first, _, last = suite
    assert first.get("name") == "case 1: b.stall_at=100000"
    assert [each.tag for each in first] == ["failure", "system-out"] and not len(last)
    assert first[0].get("message") == "errors == [86]"
    assert (first[1].text or "").startswith("multidrop program sweep go.mxt --cell 'cell.toml#line:b' --vary ")


def test_interrupted_it_keeps_what_is_done(sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried = trial.Bench.tried

    def interrupted(self: trial.Bench, case: trial.Case) -> trial.TrialResult:
        if case[0] == 4:
            signal.raise_signal(signal.SIGTERM)
        return tried(self, case)

    monkeypatch.setattr(trial.Bench, "tried", interrupted)
    arguments = ("--cell", "cell.toml", *WALLS, "--expect", "errors == []")
    done = sweep(*arguments, "--json", "--junit", "sweep.xml")
    *cases, last = objects(done)
    assert done.returncode == 130 and [each["case"] for each in cases] == [1, 2, 3]
    assert (last["summary"]["cases"], last["summary"]["failed"]) == (3, 3)
    assert done.stderr == "ended after 3 cases of 60; the others were not run\n"
    (suite,) = ElementTree.parse(tmp_path / "sweep.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "3", "1")
    text = sweep(*arguments)
    assert text.returncode == 130 and "3 cases, 3 failed" in text.stdout and "b.stall_at=100000" in text.stdout


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (("--vary", "b.speed=1"), '--vary b.speed=1: drive b: set: "SPEED" is not an MCode mnemonic'),
        (("--vary", "b.lod=1"), "LMDCM; did you mean the world's load?"),
        (("--vary", "c.load=1"), "no drive c; valid: a, b, 00, line:a, line:b, stage:00"),
        (("--vary", "b.load=5..1"), "--vary b.load: 5..1 is an empty range"),
        (("--vary", "b.load=0,11"), "--vary b.load=11: drive b: [bus.drive.world]: load must be from 0 to 10, not 11"),
        (("--vary", "b.load=heavy"), "--vary b.load=heavy: "),
        (("--vary", "b.VM=5"), "--vary b.VM=5: drive b: set: VM=5: refused by an LMDCM: error 23"),
        (("--vary", "b.stall_at=0..200000", "--vary", "b.load=0..0.1:0.1"), "400002 cases are too many"),
        (("--vary", "b.load=1", "--vary", "line:b.load=2"), "varied twice"),
        (("--vary", "b.load=1", "--vary", "a.load=2"), "drives match"),
        (("--vary", "load=1"), "drives match"),
        (("--vary", "seed=x", "--vary", "b.load=0"), "seed"),
        (("--vary", "b.load"), "b.load is not KEY=VALUES"),
        (("--vary", "b.load=0", "--expect", "errors = []"), "--expect errors = []: "),
        (("--vary", "b.load=0", "--run", "nowhere"), "nothing to run at nowhere"),
        (("--vary", "b.load=0", "--random", "0"), "0 is not a number from 1 to 100000"),
        (("--vary", "b.load=0", "--junit", "cell.toml"), "is not a JUnit report"),
        (("--vary", "b.load=0", "--jobs", "2", "--cluster", "tcp://a:1"), "not allowed with"),
    ],
)
def test_wrong_usage_is_one_line_before_anything_runs(sweep, arguments: tuple[str, ...], what: str) -> None:
    done = sweep("--cell", "cell.toml", *arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and what in done.stderr


def test_files_that_cannot_be_read_are_one_line(sweep, tmp_path: Path) -> None:
    for arguments, file in (
        ((), "gone.mxt"),
        (("--cell", "gone.toml"), "go.mxt"),
        (("--cell", "cell.toml#x"), "go.mxt"),
    ):
        done = sweep(*arguments, file=file)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done
    done = sweep("--cell", "cell.toml#:a", "--vary", "b.load=1")
    assert done.returncode == 2 and done.stderr == (
        "--vary b.load: drive a runs the program, so drive b changes nothing; "
        "--cell cell.toml#line:b lets drive b run it\n"
    )


FAILING = ("--cell", "cell.toml", "--vary", "b.stall_at=100000", "--expect", "errors == []")


def test_a_lost_report_is_said_beside_failed_cases(sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: JUnitFile, cases: list[Case], *_: object) -> None:
        if cases[0].name.startswith("case 1"):
            raise Diagnostic("No space left on device", "sweep.xml")

    monkeypatch.setattr(JUnitFile, "write", full)
    done = sweep(*FAILING, "--junit", "sweep.xml")
    assert (done.returncode, done.stderr) == (1, "sweep.xml: No space left on device\n")


def test_lost_output_is_said_beside_failed_cases(sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "multidrop.shell.streams.stdout.dropped", ["the output cannot be written: No space left on device"]
    )
    done = sweep(*FAILING)
    assert (done.returncode, done.stderr) == (1, "the output cannot be written: No space left on device\n")


def test_walls_are_varied_with_units_of_the_scale(sweep, tmp_path: Path) -> None:
    text = bus("line", drive("LMDCM", "a", EE=1), baud=0).replace('name = "a"', 'name = "a"\nunits = "5 mm/turn"')
    (tmp_path / "mm.toml").write_text(text)
    (tmp_path / "turn.mxt").write_text(GO.replace("51200", "4000"))
    wall = ("--cell", "mm.toml", "--vary", "stall_at=3..6 mm")
    *cases, _ = objects(sweep(*wall, "--expect", "errors == []", "--json", file="turn.mxt"))
    assert [(each["set"]["stall_at"], each["ok"]) for each in cases] == [
        ("3 mm", False),
        ("4 mm", False),
        ("5 mm", True),
        ("6 mm", True),
    ]
    *_, row, command, _ = sweep(*wall, "--expect", "errors == []", file="turn.mxt").stdout.splitlines()
    assert row.split()[-2:] == ["stall_at=3", "mm"] and "'stall_at=3 mm'" in command
    refused = sweep("--cell", "mm.toml", "--vary", "stall_at=3 kg", file="turn.mxt")
    assert refused.returncode == 2 and "stall_at=3 kg" in refused.stderr and "no unit kg" in refused.stderr


def test_with_a_motor_a_sweep_over_current_acceleration_and_load_finds_what_stalls(sweep, tmp_path: Path) -> None:
    (tmp_path / "motor.csv").write_text("0, 0.5\n20, 0.2\n")
    text = bus("line", drive("LMDCM", "a", EE=1) + 'motor = "motor.csv"\n', baud=0)
    (tmp_path / "motor.toml").write_text(text)
    vary = ("--vary", "RC=20,90", "--vary", "A=50000,40000000", "--vary", "load=0,0.3")
    *cases, _ = objects(sweep("--cell", "motor.toml", *vary, "--vary", "inertia=2e-5", "--json"))
    held = {tuple(each["set"].values())[:3]: each["ok"] for each in cases}
    assert held == {
        (20, 50000, 0): True,
        (20, 50000, 0.3): False,
        (20, 40000000, 0): False,
        (20, 40000000, 0.3): False,
        (90, 50000, 0): True,
        (90, 50000, 0.3): True,
        (90, 40000000, 0): False,
        (90, 40000000, 0.3): False,
    }
