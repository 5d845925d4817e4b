"""Where messages have a length: nothing in either direction is cut, whatever is stopped or late, numbered or not."""

from dataclasses import dataclass, replace

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.dialects import Decoded, DriveState, End, Kind, Reply, Request, StopPiece
from multidrop.drives.events import Unsolicited
from multidrop.drives.inbox import TAIL
from multidrop.drives.line import RECOVERY_QUIET, Finished, Line, Write
from multidrop.families.lexium.host.mcode.codec import MCode
from tests.support.procedure import ProcedureRunner


@dataclass(frozen=True)
class Lengths(MCode):
    """A toy language: a byte of length, then so many bytes; the first of them is the request's tag."""

    framed = numbered = True

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

    def on_quiet(self, request, buffer):
        return None

    def on_timeout(self, request, buffer):
        return Decoded(Reply(end=End.TIMEOUT), 0)

    def parse_unsolicited(self, buffer):
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
    line.events(1.9 + RECOVERY_QUIET)
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
    line.stop(0.1, StopPiece(b"S"))
    assert ended(line.events(0.1)) == [("x", End.STOPPED, ())]
    line.receive(b"L", 0.15)
    line.ask(asked("next"))
    events = line.events(0.15 + RECOVERY_QUIET) + line.events(0.15 + 2 * RECOVERY_QUIET)
    assert [e.data for e in events if isinstance(e, Write)] == [b"S", b"\x02\x02?"]
    line.receive(bytes((2, 2)) + b"N", 0.5)
    assert ended(line.events(0.5)) == [("next", End.DONE, ("N",))]


def test_a_stop_is_repeated_piece_by_piece_with_quiet_between():
    line = Line(MCode())
    line.stop(0.0, StopPiece(b"one"), StopPiece(b""), StopPiece(b"two"))
    seen = []
    for step in range(1, 100):
        seen += [(step, e.data) for e in line.events(step / 100) if isinstance(e, Write)]
    assert [data for _, data in seen] == [b"one", b"two"]
    assert seen[0][0] >= RECOVERY_QUIET * 100 and seen[1][0] - seen[0][0] >= RECOVERY_QUIET * 100


def test_other_languages_still_show_half_a_line_and_forget_it():
    line = Line(replace(MCode(), em=1))
    line.receive(b"half", 0.0)
    assert line.events(TAIL * 2) == [Unsolicited(TAIL * 2, ("half",))]


# --- framed, and not numbered: nine bytes each way, found by counting, with a sum at their end


@dataclass(frozen=True)
class Nines(Lengths):
    """Another toy: what is asked for comes back, and a value. Neither direction has a start mark or a number."""

    numbered = False

    def encode(self, request):
        return nine(request.address, request.text)

    def decode(self, request, buffer):
        if len(buffer) < 9:
            return None
        if sum(buffer[:8]) % 256 != buffer[8] or buffer[1:2] != request.text.encode():
            return Decoded(Reply(end=End.DAMAGED), 9)
        return Decoded(Reply((str(int.from_bytes(buffer[4:8])),), acknowledged=True), 9)

    def on_timeout(self, request, buffer):
        return Decoded(Reply(end=End.DAMAGED if buffer else End.TIMEOUT), 0)

    def parse_unsolicited(self, buffer):
        used = len(buffer) // 9 * 9
        return tuple(buffer[n : n + 9].hex(" ") for n in range(0, used, 9)), used

    def read(self, state, text):
        """A value; what only reads may be asked once more after what came was no answer. Raises NoAnswer."""
        asked = Request(state.address, text, Kind.PRINT if text == "G" else Kind.COMMAND, self)
        for _ in range(2 if asked.kind is Kind.PRINT else 1):
            reply = yield asked
            if reply.end is End.DONE and not reply.doubtful:
                return reply.text
        raise NoAnswer(f"{text}: {reply.end.value}")


def nine(address: str, text: str, value: int = 0) -> bytes:
    frame = address.encode() + text.encode() + b"\0\0" + value.to_bytes(4)
    return frame + bytes([sum(frame) % 256])


class Host:
    """A conversation in that language on a line in memory."""

    def __init__(self):
        self.line, self.now, self.events, self.procedure = Line(Nines(), timeout=1.0), 0.0, [], None

    def ask(self, text, address="\1"):
        self.procedure = ProcedureRunner(Nines().read(DriveState(Nines(), address), text))
        self.line.ask(self.procedure.request)
        self.look()

    def look(self):
        for event in self.line.events(self.now):
            self.events.append(event)
            if isinstance(event, Finished) and self.procedure is not None:
                self.procedure.answer(event.reply)
                if self.procedure.request is not None:
                    self.line.ask(self.procedure.request)
                    self.look()

    def hear(self, *pieces):
        for piece in pieces:
            self.now += 0.001
            self.line.receive(piece, self.now)
            self.look()

    def wait(self, seconds):
        until = self.now + seconds
        while (due := self.line.deadline) is not None and due <= until:
            self.now = due
            self.look()
        self.now = until
        self.look()

    @property
    def written(self):
        return [event.data for event in self.events if isinstance(event, Write)]

    @property
    def replies(self):
        return [(e.reply.end, e.reply.lines, e.reply.doubtful) for e in self.events if isinstance(e, Finished)]

    @property
    def strays(self):
        return [text for event in self.events if isinstance(event, Unsolicited) for text in event.lines]


