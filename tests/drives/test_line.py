"""The line: one request in flight, priorities, quiet after trouble, local echo; bytes and times in, events out."""

from dataclasses import replace

import pytest

from multidrop.dialects import End, Kind, Priority, Request, StopPiece
from multidrop.drives.events import Unsolicited
from multidrop.drives.line import RECOVERY_QUIET, Finished, Line, Write
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.framing import sealed
from tests.drives.line_run import LineRun

ECHO = MCode(em=0)
QUIETLY = MCode(em=1)


def request(text="PR P", codec=QUIETLY, **changes) -> Request:
    return replace(codec.request("", text), **changes)


def test_one_request_is_in_flight_and_the_next_goes_when_it_is_answered():
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    line.ask(request("PR V"))
    run = LineRun(line, 2.0, {0.1: b"\r\n1\r\n", 0.3: b"\r\n2\r\n"})
    assert run.written == [(0.0, b"PR P\r"), (0.1, b"PR V\r")]
    assert run.ended == [(0.1, "PR P", End.DONE, ("1",)), (0.3, "PR V", End.DONE, ("2",))]


def test_bytes_may_come_one_by_one():
    line = Line(ECHO)
    line.ask(request("PR P", ECHO))
    data = b"PR P\r\n-12\r\n>"
    run = LineRun(line, 2.0, {(i + 1) / 100: data[i : i + 1] for i in range(len(data))})
    assert run.ended == [(len(data) / 100, "PR P", End.DONE, ("-12",))]


def test_operators_go_before_transfers_and_polls_last():
    line = Line(QUIETLY)
    line.ask(request("PR C1"))
    line.ask(request("PR P", priority=Priority.POLL))
    line.ask(request("PR A", priority=Priority.TRANSFER))
    line.ask(request("PR D"))
    assert [waiting.text for waiting in line.waiting] == ["PR C1", "PR D", "PR A", "PR P"]


def test_a_request_without_an_answer_ends_once_and_is_written_once():
    line = Line(QUIETLY, timeout=1.0)
    line.ask(request("PR P"))
    run = LineRun(line, 10.0)
    assert run.written == [(0.0, b"PR P\r")]
    assert run.ended == [(1.0, "PR P", End.TIMEOUT, ())]


@pytest.mark.parametrize(("timeout", "end"), [(1.0, End.SILENT), (5.0, End.DONE)])
def test_a_signed_print_is_awaited_longer_on_a_line_whose_timeout_is_longer(timeout, end):
    """Marks wait 0.25 s of a wire: on a link of 4 s, for which a person said timeout=5, none came in time."""
    line = Line(QUIETLY, timeout=timeout)
    line.ask(request('PR P,"~1"', kind=Kind.QUIET, timeout=0.25, expect=r"(-?\d+)~1", signed=True))
    assert [each[2] for each in LineRun(line, 9.0, {4.0: b"\r\n7~1\r\n"}).ended] == [end]


def test_a_longer_timeout_does_not_delay_a_print_that_has_come():
    line = Line(QUIETLY, timeout=20.0)
    line.ask(request('PR P,"~1"', kind=Kind.QUIET, timeout=0.25, expect=r"(-?\d+)~1", signed=True))
    [(at, _, end, _)] = LineRun(line, 60.0, {0.5: b"\r\n5~1\r\n"}).ended
    assert (at < 1.0, end) == (True, End.DONE)


def test_the_wires_own_time_is_added_to_the_timeout():
    line = Line(QUIETLY, baud=9600, timeout=1.0)
    line.ask(request("PR P"))
    [(at, *_)] = LineRun(line, 10.0).ended
    assert at == round(1.0 + 5 * 10 / 9600, 4)


def test_a_late_answer_is_a_stray_and_never_the_next_requests():
    line = Line(QUIETLY, timeout=1.0)
    line.ask(request("PR P"))
    line.ask(request("PR V"))
    late = {1.05: b"\r\n111\r\n", 1.5: b"\r\n2\r\n"}
    run = LineRun(line, 5.0, late)
    assert run.written == [(0.0, b"PR P\r"), (round(1.05 + RECOVERY_QUIET, 4), b"PR V\r")]
    assert run.ended == [(1.0, "PR P", End.TIMEOUT, ()), (1.5, "PR V", End.DONE, ("2",))]
    assert (1.05, Unsolicited(1.05, ("111",))) in run.seen


def test_what_cannot_be_understood_is_damaged_not_silent():
    line = Line(ECHO, timeout=1.0)
    line.ask(request("MR 51200", ECHO))
    [(_, _, end, _)] = LineRun(line, 5.0, {0.1: b"MR 5120p\r\n>"}).ended
    assert end is End.DAMAGED


