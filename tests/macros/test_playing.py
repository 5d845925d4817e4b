import pytest

from multidrop.dialects.errors import Diagnostic
from multidrop.macros import Macro, Recorder, Step


def recorded(*kept: tuple[str, float], start: float = 0.0) -> Macro:
    recorder = Recorder()
    recorder.start("m", start)
    for line, at in kept:
        recorder.record(line, at)
    return recorder.macro()


def test_a_recording_begins_with_its_first_line_in_milliseconds() -> None:
    macro = recorded(("@b MR 1", 7.0), ("/wait stopped", 7.1234), ("PR P", 9.0), start=2.0)
    assert macro == Macro("m", (Step(0.0, "@b MR 1"), Step(0.123, "/wait stopped"), Step(1.877, "PR P")))


def test_rounding_does_not_add_up() -> None:
    macro = recorded(*((f"{n}", n * 0.0104) for n in range(1001)))
    assert sum(step.after for step in macro.steps) == pytest.approx(10.4, abs=0.001)


def test_nothing_is_kept_while_nothing_is_recorded() -> None:
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
