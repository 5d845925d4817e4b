"""A drive's late answer is never told as another's, however the bytes of the two answers come: a line in memory."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import NoAnswer
from multidrop.dialects import End, Kind, Reply, Request
from multidrop.drives.events import Unsolicited
from multidrop.drives.line import Finished, Line, Write
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.family import MCodeFamily
from multidrop.families.lexium.host.mcode.framing import sealed
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.families.pmx.host.codec import Pmx
from tests.support.cases import for_each
from tests.support.procedure import ProcedureRunner

HELD = {"a": "7", "b": "5"}
MODES = [(em, check) for em in (1, 2) for check in (0, 1)]
PRINTS = ["PR R1", 'PR "v",R1', "PR R1;", 'PR "so far away from home and in steps of the motor it is ",R1']


def answer(frame: bytes, mode: MCode) -> bytes:
    """What a drive with that R1 answers to a frame, without the simulator: prints only, in EM 1 and 2."""
    name, text = chr(frame[0]), frame[1:].rstrip(b"\n").rstrip(bytes(range(0x80, 0x100))).decode()
    items = re.findall(r'"[^"]*"|\w+', text.removeprefix("PR"))
    values = {"R1": HELD[name], "DN": f'"{name}"'}
    line = "".join(values.get(item, item.strip('"')) for item in items).encode()
    head = b"" if mode.em == 2 else b"\x06" if mode.checksum else b"\r\n"
    if text.endswith(";"):
        return head + line
    return head + (sealed(line) if mode.checksum else line) + b"\r\n"


def timed(line: Line) -> tuple[Callable[..., None], list[Reply]]:
    """A function that lets bytes come at a time, and the replies that have ended by then."""
    ended: list[Reply] = []

    def at(now: float, data: bytes = b"") -> None:
        if data:
            line.receive(data, now)
        ended.extend(event.reply for event in line.events(now) if isinstance(event, Finished))

    return at, ended


class Two:
    """A line on which b did not answer in time, and a is asked: its bytes and b's late ones come as the test has it."""

    def __init__(self, em: int, check: int, text: str, signs: bool, asked_of_b: str = "") -> None:
        self.mode = MCode(em=em, party=True, checksum=check, escape=1)
        self.line, self.now = Line(self.mode), 0.0
        self.coming = {"a": b"", "b": b""}
        self.strays: list[str] = []
        self.state = MCodeState(self.mode, "a", "a", signs=signs)
        self.late = answer(self._frame(asked_of_b or text), self.mode)
        self.procedure: ProcedureRunner[tuple[str, ...]] | None = None
        self.result: tuple[str, ...] | NoAnswer | None = None
        self.ticket = 0

    def _frame(self, text: str) -> bytes:
        """What the host sent to b, which was the same that it will send to a; b does not reply."""
        other = MCodeState(self.mode, "b", "b")
        procedure = ProcedureRunner(MCodeFamily(other).perform(text))
        assert procedure.request is not None
        self.line.ask(procedure.request)
        [write] = [event for event in self.line.events(0.0) if isinstance(event, Write)]
        while self.line.deadline is not None:
            self.now = self.line.deadline
            self.line.events(self.now)
        self.now += 0.2
        return write.data.removeprefix(b"~\n")

    def ask(self, text: str) -> None:
        self.procedure = ProcedureRunner(MCodeFamily(self.state).perform(text))
        self._next()
        self.coming["b"] = self.late

    def _next(self) -> None:
        assert self.procedure is not None
        if self.procedure.request is None:
            self.result = self.procedure.result
        else:
            self.ticket = self.line.ask(self.procedure.request)
            self.look()

    def look(self) -> None:
        """Do what the line says."""
        for event in self.line.events(self.now):
            if isinstance(event, Unsolicited):
                self.strays.extend(event.lines)
            elif isinstance(event, Write):
                self.coming["a"] += answer(event.data.removeprefix(b"~\n"), self.mode)
            elif isinstance(event, Finished) and event.ticket == self.ticket and self.procedure is not None:
                try:
                    self.procedure.answer(event.reply)
                except NoAnswer as error:
                    self.result = error
                else:
                    self._next()

    def hear(self, data: bytes) -> None:
        self.now += 0.001
        self.line.receive(data, self.now)
        self.look()

    def end(self) -> tuple[str, ...] | NoAnswer | None:
        """Let all that is still to come, come."""
        for _ in range(50):
            for who in "ba":
                data, self.coming[who] = self.coming[who], b""
                if data:
                    self.hear(data)
            if self.result is not None or self.line.deadline is None:
                break
            self.now = self.line.deadline
            self.look()
        return self.result


def own(text: str) -> tuple[str, ...]:
    return (text[3:].rstrip(";").replace('"', "").replace(",", "").replace("R1", HELD["a"]),)


