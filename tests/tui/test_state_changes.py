"""What happens by itself is said in the transcript: limits, errors, ends of programs, silence."""

from dataclasses import replace

from multidrop.dialects.values import UNREAD, Conditions, Lamp
from multidrop.drives.events import Conditioned, Sample, Silent
from multidrop.shell.events import By, Entered, Failed, OnBus
from multidrop.tui.screen_model import ScreenModel

REST = Conditions(lamps=(Lamp("1", "home", False), Lamp("2", "lim+", False), Lamp("3", "", True)))
LIMIT = replace(REST, lamps=(Lamp("1", "home", True), Lamp("2", "lim+", True), Lamp("3", "", False)))
ERROR = replace(REST, error=UNREAD, error_text="PR ER shows and clears it")


def told(*events: object) -> list[tuple[str, str, str]]:
    """Mark, address and text of the records of some events of the drive b."""
    model = ScreenModel(lambda: "press", lambda: {"press"})
    for number, each in enumerate(events):
        at = float(number)
        if isinstance(each, Conditions):
            model.take(OnBus("press", Conditioned(at, "b", (each,))))
        elif isinstance(each, tuple):
            model.take(OnBus("press", Sample(at, "b", *each)))
        elif each == "silent":
            model.take(OnBus("press", Silent(at, "b")))
        elif each == "failed":
            model.take(Entered(at, "@b PR VX", By.OPERATOR, "press", "b"))
            model.take(Failed(at, "b: 20 unknown", "press", "b", code=20))
    return [(record.mark, record.address, record.text) for record in model.page("press")]


def test_a_limit_is_said_with_the_position_when_it_lights_and_not_while_it_stays() -> None:
    assert told((2_048_000, 0), REST, LIMIT, LIMIT) == [("!", "b", "limit+ reached at 2048000; it is at rest")]
    assert told((0, 500), REST, LIMIT) == [("!", "b", "limit+ reached at 0")]
    assert told(LIMIT) == [], "what was read first is a state, not an event"


def test_an_error_is_said_once_and_not_where_a_typed_line_has_failed() -> None:
    said = ("!", "b", "an error is set")
    assert told(REST, ERROR, ERROR, REST) == [said, (".", "b", "the error is cleared")]
    failed = told(REST, "failed", ERROR)
    assert [mark for mark, _, _ in failed] == [">", "x"]
    assert told(REST, "failed", REST, ERROR)[-1] == said, "that one came by itself"


def test_an_error_whose_cause_is_known_is_named_by_it() -> None:
    stalled = replace(ERROR, cause="stalled", error_text="stalled; PR ER shows and clears it")
    assert told(REST, stalled) == [("!", "b", "stalled")]


def test_a_change_that_is_read_late_has_two_times_and_no_place() -> None:
    model = ScreenModel(lambda: "press", lambda: {"press"}, between=lambda one, other: f" ({one:g} to {other:g})")
    for event in (
        Sample(0.0, "b", 500, 0),
        Conditioned(0.0, "b", (REST,)),
        Sample(20.0, "b", 90_000, 0),
        Conditioned(20.0, "b", (replace(LIMIT, error=UNREAD),)),
        Conditioned(21.0, "b", (replace(LIMIT, error=UNREAD, program="running"),)),
        Sample(30.0, "b", 90_000, 0, "", "limit+"),
    ):
        model.take(OnBus("press", event))
    assert [record.text for record in model.page("press")] == [
        "limit+ reached (0 to 20)",
        "an error is set (0 to 20)",
        "a program runs",
        "limit+ (20 to 30)",
    ]


def test_an_error_with_a_number_has_its_text() -> None:
    stalled = replace(REST, axis="x", error=8, error_text="StepNLoop stall")
    assert told(replace(REST, axis="x"), stalled) == [("!", "b", "x: error 8: StepNLoop stall")]


def test_the_beginning_and_the_end_of_a_program_are_said() -> None:
    runs = replace(REST, program="running")
    assert told(REST, runs, runs, REST) == [(".", "b", "a program runs"), (".", "b", "the program has ended")]
    assert told(replace(REST, program="G1"), REST) == [(".", "b", "the program G1 has ended")]


def test_an_alarm_among_the_values_of_a_family_is_said() -> None:
    lag, locked = (replace(REST, more=(("hMT", word),)) for word in ("lags", "locked rotor, active"))
    assert told(REST, lag, locked, locked) == [("!", "b", "hMT: locked rotor, active")]


def test_silence_and_its_end_are_said_once() -> None:
    assert told((0, 0), "silent", "silent", (0, 0), (0, 0)) == [
        ("!", "b", "no reply to polls"),
        (".", "b", "polls get a reply again"),
    ]


def test_the_trouble_of_an_axis_is_said_when_it_changes() -> None:
    troubled = (0, 0, "x", "limit+")
    said = told((0, 0, "x"), troubled, troubled, (0, 0, "x"))
    assert said == [("!", "b", "x: limit+"), (".", "b", "x: cleared: limit+")]


def test_the_number_of_an_error_leads_to_its_help() -> None:
    model = ScreenModel(lambda: "press", lambda: {"press"})
    model.take(Failed(1.0, "b: 20 unknown", "press", "b", code=20))
    assert model.page("press")[-1].help == "/help 20"
