import pytest

from dialects.errors import Diagnostic, Refused
from macros import Macro, Recorder, Step, play


class Clock:
    """Time that passes only where somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    async def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.now += seconds


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


async def test_steps_start_after_the_start_of_the_one_before_however_long_it_took() -> None:
    clock, ran = Clock(), []

    async def run(line: str) -> None:
        ran.append((round(clock.now - 100.0, 6), line))
        clock.now += float(line)

    steps = (Step(0.5, "0.25"), Step(1.0, "3"), Step(2.0, "0"), Step(0.0, "0"), Step(0.5, "0"))
    await play(Macro("m", steps), run, clock.sleep, {}, clock)
    assert ran == [(0.5, "0.25"), (1.5, "3"), (4.5, "0"), (4.5, "0"), (5.0, "0")]


async def test_the_first_failure_ends_it() -> None:
    ran = []

    async def run(line: str) -> None:
        ran.append(line)
        if line == "bad":
            raise Refused("b: error 24")

    with pytest.raises(Refused, match="error 24"):
        await play(Macro("m", (Step(0, "good"), Step(0, "bad"), Step(0, "never"))), run, Clock().sleep, {}, Clock())
    assert ran == ["good", "bad"]


@pytest.mark.parametrize(
    ("values", "says"),
    [({}, "step 2: no value for {FAR}"), ({"FAR": "1", "FRA": "2"}, "no line takes the value FRA; valid: FAR")],
)
async def test_values_that_do_not_fit_are_told_before_anything_is_run(values: dict[str, str], says: str) -> None:
    async def run(line: str) -> None:
        raise AssertionError(line)

    with pytest.raises(Diagnostic) as caught:
        await play(Macro("m", (Step(0, "MR 1"), Step(0, "MR {FAR}"))), run, Clock().sleep, values, Clock())
    assert says in str(caught.value)


async def test_what_was_recorded_is_played_as_typed() -> None:
    clock, ran = Clock(), []

    async def run(line: str) -> None:
        ran.append((line, clock.now))

    typed = [('PR "{x}"', 100.0), ("}{", 100.5), ("MR 1", 102.0)]
    await play(recorded(*typed), run, clock.sleep, {}, clock)
    assert ran == typed
