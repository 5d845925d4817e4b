"""Where messages carry their length: nothing in either direction is cut, whatever is stopped or late."""

from dataclasses import dataclass, replace

from dialects import Decoded, End, Kind, Reply, Request
from dialects.mcode.dialect import MCode
from drives.line import QUIET, TAIL, Finished, Line, Stray, Write


@dataclass(frozen=True)
class Lengths(MCode):
    """A toy language: a byte of length, then so many bytes; the first of them is the request's tag."""

    framed = True

    def encode(self, request):
        return bytes((2, request.tag)) + b"?"

    def decode(self, request, buffer):
        used = 0
        while len(buffer) > used and len(buffer) >= used + 1 + buffer[used]:
            body = buffer[used + 1 : used + 1 + buffer[used]]
            used += 1 + len(body)
            if body[0] == request.tag:
                return Decoded(Reply((body[1:].decode(),)), used)
        return None

    def settled(self, request, buffer):
        return None

    def overdue(self, request, buffer):
        return Decoded(Reply(end=End.TIMEOUT), 0)

    def idle(self, buffer):
        used = 0
        while len(buffer) > used and len(buffer) >= used + 1 + buffer[used]:
            used += 1 + buffer[used]
        return (), used


def asked(text="x"):
    return Request("", text, Kind.PRINT, Lengths())


def ended(events):
    return [(e.request.text, e.reply.end, e.reply.lines) for e in events if isinstance(e, Finished)]


def test_every_request_is_written_with_a_number_of_its_own():
    line = Line(Lengths())
    line.ask(asked("a"))
    line.ask(asked("b"))
    first = line.events(0.0)
    line.receive(bytes((2, 1)) + b"A", 0.1)
    second = line.events(0.1)
    assert [e.data for e in first + second if isinstance(e, Write)] == [b"\x02\x01?", b"\x02\x02?"]
    assert ended(second) == [("a", End.DONE, ("A",))]


def test_a_late_answer_that_comes_in_two_halves_around_a_timeout_does_not_derail_the_next_one():
    line = Line(Lengths(), timeout=1.0)
    line.ask(asked("late"))
    line.events(0.0)
    line.receive(b"\x02", 0.9)
    assert ended(line.events(1.9)) == [("late", End.TIMEOUT, ())]
    line.ask(asked("next"))
    line.events(1.9 + QUIET)
    line.receive(b"\x01L" + bytes((2, 2)) + b"N", 2.1)
    assert ended(line.events(2.1)) == [("next", End.DONE, ("N",))]


def test_half_an_answer_that_nobody_waits_for_is_no_line_and_is_kept():
    line = Line(Lengths())
    line.receive(b"\x02", 0.0)
    assert line.events(TAIL * 2) == [] and line.deadline is None
    line.receive(b"\x09L", 0.2)
    assert line.events(0.2) == []
    line.ask(asked())
    line.events(0.3)
    line.receive(bytes((2, 1)) + b"A", 0.3)
    assert ended(line.events(0.3)) == [("x", End.DONE, ("A",))]


def test_a_stop_in_the_middle_of_an_answer_keeps_its_first_half():
    line = Line(Lengths())
    line.ask(asked())
    line.events(0.0)
    line.receive(b"\x02\x01", 0.1)
    line.stop(0.1, b"S")
    assert ended(line.events(0.1)) == [("x", End.STOPPED, ())]
    line.receive(b"L", 0.15)
    line.ask(asked("next"))
    events = line.events(0.15 + QUIET) + line.events(0.15 + 2 * QUIET)
    assert [e.data for e in events if isinstance(e, Write)] == [b"S", b"\x02\x02?"]
    line.receive(bytes((2, 2)) + b"N", 0.5)
    assert ended(line.events(0.5)) == [("next", End.DONE, ("N",))]


def test_a_stop_is_repeated_piece_by_piece_with_quiet_between():
    line = Line(MCode())
    line.stop(0.0, b"one", b"", b"two")
    seen = []
    for step in range(1, 100):
        seen += [(step, e.data) for e in line.events(step / 100) if isinstance(e, Write)]
    assert [data for _, data in seen] == [b"one", b"two"]
    assert seen[0][0] >= QUIET * 100 and seen[1][0] - seen[0][0] >= QUIET * 100


def test_other_languages_still_show_half_a_line_and_forget_it():
    line = Line(replace(MCode(), em=1))
    line.receive(b"half", 0.0)
    assert line.events(TAIL * 2) == [Stray("half")]
