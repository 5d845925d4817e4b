"""Program files tried out in virtual time: what is told, when it ends and why."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.families.lexium.manual import program_file
from multidrop.families.lexium.simulator.program_run import MCodeRun
from multidrop.simulator.cell.spec import DriveSpec, WorldSpec
from multidrop.simulator.program_events import ProgramEvent, Summary
from multidrop.simulator.program_run import LONGEST_RUN


def tried(text: str, label: str = "", until: float | None = None, **spec: object) -> list[ProgramEvent]:
    lines = program_file.read(text, "a.mxt")
    return list(MCodeRun(DriveSpec(**spec), lines, "a.mxt").run(label, until))  # type: ignore[arg-type]


def end(events: list[ProgramEvent]) -> Summary:
    summary = events[-1]
    assert isinstance(summary, Summary)
    return summary


def prints(events: list[ProgramEvent]) -> list[str]:
    return [each.facts["print"] for each in events if "print" in each.facts]


def failures(events: list[ProgramEvent]) -> list[tuple[int, int, bool]]:
    found = [each.facts for each in events if "error" in each.facts]
    return [(each["error"], each["line"], each.get("handled", False)) for each in found]


def test_a_program_is_told_by_its_prints_and_summed_up_at_its_end() -> None:
    events = tried("' a remark\n\nVA Q1=3\nPG 1\nH 250\nPR Q1\nMR 1000\nH\nPR P\nE\nPG\nS\n")
    assert prints(events) == ["3", "1000"]
    assert events[0].fact(0.0) == {"t": 0.25, "print": "3"}
    summary = end(events)
    assert (summary.ended, summary.position, summary.moves, summary.instructions) == ("E", 1000, 1, 6)
    assert summary.errors == () and not summary.given_up


def test_time_is_that_of_the_end_and_not_a_moment_more() -> None:
    events = tried("PG 1\nMR 51200\nH 100\nE\nPG\n")
    summary = end(events)
    assert summary.t == pytest.approx(0.1002)
    assert summary.moving and 0 < summary.position < 51200


def test_a_print_is_told_when_its_line_is_complete() -> None:
    events = tried('PG 1\nPR "a";\nH 1000\nPR "b"\nPR "c";\nE\nPG\n')
    assert prints(events) == ["ab", "c"]
    assert "print" in events[0].facts and events[0].t > 1.0


@pytest.mark.parametrize(
    ("label", "printed"), [("", "su"), ("k1", "k1"), ("K1", "k1"), ("1", "one")], ids=["SU", "k1", "K1", "address"]
)
def test_what_is_run_is_a_label_an_address_or_su(label: str, printed: str) -> None:
    text = 'PG 1\nPR "one"\nE\nLB SU\nPR "su"\nE\nLB K1\nPR "k1"\nE\nPG\n'
    assert prints(tried(text, label)) == [printed]


def test_without_su_it_is_address_1() -> None:
    assert prints(tried('PG 1\nPR "one"\nE\nPG\n')) == ["one"]


def test_a_file_that_starts_its_program_itself_is_taken_at_its_word() -> None:
    text = 'PG 1\nPR "one"\nE\nLB K1\nPR "k1"\nE\nPG\nS\nEX K1\n'
    assert prints(tried(text)) == ["k1"]
    assert prints(tried(text, "1")) == ["one"]


@pytest.mark.parametrize(("label", "says"), [("Zz", "at Zz"), ("7", "at 7"), ("", "address 1")])
def test_nothing_to_run_is_a_diagnostic_that_names_what_there_is(label: str, says: str) -> None:
    with pytest.raises(Diagnostic, match=f"{says}.*K1"):
        tried("PG 100\nLB K1\nE\nPG\n", label)


def test_what_a_drive_refuses_is_told_with_its_line_and_nothing_is_run() -> None:
    events = tried("VM=5\nPG 1\nQQ=1\nPR 1\nE\nPG\n")
    assert failures(events) == [(23, 1, False), (20, 3, False)]
    assert all(": refused: " in each.text for each in events[:-1])
    assert (end(events).ended, end(events).instructions, end(events).lines_at) == ("error", 0, (0,))


def test_a_refused_pg_does_not_let_the_program_be_executed_line_by_line() -> None:
    events = tried("PG 9999\nMR 51200\nPG\n")
    assert failures(events) == [(42, 1, False)]
    assert end(events).moves == 0


def test_an_error_while_running_names_the_line_of_the_file_and_the_program_goes_on() -> None:
    events = tried("VM=300000\n\nPG 1\nLB Ga\n VM=5   'too slow\n PR VM\nE\nPG\n")
    assert failures(events) == [(23, 5, False)]
    assert prints(events) == ["300000"]
    assert (end(events).ended, end(events).errors) == ("E", (23,))


def test_an_error_that_ends_the_program_is_its_end() -> None:
    events = tried("PG 1\nH 500\nBR Zz\nPR 1\nE\nPG\n")
    assert failures(events) == [(30, 3, False)]
    assert (end(events).ended, end(events).lines_at, prints(events)) == ("error", (3,), [])


def test_an_error_that_oe_takes_is_told_as_handled_and_is_no_failure() -> None:
    events = tried("PG 1\nOE K1\nVM=5\nE\nLB K1\nPR ER\nRT\nPG\n")
    assert failures(events) == [(23, 3, True)]
    assert prints(events) == ["23"]
    assert (end(events).ended, end(events).errors) == ("E", ())


def test_an_error_within_the_handler_is_not_handled() -> None:
    events = tried("PG 1\nOE K1\nVM=5\nE\nLB K1\nVM=5\nRT\nPG\n")
    assert failures(events) == [(23, 3, True), (23, 6, False)]


def test_an_error_that_comes_from_outside_belongs_to_the_line_that_holds() -> None:
    world = WorldSpec(limit_plus=1000)
    events = tried("IS=2,2,0\nPG 1\nSL 20000\nH\nPR P\nE\nPG\n", world=world)
    assert failures(events) == [(83, 4, False)]


def test_an_error_that_comes_from_outside_belongs_to_the_loop_that_goes_round() -> None:
    world = WorldSpec(limit_plus=1000)
    events = tried("IS=2,2,0\nPG 1\nBR K1\nE\nLB K1\nSL 20000\nLB K2\nBR K2,MV=1\nE\nPG\n", world=world)
    assert failures(events) == [(83, 8, False)]


def test_the_world_moves_inputs_while_the_program_runs() -> None:
    world = WorldSpec(inputs=((2.0, 1, 0),))
    events = tried('IS=1,0,0\nPG 1\nLB K1\nBR K1,I1=0\nPR "now"\nE\nPG\n', world=world)
    assert "print" in events[0].facts and events[0].t == pytest.approx(2.0, abs=0.001)


def test_until_ends_a_program_that_goes_on_and_says_where_it_stood() -> None:
    events = tried("PG 1\nLB K1\nIC R1\nBR K1\nPG\n", until=2.0)
    summary = end(events)
    assert (summary.ended, summary.t, summary.given_up, summary.stuck) == ("until", 2.0, False, False)
    assert summary.instructions == pytest.approx(10_000, rel=0.01)
    assert summary.lines_at in ((3,), (4,))


def test_a_program_that_never_ends_is_given_up_without_an_until() -> None:
    summary = end(tried("PG 1\nLB K1\nH 60000\nBR K1\nPG\n"))
    assert (summary.ended, summary.t, summary.given_up) == ("until", LONGEST_RUN, True)


def test_where_nothing_can_ever_happen_any_more_time_does_not_pass_for_nothing() -> None:
    summary = end(tried("PG 1\nSL 20000\nH\nE\nPG\n"))
    assert (summary.ended, summary.given_up, summary.stuck, summary.lines_at) == ("until", True, True, (3,))
    assert summary.instructions == 2


def test_the_program_that_the_cell_gives_its_drive_is_not_in_the_way() -> None:
    assert prints(tried('PG 1\nLB K1\nPR "mine"\nE\nPG\n', program="PG 1\nLB K1\nE\nPG\n")) == ["mine"]


def test_a_drive_that_does_not_speak_mcode_is_refused() -> None:
    with pytest.raises(Diagnostic, match="PMX"):
        tried("PG 1\nE\nPG\n", personality="PMX")


@pytest.mark.parametrize("personality", ["LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM", "MDI", "MDIE", "MDIX"])
def test_every_personality_runs_programs(personality: str) -> None:
    assert prints(tried("PG 1\nPR VR\nE\nPG\n", personality=personality))


def test_ten_minutes_of_holds_take_no_time() -> None:
    summary = end(tried("PG 1\nLB K1\nH 60000\nIC R1\nBR K1,R1<10\nE\nPG\n"))
    assert summary.t == pytest.approx(600, abs=1)
    assert summary.instructions == 31


@pytest.mark.parametrize(
    ("head", "spec"), [("AS=1\n", {}), ("AS=2\n", {}), ("", {"set": {"AS": 1}}), ("AS=1\nAS=0\nAS=2\n", {})]
)
def test_a_program_starts_after_the_calibration_that_its_header_has_begun(head: str, spec: dict[str, object]) -> None:
    events = tried(f"{head}PG 1\nMR 1000\nH\nPR P\nE\nPG\n", **spec)
    assert (prints(events), end(events).errors) == (["1000"], ())


def test_a_calibration_that_the_program_begins_still_takes_its_time() -> None:
    assert failures(tried("PG 1\nAS=1\nMR 1000\nE\nPG\n")) == [(88, 3, False)]
