"""A stop key in another thread: whether it begins a stop or goes on with one, and when the next piece is looked at."""

from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.dialects import StopPiece
from multidrop.drives import pacing
from multidrop.drives.stop_ahead import RETRY_AFTER, BegunStop, StopAhead
from multidrop.drives.stop_forms import StopForms

FORMS = StopForms(b"STOP", b"ST", (StopPiece(b"x", 0.3),), b"~", True)


class Desk:
    """A link of which another thread writes the stop; its clock is at 5 s, and its transport writes at once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, preemptible: bool = True) -> None:
        self.calls: list[Any] = []
        self.time = 5.0
        self.waiting, self.last = 0, True
        """The bytes that the transport has not passed on; whether the last key is followed."""
        self.written: list[bytes] = []
        self.owed: list[StopPiece] = []
        self.transport = SimpleNamespace(
            preempt=self._preempt, follow=self._follow, yielded=lambda note: note(self.last), preemptible=preemptible
        )
        self.line: Any = SimpleNamespace(
            last_write_was_stop=False,
            stops_all=True,
            byte_time=0.0,
            transmitted_at=5.0,
            overtaken=False,
            owed_pieces=lambda: [*self.owed],
            half_sent=lambda now: False,
        )
        self.soon: list[Any] = []
        link: Any = SimpleNamespace(
            name="w", transport=self.transport, line=self.line, now=lambda: self.time, call_soon=self.soon.append
        )
        monkeypatch.setattr(pacing, "PACER", SimpleNamespace(begin=lambda: None, after=self._after))
        self.look: Any = None
        """What the pacer does at its time."""
        self.ahead = StopAhead(link, lambda: FORMS, lambda: None)

    def _after(self, owner: object, wait: float, work: Any) -> None:
        self.calls.append(("after", pytest.approx(wait)))
        self.look = work

    def _preempt(self, whole: bool, make: Any) -> bool:
        self.calls.append(("preempt", whole, self._write(make(0))))
        return True

    def _follow(self, make: Any, key: bool = False) -> bool:
        made = make(self.waiting)
        self.calls.append(("follow", key, self._write(made)))
        return made is not None

    def _write(self, data: bytes | None) -> bytes | None:
        self.written += [data] if data else []
        return data

    def did(self) -> list[Any]:
        """What was done since the last look."""
        calls, self.calls = self.calls, []
        return calls

    def taken(self) -> BegunStop:
        """What the loop takes over."""
        taken = self.ahead.take(True)
        assert taken is not None
        return taken


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


def test_the_first_key_begins_a_stop_and_the_next_one_goes_on_with_it(desk: Desk) -> None:
    desk.ahead.press()
    assert desk.did() == [("preempt", True, b"STOP"), ("after", 0.3)] and desk.line.overtaken
    desk.waiting = 1
    desk.ahead.press()
    assert desk.did() == [("follow", True, b""), ("after", 0.3)]


def test_a_key_goes_on_with_a_stop_of_the_loop_or_begins_a_new_one_once_that_is_over(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.owed, desk.waiting = True, [StopPiece(b"y", 0.2)], 1
    desk.ahead.press()
    assert desk.did()[0] == ("follow", True, b"")
    desk.taken()
    desk.owed, desk.waiting = [], 0
    desk.ahead.press()
    assert [each[0] for each in desk.did()] == ["follow", "preempt", "after"]


def test_a_key_begins_a_stop_behind_one_of_some_drives_and_in_its_own_order(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.line.stops_all, desk.owed = True, False, [StopPiece(b"y", 0.2), *FORMS.repeats]
    desk.ahead.press()
    assert desk.did() == [("preempt", True, b"STOP"), ("after", 0.3)]
    assert desk.taken().pieces == [*FORMS.repeats]


@pytest.mark.parametrize(("now", "first"), [(5.1, b"STOP"), (5.01, b"ST~STOP")])
def test_so_it_does_where_a_thread_has_gone_on_with_that_one(desk: Desk, now: float, first: bytes) -> None:
    """What is still leaving of it may be cut off."""
    desk.line.last_write_was_stop, desk.line.stops_all, desk.owed = (
        True,
        False,
        [StopPiece(b"y", 0.2), StopPiece(b"z", 0.2)],
    )
    desk.line.transmitted_at, desk.line.byte_time = 4.8, 0.05
    desk.ahead.watch(FORMS)
    desk.look()  # the loop is asked
    desk.look()
    assert desk.written == [b"y"]
    desk.time = now
    desk.did()
    desk.ahead.press()
    assert desk.did()[0] == ("preempt", True, first)
    taken = desk.taken()
    assert taken.pieces == [*FORMS.repeats] and [each for _, each in taken.written] == [b"y", first]


def test_a_piece_that_is_due_and_does_not_leave_is_tried_again_soon(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.line.transmitted_at, desk.owed = True, 4.8, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    assert desk.did() == [("after", RETRY_AFTER)]


@pytest.mark.parametrize(("last_write_was_stop", "owed"), [(False, True), (True, False)])
def test_nothing_is_looked_at_where_the_loop_has_written_all_or_something_else(
    desk: Desk, last_write_was_stop: bool, owed: bool
) -> None:
    desk.line.last_write_was_stop, desk.owed = last_write_was_stop, [StopPiece(b"y", 0.2)] if owed else []
    desk.ahead.watch(FORMS)
    assert desk.did() == []


def test_nor_on_a_transport_that_no_other_thread_may_write_to(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = Desk(monkeypatch, preemptible=False)
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    assert desk.did() == []


def test_the_loop_is_asked_for_a_sign_of_life_before_its_stop_is_taken_from_it(desk: Desk) -> None:
    desk.line.last_write_was_stop, desk.owed = True, [StopPiece(b"y", 0.2)]
    desk.ahead.watch(FORMS)
    desk.did()
    desk.look()
    assert desk.did() == [("follow", False, None), ("after", 0.2)]
    [alive] = desk.soon
    desk.look()
    assert [each[:2] for each in desk.did()[:2]] == [("follow", False), ("follow", True)] and desk.soon == [alive]
    alive()
    desk.look()
    assert [each[:2] for each in desk.did()] == [("follow", False), ("after", pytest.approx(0.2))]
    assert desk.soon == [alive] * 2 and desk.written == []


def test_the_next_piece_is_written_once_it_is_due_and_nothing_waits(desk: Desk) -> None:
    desk.ahead.press()
    for desk.time, desk.waiting, data in ((5.0, 0, b""), (5.0, 3, b""), (5.4, 3, b""), (5.4, 0, b"x"), (5.4, 3, b"")):
        desk.did()
        desk.look()
        assert desk.did()[0] == ("follow", False, data)
    desk.waiting = 0
    desk.look()
    assert desk.did() == [("follow", False, None)], "all is written, and the loop has not taken it over"
    taken = desk.taken()
    assert taken.written == [(5.0, b"STOP"), (5.4, b"x")] and taken.pieces == []


def held_up(desk: Desk) -> None:
    """The loop has begun a stop, was asked for a sign of life, and gives none."""
    desk.line.last_write_was_stop = True
    desk.ahead.watch(FORMS)
    desk.look()
    desk.did()


def test_a_piece_is_taken_back_from_a_loop_that_is_held_up(desk: Desk) -> None:
    desk.owed = [StopPiece(b"y", 0.2), StopPiece(b"z", 0.2)]
    held_up(desk)
    desk.look()
    assert desk.did()[:2] == [("follow", False, None), ("follow", True, None)] and not desk.line.overtaken
    desk.line.transmitted_at = 4.8
    desk.look()
    assert desk.did()[:2] == [("follow", False, None), ("follow", True, b"y")] and desk.line.overtaken
    taken = desk.taken()
    assert taken.pieces == [StopPiece(b"z", 0.2)] and taken.written == [(5.0, b"y")]


def test_where_bytes_wait_the_stop_is_taken_back_and_nothing_written(desk: Desk) -> None:
    desk.owed = [StopPiece(b"y", 0.2)]
    held_up(desk)
    desk.waiting = 3
    desk.look()
    assert desk.did()[1] == ("follow", True, b"") and desk.line.overtaken
    assert desk.taken().written == []


@pytest.mark.parametrize("last", [True, False])
def test_the_loop_takes_the_stop_over_after_the_last_key(desk: Desk, last: bool) -> None:
    desk.last = last
    assert desk.ahead.take(True) is None
    desk.ahead.press()
    taken = desk.taken()
    assert taken.data == b"STOP"
    assert (taken.pieces, taken.written) == (([*FORMS.repeats], [(5.0, b"STOP")]) if last else ([], []))
    assert (desk.ahead.take(False) is None) is last


def test_a_stop_that_follows_no_key_takes_nothing_over(desk: Desk) -> None:
    desk.ahead.press()
    taken = desk.ahead.take(False)
    assert taken is not None and taken.pieces == taken.written == [] and desk.taken().pieces == [*FORMS.repeats]
    desk.ahead.press()
    desk.ahead.forget()
    assert desk.ahead.take(False) is None


def test_a_key_that_goes_on_with_a_stop_keeps_all_of_its_own_pieces_and_none_that_are_no_longer_meant(
    desk: Desk,
) -> None:
    desk.line.last_write_was_stop, desk.line.transmitted_at = True, 4.0
    desk.owed = [StopPiece(b"gone", 0.2)]
    desk.ahead.press()
    first, *others = FORMS.pieces
    assert desk.written == [first.data]
    assert desk.taken().pieces == others
