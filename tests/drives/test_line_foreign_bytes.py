"""Bytes that are not the reply, on the host's line: chatter, late and foreign replies, echoes, stops among them."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects import End, Kind, Priority, Request, StopPiece
from multidrop.drives.echoes import LONGEST_TAIL
from multidrop.drives.events import Unsolicited
from multidrop.drives.inbox import LATE_WITHIN
from multidrop.drives.line import LONGEST_LIST, LONGEST_WAIT_FOR_QUIET, Finished, Line, Write
from multidrop.families.lexium.host.mcode.codec import MCode
from tests.drives.line_run import LineRun
from tests.support.examples import examples

QUIETLY = MCode(em=1)
PARTY = MCode(em=1, party=True)


def request(text="PR P", codec=QUIETLY, address="", **changes) -> Request:
    return replace(codec.request(address, text), **changes)


def chatter(start: float, end: float, every: float = 0.05) -> dict[float, bytes]:
    return {start + n * every: b"Logic 000\r\n" for n in range(round((end - start) / every))}


# --- a program that prints without a pause


def test_a_wire_that_is_never_quiet_is_written_to_again_after_a_timeout():
    line = Line(QUIETLY)
    line.ask(request("PR ZZ", expect="never"))
    line.ask(request("PR V", expect=r"-?\d+"))
    run = LineRun(line, 20.0, chatter(0.01, 20.0))
    (_, _), (at, _) = run.written
    assert at <= 4.0 + LONGEST_WAIT_FOR_QUIET + 0.1


def test_what_shows_its_success_by_silence_is_not_waited_for_for_ever_while_a_program_prints():
    line = Line(MCode(em=2))
    line.ask(request("MR 1", MCode(em=2)))
    line.ask(request("PR V", MCode(em=2)))
    half = {n * 0.01 + 0.005: b"Log" if n % 2 else b"ic\r\n" for n in range(1, 300)}
    run = LineRun(line, 2.0, half)
    assert run.finished[0] == ("MR 1", End.SILENT, ())
    ended = next(at for at, event in run.seen if isinstance(event, Finished))
    assert ended <= LONGEST_WAIT_FOR_QUIET + 0.1
    assert set(run.strays[1:]) == {"Logic"}  # no line was cut in two by that


def test_a_program_that_never_ends_a_line_does_not_keep_the_wire_to_itself():
    line = Line(QUIETLY)
    coming = {n * 0.02: b"0" for n in range(1, 300)}
    run = LineRun(line, 2.0, coming)
    line.ask(request("MR 1"))
    later = {at: data for at, data in coming.items() if at > 2.0}
    sent, now = [], 2.0
    while not sent:
        now = min(later)
        line.receive(later.pop(now), now)
        sent = [event for event in line.events(now) if isinstance(event, Write)]
    assert now <= 2.0 + LONGEST_WAIT_FOR_QUIET + 0.1
    assert "".join(run.strays).strip("0") == ""


def test_a_stop_is_repeated_on_a_wire_that_is_never_quiet():
    line = Line(QUIETLY)
    line.events(0.0)
    line.stop(0.0, StopPiece(b"\x1b"))
    run = LineRun(line, 5.0, chatter(0.01, 5.0))
    assert [data for _, data in run.written] == [b"\x1b"]
    assert run.written[0][0] <= LONGEST_WAIT_FOR_QUIET + 0.1


def test_a_list_ends_even_where_a_program_prints_for_ever():
    line = Line(QUIETLY)
    line.ask(request("L"))
    run = LineRun(line, 3 * LONGEST_LIST, chatter(0.01, 3 * LONGEST_LIST, 0.2))
    assert [end for _, end, _ in run.finished] == [End.DAMAGED]


@pytest.mark.slow
def test_ten_kilobytes_at_4800_baud_are_one_list():
    line = Line(MCode(em=0), baud=4800)
    line.ask(request("L", MCode(em=0)))
    rows = [b"%d  MR 51200\r\n" % n for n in range(700)]
    answers, at = {0.1: b"L\r\n"}, 0.1
    for row in rows:
        at += len(row) / 480
        answers[at] = row
    answers[at + 0.01] = b">"
    [(_, end, lines)] = LineRun(line, 60.0, answers).finished
    assert (end, len(lines)) == (End.DONE, 700)


# --- whose answer is it?


def test_half_a_line_that_is_under_way_is_not_the_head_of_the_next_answer():
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    line.ask(request("PR V"))
    run = LineRun(line, 3.0, {0.1: b"\r\n1\r\n34", 0.11: b"567\r\n", 0.3: b"\r\n2\r\n"})
    assert [(text, lines) for text, _, lines in run.finished] == [("PR P", ("1",)), ("PR V", ("2",))]
    assert run.strays == ["34567"]


def test_an_answer_is_doubtful_while_another_drives_answer_is_outstanding():
    line = Line(PARTY)
    line.ask(request("PR P", PARTY, "a"))
    line.ask(request("PR P", PARTY, "b"))
    mark = request('PR "~a1"', PARTY, "a", expect="~a1", gather=True)
    line.ask(mark)
    line.ask(request("PR V", PARTY, "b"))
    run = LineRun(line, 9.0, {1.2: b"\r\n5\r\n", 1.3: b"\r\n~a1\r\n", 1.5: b"\r\n6\r\n"})
    assert run.doubts == [("aPR P", False), ("bPR P", True), ('aPR "~a1"', False), ("bPR V", True)]


def test_doubt_does_not_last_for_ever():
    line = Line(PARTY)
    line.ask(request("PR P", PARTY, "a"))
    LineRun(line, 2.0)
    line.ask(request("PR P", PARTY, "b"))
    line.events(2.0 + LATE_WITHIN)
    line.receive(b"\r\n5\r\n", 2.1 + LATE_WITHIN)
    [done] = [e for e in line.events(2.1 + LATE_WITHIN) if isinstance(e, Finished)]
    assert not done.reply.doubtful


@pytest.mark.parametrize("cut", range(8))
def test_the_rest_of_an_answer_that_a_stop_cut_off_is_no_line_of_a_program(cut):
    whole = b"\r\n0a 0\r\n"
    line = Line(PARTY)
    line.ask(request('PR P,"a ",V', PARTY, "a", expect=r"(-?\d+)a (-?\d+)", priority=Priority.POLL))
    line.events(0.0)
    line.receive(whole[:cut], 0.01)
    events = line.events(0.01)
    line.stop(0.02)
    events += line.events(0.02)
    line.stop(0.025)  # the key is hit twice
    line.receive(whole[cut:], 0.03)
    events += line.events(0.03)
    line.receive(b"Log\r\n", 0.04)
    events += line.events(0.04) + line.events(1.0)
    assert [event.lines for event in events if isinstance(event, Unsolicited)] == [("Log",)]
    assert [event.reply.end for event in events if isinstance(event, Finished)] == [End.STOPPED]


def test_what_comes_after_a_stop_that_cut_off_an_answer_is_shown_where_that_never_comes():
    line = Line(PARTY)
    line.ask(request('PR P,"a ",V', PARTY, "a", expect=r"(-?\d+)a (-?\d+)"))
    line.events(0.0)
    line.stop(0.02)
    line.receive(b"Log\r\n", 0.03)
    assert [event for event in line.events(0.2) if isinstance(event, Unsolicited)] == [Unsolicited(0.2, ("Log",))]


def test_what_comes_without_an_end_after_a_stop_that_cut_off_an_answer_is_not_kept():
    line = Line(PARTY)
    line.ask(request('PR P,"a ",V', PARTY, "a", expect=r"(-?\d+)a (-?\d+)"))
    line.events(0.0)
    line.stop(0.02)
    shown = 0
    for number in range(200):
        line.receive(b"U" * 64, 0.03 + number / 1000)
        events = line.events(0.03 + number / 1000)
        shown += sum(len("".join(each.lines)) for each in events if isinstance(each, Unsolicited))
        assert len(line.inbox.buffer) <= LONGEST_TAIL
    assert shown + len(line.inbox.buffer) == 200 * 64


def test_what_was_under_way_when_a_stop_came_is_outstanding():
    line = Line(PARTY)
    line.ask(request("PR P", PARTY, "a"))
    line.events(0.0)
    line.stop(0.01, StopPiece(b"\x1b"))
    line.ask(request("PR P", PARTY, "b"))
    run = LineRun(line, 3.0, {0.5: b"\r\n5\r\n"})
    assert run.doubts[-1] == ("bPR P", True)


# --- adapters that repeat what is sent


def echoing() -> Line:
    return Line(QUIETLY, local_echo=True)


def test_a_print_that_was_under_way_before_our_own_echo_is_no_answer():
    line = echoing()
    line.ask(request("PR P"))
    run = LineRun(line, 3.0, {0.01: b"!\r\nPR P\r\r\n5\r\n"})
    assert run.finished == [("PR P", End.DONE, ("5",))]
    assert run.strays == ["!"]


def test_an_echo_that_came_back_changed_is_never_an_answer():
    line = echoing()
    line.ask(request("PR P"))
    run = LineRun(line, 9.0, {0.01: b"PR Q\r", 0.02: b"\r\n5\r\n"})
    assert run.finished == [("PR P", End.DAMAGED, ())]


def test_an_echo_that_never_comes_is_no_silent_success():
    line = Line(MCode(em=2), local_echo=True)
    line.ask(request("MR 1", MCode(em=2)))
    assert LineRun(line, 9.0).finished == [("MR 1", End.TIMEOUT, ())]


def test_an_echo_that_was_lost_does_not_spoil_the_next_one():
    line = echoing()
    line.ask(request("PR P"))
    line.ask(request("PR V"))
    run = LineRun(line, 9.0, {1.2: b"PR V\r", 1.21: b"\r\n7\r\n"})
    assert run.finished == [("PR P", End.TIMEOUT, ()), ("PR V", End.DONE, ("7",))]


def test_without_any_echo_nothing_piles_up():
    line = echoing()
    for n in range(200):
        line.ask(request("PR P", priority=Priority.POLL))
        LineRun(line, 1.0)
        line.events(3.0 * (n + 1))
    assert line.inbox.echo is not None
    assert len(line.inbox.echo.own) + len(line.inbox.echo.held) + len(line.inbox.buffer) < 20


def test_the_echo_of_a_stop_is_swallowed_too():
    line = echoing()
    line.stop(0.0, StopPiece(b"\x1b\n"))
    line.note_written(b"\x1b\n", 0.0)
    line.ask(request("PR V"))
    run = LineRun(line, 3.0, {0.001: b"\x1b\n", 0.12: b"\x1b\n", 0.5: b"PR V\r\r\n7\r\n"})
    assert run.finished == [("PR V", End.DONE, ("7",))]
    assert run.strays == []


# --- stops


def test_a_second_stop_cuts_no_line_but_one_within_its_spoiling_does():
    line = Line(QUIETLY, baud=9600)
    line.ask(request("MR 51200"))
    line.events(0.0)
    assert line.half_sent(0.004) is True
    line.stop(0.004, StopPiece(b"\x1b"))
    line.note_written(b"\x1b", 0.004)
    assert line.half_sent(0.0041) is False
    line.stop(0.0041, StopPiece(b"\x1b"))
    line.note_written(b"\x1b" + b"~" * 65 + b"\r\x1b", 0.0041, whole=True)
    assert line.half_sent(0.02) is True
    line.stop(0.02, StopPiece(b"\x1b"))


def test_a_stop_that_is_still_to_be_repeated_can_be_taken_at_once():
    line = Line(QUIETLY)
    line.stop(0.0, StopPiece(b"one"), StopPiece(b"two"))
    assert line.take_repeats() == b"onetwo"
    assert LineRun(line, 3.0).written == []


TEXTS = st.sampled_from(["PR P", "MR 1", "L", "EM=1", "S"])
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("ask"), TEXTS, st.sampled_from(list(Priority)), st.sampled_from("ab")),
        st.tuples(st.just("hear"), st.sampled_from([b"\r\n", b"0", b"1\r\n", b"\x06", b"\x15", b">", b"aMR 1", b"?"])),
        st.tuples(st.just("wait"), st.floats(0.0, 3.0)),
        st.tuples(st.just("stop")),
        st.tuples(st.just("next")),
    ),
    max_size=40,
)


@examples(40, nightly=500)
@given(st.integers(0, 3), st.integers(0, 2), st.booleans(), st.sampled_from([0, 4800]), STEPS)
def test_whatever_happens_every_request_ends_once_and_time_goes_on(em, check, echo, baud, steps):
    codec = MCode(em=em, checksum=check, party=True)
    line = Line(codec, baud=baud, local_echo=echo)
    now, asked, ended = 0.0, [], []

    def look() -> None:
        ended.extend(event.ticket for event in line.events(now) if isinstance(event, Finished))
        assert line.deadline is None or line.deadline > now, "a busy loop"

    for what, *more in steps:
        if what == "ask":
            text, priority, address = more
            asked.append(line.ask(replace(codec.request(address, text), priority=priority)))
        elif what == "hear":
            line.receive(more[0], now)
        elif what == "wait":
            now += more[0]
        elif what == "stop":
            line.stop(now, StopPiece(b"\x1b"))
            line.note_written(b"\x1b", now)
        elif line.deadline is not None:
            now = line.deadline
        look()
    while line.deadline is not None:
        now = line.deadline
        look()
    assert sorted(ended) == asked


def test_a_collection_that_nothing_answers_is_silent_and_nothing_is_outstanding():
    line = Line(PARTY)
    line.ask(Request("q", "PR VR", Kind.QUIET, PARTY))
    line.ask(request("PR P", PARTY, "b"))
    run = LineRun(line, 3.0, {0.6: b"\r\n5\r\n"})
    assert run.doubts == [("qPR VR", False), ("bPR P", False)]


# --- an adapter that repeats, found by itself

OWN, ALONE, VALUE = b"PR P\r", MCode(em=0), b"5\r\n"
ADAPTERS: dict[str, tuple[MCode, bytes, bool]] = {
    "EM=1": (MCode(em=1), OWN + b"\r\n" + VALUE, True),
    "EM=2": (MCode(em=2), OWN + VALUE, True),
    "EM=0": (ALONE, OWN + b"PR P\r\n" + VALUE + b">", True),
    "EM=0, a drive alone": (ALONE, b"PR P\r\n" + VALUE + b">", False),
    "EM=3, a drive alone": (MCode(em=3), b"PR P\r\n" + VALUE, False),
    "a print before": (MCode(em=1), b"!\r\n" + OWN + b"\r\n" + VALUE, True),
    "a refusal": (MCode(em=1), b"?" + OWN + b"\r\n" + VALUE, False),
}


@examples(60, nightly=600)
@given(st.sampled_from(sorted(ADAPTERS)), st.lists(st.integers(0, 40), max_size=6))
def test_an_adapter_that_repeats_is_found_however_its_bytes_are_grouped(name, cuts):
    codec, stream, repeats = ADAPTERS[name]
    ends = sorted({*(each for each in cuts if each < len(stream)), 0, len(stream)})
    pieces = {0.01 * (n + 1): stream[a:b] for n, (a, b) in enumerate(pairwise(ends))}
    line = Line(codec)
    line.ask(request("PR P", codec))
    run = LineRun(line, 5.0, pieces)
    assert run.echoes == int(repeats)
    assert (line.inbox.echo is not None) is repeats
    if name == "a print before":
        assert run.strays == ["!"]
    if name != "a refusal":
        assert run.finished == [("PR P", End.DONE, ("5",))]


@pytest.mark.parametrize("em", range(4))
@pytest.mark.parametrize(("kind", "end"), [(Kind.PRINT, End.TIMEOUT), (Kind.QUIET, End.SILENT)])
def test_where_no_drive_replies_an_adapters_repetition_is_no_reply_and_is_known_from_then_on(em, kind, end):
    codec = MCode(em=em)
    line = Line(codec)
    for text in ("PR P", "PR V"):
        line.ask(request(text, codec, kind=kind))
    run = LineRun(line, 9.0, {0.01: OWN})
    (_, _, first, lines), _ = run.ended
    assert (first, lines, run.echoes) == (End.SILENT if em == 2 else end, (), 1)
    line.ask(request("PR P", codec))
    reply = {0: b"PR P\r\n5\r\n>", 1: b"\r\n5\r\n", 2: b"5\r\n", 3: b"PR P\r\n5\r\n"}[em]
    again = LineRun(line, 30.0, {20.01: OWN + reply}, 20.0)
    assert again.finished == [("PR P", End.DONE, ("5",))]


@pytest.mark.parametrize("came", [b"\r\n12\r\n", b"\r\n12\xff"])
def test_what_comes_for_a_request_that_another_threads_stop_overtook_is_not_its_reply(came):
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    LineRun(line, 0.05)
    line.overtaken = True
    assert LineRun(line, 4.0, {0.1: came}, 0.05).finished == [("PR P", End.TIMEOUT, ())]


def test_a_print_that_comes_before_a_reply_is_a_print_from_its_time_on():
    line = Line(PARTY)
    line.ask(request('PR P,"~a"', PARTY, "a", expect=r"(-?\d+)~a"))
    run = LineRun(line, 2.0, {0.1: b"p=1\r\n", 0.2: b"\r\n5~a\r\n"})
    assert run.strays == ["p=1"] and 0.1 <= line.printed_at <= 0.2


def test_after_many_requests_nothing_is_taken_for_an_adapters_repetition():
    line = Line(MCode(em=1))
    for _ in range(100):
        line.ask(request("PR V", MCode(em=1)))
    answers = {0.01 * n: b"\r\n0\r\n" for n in range(1, 101)}
    LineRun(line, 9.0, answers)
    line.ask(request("PR P", MCode(em=1)))
    assert LineRun(line, 30.0, {20.0: OWN + b"\r\n" + VALUE}, 19.0).echoes == 0


def test_a_short_silence_behind_a_repeated_cr_proves_nothing():
    """A search waits less than the byte time of a slow line, and the drive's LF comes behind that."""
    line = Line(MCode())
    asked = Request("", "PR VR", Kind.QUIET, MCode(), settle=0.002, body=b"PR VR\r")
    line.ask(asked)
    assert LineRun(line, 1.0, {0.01: b"PR VR\r", 0.015: b"\nLMDCM\r\n>"}).echoes == 0


def test_an_echo_that_stays_away_is_looked_for_again():
    line = Line(MCode(em=1))
    for _ in range(3):
        line.ask(request("PR P", MCode(em=1)))
    answers = {0.01: OWN + b"\r\n" + VALUE, 0.1: b"\r\n" + VALUE, 1.5: b"\r\n" + VALUE}
    run = LineRun(line, 9.0, answers)
    assert run.finished[0] == run.finished[2] == ("PR P", End.DONE, ("5",))
    assert run.finished[1][1] is not End.DONE
