"""A recording: its lines and times, and the waits that are offered in place of pauses."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, Recorder
from multidrop.macros.recorder import Observed, offers, with_waits


def recorded(*lines: tuple[float, str, bool], observed: Observed | None = None) -> Recorder:
    recorder = Recorder()
    recorder.start("m", 0.0)
    for at, line, starts in lines:
        recorder.record(line, at, starts=starts)
    recorder.observed = observed or Observed()
    return recorder


MOVE, ASK = (10.0, "MR 51200", True), (14.2, "PR P", False)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ([MOVE, ASK], [(2, "/wait stopped 13")]),
        ([MOVE, (10.5, "PR P", False), (14.0, "PR V", False)], [(3, "/wait stopped 11")]),
        ([MOVE, (10.5, "PR P", False)], []),
        ([(10.0, "PR P", False), ASK], []),
        ([MOVE, (10.1, "/wait stopped", False), ASK], []),
        ([MOVE, (14.0, "/wait stopped", False)], []),
        ([MOVE, ASK, (24.2, "PR P", False)], [(2, "/wait stopped 13")]),
    ],
)
def test_a_pause_after_a_start_of_motion_is_one_for_its_end(
    lines: list[tuple[float, str, bool]], expected: list[tuple[int, str]]
) -> None:
    assert [(offer.step, offer.line) for offer in recorded(*lines).offers] == expected


@pytest.mark.parametrize(
    ("readings", "expected"),
    [
        ([(11.0, True), (12.0, False)], ["/wait stopped 13"]),
        ([(11.0, True), (14.0, True)], []),
        ([(11.0, False), (14.0, False)], []),
        ([(1.0, True), (15.0, False)], ["/wait stopped 13"]),
    ],
)
def test_readings_of_the_velocity_say_whether_a_motion_ended(
    readings: list[tuple[float, bool]], expected: list[str]
) -> None:
    observed = Observed()
    observed.moving.extend(readings)
    assert [offer.line for offer in recorded(MOVE, ASK, observed=observed).offers] == expected


def test_a_text_or_an_input_that_ended_the_pause_comes_first() -> None:
    observed = Observed()
    observed.inputs.append((13.0, "@press:a I1=1"))
    assert [offer.line for offer in recorded(MOVE, ASK, observed=observed).offers] == ["/wait @press:a I1=1 13"]
    observed.texts.extend([(9.0, "long ago"), (13.5, 'part 17 "done" {1}'), (14.5, "too late")])
    assert [offer.line for offer in recorded(MOVE, ASK, observed=observed).offers] == ['/wait "part" 13']
    observed.texts.append((14.0, "12 34"))
    assert [offer.line for offer in recorded(MOVE, ASK, observed=observed).offers] == ['/wait "part" 13']


def test_a_text_long_before_the_next_line_did_not_end_the_pause() -> None:
    observed = Observed()
    observed.texts.append((11.0, "begun"))
    lines = [(10.0, "PR 1", False), (20.0, "PR 2", False)]
    assert recorded(*lines, observed=observed).offers == []


def test_a_wait_takes_the_place_of_the_pause() -> None:
    recorder = recorded(MOVE, ASK)
    (offer,) = recorder.offers
    assert offer.text == "before step 2, /wait stopped 13 for the pause of 4.2 s"
    assert with_waits(recorder.macro(), [offer]).steps == (
        MacroStep(0.0, "MR 51200"),
        MacroStep(0.0, "/wait stopped 13"),
        MacroStep(0.0, "PR P"),
    )


def test_what_came_back_is_kept_beside_the_step_and_cut() -> None:
    recorder = Recorder()
    recorder.start("m", 0.0, time="2026-11-22 13:00:00+00:00")
    recorder.record("L", 1.0, "press:a").came_back([*map(str, range(25)), "x" * 300])
    recorder.record("PR 1", 2.0, "press:a").came_back(["y" * 300, "\x1b"])
    first, second = recorder.macro().steps
    assert (first.drive, len(first.replies), first.replies[-1]) == ("press:a", 21, "... 6 more")
    assert second.replies == ("y" * 200 + "... (300 characters)", "\\x1b")
    assert recorder.macro().recorded == "2026-11-22 13:00:00+00:00"


def test_no_events_and_no_lines_are_no_offers() -> None:
    assert offers([], Observed()) == []
    assert with_waits(Macro("m", (MacroStep(1.0, "PR P"),)), []) == Macro("m", (MacroStep(1.0, "PR P"),))


def typed(*kept: tuple[str, float], start: float = 0.0) -> Macro:
    recorder = Recorder()
    recorder.start("m", start)
    for line, at in kept:
        recorder.record(line, at)
    return recorder.macro()


def test_a_recording_begins_with_its_first_line_in_milliseconds() -> None:
    macro = typed(("@b MR 1", 7.0), ("/wait stopped", 7.1234), ("PR P", 9.0), start=2.0)
    assert macro == Macro("m", (MacroStep(0.0, "@b MR 1"), MacroStep(0.123, "/wait stopped"), MacroStep(1.877, "PR P")))


def test_rounding_does_not_add_up() -> None:
    macro = typed(*((f"{n}", n * 0.0104) for n in range(1001)))
    assert sum(step.after for step in macro.steps) == pytest.approx(10.4, abs=0.001)


def test_nothing_is_kept_while_nothing_is_typed() -> None:
    recorder = Recorder()
    recorder.record("MR 1", 0.0)
    recorder.start("m", 1.0)
    assert recorder.name == "m"
    with pytest.raises(Diagnostic, match="nothing was typed"):
        recorder.macro()
    assert recorder.name == ""
    with pytest.raises(Diagnostic, match="no macro is being recorded"):
        recorder.macro()


def test_one_macro_is_recorded_at_a_time_under_a_name_that_can_be_kept() -> None:
    recorder = Recorder()
    with pytest.raises(Diagnostic, match="invalid macro name"):
        recorder.start("a/b", 0.0)
    recorder.start("a", 0.0)
    with pytest.raises(Diagnostic, match="the macro a is being recorded"):
        recorder.start("b", 0.0)
    recorder.discard()
    recorder.start("b", 0.0)