@pytest.mark.parametrize("size", range(1, 10))
def test_a_frame_is_found_by_counting_however_it_comes(size):
    host, data = Host(), nine("\2", "G", 5)
    host.ask("G")
    host.hear(*[data[n : n + size] for n in range(0, 9, size)])
    assert host.procedure.result == "5" and host.written == [nine("\1", "G")]


def test_a_late_reply_is_not_taken_for_the_next_ones_where_nothing_is_numbered():
    host = Host()
    host.ask("M")
    with pytest.raises(NoAnswer, match="no reply"):
        host.wait(1.5)
    host.ask("G")
    host.wait(0.2)
    host.hear(nine("\2", "G", 77))  # of an earlier G, as far as anybody can tell
    assert host.replies[-1] == (End.DONE, ("77",), True) and len(host.written) == 3  # asked once more: it only reads
    with pytest.raises(NoAnswer):
        host.hear(nine("\2", "G", 5))  # which may be the one to its own first question


@pytest.mark.parametrize("lost", range(9))
@pytest.mark.parametrize("text", ["G", "M"])
def test_after_a_lost_byte_only_a_pause_resynchronises_and_what_is_safe_is_asked_again(text, lost):
    host, data = Host(), nine("\2", text, 0x01020304)
    host.ask(text)
    host.hear(data[:lost] + data[lost + 1 :])
    if text == "M":
        with pytest.raises(NoAnswer, match="damaged"):
            host.wait(1.5)
        assert len(host.written) == 1
        return
    host.wait(1.5)
    assert host.replies == [(End.DAMAGED, (), False)] and len(host.written) == 2
    assert host.line.inbox.buffer == b""


def test_a_numbered_language_has_no_doubt_and_keeps_what_is_left():
    line = Line(Lengths())
    line.receive(b"\x02", 0.0)
    line.events(1.0)
    assert line.inbox.buffer == b"\x02" and line.deadline is None
    line.ask(asked("late"))
    line.events(1.0)
    while line.deadline is not None:
        line.events(line.deadline)
    line.ask(asked("next"))
    line.events(9.0)
    line.receive(b"\x01L" + bytes((2, 2)) + b"N", 9.1)
    [done] = [e for e in line.events(9.1) if isinstance(e, Finished)]
    assert done.reply.lines == ("N",) and not done.reply.doubtful


def test_noise_in_front_of_a_frame_is_dropped_after_a_pause_and_shown():
    host = Host()
    host.line.receive(b"\xaa\xbb", 0.0)
    host.look()
    host.ask("G")
    assert host.written == []  # it may be the head of a frame that is under way
    host.wait(TAIL * 2)
    assert host.strays == ["aa bb"] and host.written == [nine("\1", "G")]
    host.hear(nine("\2", "G", 5))
    assert host.procedure.result == "5"


@pytest.mark.parametrize("came", range(9))
def test_a_stop_within_a_reply_forgets_no_half_of_it(came):
    host, data = Host(), nine("\2", "G", 5)
    host.procedure = None
    host.line.ask(Request("\1", "G", Kind.PRINT, Nines()))
    host.look()
    host.hear(data[:came])
    host.line.stop(host.now, StopPiece(b"S"))
    host.look()
    host.hear(data[came:])
    host.wait(2 * RECOVERY_QUIET)
    assert [reply[0] for reply in host.replies] == [End.STOPPED]
    assert host.strays in ([data.hex(" ")], [])  # late, and nobody's
    assert host.written == [nine("\1", "G"), b"S"]
    host.line.ask(Request("\1", "G", Kind.PRINT, Nines()))
    host.wait(2 * RECOVERY_QUIET)
    host.hear(nine("\2", "G", 6))
    assert host.replies[-1][:2] == (End.DONE, ("6",))


def test_every_language_says_both():
    from multidrop.dialects.families import FAMILIES

    told = {family: (each.codec.framed, each.codec.numbered) for family, each in FAMILIES.items()}
    assert told == {"mcode": (False, False), "pmx": (False, False), "modbus": (True, True), "tmcl": (True, False)}
