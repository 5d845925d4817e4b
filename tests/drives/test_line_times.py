"""The times of a line: when a reply is over, when a request times out, and the order of the pieces of stops."""

from dataclasses import dataclass, replace
from typing import Any

import pytest

from multidrop.dialects import Decoded, End, Kind, Priority, Reply, Request, StopPiece
from multidrop.drives.events import Unsolicited
from multidrop.drives.inbox import LONGEST_WAIT_FOR_QUIET, TAIL
from multidrop.drives.line import (
    CHATTER,
    LONG_QUIET,
    LONGEST_LIST,
    MOST_HELD_UP_QUIETS,
    RECOVERY_QUIET,
    Finished,
    Flight,
    Line,
    Recovering,
    Write,
    divided,
    merged,
)
from multidrop.families.lexium.host.mcode.codec import MCode
from tests.drives.line_run import LineRun


@dataclass(frozen=True)
class Slow(MCode):
    """A toy language whose replies end with `;`, after this much quiet, or as a time-out."""

    patience: float = 0.2

    def encode(self, request: Request) -> bytes:
        return request.text.encode()

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        return self.patience

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        if b";" not in buffer:
            return None
        head, _, _ = buffer.partition(b";")
        return Decoded(Reply((head.decode(),), End.NAK if head == b"n" else End.DONE), len(head) + 1)

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        return Decoded(Reply(("quiet",)), len(buffer)) if buffer else None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        return Decoded(Reply(end=End.DAMAGED if buffer else End.TIMEOUT), len(buffer))

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        return False


def asked(text: str = "q", address: str = "a", kind: Kind = Kind.PRINT, patience: float = 0.2, **more: Any) -> Request:
    return Request(address, text, kind, Slow(patience=patience), **more)


@pytest.mark.parametrize(
    ("request_", "heard", "received_at", "default", "quiet", "timeout"),
    [
        (asked(), b"", 1.0, 1.0, 2.2, 3.0),
        (asked(), b"x\n", 5.0, 1.0, 5.2, 2.0 + CHATTER),
        (asked(), b"x\n", 2.5, 1.0, 2.7, 3.5),
        (asked(timeout=0.5), b"", 1.0, 1.0, 2.2, 2.5),
        (asked(timeout=0.1), b"", 1.0, 1.0, 2.2, 2.2),
        (asked(timeout=0.5), b"x\n", 9.0, 1.0, 9.2, 2.0 + CHATTER * 0.5),
        (asked(timeout=0.5), b"x", 4.0, 1.0, 4.2, 4.0 + TAIL),
        (asked(timeout=0.5), b"x", 9.0, 1.0, 9.2, 2.0 + CHATTER * 0.5 + LONGEST_WAIT_FOR_QUIET),
        (asked(kind=Kind.LIST), b"x\n", 70.0, 1.0, 70.2, 2.0 + LONGEST_LIST),
        (asked(kind=Kind.COMMAND), b"x\n", 5.0, 1.0, 3.0, 6.0),
        (asked(kind=Kind.COMMAND), b"", 1.0, 1.0, 2.2, 3.0),
        (asked(kind=Kind.COMMAND, patience=0.7), b"x\n", 5.0, 1.0, 3.4, 6.0),
        (asked(timeout=0.25, signed=True, expect="5"), b"", 1.0, 3.0, 4.2, 4.25),
        (asked(timeout=0.25, signed=True, expect="5"), b"5\n", 1.0, 3.0, 2.2, 4.25),
        (asked(timeout=0.25, signed=True), b"x\n", 1.0, 3.0, 2.2, 4.25),
        (asked(timeout=0.25, expect="5"), b"", 1.0, 3.0, 2.2, 2.25),
        (asked(signed=True, expect="5"), b"", 1.0, 3.0, 2.2, 5.0),
        (asked(timeout=0.25, signed=True, expect="5"), b"", 1.0, 0.5, 2.2, 2.25),
    ],
)
def test_the_times_of_a_request(request_, heard, received_at, default, quiet, timeout):
    """It left at 2.0."""
    flight = Flight(1, request_, 1.0, 2.0, received_at)
    assert flight.times(heard, default) == (pytest.approx(quiet), pytest.approx(timeout))
    assert flight.due == flight.times(b"other", 99.0)