def right(two: Two, text: str) -> bool:
    return two.result == own(text) or isinstance(two.result, NoAnswer)


@pytest.mark.slow
@for_each("signs", [False, True])
@pytest.mark.parametrize("text", PRINTS)
@pytest.mark.parametrize(("em", "check"), MODES)
@for_each("order", ["ba", "ab", "b", "a"])
@for_each("grouped", ["whole", "one by one", "each at once"])
def test_a_late_answer_is_never_the_value_of_another_drive(em, check, text, signs, order, grouped):
    two = Two(em, check, text, signs)
    two.ask(text)
    stream = [two.coming[who] for who in order]
    two.coming = {"a": b"", "b": b""}
    data = {
        "whole": [b"".join(stream)],
        "each at once": stream,
        "one by one": [bytes([byte]) for byte in b"".join(stream)],
    }
    for each in data[grouped]:
        two.hear(each)
    two.end()
    assert right(two, text)
    if order == "a" and len(text) < 30 or grouped == "one by one" and order == "ab" and text == "PR R1":
        assert two.result == own(text)


@pytest.mark.slow
@pytest.mark.wide
@pytest.mark.parametrize("text", PRINTS)
@pytest.mark.parametrize(("em", "check"), MODES)
def test_nor_where_the_two_are_cut_anywhere_into_three(em, check, text):
    probe = Two(em, check, text, True)
    probe.ask(text)
    for stream in (probe.coming["b"] + probe.coming["a"], probe.coming["a"] + probe.coming["b"]):
        for first, second in combinations(range(0, len(stream) + 1, 1 + len(stream) // 20), 2):
            two = Two(em, check, text, True)
            two.ask(text)
            two.coming = {"a": b"", "b": b""}
            for each in (stream[:first], stream[first:second], stream[second:]):
                if each:
                    two.hear(each)
            two.end()
            assert right(two, text), (stream, first, second)


@pytest.mark.slow
@given(
    mode=st.sampled_from(MODES),
    text=st.sampled_from(PRINTS),
    signs=st.booleans(),
    steps=st.lists(st.tuples(st.sampled_from("ab"), st.integers(1, 30), st.booleans(), st.floats(0.0, 0.2))),
    lost=st.booleans(),
)
def test_nor_in_any_order_and_grouping_and_with_any_pauses(mode, text, signs, steps, lost):
    two = Two(*mode, text, signs)
    two.ask(text)
    if lost:
        two.coming["a"] = b""  # its own answer never comes
    held = b""
    for who, size, together, pause in steps:
        data, two.coming[who] = two.coming[who][:size], two.coming[who][size:]
        held += data
        if held and not together:
            two.now += pause
            two.hear(held)
            held = b""
    if held:
        two.hear(held)
    two.end()
    assert right(two, text)


@pytest.mark.parametrize(("em", "check"), MODES)
def test_a_print_that_no_outstanding_answer_looks_like_is_taken(em, check):
    long = 'PR "so far away from home and in steps of the motor it is ",R1'
    two = Two(em, check, long, True, asked_of_b='PR "q",R1')
    two.ask(long)
    two.hear(two.coming.pop("a"))
    two.coming["a"] = b""
    assert two.end() == own(long)


@pytest.mark.parametrize(("check", "lost"), [(0, b"\n"), (1, b"\n"), (1, b"\r\n")])
@pytest.mark.parametrize("em", [1, 2])
def test_a_programs_line_that_has_lost_its_end_does_not_run_into_the_answer(em, check, lost):
    two = Two(em, check, 'PR "q"', True)
    two.coming["b"] = two.late = b""
    two.ask("PR R1")
    printed = (sealed(b"50002004") if check else b"50002004") + b"\r\n".removesuffix(lost)
    head, line = two.coming["a"].split(b"7")
    two.coming["a"] = b""
    two.hear(head + printed + b"7" + line)
    two.end()
    assert two.result == ("7",) if lost == b"\n" else isinstance(two.result, NoAnswer)


def test_a_list_that_another_drives_answer_may_stand_in_is_not_taken():
    two = Two(1, 0, "PR R1", True)
    two.coming["b"] = b""
    talk = MCodeFamily(two.state).perform("PR AL")
    request = next(talk)
    two.ticket = two.line.ask(request)
    ended = two.line.events(two.now)
    two.line.receive(b"\r\nA = 1\r\n5\r\nD = 2\r\n\r\n", two.now)
    while not (ended := [e for e in two.line.events(two.now) if isinstance(e, Finished)]):
        two.now = two.line.deadline
    [done] = ended
    assert done.reply.doubtful is False  # b was asked for a number with its name, which none of the lines is
    line = Line(two.mode)
    line.ask(Request("b", "PR ZZ", Kind.PRINT, two.mode))
    line.events(0.0)
    while line.deadline is not None:
        line.events(line.deadline)
    line.ask(request)
    line.events(2.0)
    line.receive(b"\r\nA = 1\r\n5\r\nD = 2\r\n\r\n", 2.1)
    [done] = [e for e in line.events(line.deadline) if isinstance(e, Finished)]
    assert done.reply.doubtful
    with pytest.raises(NoAnswer, match="late from another drive"):
        talk.send(done.reply)


@pytest.mark.parametrize("sign", [b"\x15", b"\x06"])
def test_a_print_behind_a_nak_is_owed_no_sign_any_more(sign):
    """With an error set some units reply NAK to everything, and print."""
    mode = MCode(em=1, party=True, checksum=1, escape=1)
    line = Line(mode)
    at, ended = timed(line)

    asked = mode.request("a", "PR VR,DN")
    line.ask(replace(asked, kind=Kind.QUIET, expect='3\\.010"a"', signed=True, settle=0.1, timeout=0.5))
    at(0.0)
    at(0.1, sign + sealed(b'3.010"a"') + b"\r\n")
    at(2.0)
    line.ask(mode.request("b", "MR 5"))
    at(2.5)
    at(2.6, b"\x06")
    assert len(ended) == 2
    assert not ended[-1].doubtful


@pytest.mark.parametrize(("first", "doubtful"), [(b"\x15", True), (b"\x06", False)])
def test_an_acknowledgement_of_another_drive_may_be_the_late_one_of_a_drive_whose_nak_was_noise(first, doubtful):
    """a replies NAK, which may be noise; the ACK in the time of b may be that of a."""
    mode = MCode(em=1, party=True, checksum=1, escape=1)
    line = Line(mode)
    at, ended = timed(line)

    line.ask(replace(mode.request("a", "MR 5"), kind=Kind.QUIET))
    at(0.0)
    at(0.1, first)
    at(2.0)
    line.ask(replace(mode.request("b", "VM 5000"), kind=Kind.QUIET, expect=None))
    at(2.5)
    at(2.6, b"\x06")
    at(2.7)
    line.ask(replace(mode.request("a", "PR VR,DN"), kind=Kind.PRINT, expect='3\\.010"a"', signed=True))
    at(3.0)
    at(3.1, b"\x06" + sealed(b'3.010"a"') + b"\r\n")
    at(4.0)
    assert [each.end for each in ended] == [End.NAK if doubtful else End.DONE, End.DONE, End.DONE]
    assert ended[-1].doubtful is doubtful


# --- a language whose marks are asked for behind a doubtful answer


def pmx(text: str, address: str, **changes: object) -> Request:
    return replace(Pmx().request(address, text), **changes)


@pytest.mark.parametrize(("beginning", "doubtful"), [(b"Performax-2", True), (b"Performax-2ED-SA?\r", False)])
def test_the_rest_of_a_reply_that_had_begun_may_look_like_any_value(beginning, doubtful):
    """The wait for 03 ends within its reply, and the rest comes where 02 was asked."""
    line = Line(Pmx(), timeout=0.3)
    at, ended = timed(line)

    line.ask(pmx("ID", "03", kind=Kind.PRINT, expect="Performax-2ED-SA"))
    at(0.0)
    at(0.1, beginning)
    at(0.5)
    line.ask(pmx("V1", "02"))
    at(1.0)
    at(1.1, b"ED-SA\r")
    assert ended[0].end is End.DAMAGED
    assert ended[-1].lines == ("ED-SA",) and ended[-1].doubtful is doubtful


def test_a_doubtful_reply_of_another_drive_stands_in_front_of_the_mark():
    """02 is asked, gets what is left of 03's reply, and its own goes to 01, which was asked before the mark."""
    line = Line(Pmx(), timeout=0.3)
    at, ended = timed(line)

    line.ask(pmx("ID", "03", kind=Kind.PRINT, expect="Performax-2ED-SA"))
    at(0.0)
    at(0.1, b"Performax-2")
    at(0.5)
    line.ask(pmx("V1", "02"))
    at(1.0)
    at(1.1, b"ED-SA\r")
    line.ask(pmx("MSTX", "01"))
    at(1.2)
    at(1.3, b"202\r")
    assert ended[-1].lines == ("202",) and ended[-1].doubtful
    line.ask(pmx("Q02001", "02", kind=Kind.PRINT, expect=r"\?Q02001", gather=True))
    at(1.4)
    at(1.5, b"?Q02001\r")
    assert ended[-1].lines == ("202", "?Q02001")


def test_what_came_before_a_mark_that_gets_no_reply_counts_as_well():
    """03's late reply passes for 01's, and 01's own comes while the mark of 03 waits in vain."""
    line = Line(Pmx(), timeout=0.3)
    at, ended = timed(line)

    line.ask(pmx("V1", "03"))
    at(0.0)
    at(0.5)
    line.ask(pmx("V1", "01"))
    at(1.0)
    at(1.1, b"303\r")
    assert ended[-1].lines == ("303",) and ended[-1].doubtful
    line.ask(pmx("Q03001", "03", kind=Kind.PRINT, expect=r"\?Q03001", gather=True))
    at(1.2)
    at(1.3, b"101\r")
    at(2.0)
    assert ended[-1].end is not End.DONE
    line.ask(pmx("Q01001", "01", kind=Kind.PRINT, expect=r"\?Q01001", gather=True))
    at(2.5)
    at(2.6, b"?Q01001\r")
    assert ended[-1].lines == ("101", "?Q01001"), "a late reply came: 303 is not shown"


def test_a_late_refusal_of_another_drive_is_not_certain():
    """A command that reads nothing is replied to with OK, and with a refusal: either may come late."""
    line = Line(Pmx(), timeout=0.3)
    at, ended = timed(line)

    line.ask(pmx("X7000", "01"))
    at(0.0)
    at(0.5)
    line.ask(pmx("V2=5", "02"))
    at(1.0)
    at(1.1, b"?Moving\r")
    assert ended[-1].end is End.REFUSED and ended[-1].doubtful


FIRST = [[b"101\r202\r"], [b"101\r", b"202\r"], [b"101\r2", b"02\r"], [b"101\r"], [b"101\r20"]]


@pytest.mark.parametrize("first", FIRST)
@pytest.mark.parametrize("one_by_one", [True, False])
def test_what_came_behind_a_doubtful_answer_stands_in_front_of_the_mark(first, one_by_one):
    line, now, ended = Line(Pmx(), timeout=0.3), 0.0, []

    def hear(data: bytes) -> None:
        nonlocal now
        for each in (data[n : n + 1] for n in range(len(data))) if one_by_one else [data]:
            now += 0.001
            line.receive(each, now)
            look()

    def look() -> None:
        ended.extend(event for event in line.events(now) if isinstance(event, Finished))

    line.ask(pmx("PX", "01"))
    look()
    now = 0.5
    look()
    line.ask(pmx("PX", "00"))
    now = 1.0
    look()
    for each in first:
        hear(each)
    assert [(e.request.address, e.reply.lines, e.reply.doubtful) for e in ended[1:]] == [("00", ("101",), True)]
    line.ask(pmx("Q00001", "00", kind=Kind.PRINT, expect=r"\?Q00001", gather=True))
    look()
    hear(b"101\r202\r"[len(b"".join(first)) :])
    now += 0.1  # half a line that stood there is waited for, before the mark is written
    look()
    hear(b"?Q00001\r")
    assert ended[-1].reply.lines == ("202", "?Q00001") and ended[-1].reply.end is End.DONE


def test_what_came_before_the_mark_of_another_drive_may_be_the_reply_that_is_owed():
    """The mark of the slow drive goes first, and the reply of the other one comes before it."""
    line = Line(Pmx(), timeout=0.3)
    at, ended = timed(line)

    def mark(address: str) -> Request:
        return pmx(f"Q{address}001", address, kind=Kind.PRINT, expect=rf"\?Q{address}001", gather=True)

    line.ask(pmx("V1", "01"))
    at(0.0)
    at(0.5)
    line.ask(pmx("V1", "03"))
    at(1.0)
    at(1.1, b"101\r")
    assert ended[-1].lines == ("101",) and ended[-1].doubtful
    line.ask(mark("01"))
    at(1.2)
    at(1.3, b"303\r?Q01001\r")
    line.ask(mark("03"))
    at(1.5)
    at(1.6, b"?Q03001\r")
    assert ended[-1].lines == ("303", "?Q01001", "?Q03001")


@pytest.mark.slow
@pytest.mark.wide
@pytest.mark.parametrize("checksum", [0, 1, 2])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
def test_what_a_program_prints_instead_of_a_lost_reply_is_shown(em, checksum):
    codec = MCode(em=em, checksum=checksum)
    line, shown, ends = Line(codec, timeout=1.0), [], []
    line.ask(codec.request("", "PR P"))
    for number in range(400):
        now = number / 50
        text = b"tick %d" % number
        line.receive((sealed(text) if checksum else text) + b"\r\n", now)
        for event in line.events(now):
            shown += event.lines if isinstance(event, Unsolicited) else ()
            ends += [event.transaction.reply.end] if isinstance(event, Finished) else []
    assert ends == [End.DAMAGED]
    assert shown == [f"tick {number}" for number in range(400)]
