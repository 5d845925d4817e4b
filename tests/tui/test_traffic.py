"""The bytes of a bus that the screen keeps: whose they are, which are polls, and how many there may be."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects import End, Priority, Reply
from multidrop.dialects.mcode.host.codec import MCode
from multidrop.drives.events import Ended, Sample, Sent, Traffic, Transaction
from multidrop.tui.screen_model import MOST, MOST_BYTES, TrafficStore


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
    for _ in range(MOST + 10):
        store.take(Traffic(1.0, True, b"x"))
    assert len(store.pieces) == MOST and store.taken == MOST + 10
    for _ in range(40):
        store.take(Traffic(1.0, False, b"y" * (MOST_BYTES // 8)))
    store.take(Traffic(1.0, False, b"z" * (2 * MOST_BYTES)))
    assert sum(len(each.data) for each in store.pieces) <= MOST_BYTES


def test_other_events_are_left_to_others() -> None:
    assert TrafficStore().take(Sample(1.0, "b", 0, 0)) is False
