"""The screen's memory: what it may claim of a drive, and the bytes of a bus that it keeps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from multidrop.dialects import End, Priority, Reply
from multidrop.dialects.values import Conditions
from multidrop.drives.events import (
    Conditioned,
    Ended,
    Rested,
    Sample,
    Sent,
    Silent,
    Traffic,
    Transaction,
    Unsolicited,
)
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.shell.events import (
    Agreed,
    By,
    Diverged,
    Entered,
    Failed,
    Notified,
    OnBus,
    Output,
    Predicted,
    Printed,
    Progressed,
    TwinEnded,
)
from multidrop.tui.panels.drive import program_words
from multidrop.tui.readout import Readout, ReadoutState
from multidrop.tui.screen_model import MOST_BYTES, MOST_PIECES, BusFacts, ScreenModel, TrafficStore, bus_old, bus_state


def sample(at: float, velocity: int, position: int = 0, address: str = "a", axis: str = "") -> OnBus:
    return OnBus("press", Sample(at, address, position, velocity, axis))


@pytest.fixture
def model() -> ScreenModel:
    return ScreenModel(lambda: "press", lambda: {"press", "eth"})


def readout(model: ScreenModel, address: str = "a") -> Readout:
    return model.bus("press").readout(address)


def test_stopped_is_said_only_when_the_velocity_was_read_as_0(model: ScreenModel) -> None:
    assert readout(model).state() is ReadoutState.UNKNOWN
    model.take(sample(1.0, 5000))
    model.take(Notified(1.1, "stop: stop sent to every drive", "press"))
    assert readout(model).state() is ReadoutState.MOVING
    model.take(sample(1.2, 0))
    assert readout(model).state() is ReadoutState.AT_REST


def test_progress_is_shown_until_its_end(model: ScreenModel) -> None:
    model.take(Progressed(1.0, "a: download", 1, 4))
    assert model.progress == "a: download: 1 of 4"
    model.take(Progressed(2.0, "a: download", 4, 4, 0.0))
    assert model.progress == ""


def test_an_old_state_stays_with_its_age_until_the_next_is_read(model: ScreenModel) -> None:
    readout(model).period = 1.0
    model.take(sample(1.0, 5000))
    assert readout(model).words(2.9) == "moving"
    assert readout(model).words(4.0) == "moving 3 s ago"
    assert bus_state(model.bus("press"), ["a"], False) is ReadoutState.MOVING and bus_old(
        model.bus("press"), ["a"], 4.0
    )
    model.take(sample(4.1, 0))
    assert readout(model).words(4.2) == "at rest"
    assert readout(model).words(14.0) == "at rest 10 s ago"
    assert not bus_old(model.bus("press"), ["a"], 4.2)


def test_a_stop_takes_no_state_away(model: ScreenModel) -> None:
    for address, velocity in (("a", 0), ("b", 700)):
        readout(model, address).period = 2.0
        model.take(sample(1.0, velocity, address=address))
    model.stopped(2.0)
    assert [readout(model, address).words(2.1) for address in "ab"] == ["at rest 1 s ago", "moving 1 s ago"]
    assert bus_state(model.bus("press"), ["a", "b"], False) is ReadoutState.MOVING


def test_a_drive_that_does_not_answer_is_silent_and_not_its_last_state(model: ScreenModel) -> None:
    model.take(sample(1.0, 0))
    model.take(OnBus("press", Silent(2.0, "a")))
    model.take(OnBus("press", Silent(3.0, "a")))
    assert readout(model).state() is ReadoutState.SILENT
    assert readout(model).words(4.0) == "silent 3 s"
    model.take(sample(4.0, 0))
    assert readout(model).state() is ReadoutState.AT_REST


def test_a_drive_in_program_mode_is_said_to_store(model: ScreenModel) -> None:
    model.take(sample(1.0, 0))
    assert readout(model).state(storing=True) is ReadoutState.STORING


def test_what_was_read_before_a_line_was_sent_is_old(model: ScreenModel) -> None:
    for address in "ab":
        readout(model, address).period = 2.0
        model.take(sample(1.0, 0, address=address))
    model.take(Entered(2.0, "@b MR 5", By.OPERATOR, "press", "b"))
    assert readout(model, "a").words(2.1) == "at rest"
    assert readout(model, "b").words(2.1) == "at rest 1 s ago"
    model.take(sample(2.2, 700, address="b"))
    assert readout(model, "b").words(2.3) == "moving"
    model.take(Entered(2.4, "@* SL 0", By.MACRO, "press", "*"))
    assert readout(model, "a").words(2.5) == "at rest 2 s ago"


def test_a_value_that_is_read_anew_ten_times_a_second_does_not_flicker_with_every_line(model: ScreenModel) -> None:
    readout(model).period = 0.1
    model.take(sample(1.0, 0))
    model.take(Entered(1.05, "PR P", By.OPERATOR, "press", "a"))
    assert readout(model).words(1.1) == "at rest"


def test_the_rate_is_counted_and_not_promised(model: ScreenModel) -> None:
    readout(model).period = 0.01
    for n in range(80):
        model.take(sample(n / 40, 1))
    assert readout(model).rate(2.0) == pytest.approx(40, abs=1)
    assert readout(model).rate(10.0) == 0


def test_samples_are_kept_for_the_plot_and_not_for_ever(model: ScreenModel) -> None:
    for n in range(1000):
        model.take(sample(n / 10, 1))
    assert 200 <= len(readout(model).points) < 250


def test_a_second_axis_does_not_mix_with_the_first(model: ScreenModel) -> None:
    model.take(sample(1.0, 0, 100, axis="x"))
    model.take(sample(1.0, 9, 999, axis="y"))
    last = readout(model).last
    assert last is not None
    assert (last.position, last.velocity) == (100, 0)


def test_what_is_said_becomes_records_of_its_bus(model: ScreenModel) -> None:
    for event in (
        Entered(1, "MR 1", By.OPERATOR, "eth", "a"),
        Entered(1, "MR 1", By.SCRIPT, "eth", "a"),
        Printed(2, "eth", "a", "384112"),
        OnBus("eth", Unsolicited(3, ("at home", "counted 12"))),
        Failed(4, "a: 20 unknown", "eth", "a"),
        Notified(5, "closed", "eth"),
        Notified(6, "stop", "eth", warning=True),
    ):
        model.take(event)
    assert [record.mark for record in model.bus("eth").fresh] == [">", "»", "", "<", "<", "x", ".", "!"]
    assert not model.bus("press").fresh


def test_what_belongs_to_no_bus_goes_to_the_one_that_is_shown(model: ScreenModel) -> None:
    model.take(Output(1, "a LMDCM"))
    assert model.bus("press").fresh[0].text == "a LMDCM"


def test_a_bus_is_idle_only_when_every_drive_was_read_as_still() -> None:
    facts = BusFacts()
    facts.readout("a").take(Sample(1.0, "a", 0, 0))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.UNKNOWN
    facts.readout("b").take(Sample(1.0, "b", 0, 0))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.AT_REST
    facts.readout("b").take(Sample(1.1, "b", 0, 7))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.MOVING
    assert bus_state(facts, ["a", "b"], True) is ReadoutState.LOST
    assert bus_state(facts, [], False) is ReadoutState.UNKNOWN


RUNS = Conditions(program="running", runs=True)


def test_a_line_is_not_idle_while_a_program_runs_in_a_drive_of_it() -> None:
    facts, both = BusFacts(), ["a", "b"]
    for address in both:
        facts.readout(address).take(Sample(1.0, address, 5, 0))
    facts.readout("b").condition(1.0, [RUNS])
    assert bus_state(facts, both, False) is ReadoutState.DWELL and not bus_old(facts, both, 1.1)
    assert bus_old(facts, both, 9.0), "the program was read long ago"
    facts.readout("b").take(Sample(9.0, "b", 5, 0))
    assert bus_state(facts, both, False) is ReadoutState.DWELL, "a poll of the motion says nothing of the program"
    facts.readout("b").condition(10.0, [Conditions(disabled="DE=0", runs=True, program="running")])
    assert bus_state(facts, both, False) is ReadoutState.DWELL
    facts.readout("b").condition(10.0, [Conditions(runs=False)])
    assert bus_state(facts, both, False) is ReadoutState.AT_REST


def test_a_line_is_not_idle_after_a_stop_before_each_drive_was_read(model: ScreenModel) -> None:
    for address in "ab":
        model.take(OnBus("press", Sample(1.0, address, 5, 0)))
    facts = model.bus("press")
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.AT_REST
    model.stopped(2.0)
    model.take(OnBus("press", Sample(2.1, "a", 5, 0)))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.UNKNOWN
    model.take(OnBus("press", Sample(2.2, "b", 5, 0)))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.AT_REST


def test_what_was_read_of_a_program_before_a_stop_is_past_until_the_stop_has_read_it(model: ScreenModel) -> None:
    for address in "ab":
        model.take(OnBus("press", Sample(1.0, address, 5, 0)))
        model.take(OnBus("press", Conditioned(1.0, address, (RUNS,))))
    facts = model.bus("press")
    a, b = facts.readout("a"), facts.readout("b")
    assert (a.state(), program_words(a, 2.0)) == (ReadoutState.DWELL, "program running")
    model.stopped(2.0)
    assert (a.state(), program_words(a, 4.0), a.aged(4.0)) == (ReadoutState.AT_REST, "program ran 3 s ago", True)
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.UNKNOWN
    stopped = Sample(3.0, "a", 5, 0, program=False)
    assert not model.quiet(OnBus("press", stopped))
    model.take(OnBus("press", stopped))
    model.take(OnBus("press", Sample(3.0, "b", 5, 0, program=True)))
    assert (a.state(), program_words(a, 4.0)) == (ReadoutState.AT_REST, "")
    assert (b.state(), program_words(b, 4.0)) == (ReadoutState.DWELL, "program running")
    assert model.quiet(OnBus("press", stopped._replace(at=4.0, program=None)))
    assert not model.quiet(OnBus("press", stopped._replace(at=4.0, program=True)))
    assert not model.quiet(OnBus("press", Conditioned(4.0, "b", (RUNS,)))), "the lamps are current again"


def test_a_line_with_an_error_shows_it_unless_a_drive_moves_or_is_silent() -> None:
    facts = BusFacts()
    for address in ("a", "b"):
        facts.readout(address).take(Sample(1.0, address, 5, 0))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.AT_REST
    facts.readout("b").condition(1.0, [Conditions(error=84)])
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.TROUBLE
    facts.readout("a").take(Sample(2.0, "a", 9, 100))
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.MOVING
    facts.readout("a").no_answer(3.0)
    assert bus_state(facts, ["a", "b"], False) is ReadoutState.SILENT


def test_only_what_shows_something_new_is_a_reason_to_paint(model: ScreenModel) -> None:
    screen = model
    at_rest, moving = Sample(1.0, "a", 5, 0), Sample(2.0, "a", 6, 7)
    assert not screen.quiet(OnBus("press", at_rest))
    screen.take(OnBus("press", at_rest))
    assert screen.quiet(OnBus("press", at_rest._replace(at=1.5)))
    assert screen.quiet(OnBus("press", Traffic(1.5, True, b"PR P\r")))
    assert not screen.quiet(OnBus("press", moving))
    assert not screen.quiet(OnBus("press", at_rest._replace(trouble="stalled")))
    assert not screen.quiet(OnBus("press", Unsolicited(1.5, ("tick",))))
    screen.take(Entered(1.6, "MR 5", By.OPERATOR, "press", "a"))
    assert not screen.quiet(OnBus("press", at_rest._replace(at=1.7))), "it is known to stand again"


def test_conditions_that_recur_are_not_a_reason_to_paint_unless_they_were_outdated(model: ScreenModel) -> None:
    read = Conditioned(1.0, "a", (Conditions("x"), Conditions("y")))
    assert not model.quiet(OnBus("press", read))
    model.take(OnBus("press", read))
    assert model.quiet(OnBus("press", read._replace(at=2.0)))
    assert not model.quiet(OnBus("press", read._replace(at=9.0)))
    assert not model.quiet(
        OnBus("press", read._replace(at=2.0, conditions=(Conditions("x"), Conditions("y", error=84))))
    )


def predicted(at: float, velocity: int, difference: int, axis: str = "") -> OnBus:
    return OnBus("press", Predicted(at, "a", 100, velocity, difference, axis))


def test_a_twin_is_beside_its_axis_until_it_ends(model: ScreenModel) -> None:
    for axis in "xy":
        model.take(sample(1.0, 0, 100, axis=axis))
    model.take(predicted(1.0, 0, 3, "y"))
    diverged = Diverged(1.0, "a", 300, 100, ("stall",), "y")
    model.take(OnBus("press", diverged))
    first, second = readout(model).axes
    assert first.twin is None and second.twin is not None
    assert second.twin.predicted is not None and second.twin.predicted.difference == 3
    assert second.twin.diverged == diverged
    model.take(OnBus("press", Agreed(2.0, "a", "y")))
    assert second.twin.diverged is None
    model.take(OnBus("press", TwinEnded(3.0, "a")))
    assert second.twin is None


def test_a_prediction_that_says_nothing_new_is_no_reason_to_paint(model: ScreenModel) -> None:
    assert not model.quiet(predicted(1.0, 0, 0))
    model.take(predicted(1.0, 0, 0))
    assert model.quiet(predicted(1.1, 0, 0))
    assert not model.quiet(predicted(1.1, 0, 1)) and not model.quiet(predicted(1.1, 5, 0))


# The bytes of a bus that are kept


def exchange(store: TrafficStore, out: bytes, back: bytes, priority: Priority) -> None:
    request = replace(MCode().request("b", "PR P"), priority=priority)
    store.take(Sent(1.0, request))
    store.take(Traffic(1.0, True, out))
    store.take(Traffic(1.1, False, back))
    store.take(Ended(1.2, Transaction(request, Reply(End.DONE), 1.0, 1.2, 1.0)))


def test_polls_and_lines_of_people_are_told_apart_with_their_drive() -> None:
    store = TrafficStore()
    exchange(store, b"bPR P\n", b"5\r\n", Priority.OPERATOR)
    exchange(store, b"bPR V\n", b"0\r\n", Priority.POLL)
    store.take(Traffic(2.0, False, b"at home\r\n"))
    assert [(each.outgoing, each.address, each.poll) for each in store.pieces] == [
        (True, "b", False),
        (False, "b", False),
        (True, "b", True),
        (False, "b", True),
        (False, "", False),
    ]


def test_a_stop_is_nobodys_request_and_never_a_poll() -> None:
    store = TrafficStore()
    store.take(Traffic(2.0, True, b"\x1b"))
    assert store.pieces[0].poll is False and store.pieces[0].address == ""


def test_single_bytes_of_a_slow_line_are_one_piece_up_to_its_end() -> None:
    store = TrafficStore()
    for number, each in enumerate(b"51200\r\n7\r\n"):
        store.take(Traffic(number * 0.001, False, bytes([each])))
    store.take(Traffic(0.5, False, b"late"))
    assert [(each.at, each.data) for each in store.pieces] == [(0.0, b"51200\r\n"), (0.007, b"7\r\n"), (0.5, b"late")]
    assert store.taken == 3


def test_what_is_kept_is_bounded_in_pieces_and_in_bytes() -> None:
    store = TrafficStore()
    for _ in range(MOST_PIECES + 10):
        store.take(Traffic(1.0, True, b"x"))
    assert len(store.pieces) == MOST_PIECES and store.taken == MOST_PIECES + 10
    for _ in range(40):
        store.take(Traffic(1.0, False, b"y" * (MOST_BYTES // 8)))
    store.take(Traffic(1.0, False, b"z" * (2 * MOST_BYTES)))
    assert sum(len(each.data) for each in store.pieces) <= MOST_BYTES


def test_other_events_are_left_to_others() -> None:
    assert TrafficStore().take(Sample(1.0, "b", 0, 0)) is False


def test_the_gutter_has_the_name_that_a_person_gave_and_a_failure_does_not_repeat_it() -> None:
    named = {("press", "a"): "gantry"}
    model = ScreenModel(lambda: "press", lambda: {"press"}, named=lambda bus, address: named.get((bus, address), ""))
    model.take(Failed(1.0, "gantry refused 'VM=-1': error 21", "press", "a"))
    model.take(Failed(1.1, "press:gantry refused 'XX'", "press", "a"))
    model.take(Failed(1.2, "b refused 'XX'", "press", "b"))
    model.take(Failed(1.3, "a stop came before 'MR 1' was sent", "press", "a"))
    model.take(Failed(1.3, "press:a: no reply", "press", "a"))
    model.take(Printed(1.4, "press", "a", "0"))
    assert [(each.address, each.name, each.text) for each in model.bus("press").fresh] == [
        ("a", "gantry", "refused 'VM=-1': error 21"),
        ("a", "gantry", "refused 'XX'"),
        ("b", "", "refused 'XX'"),
        ("a", "gantry", "a stop came before 'MR 1' was sent"),
        ("a", "gantry", "no reply"),
        ("a", "gantry", "0"),
    ]


def rested(at: float, name: str, *places: tuple[str, int], stop: int = 0, drives: int = 3) -> Notified:
    text = f"press: {name}: stopped, velocity 0 at {places}"
    return Notified(at, text, "press", address=name, rested=Rested(stop, drives, name, places))


def test_the_drives_of_one_stop_are_one_record_with_the_place_of_each(model: ScreenModel) -> None:
    model.take(rested(1.0, "a", ("", 5)))
    model.take(rested(1.1, "b", ("x", 6), ("y", -7)))
    (record,) = model.bus("press").fresh
    assert record.text == "press: 2 of 3 at rest   a 5   b x 6, y -7"
    assert record.details == ("a 5", "b x 6, y -7")
    model.bus("press").fresh.clear()  # a transcript has taken it
    model.take(rested(1.2, "c", ("", 8)))
    (later,) = model.bus("press").fresh
    assert later.joins == record.joins and later.text.startswith("press: 3 of 3 at rest")


def test_a_later_stop_is_a_record_of_its_own_and_a_stop_of_one_drive_keeps_its_words(model: ScreenModel) -> None:
    model.take(rested(1.0, "a", ("", 5)))
    model.take(rested(2.0, "a", ("", 5), stop=1))
    model.take(rested(3.0, "a", ("", 5), stop=2, drives=1))
    texts = [record.text for record in model.bus("press").fresh]
    assert texts == ["press: 1 of 3 at rest   a 5"] * 2 + ["press: a: stopped, velocity 0 at (('', 5),)"]
