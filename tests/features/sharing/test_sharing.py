"""Who writes on a shared port: bytes and times in, what is written and sent out."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.text import visible
from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.features.sharing.writer_turns import WRITER_TIMEOUT, ClientWrite, Close, PortClients, Send, Stop
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION, Setting, message
from tests.support.shared_exchange import ADA, BOB, DAN, EVE, MST, ROR, Port


def test_the_first_to_write_is_the_writer_and_bytes_of_another_are_refused(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"MR 51200\r", 9.9)
    assert port.written == b"PR P\r"
    assert port.closed == [BOB]
    assert port.sent[BOB] == b""  # a program would take a reason for a reply
    assert port.said == ["ada writes", "bob refused ada writes, until it leaves or is silent for 10 s"]


def test_every_client_hears_what_the_drives_send_but_one_that_was_refused(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.send(EVE, b"x\r")
    port.sent[EVE] = b""
    port.do(port.exchange.printed(b"51200\r\n\xff", 0.0))
    assert port.sent == {ADA: b"51200\r\n\xff", BOB: b"51200\r\n\xff", EVE: b""}


def test_after_ten_seconds_of_silence_another_writes_and_the_first_is_refused(port: Port) -> None:
    port.send(ADA, b"PR P\r", 1.0)
    port.send(ADA, b"PR V\r", 5.0)
    assert port.exchange.deadline == 5.0 + WRITER_TIMEOUT
    port.do(port.exchange.advance(14.9))
    assert port.exchange.writer == ADA
    port.do(port.exchange.advance(15.0))
    assert port.said[-1] == "ada silent another client may write" and port.exchange.deadline is None
    port.send(BOB, b"PR P\r", 15.0)
    port.send(ADA, b"PR P\r", 15.1)
    assert port.exchange.writer == BOB and port.closed == [ADA]


def test_silence_counts_although_nothing_has_looked_at_the_clock(port: Port) -> None:
    port.send(ADA, b"PR P\r", 1.0)
    port.reply()
    port.send(BOB, b"PR V\r", 11.0)
    assert port.written == b"PR P\rPR V\r" and port.closed == []


def test_a_writer_that_leaves_makes_room_at_once(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.reply()
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR V\r", 0.1)
    assert port.written == b"PR P\rPR V\r" and port.closed == []


@pytest.mark.parametrize("key", [b"\x1b", b"\x03", b"\x05", b"a\x1bb\x1b\n", b"@00ABORT\r", b"\xff\xf4\xff\xfd\x06"])
def test_a_stop_passes_from_any_client_which_stays_connected_and_does_not_write(port: Port, key: bytes) -> None:
    port.send(ADA, b"MR 51200\r")
    port.send(BOB, key)
    expected = b"\x03" if key[0] == telnet.IAC else key
    assert port.written == b"MR 51200\r" + expected
    assert port.closed == [] and port.exchange.writer == ADA
    assert port.said[-1] == f"bob stop {visible(expected.decode())}"


def test_a_stop_passes_from_a_client_that_was_refused_and_in_the_read_that_is_refused(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"MR 1\r\x1bMR 2\r")
    assert port.closed == [BOB] and port.written == b"PR P\r\x1b"
    port.send(BOB, b"MR 3\r")
    port.send(BOB, b"MR 4\r\x1b\r")
    assert port.written == b"PR P\r\x1b\x1b"


def test_enter_after_a_stop_is_not_refused(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"\x1b\r\n")
    assert port.closed == [] and port.written == b"PR P\r\x1b"


def test_a_stop_drops_what_waits_and_makes_a_line_that_it_cuts_harmless() -> None:
    port = Port(slow=True)
    port.send(ADA, b"MR 51200\rMR 5")
    port.send(BOB, b"\x1b")
    assert port.written == b"\x1b" + b"~" * 65 + b"\r" + b"\x1b"
    assert port.waiting == b""
    assert "ada unsent 13 bytes that had not left were dropped" in port.said
    port.send(ADA, b"1200\rPR P\r")  # the rest of the cut line is no line
    assert port.waiting == b"PR P\r"


def test_a_whole_line_follows_a_stop_whole() -> None:
    port = Port(slow=True)
    port.send(ADA, b"MR 51200\r")
    port.send(BOB, b"\x1b")
    port.send(ADA, b"PR P\r")
    assert port.waiting == b"PR P\r"


def test_the_stop_of_a_pmx_follows_the_end_of_the_line_that_it_cuts() -> None:
    port = Port("pmx", slow=True)
    port.send(ADA, b"@00X1000\r")
    port.send(BOB, b"@00ABORT\r")
    assert port.written == b"~~~\r@00ABORT\r"


@pytest.mark.parametrize(
    ("family", "line", "stop", "written"),
    [
        ("", b"PR P\rMR 5", b"a\x1b\n", b"a\x1b" + b"~" * 65 + b"\ra\x1b\n"),
        ("pmx", b"@00X10", b"@00ABORT\r", b"~~~\r@00ABORT\r"),
    ],
)
def test_a_stop_within_a_line_that_another_one_is_typing_is_no_part_of_it(
    family: str, line: bytes, stop: bytes, written: bytes
) -> None:
    port = Port(family)
    port.send(ADA, line)
    port.send(BOB, stop.rstrip(b"\n"))
    assert port.written.startswith(line + written.rstrip(b"\n"))


def test_the_writers_own_stop_drops_what_came_with_it_and_what_follows_is_written(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.send(ADA, b"MR 51200\r\x1bPR V\r")
    assert port.written == b"PR P\r\x1bPR V\r"
    assert "ada unsent 9 bytes that came with a stop were dropped" in port.said


def test_a_stop_of_this_side_is_one_of_any_client() -> None:
    port = Port(slow=True)
    port.send(ADA, b"MR 5")
    port.do(port.exchange.stop(b"\x1b", 0.0))
    port.send(ADA, b"1200\rPR P\r")
    assert port.written == b"\x1b" + b"~" * 65 + b"\r" + b"\x1b" and port.waiting == b"PR P\r"
    assert r"this terminal stop \x1b" in port.said


def test_bytes_of_no_language_of_text_pass_as_they_are_and_a_stop_among_anothers_does_too(port: Port) -> None:
    port.send(ADA, bytes(range(256)))
    assert port.written == bytes(range(256))
    port.send(BOB, b"\x80\x1b\x81")
    assert port.written.endswith(b"\xff\x1b") and port.closed == [BOB]


def test_in_frames_only_a_whole_stop_is_one() -> None:
    port = Port("tmcl")
    port.send(ADA, ROR)
    port.send(ADA, bytes([3, 0x1B, 5]))
    port.send(BOB, MST * 2)
    assert port.written == ROR + MST * 2  # within a frame of another one the stop would be a part of it
    port.send(ADA, bytes(6))
    assert port.written == ROR + MST * 2 + bytes([3, 0x1B, 5]) + bytes(6)
    port.send(BOB, ROR)
    assert port.closed == [BOB]


@pytest.mark.parametrize(
    ("family", "line", "stop"),
    [
        ("", b"MR 51200\r", b"ABORT\r"),
        ("", b"MR 51200\r", b"~" * 65 + b"\r"),
        ("pmx", b"@00X1000\r", b"@00ABORT\r"),
        ("tmcl", ROR, MST),
        ("tmcl", ROR, MST * 2),
    ],
)
def test_a_stop_passes_in_any_pieces(family: str, line: bytes, stop: bytes) -> None:
    for at in range(1, len(stop)):
        port = Port(family)
        port.send(ADA, line)
        port.send(BOB, stop[:at])
        port.send(BOB, stop[at:])
        assert port.written == line + stop, at
        assert not port.closed and port.exchange.writer == ADA


def test_a_line_that_comes_while_another_one_writes_is_refused_at_its_end_and_sent_whole_after_that(port: Port) -> None:
    port.send(ADA, b"PR P\r")
    port.reply()
    port.send(BOB, b"MR 5")
    assert port.closed == [] and port.written == b"PR P\r"
    port.send(EVE, b"MR 5")
    port.send(EVE, b"1200\r")
    assert port.closed == [EVE]
    port.do(port.exchange.advance(11.0))
    port.send(BOB, b"1200\r", 11.0)
    assert port.written == b"PR P\rMR 51200\r"


OVERFLOW = b"~" * 65 + b"\r\n"
STOPPED = b"\x1b\x05!\x05!\x1b\x1b\x05" + OVERFLOW + b"\x1b\x05!\x05!\x1b\n\x1b\x05"


@pytest.mark.parametrize(
    ("family", "party", "line", "harmless"),
    [
        ("", None, b"MR 5", OVERFLOW),
        ("mcode", None, b"PR P\r\naSL 2", OVERFLOW),
        ("", None, b"aFD", OVERFLOW),
        ("", None, b"PR P", OVERFLOW),
        ("", None, b"hello", OVERFLOW),
        ("", None, b" ", OVERFLOW),
        ("", None, b"*FD\xcc", OVERFLOW),
        ("", None, b"\x80\xff", OVERFLOW),
        ("", None, b"FD\n", OVERFLOW),
        ("", None, b"aFD\r", STOPPED),
        ("", None, b"MR 5\r", STOPPED),
        ("", None, b"aVM=5\raFD", STOPPED),
        ("", None, b"PR P\r\n", b""),
        ("", None, b"\r", b""),
        ("", None, b"\n", b""),
        ("mcode", False, b"FD", b"~" * 65 + b"\r"),
        ("mcode", False, b"FD\n", b"~" * 65 + b"\r"),
        ("mcode", False, b"MR 5\r", b""),
        ("mcode", True, b"aFD", OVERFLOW),
        ("mcode", True, b"aFD\r", STOPPED),
        ("mcode", True, b"aPR P\n", b""),
        ("pmx", None, b"@00X10", b"~~~\r"),
        ("pmx", None, b"@00STORE", b"~~~\r"),
        ("pmx", None, b"@00STORE\n", b"~~~\r"),
        ("pmx", None, b"@", b"~~~\r"),
        ("pmx", None, b"@00PX\r", b""),
        ("tmcl", None, ROR, b""),
    ],
)
def test_what_a_writer_left_unfinished_is_not_executed_by_the_next_one_whatever_it_says(
    family: str, party: bool | None, line: bytes, harmless: bytes
) -> None:
    port = Port(family, party=party)
    port.send(ADA, line)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, MST if family == "tmcl" else b"\n")
    assert port.written == line + harmless + (MST if family == "tmcl" else b"\n")
    assert bool([each for each in port.said if " unfinished " in each]) is bool(harmless)


@pytest.mark.parametrize("size", range(1, 9))
def test_a_part_of_a_frame_never_reaches_a_module(size: int) -> None:
    port = Port("tmcl")
    port.send(ADA, ROR[:size])
    port.do(port.exchange.leave(ADA))
    assert "ada unsent the beginning of a message" in " ".join(port.said)
    port.send(BOB, ROR)
    assert port.written == ROR


def test_a_frame_in_pieces_is_written_once_it_is_whole() -> None:
    port = Port("tmcl")
    for byte in ROR + ROR:
        port.send(ADA, bytes([byte]))
    assert port.written == ROR + ROR


@pytest.mark.parametrize("reply", [b"\r\n", b"0\r\n>", b"\x06", b"\x15"])
@pytest.mark.parametrize("line", [b"MR 5\r", b"aMR 5\n"])
def test_a_line_that_a_drive_has_replied_to_has_ended(port: Port, line: bytes, reply: bytes) -> None:
    port.send(ADA, line)
    port.reply(reply)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR P\r")
    assert port.written == line + b"PR P\r"


def test_an_echo_is_no_reply_and_neither_is_one_to_the_line_before(port: Port) -> None:
    port.send(ADA, b"FD\n")
    port.reply(b"FD\n")
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"aPR P\naFD\r")
    assert port.written == b"FD\n" + OVERFLOW + b"aPR P\naFD\r"
    port.reply(b"0\r\n")
    port.do(port.exchange.leave(BOB))
    port.send(EVE, b"\n")
    assert port.written.endswith(b"aFD\r" + STOPPED + b"\n")


def test_the_rest_of_a_reply_shows_nothing_of_a_line_after_it(port: Port) -> None:
    port.send(ADA, b"aPR P\n", 0.0)
    port.reply(b"0\r\n", 0.1)
    port.send(ADA, b"aFD\r", 0.2)
    port.reply(b"1\r\n", 0.3)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"\n", 0.4)
    assert port.written == b"aPR P\naFD\r" + STOPPED + b"\n"


def test_names_that_nobody_bears_leave_nothing_once_the_drive_has_replied(port: Port) -> None:
    port.send(ADA, b"~\na\n", 0.0)
    port.send(ADA, b"PR VR\r", 0.5)
    port.reply(b"LMDCM\r\n", 0.6)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR P\r", 1.0)
    assert port.written == b"~\na\nPR VR\rPR P\r"


def test_the_rest_of_a_line_that_was_made_harmless_is_dropped_and_said(port: Port) -> None:
    port.send(ADA, b"MR 5", 0.0)
    port.send(BOB, b"PR P\r", 11.0)
    port.reply()
    port.do(port.exchange.leave(BOB))
    port.send(ADA, b"12", 12.0)
    port.send(ADA, b"00\rPR V\r", 12.0)
    assert port.written == b"MR 5" + OVERFLOW + b"PR P\r" + b"PR V\r"
    assert "ada unsent the rest of a line (12) was dropped, as its beginning was made harmless" in port.said


def test_the_rest_of_a_line_that_anothers_stop_has_cut_is_dropped(port: Port) -> None:
    port.send(ADA, b"MR 5")
    port.send(BOB, b"\x1b")
    port.send(ADA, b"1200\rPR P\r")
    assert port.written == b"MR 5\x1b" + b"~" * 65 + b"\r\x1bPR P\r"


@pytest.mark.parametrize(("family", "line", "stop"), [("", b"MR 5", b"\x1b"), ("pmx", b"@00X10", b"@00ABORT\r")])
@pytest.mark.parametrize("leaves", [True, False])
def test_a_stop_after_the_half_line_of_a_writer_that_is_gone_or_silent_is_no_part_of_it(
    family: str, line: bytes, stop: bytes, leaves: bool
) -> None:
    port = Port(family)
    port.send(ADA, line, 0.0)
    if leaves:
        port.do(port.exchange.leave(ADA))
    port.do(port.exchange.advance(11.0))
    port.send(BOB, stop, 11.0)
    assert port.exchange.writer is None or port.exchange.writer == BOB
    harmless = b"\x1b" + b"~" * 65 + b"\r" if not family else b"~~~\r"
    assert port.written == line + harmless + stop


def test_what_a_purge_a_loss_or_a_full_line_may_have_cut_is_made_harmless() -> None:
    for cut in ("purge", "loss", "full"):
        port = Port("pmx")
        port.send(ADA, b"@00STORE\r", 1.0)
        match cut:
            case "purge":
                port.do(port.exchange.dropped(1, True, 1.0))
            case "loss":
                port.do(port.exchange.lose("gone", 1.1))
                port.exchange.back()
            case "full":
                port.exchange.unwritten(1.0)
        port.do(port.exchange.leave(ADA))
        port.join(DAN)
        port.send(DAN, b"\r", 2.0)
        assert port.written == b"@00STORE\r~~~\r\r", cut


def test_a_loss_after_the_reply_cuts_nothing() -> None:
    port = Port("pmx")
    port.send(ADA, b"@00PX\r", 1.0)
    port.reply(b"0\r", 1.1)
    port.do(port.exchange.lose("gone", 1.2))
    port.exchange.back()
    port.join(DAN)
    port.send(DAN, b"@00PX\r", 2.0)
    assert port.written == b"@00PX\r@00PX\r"


def test_the_next_writer_is_not_sent_the_reply_to_what_made_a_line_harmless(port: Port) -> None:
    port.settles = False
    port.send(ADA, b"FD", 0.0)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR P\r", 1.0)
    assert port.written == b"FD" + OVERFLOW
    until = port.exchange.deadline
    assert until is not None and 1.3 < until < 1.5
    port.reply(b"\r\n?", 1.25)  # a slow drive
    port.do(port.exchange.advance(1.34))
    assert port.written == b"FD" + OVERFLOW, "more of it may follow"
    port.do(port.exchange.advance(1.36))
    assert port.written == b"FD" + OVERFLOW + b"PR P\r"
    port.reply(b"0\r\n", 1.4)
    assert (port.sent[BOB], port.sent[EVE]) == (b"0\r\n", b"\r\n?0\r\n")
    assert r"bob unfinished the drives' reply was not passed on: '\x0d\x0a?'" in port.said


def test_drives_that_never_fall_silent_hold_the_next_writer_up_for_a_second_at_most(port: Port) -> None:
    port.settles = False
    port.send(ADA, b"FD", 0.0)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR P\r", 1.0)
    for tenth in range(10, 22):
        port.reply(b"x", tenth / 10)
        port.do(port.exchange.advance(tenth / 10 + 0.01))
    assert port.written.endswith(b"PR P\r")


def test_a_client_that_has_left_meanwhile_is_written_and_a_stop_waits_for_nothing(port: Port) -> None:
    port.settles = False
    port.send(ADA, b"FD", 0.0)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR P\r", 1.0)
    port.send(EVE, b"\x1b", 1.01)
    assert port.written == b"FD" + OVERFLOW + b"\x1b"
    assert "bob unsent 5 bytes that came before a stop were dropped" in port.said
    port.send(BOB, b"PR V\r", 1.02)
    port.do(port.exchange.leave(BOB))
    assert port.written.endswith(b"PR V\r")


def test_what_was_begun_is_made_harmless_as_sharing_ends(port: Port) -> None:
    port.send(ADA, b"aFD")
    port.do(port.exchange.close(ADA, "closed", "over"))
    port.do(port.exchange.over())
    port.do(port.exchange.over())
    assert port.written == b"aFD" + OVERFLOW


def test_a_writer_that_was_silent_ends_its_own_line(port: Port) -> None:
    port.send(ADA, b"MR 5", 0.0)
    port.send(ADA, b"0\r", 20.0)
    assert port.written == b"MR 50\r"


def test_a_stop_key_may_be_another_one_than_the_drives_take_so_the_line_is_made_harmless(port: Port) -> None:
    port.send(ADA, b"MR 5")
    port.send(ADA, b"\x1b")
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"\n")
    assert port.written == b"MR 5\x1b" + OVERFLOW + b"\n"


PIECES = st.one_of(
    st.binary(max_size=12),
    st.sampled_from(
        [
            b"MR 51200\r",
            b"PR P\r",
            b"MR 5",
            b"\x1b",
            b"\x03",
            b"a\x1bb\x1b\n",
            telnet.option(telnet.WILL, OPTION),
            message(Setting.BAUD, 19200),
            message(Setting.PURGE, 2),
            message(Setting.SUSPEND, b""),
            message(Setting.RESUME, b""),
        ]
    ),
)
STEPS = st.lists(st.tuples(st.integers(0, 2), PIECES, st.floats(0, 15)), max_size=30)


@given(STEPS, st.integers(0, 20))
def test_only_the_writer_writes_and_every_stop_passes(steps: list[tuple[int, bytes, float]], dropped: int) -> None:
    exchange, now = PortClients(stop_bytes(""), 9600), 0.0
    closed: set[int] = set()
    first: dict[int, bytes] = {}
    """What each client sent first: telnet, or bytes alone."""
    writer, last = -1, 0.0
    for client in range(3):
        exchange.connect(client, f"pc:{client}")
    for client, data, pause in steps:
        now += pause
        if data:
            first.setdefault(client, data)
        begun = exchange.clients[client].begun
        actions = exchange.receive(client, data, now)
        while until := exchange.settling.until:
            now = max(now, until)
            actions += exchange.advance(now)
        for each in actions:
            match each:
                case ClientWrite(by, written):
                    assert by == client and by not in closed
                    assert by == writer or writer < 0 or writer in closed or now >= last + WRITER_TIMEOUT
                    assert written in (OVERFLOW, STOPPED) or _left_of(written, begun + data)
                    writer, last = by, now
                case Close(by):
                    assert by == client
                    closed.add(by)
                case Send(by):
                    assert by == client and by not in closed
                case Stop():
                    exchange.dropped(dropped)
        in_telnet = first.get(client, b"")[:1] == bytes([telnet.IAC])  # a command that has begun takes what follows
        if data in (b"\x1b", b"\x03", b"a\x1bb\x1b\n") and not in_telnet:
            [stop] = [each for each in actions if isinstance(each, Stop)]
            assert stop.data in (data, stop.mended) and stop.mended.endswith(data)


def _left_of(written: bytes, data: bytes) -> bool:
    """Whether bytes are others without some of them: commands of telnet, or a stop."""
    rest = iter(data)
    return all(byte in rest for byte in written)
