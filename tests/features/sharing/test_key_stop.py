"""The pieces of a stop that the thread of the keys writes: their order, their times, and who goes on with them."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import pytest

from multidrop.dialects import StopPiece
from multidrop.drives import pacing
from multidrop.features.sharing.key_stop import LOOK_PERIOD, KeyStop, pause
from multidrop.features.sharing.stop_bytes import StopBytes, stop_bytes

PIECES = (StopPiece(b"AAAA"), StopPiece(b"BB", 0.1), StopPiece(b"C", 0.5))
STOP = StopBytes(re.compile(b"AAAA"), False, b"~\r", own=PIECES)


class Port:
    """A port whose transport keeps what is written, and the clock of the thread."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.written = 100.0, list[bytes]()
        self.cut = self.leaving = False
        self.dropped = self.waiting = 0
        self.free, self.last = True, True
        """Whether the loop has not taken the port back; whether no other key has come."""
        self.due: list[tuple[float, Callable[[], None]]] = []
        monkeypatch.setattr(time, "monotonic", lambda: self.now)
        monkeypatch.setattr(pacing.PACER, "begin", lambda: None)
        monkeypatch.setattr(pacing.PACER, "after", self.after)
        self.key = KeyStop(STOP, lambda: self.cut, lambda: self.leaving)
        transport: Any = self
        self.key.transport = transport

    def after(self, owner: object, seconds: float, work: Callable[[], None]) -> None:
        assert owner is self.key
        self.due.append((round(seconds, 6), work))

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> None:
        assert whole is False
        self.written.append(make(self.dropped))

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        data = make(self.waiting) if self.free else None
        if data:
            self.written.append(data)
        return data is not None

    def yielded(self, note: Callable[[bool], None]) -> None:
        note(self.last)

    def go_on(self, later: float = 0.0) -> float:
        """Have the thread look again; return when it looks next, s from now; -1: it does not."""
        [(_, work)], self.due = self.due, []
        self.now += later
        work()
        return self.due[0][0] if self.due else -1.0


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    return Port(monkeypatch)


def test_the_pieces_are_written_at_their_times_and_none_while_bytes_wait(port: Port) -> None:
    port.key.press()
    assert port.written == [b"AAAA"] and port.due[0][0] == 0.1
    assert port.go_on(0.0999) == pytest.approx(0.0001)
    assert port.written == [b"AAAA"]
    port.waiting = 1
    assert port.go_on(0.0002) == LOOK_PERIOD and port.written == [b"AAAA"]
    port.waiting = 0
    assert port.go_on(LOOK_PERIOD) == 0.5 and port.written == [b"AAAA", b"BB"]
    assert port.go_on(0.5) == -1.0 and port.written == [b"AAAA", b"BB", b"C"]


def test_at_a_baud_rate_a_piece_and_its_reply_take_their_time() -> None:
    assert pause(PIECES[0], PIECES[1], 0) == 0.1
    assert pause(PIECES[0], PIECES[1], 1000) == pytest.approx(0.1 + 2 * 0.04)


def test_the_time_of_a_piece_counts_with_the_rate_of_the_port(port: Port) -> None:
    port.key.baud = 1000
    port.key.press()
    assert port.due[0][0] == pytest.approx(0.18)


@pytest.mark.parametrize(
    ("cut", "dropped", "first"), [(False, 0, b"AAAA"), (True, 0, b"~\rAAAA"), (False, 3, b"~\rAAAA")]
)
def test_a_line_that_may_be_cut_off_is_made_harmless_first(port: Port, cut: bool, dropped: int, first: bytes) -> None:
    port.cut, port.dropped = cut, dropped
    port.key.press()
    assert port.written == [first]
    taken = port.key.take()
    assert taken is not None and taken.dropped == dropped
    assert (taken.written, taken.left, taken.due) == ([PIECES[0]], [*PIECES[1:]], 100.1)


def test_what_two_keys_dropped_is_counted_together_and_the_second_begins_the_stop_anew(port: Port) -> None:
    port.dropped = 3
    port.key.press()
    port.go_on(0.1)
    port.due.clear()
    port.dropped = 4
    port.key.press()
    taken = port.key.take()
    assert taken is not None and taken.dropped == 7
    assert taken.written == [PIECES[0], PIECES[1], PIECES[0]] and taken.left == [*PIECES[1:]]


def test_a_key_while_a_stop_leaves_moves_it_on_and_cuts_nothing_off(port: Port) -> None:
    port.key.press()
    port.due.clear()
    port.leaving, port.cut = True, True
    port.key.press()
    assert port.written == [b"AAAA"], "the next piece is not due"
    port.now += 0.1
    port.due.clear()
    port.key.press()
    assert port.written == [b"AAAA", b"BB"]


def test_behind_a_stop_of_the_loop_a_key_writes_a_whole_one(port: Port) -> None:
    port.leaving = True
    port.key.press()
    assert port.written == [b"AAAA"] and port.due[0][0] == 0.1
    port.free = False
    assert port.go_on(0.1) == -1.0


def test_where_the_loop_has_the_port_a_key_takes_it(port: Port) -> None:
    port.leaving, port.free = True, False
    port.cut = True
    port.key.press()
    assert port.written == [b"~\rAAAA"]


def test_after_the_last_key_the_loop_goes_on_alone(port: Port) -> None:
    assert port.key.take() is None
    port.key.press()
    taken = port.key.take()
    assert taken is not None and taken.left == [*PIECES[1:]]
    assert port.go_on(0.1) == -1.0 and port.written == [b"AAAA"]
    assert port.key.take() is None


def test_while_another_key_is_on_its_way_the_thread_goes_on(port: Port) -> None:
    port.key.press()
    port.last = False
    taken = port.key.take()
    assert taken is not None and (taken.written, taken.left) == ([PIECES[0]], [])
    assert port.go_on(0.05) == pytest.approx(0.05) and port.go_on(0.05) == 0.5
    port.last = True
    taken = port.key.take()
    assert taken is not None and (taken.written, taken.left, taken.dropped) == ([PIECES[1]], [PIECES[2]], 0)


def test_what_was_begun_at_a_port_that_is_lost_is_forgotten(port: Port) -> None:
    port.key.press()
    port.key.forget()
    assert port.go_on(0.1) == -1.0 and port.written == [b"AAAA"]
    assert port.key.take() is None


@pytest.mark.parametrize(
    ("family", "drives", "party", "ends"),
    [
        ("", (), None, b"\r\n"),
        ("", ("a",), None, b"\r\n"),
        ("", ("a", "b"), None, b"\n"),
        ("", ("a",), True, b"\n"),
        ("", ("a",), False, b"\r"),
        ("pmx", ("00",), None, b"\r"),
        ("pmx", ("00",), True, b"\r"),
        ("pmx", ("00", "01"), None, b"\r"),
        ("tmcl", ("1",), None, b""),
    ],
)
def test_the_byte_that_ends_a_line_is_that_of_its_language_and_mode(
    family: str, drives: tuple[str, ...], party: bool | None, ends: bytes
) -> None:
    assert sorted(stop_bytes(family, drives, party).ends) == sorted(ends)