# One after the other


def test_a_poll_that_was_passed_over_once_goes_first():
    line = Line(Slow())
    for text, priority in (("1", 0), ("2", 0), ("3", 0), ("p", 2), ("o", 2)):
        line.ask(asked(text, priority=Priority(priority)))
    run = LineRun(line, 1.0, {(n + 1) / 10: b"x;" for n in range(5)})
    assert [data for _, data in run.written] == [b"1", b"p", b"2", b"o", b"3"]


def test_without_a_poll_nothing_is_passed_over():
    line = Line(Slow())
    line.ask(asked("p", priority=Priority.POLL))
    line.ask(asked("o", priority=Priority.POLL))
    line.ask(asked("t", priority=Priority.TRANSFER))
    run = LineRun(line, 1.0, {0.1: b"x;", 0.2: b"x;", 0.3: b"x;"})
    assert [data for _, data in run.written] == [b"t", b"p", b"o"]


def test_a_drive_that_refused_by_nak_is_asked_before_another_one_after_a_pause():
    line = Line(Slow())
    line.ask(asked("1", "a"))
    line.events(0.0)
    for text, address in (("2", "b"), ("3", "a"), ("4", "c")):
        line.ask(asked(text, address))
    run = LineRun(line, 3.0, {0.1: b"n;", 0.5: b"x;", 0.6: b"x;", 0.7: b"x;"}, start=0.05)
    assert run.written == [(round(0.1 + RECOVERY_QUIET, 4), b"3"), (0.5, b"2"), (0.6, b"4")]


def test_a_nak_with_nothing_behind_it_needs_no_pause():
    line = Line(Slow())
    line.ask(asked("1", "a"))
    run = LineRun(line, 0.2, {0.1: b"n;"})
    line.ask(asked("2", "b"))
    assert [type(each) for each in line.events(0.2)] == [Write]
    assert run.finished == [("1", End.NAK, ("n",))]


def test_a_reply_has_its_bytes_its_time_and_whether_it_was_sent():
    line = Line(Slow(), baud=1000)
    ticket = line.ask(asked("qq"))
    line.events(1.0)
    line.receive(b"5;", 1.5)
    [done] = line.events(1.5)
    assert isinstance(done, Finished) and done.ticket == ticket
    assert done.reply == Reply(("5",), raw=b"5;", took=pytest.approx(0.48), at=1.5)
    assert done.transaction[2:] == (1.0, 1.5, 1.02, True)


def test_quiet_is_asked_about_once_for_the_same_bytes():
    line = Line(Slow())
    line.ask(asked())
    run = LineRun(line, 3.0, {0.1: b"x"})
    assert run.ended == [(0.3, "q", End.DONE, ("quiet",))]
    empty = Line(Slow())
    empty.ask(asked())
    assert LineRun(empty, 3.0).ended == [(1.0, "q", End.TIMEOUT, ())]


def test_after_trouble_the_line_waits_for_quiet():
    line = Line(Slow())
    line.ask(asked("1"))
    line.ask(asked("2"))
    run = LineRun(line, 2.0, {1.05: b"late"})
    assert run.written == [(0.0, b"1"), (round(1.05 + RECOVERY_QUIET, 4), b"2")]
    assert run.ended[0] == (1.0, "1", End.TIMEOUT, ())


def test_bytes_that_no_request_asked_for_are_counted():
    line = Line(Slow())
    assert (line.unasked, line.printed_at) == (0, float("-inf"))
    line.receive(b"a\r\n", 1.0)
    assert (line.unasked, line.printed_at) == (1, 1.0)
    line.ask(asked())
    line.events(2.0)
    line.receive(b"5;rest", 2.5)
    line.events(2.5)
    assert (line.unasked, line.printed_at) == (2, 2.0)