def test_a_chattering_program_does_not_keep_a_request_alive_for_ever():
    line = Line(ECHO, timeout=1.0)
    line.ask(request("PR P", ECHO))
    chatter = {n / 2: b"Logic 000\r\n" for n in range(1, 40)}
    [(at, _, end, _)] = LineRun(line, 20.0, chatter).ended
    assert end is End.DAMAGED
    assert at <= 4.5


def test_lines_that_nobody_asked_for_are_handed_on():
    line = Line(QUIETLY)
    line.receive(b"Logic 000\r\nLog", 1.0)
    assert line.events(1.0) == [Unsolicited(1.0, ("Logic 000",))]
    assert line.deadline == 1.05
    assert line.events(1.05) == [Unsolicited(1.05, ("Log",))]


NOISE, OTHER = sealed(b"noise noise") + b"\r\n", sealed(b"other") + b"\r\n"


@pytest.mark.parametrize(
    ("parts", "lines"),
    [
        ((NOISE[:8], NOISE[8:], NOISE), ["noise no", "ise", "noise noise"]),
        ((NOISE[:4], NOISE[4:8], NOISE[8:], OTHER), ["nois", "e no", "ise", "other"]),
        ((NOISE[:8], OTHER, NOISE), ["noise no", "other", "noise noise"]),
        ((NOISE[:8], NOISE[8:], NOISE[8:]), ["noise no", "ise", NOISE[8:-2].decode("latin-1")]),
        ((b"x" * 60, b"y" * 200, NOISE), ["x" * 60, "y" * 200, "noise noise"]),
    ],
)
def test_the_check_byte_of_a_line_in_parts_covers_all_of_them_and_nothing_else(parts, lines):
    """On a busy machine the parts of a line may come a while apart: the last one was called damaged."""
    line, shown = Line(MCode(em=1, checksum=1)), list[str]()
    for at, part in enumerate(parts):
        line.receive(part, at)
        for now in (at, at + 0.2):
            shown += [text for event in line.events(now) if isinstance(event, Unsolicited) for text in event.lines]
    assert shown == lines


def test_a_stop_fails_what_is_queued_and_in_flight_and_is_repeated_once_it_is_quiet():
    line = Line(QUIETLY)
    line.ask(request("MR 51200"))
    line.ask(request("PR P"))
    assert [event.data for event in line.events(0.0) if isinstance(event, Write)] == [b"MR 51200\r"]
    line.stop(0.01, StopPiece(b"\x1b"))
    line.note_written(b"\x1b", 0.01)
    assert line.ask(request("PR V"))
    run = LineRun(line, 3.0, {0.05: b"\r\n", 0.5: b"\r\n7\r\n"}, start=0.01)
    assert [(text, end) for _, text, end, _ in run.ended] == [
        ("MR 51200", End.STOPPED),
        ("PR P", End.STOPPED),
        ("PR V", End.DONE),
    ]
    assert run.written == [(0.15, b"\x1b"), (0.25, b"PR V\r")]


def test_a_print_long_after_a_stop_is_not_taken_for_the_reply_that_the_stop_cut_off():
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    line.events(0.0)
    line.stop(0.01, StopPiece(b"\x1b"))
    line.note_written(b"\x1b", 0.01)
    line.ask(request("MR 1"))
    run = LineRun(line, 5.0, {3.0: b"77\r\n"}, start=0.01)
    assert [each for _, each in run.seen if isinstance(each, Unsolicited)] == [Unsolicited(3.0, ("77",))]


def test_a_stop_knows_whether_a_line_was_half_sent():
    line = Line(QUIETLY, baud=9600)
    line.ask(request("MR 51200"))
    line.events(0.0)
    assert line.half_sent(0.005) is True
    line.stop(0.005, StopPiece(b""))
    line.note_written(b"\x1b", 0.005)
    assert line.half_sent(1.0) is False
    line.stop(1.0, StopPiece(b""))


def test_the_local_echo_of_a_two_wire_adapter_is_swallowed():
    line = Line(QUIETLY, local_echo=True)
    line.ask(request("PR P"))
    run = LineRun(line, 2.0, {0.01: b"PR ", 0.02: b"P\r\r\n5\r\n"})
    assert run.ended == [(0.02, "PR P", End.DONE, ("5",))]


def test_an_adapter_that_repeats_is_known_by_a_request_to_which_nothing_else_came():
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    run = LineRun(line, 2.0, {0.01: b"PR P\r"})
    assert [(end, lines) for _, _, end, lines in run.ended] == [(End.TIMEOUT, ())]
    assert line.inbox.echo is not None


