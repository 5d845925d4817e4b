"""A stop key in another thread: whether it begins a stop or goes on with one, and when the next piece is looked at."""

from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.dialects import StopPiece
from multidrop.drives import pacing
from multidrop.drives.stop_ahead import RETRY_AFTER, StopAhead
from multidrop.drives.stop_forms import StopForms

FORMS = StopForms(b"STOP", b"ST", (StopPiece(b"x", 0.3),), b"~", True)


class Desk:
    """A link of which another thread writes the stop; its clock is at 5 s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, preemptible: bool = True, follows: bool = True) -> None:
        self.calls: list[Any] = []
        self.follows = follows
        self.owed: list[StopPiece] = []
        transport = SimpleNamespace(preempt=self._preempt, follow=self._follow, preemptible=preemptible)
        self.line: Any = SimpleNamespace(
            last_write_was_stop=False,
            stops_all=True,
            byte_time=0.0,
            transmitted_at=5.0,
            owed_pieces=lambda: [*self.owed],
            half_sent=lambda now: False,
        )
        self.soon: list[Any] = []
        link: Any = SimpleNamespace(
            name="w", transport=transport, line=self.line, now=lambda: 5.0, call_soon=self.soon.append
        )
        pacer = SimpleNamespace(begin=lambda: None, after=lambda owner, wait, work: self.calls.append(("after", wait)))
        monkeypatch.setattr(pacing, "PACER", pacer)
        self.ahead = StopAhead(link, lambda: FORMS, lambda: None)

    def _preempt(self, whole: bool, make: Any) -> bool:
        self.calls.append(("preempt", whole, make(0)))
        return True

    def _follow(self, make: Any, key: bool = False) -> bool:
        self.calls.append(("follow", key))
        return self.follows


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


def test_the_first_key_begins_a_stop_and_the_next_one_goes_on_with_it(desk: Desk) -> None:
    desk.ahead.press()
    assert desk.calls == [("preempt", True, b"STOP"), ("after", pytest.approx(0.3))] and desk.line.overtaken
    desk.calls.clear()
    desk.ahead.press()
    assert desk.calls == [("follow", True), ("after", pytest.approx(0.3))]


def test_a_key_goes_on_with_a_stop_of_the_loop_or_begins_a_new_one_once_that_is_over(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2)]
    desk.ahead.press()
    assert desk.calls == [("follow", True), ("after", pytest.approx(0.2))]
    desk.calls.clear()
    desk.follows = False
    desk.ahead.press()
    assert [each[0] for each in desk.calls] == ["follow", "preempt", "after"]


def test_a_key_begins_a_stop_behind_one_of_some_drives_and_in_its_own_order(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.line.stops_all, desk.owed = True, False, [StopPiece(b"y", 0.2), *FORMS.repeats]
    desk.ahead.press()
    assert desk.calls == [("preempt", True, b"STOP"), ("after", pytest.approx(0.3))]
    assert desk.ahead._begun is not None and desk.ahead._begun.pieces == [*FORMS.repeats]


@pytest.mark.parametrize(("left", "first"), [(4.9, b"STOP"), (5.1, b"ST~STOP")])
def test_so_it_does_where_a_thread_has_gone_on_with_that_one(desk: Desk, left: float, first: bytes) -> None:
    """What is still leaving of it may be cut off."""
    desk.line.last_write_was_stop, desk.line.stops_all, desk.owed = (
        True,
        False,
        [StopPiece(b"y", 0.2), StopPiece(b"z", 0.2)],
    )
    desk.line.transmitted_at = 4.8
    desk.ahead.watch(FORMS)
    assert desk.ahead._take_back(0) == b"y" and desk.ahead._begun is not None
    desk.ahead._begun.left = left
    desk.calls.clear()
    desk.ahead.press()
    assert desk.calls[0] == ("preempt", True, first)
    assert desk.ahead._begun.pieces == [*FORMS.repeats] and [each for _, each in desk.ahead._begun.written] == [
        b"y",
        first,
    ]


def test_a_piece_that_is_due_and_does_not_leave_is_tried_again_soon(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.line.transmitted_at, desk.owed = True, 4.8, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    assert desk.calls == [("after", RETRY_AFTER)]


@pytest.mark.parametrize(("last_write_was_stop", "owed"), [(False, True), (True, False)])
def test_nothing_is_looked_at_where_the_loop_has_written_all_or_something_else(
    desk: Desk, last_write_was_stop: bool, owed: bool
) -> None:
    desk.line.last_write_was_stop, desk.owed = last_write_was_stop, [StopPiece(b"y", 0.2)] if owed else []
    desk.ahead.watch(FORMS)
    assert desk.calls == []


def test_nor_on_a_transport_that_no_other_thread_may_write_to(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = Desk(monkeypatch, preemptible=False)
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    assert desk.calls == []


def test_the_loop_is_asked_for_a_sign_of_life_before_its_stop_is_taken_from_it(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.owed, desk.follows = True, [StopPiece(b"y", 0.2)], False
    desk.ahead.watch(FORMS)
    desk.calls.clear()
    desk.ahead._go_on()
    assert desk.calls == [("follow", False), ("after", pytest.approx(0.2))] and desk.soon == [desk.ahead._lives]
    desk.calls.clear()
    desk.ahead._go_on()
    assert [each[:2] for each in desk.calls[:2]] == [("follow", False), ("follow", True)] and len(desk.soon) == 1
    desk.ahead._lives()
    desk.calls.clear()
    desk.ahead._go_on()
    assert desk.calls[:1] == [("follow", False)] and desk.soon == [desk.ahead._lives] * 2


def test_the_next_piece_is_written_once_it_is_due_and_nothing_waits(desk: Desk) -> None:
    ahead = desk.ahead
    assert ahead._next(0) is None
    ahead.press()
    begun = ahead._begun
    assert begun is not None and ahead._next(0) == ahead._next(3) == b""
    begun.left = 4.7
    assert ahead._next(3) == b"" and ahead._next(0) == b"x"
    assert begun.written == [(5.0, b"STOP"), (5.0, b"x")] and begun.pieces == []
    assert ahead._next(3) == b"" and ahead._next(0) is None


def test_a_piece_is_taken_back_from_a_loop_that_is_held_up(desk: Desk) -> None:
    ahead = desk.ahead
    assert ahead._take_back(0) is None
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2), StopPiece(b"z", 0.2)]
    ahead.watch(FORMS)
    assert ahead._take_back(0) is None and not hasattr(desk.line, "overtaken")
    desk.line.transmitted_at = 4.8
    assert ahead._take_back(0) == b"y" and desk.line.overtaken
    begun = ahead._begun
    assert begun is not None and begun.pieces == [StopPiece(b"z", 0.2)] and begun.written == [(5.0, b"y")]
    assert ahead._take_back(0) is None


def test_where_bytes_wait_the_stop_is_taken_back_and_nothing_written(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    assert desk.ahead._take_back(3) == b"" and desk.line.overtaken
    assert desk.ahead._begun is not None and desk.ahead._begun.written == []


@pytest.mark.parametrize("last", [True, False])
def test_the_loop_takes_the_stop_over_after_the_last_key(desk: Desk, last: bool) -> None:
    desk.ahead._link.transport.yielded = lambda note: note(last)  # type: ignore[method-assign]
    assert desk.ahead.take(True) is None
    desk.ahead.press()
    begun = desk.ahead._begun
    assert begun is not None
    taken = desk.ahead.take(True)
    assert taken is not None and taken.data == b"STOP"
    assert (taken.pieces, taken.written) == ((begun.pieces, begun.written) if last else ([], []))
    assert desk.ahead._begun is (None if last else begun)


def test_a_stop_that_follows_no_key_takes_nothing_over(desk: Desk) -> None:
    desk.ahead.press()
    begun, taken = desk.ahead._begun, desk.ahead.take(False)
    assert taken is not None and taken.pieces == taken.written == [] and desk.ahead._begun is begun
    desk.ahead.forget()
    assert desk.ahead.take(False) is None


def test_a_key_that_goes_on_with_a_stop_keeps_all_of_its_own_pieces_and_none_that_are_no_longer_meant(
    desk: Desk,
) -> None:
    made: list[Any] = []

    def follow(make: Any, key: bool = False) -> bool:
        made.append(make(0))
        return True

    desk.ahead._link.transport.follow = follow  # type: ignore[method-assign]
    desk.line.last_write_was_stop, desk.line.transmitted_at = True, 4.0
    desk.owed = [StopPiece(b"gone", 0.2)]
    desk.ahead.press()
    first, *others = FORMS.pieces
    assert made == [first.data]
    assert desk.ahead._begun is not None and desk.ahead._begun.pieces == others