def test_a_request_that_is_withdrawn_is_not_written():
    line = Line(Slow())
    first, second = line.ask(asked("1")), line.ask(asked("2"))
    assert line.withdraw(second) and not line.withdraw(second)
    line.events(0.0)
    assert not line.withdraw(first) and line.waiting == []
    line.not_written(0.0)
    assert line.withdraw(first)


def test_a_write_that_the_transport_dropped_has_no_part_in_a_drive_and_its_request_times_out():
    line = Line(Slow(), baud=1000)
    line.ask(asked("long"))
    line.events(0.0)
    assert line.half_sent(0.0) and line.half_sent(0.039) and not line.half_sent(0.04)
    line.not_written(0.0)
    assert not line.half_sent(0.0)
    line.receive(b"5;", 0.5)
    assert line.events(0.5) == []
    assert line.deadline == pytest.approx(1.5)
    [done] = [each for each in line.events(1.5) if isinstance(each, Finished)]
    assert not done.transaction.sent and done.reply.end is End.TIMEOUT


def test_while_a_stop_of_another_thread_is_on_its_way_no_reply_is_taken():
    line = Line(Slow())
    line.ask(asked())
    line.events(0.0)
    line.overtaken = True
    line.receive(b"5;", 0.5)
    assert line.events(0.5) == []
    line.stop(0.6)
    assert not line.overtaken
    assert [each.reply.end for each in line.events(0.6) if isinstance(each, Finished)] == [End.STOPPED]


# Stops


def piece(name: str, quiet: float = 0.1) -> StopPiece:
    return StopPiece(name.encode(), quiet)


A, B, C, LATE, LATER = piece("A"), piece("B"), piece("C"), piece("L", 0.6), piece("M", 0.6)


@pytest.mark.parametrize(
    ("pieces", "before", "behind"),
    [
        ([], [], []),
        ([A, B], [A, B], []),
        ([A, LATE, B], [A], [LATE, B]),
        ([LATE], [], [LATE]),
        ([piece("x", LONG_QUIET), LATE], [piece("x", LONG_QUIET)], [LATE]),
    ],
)
def test_a_longer_quiet_divides_a_stop(pieces, before, behind):
    assert divided(pieces) == (before, behind)
    assert divided(tuple(pieces)) == (before, behind)


@pytest.mark.parametrize(
    ("pending", "added", "every", "some"),
    [
        ([], [A, LATE], [A, LATE], [A, LATE]),
        ([A], [B], [B], [A, B]),
        ([B, C], [A, B, C], [B, C, A], [B, C, A]),
        ([B, A, LATE], [A, B, LATE], [B, A, LATE], [B, A, LATE]),
        ([B, LATER], [A, LATE], [A, LATE], [B, A, LATER, LATE]),
        ([LATE], [A, LATE], [A, LATE], [A, LATE]),
        ([A, A], [A], [A], [A, A]),
    ],
)
def test_stops_go_round(pending, added, every, some):
    assert merged(pending, added) == every
    assert merged(pending, added, keep=True) == some


def test_a_stop_is_written_piece_by_piece_each_after_its_quiet():
    line = Line(Slow())
    line.stop(0.0, A, piece("", 0.1), piece("B", 0.3))
    assert line.stopping and line.owed_pieces() == [A, piece("B", 0.3)]
    run = LineRun(line, 2.0)
    assert run.written == [(0.1, b"A"), (0.4, b"B")]
    assert not line.stopping and line.last_write_was_stop


def test_a_piece_that_further_stops_keep_back_is_written_after_four_times_its_quiet():
    line, written = Line(Slow()), []
    line.stop(0.0, A, B)
    for tenth in range(1, 12):
        now = tenth * 0.05
        written += [(round(now, 2), each.data) for each in line.events(now) if isinstance(each, Write)]
        line.stop(now, A, B)
    assert written[0] == (round(MOST_HELD_UP_QUIETS * 0.1, 2), b"A")


