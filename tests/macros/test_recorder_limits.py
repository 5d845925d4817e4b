"""The limits of what a recording keeps and offers."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.macros import Macro, MacroStep, Recorder
from multidrop.macros.recorder import MOST_KEPT_EVENTS, Observed, WaitOffer, with_waits
from tests.support.cases import for_each


def offered(
    *lines: tuple[float, str] | tuple[float, str, bool],
    texts: list[tuple[float, str]] | None = None,
    inputs: list[tuple[float, str]] | None = None,
    moving: list[tuple[float, bool]] | None = None,
) -> list[tuple[int, str, float]]:
    """The offers for lines: when, what, and whether it starts a motion."""
    recorder = Recorder()
    recorder.start("m", 0.0)
    for at, line, *starts in lines:
        recorder.record(line, at, starts=bool(starts))
    recorder.observed.texts.extend(texts or [])
    recorder.observed.inputs.extend(inputs or [])
    recorder.observed.moving.extend(moving or [])
    return [(each.step, each.line, round(each.pause, 3)) for each in recorder.offers]


@for_each(
    "pause, wait",
    [
        (0.999, None),
        (1.0, "/wait stopped 10"),
        (3.0, "/wait stopped 10"),
        (3.5, "/wait stopped 11"),
        (20.0, "/wait stopped 60"),
    ],
)
def test_a_wait_is_offered_from_a_pause_of_a_second_on_with_three_times_as_long(pause: float, wait: str | None) -> None:
    found = offered((0.0, "MR 1", True), (pause, "PR P"))
    assert found == ([(2, wait, pause)] if wait else [])


@for_each(
    "at, text, line",
    [
        (4.99, "begun", "/wait stopped 30"),
        (5.0, "begun", '/wait "begun" 30'),
        (10.0, "begun", '/wait "begun" 30'),
        (10.1, "begun", "/wait stopped 30"),
        (9.0, "ok", "/wait stopped 30"),
        (9.0, "yes", '/wait "yes" 30'),
        (9.0, "at 12 mm, done 7", '/wait "mm, done" 30'),
        (9.0, "  done  ", '/wait "done" 30'),
        (9.0, "", "/wait stopped 30"),
        (9.0, "a1b2c3", "/wait stopped 30"),
    ],
)
def test_what_came_in_the_last_five_seconds_ended_the_pause(at: float, text: str, line: str) -> None:
    lines = (0.0, "MR 1", True), (10.0, "PR P")
    assert offered(*lines, texts=[(at, text)]) == [(2, line, 10.0)]


@for_each("at, taken", [(4.99, False), (5.0, True), (10.0, True), (10.1, False)])
def test_an_input_in_the_last_five_seconds_ended_the_pause(at: float, taken: bool) -> None:
    found = offered((0.0, "PR 1"), (10.0, "PR P"), inputs=[(at, "@a I1=1")])
    assert found == ([(2, "/wait @a I1=1 30", 10.0)] if taken else [])


def test_the_last_event_before_the_next_line_counts() -> None:
    lines = (0.0, "PR 1"), (10.0, "PR P")
    assert offered(*lines, texts=[(6.0, "first"), (9.0, "second"), (11.0, "third")])[0][1] == '/wait "second" 30'
    assert offered(*lines, inputs=[(6.0, "I1=1"), (9.0, "I1=0"), (11.0, "I2=1")])[0][1] == "/wait I1=0 30"
    assert offered(*lines, texts=[(6.0, "first")], inputs=[(9.0, "I1=0")])[0][1] == '/wait "first" 30'


@for_each(
    "lines, steps",
    [
        ([(0.0, "MR 1", True), (0.5, "PR 1"), (2.0, "PR 2"), (4.0, "PR 3")], [3]),
        ([(0.0, "MR 1", True), (0.5, "/wait stopped"), (2.0, "PR 2"), (4.0, "PR 3")], []),
        ([(0.0, "MR 1", True), (0.5, "/sleep 1"), (2.0, "MR 2", True), (4.0, "PR 3")], [4]),
        ([(0.0, "MR 1", True), (2.0, "/sleep 1"), (2.1, "PR 3")], []),
        ([(0.0, "MR 1", True), (2.0, "/waiter"), (2.1, "PR 3")], [2]),
        ([(0.0, "PR 1"), (2.0, "MR 1", True), (4.0, "PR 3")], [3]),
    ],
)
def test_one_wait_is_offered_for_each_motion_that_is_not_waited_for(
    lines: list[tuple[float, str] | tuple[float, str, bool]], steps: list[int]
) -> None:
    assert [step for step, _, _ in offered(*lines)] == steps


@for_each(
    "moving, found",
    [
        ([(0.0, True), (10.0, False)], True),
        ([(0.0, False), (10.0, True)], False),
        ([(3.0, False), (4.0, False)], False),
        ([(-1.0, True), (5.0, False)], False),
        ([(5.0, True), (6.0, False), (11.0, True)], True),
    ],
)
def test_readings_within_the_pause_say_whether_a_motion_came_to_its_end(
    moving: list[tuple[float, bool]], found: bool
) -> None:
    assert bool(offered((0.0, "PR 1"), (10.0, "PR P"), moving=moving)) == found


@for_each("count, last", [(20, "19"), (21, "... 1 more"), (25, "... 5 more")])
def test_twenty_replies_of_a_step_are_kept(count: int, last: str) -> None:
    recorder = Recorder()
    recorder.start("m", 0.0)
    line = recorder.record("L", 0.0)
    line.came_back(map(str, range(count - 1)))
    line.came_back([str(count - 1)])
    assert (len(line.replies), line.replies[-1]) == (min(count, 21), last)


def test_two_hundred_characters_of_a_reply_are_kept() -> None:
    line = Recorder().record("L", 0.0)
    line.came_back(["x" * 200, "y" * 201, "\x1b" * 60])
    assert line.replies == (
        "x" * 200,
        f"{'y' * 200}... (201 characters)",
        f"{chr(92)}x1b" * 50 + "... (240 characters)",
    )


def test_of_a_long_recording_the_last_events_are_kept() -> None:
    observed = Observed()
    for number in range(MOST_KEPT_EVENTS + 5):
        observed.texts.append((float(number), ""))
        observed.inputs.append((float(number), ""))
        observed.moving.append((float(number), True))
    assert MOST_KEPT_EVENTS == 10_000
    for each in (observed.texts, observed.inputs, observed.moving):
        assert (len(each), each[0][0]) == (MOST_KEPT_EVENTS, 5.0)


def test_a_wait_stands_before_its_step_with_its_braces_doubled() -> None:
    macro = Macro(
        "m", (MacroStep(0.0, "MR 1"), MacroStep(4.2, "PR P", "a", ("1",)), MacroStep(1.5, "PR V")), "F3", "note"
    )
    found = with_waits(macro, [WaitOffer(2, '/wait "{x}"', 4.2)])
    assert found == Macro(
        "m",
        (
            MacroStep(0.0, "MR 1"),
            MacroStep(0.0, '/wait "{{x}}"'),
            MacroStep(0.0, "PR P", "a", ("1",)),
            MacroStep(1.5, "PR V"),
        ),
        "F3",
        "note",
    )


def test_a_recording_takes_lines_and_events_only_until_it_is_stored() -> None:
    recorder = Recorder()
    assert recorder.record("before", 0.0, "a").line == "before"
    recorder.start("m", 1.0, b"old file", "2026-11-29")
    assert (recorder.name, recorder.before, recorder.offers) == ("m", b"old file", [])
    assert recorder.record("PR {x}", 2.0, "press:a").line == "PR {{x}}"
    recorder.observed.texts.append((2.0, "said"))
    with pytest.raises(Diagnostic, match="^the macro m is being recorded; stop that recording first$"):
        recorder.start("n", 3.0)
    assert recorder.macro() == Macro("m", (MacroStep(0.0, "PR {{x}}", "press:a"),), recorded="2026-11-29")
    recorder.discard()
    assert (recorder.name, recorder.before) == ("", None)
    with pytest.raises(Diagnostic, match="^no macro is being recorded; start one first$"):
        recorder.macro()
    recorder.start("n", 4.0)
    assert (recorder.before, list(recorder.observed.texts)) == (None, [])
    with pytest.raises(Diagnostic, match="^nothing was typed for the macro n; it is not stored; record it again$"):
        recorder.macro()
    recorder.start("again", 5.0)
    recorder.record("PR 1", 6.0)
    assert recorder.macro() == Macro("again", (MacroStep(0.0, "PR 1"),))


def test_lines_that_were_typed_in_one_moment_or_out_of_order_have_no_negative_pause() -> None:
    recorder = Recorder()
    recorder.start("m", 0.0)
    for at in (1.0, 1.0, 0.5, 2.0004, 2.0006):
        recorder.record("PR P", at)
    assert [step.after for step in recorder.macro().steps] == [0.0, 0.0, 0.0, 1.5, 0.001]