def test_a_withdrawn_request_is_not_sent():
    line = Line(QUIETLY)
    line.ask(request("PR P"))
    line.withdraw(line.ask(request("MR 1")))
    run = LineRun(line, 3.0, {0.1: b"\r\n1\r\n"})
    assert run.written == [(0.0, b"PR P\r")]


def test_a_list_goes_on_while_lines_come_and_ends_in_quiet():
    line = Line(QUIETLY)
    line.ask(request("L"))
    answers = {0.1 * n: b"%d  H\r\n" % n for n in range(1, 30)}
    [(_, _, end, lines)] = LineRun(line, 10.0, answers).ended
    assert (end, len(lines)) == (End.DONE, 29)


def test_a_collection_takes_whatever_comes_until_it_is_quiet():
    line = Line(QUIETLY)
    line.ask(Request("", "", Kind.QUIET, MCode(party=True), settle=0.1))
    [(at, _, end, _)] = LineRun(line, 3.0).ended
    assert (at, end) == (0.1, End.SILENT)


def test_a_poll_is_passed_over_only_once():
    line = Line(QUIETLY)
    for text in ("PR A", "PR D", "PR R1"):
        line.ask(request(text))
    line.ask(request("PR P", priority=Priority.POLL))
    run = LineRun(line, 3.0, {0.1 * n: b"\r\n1\r\n" for n in range(1, 5)})
    assert [data for _, data in run.written] == [b"PR A\r", b"PR P\r", b"PR D\r", b"PR R1\r"]


def test_a_write_that_the_transport_drops_is_no_half_sent_line_and_ends_as_not_sent():
    line = Line(MCode(), baud=9600)
    line.ask(request("MR 51200"))
    line.events(0.0)
    assert line.half_sent(0.0)
    line.not_written(0.0)
    assert not line.half_sent(0.0)
    line.stop(0.0, StopPiece(b"\x1b"))
    [ended] = [event for event in line.events(0.0) if isinstance(event, Finished)]
    assert not ended.transaction.sent and ended.reply.end is End.STOPPED


def test_after_a_break_nothing_is_written_until_the_wire_has_been_quiet():
    line = Line(QUIETLY)
    line.ask(request("MR 1"))
    line.ask(request("PR V"))
    line.events(0.0)
    flight = line.cut_off(1.0, begun=False)
    assert flight is not None and flight.request.text == "MR 1" and not line.waiting
    line.ask(request("PR P"))
    run = LineRun(line, 3.0, {1.05: b"\r\n"}, start=1.0)
    assert run.written[0] == (round(1.05 + RECOVERY_QUIET, 4), b"PR P\r")


@pytest.mark.parametrize(("cut", "doubtful"), [("PR A", True), ("", False)])
def test_what_comes_after_a_break_may_be_the_reply_to_what_was_in_flight_before(cut, doubtful):
    line = Line(QUIETLY)
    if cut:
        line.ask(request(cut))
    line.events(0.0)
    line.cut_off(1.0, begun=False)
    line.ask(request("PR P"))
    assert LineRun(line, 3.0, {2.0: b"\r\n7\r\n"}, start=1.0).doubts == [("PR P", doubtful)]


@pytest.mark.parametrize("every", [0.005, 0.02, 0.033, 0.05, 0.1])
def test_a_stop_key_that_is_held_down_keeps_no_piece_of_the_stop_from_the_wire(every):
    line = Line(MCode())
    pieces = [StopPiece(name, 0.03) for name in (b"one", b"two", b"three")]
    written, now, press = [], 0.0, 0.0
    while now < 2.0:
        if now >= press:
            line.stop(now, *pieces)
            line.note_written(b"stop", now)
            press += every
        written += [event.data for event in line.events(now) if isinstance(event, Write)]
        now += 0.001
    assert set(written) == {b"one", b"two", b"three"}
    assert written[:3] == [b"one", b"two", b"three"] and len(written) >= 9


@pytest.mark.parametrize("only", [None, {"a"}])
def test_every_piece_follows_the_last_of_several_stops_and_waits_once(only):
    line = Line(MCode())
    pieces = [StopPiece(name, 0.03) for name in (b"one", b"two", b"three")]
    line.stop(0.0, *pieces, only=only)
    assert [event.data for event in line.events(0.031) if isinstance(event, Write)] == [b"one"]
    line.stop(0.04, *pieces, only=only)
    written, now = [], 0.04
    while now < 1.0:
        written += [event.data for event in line.events(now) if isinstance(event, Write)]
        now += 0.001
    assert written == [b"two", b"three", b"one"]