@pytest.mark.parametrize(("only", "ended"), [(None, ["1", "2", "3"]), ({"a"}, ["1", "3"])])
def test_a_stop_fails_what_is_in_flight_and_what_waits_for_its_drives(only, ended):
    line = Line(Slow())
    for text, address in (("1", "b"), ("2", "b"), ("3", "a")):
        line.ask(asked(text, address))
    line.events(0.0)
    line.stop(0.5, only=only)
    found = [each for each in line.events(0.5) if isinstance(each, Finished)]
    assert [each.request.text for each in found] == ended
    assert [each.reply.end for each in found] == [End.STOPPED] * len(ended)
    assert [each.transaction.sent for each in found] == [True, *[False] * (len(ended) - 1)]
    assert found[-1].transaction[2:5] == (0.5, 0.5, 0.5)
    assert [each.text for each in line.waiting] == ([] if only is None else ["2"])


def test_what_another_thread_has_written_of_a_stop_is_not_written_again():
    line = Line(Slow())
    line.stop(0.0, A, B)
    line.stop(0.1, B, piece(""), since=0.2)
    assert line.owed_pieces() == [B]
    line.overtaken = True
    line.went_on([B], 0.5)
    assert not line.overtaken
    assert LineRun(line, 2.0, start=0.5).written == [(0.6, b"B")]


def test_a_piece_is_owed_until_the_transport_has_accepted_it():
    line = Line(Slow())
    line.stop(0.0, A, B)
    assert line.events(0.1) == [Write(b"A", None)]
    assert line.owed_pieces() == [A, B]
    line.put_back()
    assert line.owed_pieces() == [A, B]
    line.put_back()
    assert line.owed_pieces() == [A, B] and line.events(0.2) == [Write(b"A", None)]
    line.accepted()
    assert line.owed_pieces() == [B]
    line.put_first(C)
    assert line.owed_pieces() == [C, B] and line.take_repeats() == b"CB" and line.owed_pieces() == []


def test_a_wire_that_broke_forgets_what_waits_and_what_was_to_be_repeated():
    line = Line(Slow())
    line.stop(0.0, A, B)
    line.events(0.1)
    line.ask(asked())
    assert line.cut_off(0.2, begun=False) is None
    assert line.waiting == [] and line.owed_pieces() == [] and not line.last_write_was_stop and not line.half_sent(0.2)
    line.ask(asked("q"))
    line.events(1.0)
    line.receive(b"ha", 1.0)
    flight = line.cut_off(1.1, begun=True)
    assert flight is not None and flight.request.text == "q" and line.half_sent(1e9)
    assert line.inbox.buffer == b"" and not line.overtaken


def test_a_recovering_line_has_a_deadline_only_where_something_waits():
    line = Line(Slow())
    assert line.deadline is None
    line.stop(1.0)
    assert line.deadline is None
    line.ask(asked())
    assert line.deadline == 1.0 + RECOVERY_QUIET
    line.receive(b"x", 1.05)
    assert line.deadline == pytest.approx(1.05 + TAIL)
    line.events(1.1)
    assert line.deadline == pytest.approx(1.05 + RECOVERY_QUIET)
    assert Recovering(1.0).held_up_since == float("inf")


def test_unsolicited_lines_are_published_without_empty_ones():
    line = Line(MCode(em=1))
    line.receive(b"one\r\n\r\ntwo\r\n", 1.0)
    assert line.events(1.0) == [Unsolicited(1.0, ("one", "two"))]


def test_what_came_back_in_place_of_our_own_bytes_is_damage():
    line = Line(Slow(), local_echo=True)
    line.ask(asked("abc"))
    run = LineRun(line, 3.0, {0.1: b"axc5;"})
    [(at, _, end, _)] = run.ended
    assert (at, end) == (1.1, End.DAMAGED)
    [done] = [each for _, each in run.seen if isinstance(each, Finished)]
    assert done.reply.detail == "echo=local, but our own bytes came back as 'axc5;'"
    silent = Line(Slow(), local_echo=True)
    silent.ask(replace(asked("abc")))
    assert LineRun(silent, 3.0).ended == [(1.0, "abc", End.TIMEOUT, ())]
