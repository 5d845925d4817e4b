"""`multidrop program test --trace`, `--break` and `--watch`: what is shown of a run, where it ends, what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from multidrop.simulator import program_events
from tests.support.front_door import Home

LOOP = """VM=200000
PG 1
LB SU
 VA Q1=0
LB K1
 MR 51200   'a turn
 H
 IC Q1
 BR K1,Q1<3
 PR Q1
 E
PG
"""
LAMP = """; lamp.prg
WHILE V1<3
    DO1=1       ; the lamp
    DELAY=250
    X1000
    WAITX
    V1=V1+1
ENDWHILE
END
"""
Test = Callable[..., tuple[int, list[str], list[str]]]


@pytest.fixture
def test(home: Home) -> Test:
    """Run `program test`: its exit code and the lines of both streams."""
    home.file("loop.mxt", LOOP)
    home.file("lamp.prg", LAMP)

    def run(*arguments: str) -> tuple[int, list[str], list[str]]:
        code, out, err = home.run("program", "test", *arguments)
        return code, out.splitlines(), err.splitlines()

    return run


def facts(lines: list[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in lines]


def test_a_trace_shows_each_line_with_its_remark_and_what_it_changed(test: Test) -> None:
    code, out, err = test("loop.mxt", "--trace")
    assert (code, err) == (0, [])
    assert out[:4] == [
        "    0.0000  loop.mxt:4: VA Q1=0   Q1=0",
        "    0.0002  loop.mxt:6: MR 51200   'a turn",
        "    0.0004  loop.mxt:7: H",
        "    0.4542  loop.mxt:8: IC Q1   Q1=1",
    ]
    assert [line.split(": ")[0].rpartition(":")[2] for line in out[:14]] == [*"4", *"6789" * 3, "10"]
    assert out[-1].startswith("ended at E")


def test_the_order_of_lines_and_prints_is_that_of_their_times(test: Test) -> None:
    _, out, _ = test("loop.mxt", "--trace")
    assert out[-4].endswith("loop.mxt:10: PR Q1") and out[-3].endswith("  3") and out[-2].endswith("loop.mxt:11: E")


def test_a_watched_name_shows_only_the_lines_that_changed_it(test: Test) -> None:
    _, out, _ = test("loop.mxt", "--watch", "q1")
    assert [line.partition("loop.mxt:")[2] for line in out[:4]] == [
        "4: VA Q1=0   Q1=0",
        *(f"8: IC Q1   Q1={n}" for n in (1, 2, 3)),
    ]


def test_a_break_point_ends_the_run_before_its_line_and_shows_the_listing(test: Test) -> None:
    code, out, err = test("loop.mxt", "--break", "8", "--watch", "P")
    assert (code, err) == (0, [])
    assert out[0] == "    0.4542  break point 8: loop.mxt:8: IC Q1   P=51200"
    assert out[1:8] == [
        "    5  LB K1",
        "    6   MR 51200   'a turn",
        "    7   H",
        "->  8   IC Q1",
        "    9   BR K1,Q1<3",
        "   10   PR Q1",
        "   11   E",
    ]
    assert out[8].startswith("stopped at a break point after 0.4542 s: position 51200, 1 motion, 3 lines")


def test_a_break_point_at_a_label_counts_passes(test: Test) -> None:
    code, out, _ = test("loop.mxt", "--break", "k1,3", "--watch", "Q1", "--json")
    *_, broken, last = facts(out)
    assert code == 0 and last["summary"]["ended"] == "break" and last["summary"]["moves"] == 2
    assert (broken["break"], broken["line"], broken["text"], broken["values"]) == (
        "k1",
        6,
        "MR 51200   'a turn",
        {"Q1": 2},
    )


def test_a_break_point_that_is_never_reached_changes_nothing(test: Test) -> None:
    code, out, _ = test("loop.mxt", "--break", "K1,4")
    assert code == 0 and out[-1].startswith("ended at E") and not any("break point" in line for line in out)


def test_json_has_one_object_for_each_line(test: Test) -> None:
    _, out, _ = test("loop.mxt", "--trace", "--watch", "Q1", "--json")
    assert facts(out)[0] == {"t": 0.0, "line": 4, "text": "VA Q1=0", "changed": {"Q1": 0}}


def test_a_trace_is_bounded_and_says_so(test: Test, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_events, "MOST_TRACED", 3)
    code, out, err = test("loop.mxt", "--trace")
    assert code == 0 and sum("loop.mxt:" in line for line in out) == 3 and out[-1].startswith("ended at E")
    assert len(err) == 1 and "the trace ends after 3 lines" in err[0]


@pytest.mark.parametrize(
    "wrong, told",
    [
        (("--break", "1"), "no line to break at 1; valid: a line of the program, or a label (K1, SU)"),
        (("--break", "ZZ"), "no line to break at ZZ"),
        (("--break", "K1,0"), "no break point K1,0"),
        (("--break", "K1,x"), "no break point K1,x"),
        (("--watch", "ZZ"), "no variable ZZ to watch"),
        (("--watch", "MA"), "no variable MA to watch"),
    ],
)
def test_a_wrong_place_or_name_is_one_line_and_nothing_runs(test: Test, wrong: tuple[str, ...], told: str) -> None:
    code, out, err = test("loop.mxt", *wrong)
    assert (code, out) == (2, []) and len(err) == 1 and err[0].startswith(f"loop.mxt: {told}")


def test_a_script_is_traced_by_its_statements(test: Test) -> None:
    code, out, err = test("lamp.prg", "--trace")
    assert (code, err) == (0, [])
    assert out[0] == "    0.0000  lamp.prg:2: WHILE V1<3 (program 0)"
    assert "lamp.prg:3: DO1=1       ; the lamp (program 0)" in out[1] and out[2].endswith("DO=1 (program 0)")
    assert [line.rpartition("   ")[2] for line in out if "V1=V1+1" in line] == ["V1=1", "V1=2", "V1=3"]
    assert [line.split(": ")[0].rpartition(":")[2] for line in out if "lamp.prg" in line] == [*"2345678" * 3, *"29"]


def test_a_script_breaks_at_a_line_with_registers_watched(test: Test) -> None:
    code, out, _ = test("lamp.prg", "--break", "5,2", "--watch", "V1", "--watch", "PX", "--json")
    *_, broken, last = facts(out)
    assert code == 0 and (broken["line"], broken["values"]["V1"]) == (5, 1) and broken["values"]["PX"] > 0
    assert last["summary"]["ended"] == "break" and last["summary"]["moves"] == 1


def test_two_programs_are_traced_in_the_order_of_time(test: Test, tmp_path: Path) -> None:
    """One waits for seconds in a statement while the other executes many."""
    slow, quick = "PRG 0\nDELAY=5000\nEND\n", "PRG 1\nWHILE V1<4\n DELAY=700\n V1=V1+1\n DO1=1\nENDWHILE\nEND\n"
    (tmp_path / "two.prg").write_text(slow + quick)
    code, out, _ = test("two.prg", "--trace", "--json")
    times = [each["t"] for each in facts(out)[:-1]]
    assert code == 0 and times == sorted(times) and len(times) > 20
    assert [each["program"] for each in facts(out)[:-1]].count(0) == 3


@pytest.mark.parametrize(
    "wrong, told",
    [
        (("--break", "1"), "no statement to break at 1"),
        (("--break", "K1"), "no statement to break at K1"),
        (("--break", "3,0"), "no break point 3,0"),
        (("--watch", "JX+"), "no variable JX+ to watch"),
        (("--watch", "ID"), "no variable ID to watch"),
    ],
)
def test_a_watched_name_of_a_script_only_reads(test: Test, wrong: tuple[str, ...], told: str) -> None:
    code, out, err = test("lamp.prg", *wrong)
    assert (code, out) == (2, []) and len(err) == 1 and err[0].startswith(f"lamp.prg: {told}")


def test_a_program_that_sets_a_break_point_runs_as_ever(test: Test, tmp_path: Path) -> None:
    (tmp_path / "own.mxt").write_text(LOOP.replace("PG 1\n", "PG 1\n BP K1,1\n"))
    assert test("own.mxt", "--trace")[1][-1].startswith("ended at E")
