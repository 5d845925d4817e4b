"""Clients of a shared port that speak RFC 2217 or telnet, and one that is lost: bytes in, what is sent out."""

from __future__ import annotations

import pytest

from multidrop.features.sharing.writer_turns import (
    WAITING,
    WRITES_A_TURN,
    Action,
    ClientWrite,
    Close,
    Purge,
    Send,
    Set,
    Stop,
)
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION, REPLY, Control, Setting, message
from tests.support.shared_exchange import ADA, BOB, EVE, HELLO, Port


def agreed(port: Port, *clients: int) -> Port:
    for each in clients:
        port.send(each, HELLO)
        port.sent[each] = b""
    return port


def test_a_client_that_negotiates_nothing_is_sent_nothing_but_the_drives_bytes(port: Port) -> None:
    assert port.sent[ADA] == b""
    port.send(ADA, b"\x00\xff\xfb\x2c")
    assert port.written == b"\x00\xff\xfb\x2c" and port.sent[ADA] == b""


def test_the_option_is_agreed_on_once(port: Port) -> None:
    port.send(ADA, HELLO * 3 + telnet.option(telnet.DO, 1) * 2 + telnet.option(telnet.WONT, 9))
    yes = [(telnet.DO, OPTION), (telnet.WILL, 0), (telnet.DO, 0)]
    expected = b"".join(telnet.option(*each) for each in yes)
    modem = message(Setting.MODEM_STATE + REPLY, 0)
    assert port.sent[ADA] == expected + modem * 3 + telnet.option(telnet.WONT, 1)


def test_iac_is_doubled_for_telnet_and_a_nul_after_a_terminals_cr_is_left_out(port: Port) -> None:
    port.send(ADA, telnet.option(telnet.WILL, telnet.SGA) + b"PR P\r\0")
    port.sent[ADA] = b""
    port.do(port.exchange.printed(b"\xff", 0.0))
    assert port.written == b"PR P\r" and port.sent[ADA] == b"\xff\xff" and port.sent[BOB] == b"\xff"


@pytest.mark.parametrize(
    ("setting", "asked", "holds"),
    [
        (Setting.BAUD, 0, 9600),
        (Setting.BAUD, 9600, 9600),
        (Setting.DATA_SIZE, 7, 8),
        (Setting.PARITY, 3, 1),
        (Setting.STOP_SIZE, 0, 1),
        (Setting.CONTROL, Control.ASK_FLOW, Control.NO_FLOW),
        (Setting.CONTROL, 3, Control.NO_FLOW),
        (Setting.CONTROL, 16, Control.NO_FLOW_IN),
        (Setting.CONTROL, Control.ASK_DTR, Control.DTR_ON),
        (Setting.CONTROL, Control.RTS_ON, Control.RTS_ON),
        (Setting.PURGE, 3, 3),
        (Setting.LINE_MASK, 16, 16),
        (Setting.MODEM_MASK, 255, 255),
    ],
)
def test_a_request_is_answered_with_what_holds(setting: Setting, asked: int, holds: int) -> None:
    port = agreed(Port(), ADA)
    port.send(ADA, message(setting, asked))
    assert port.sent[ADA] == message(setting + REPLY, holds) and port.set == []


@pytest.mark.parametrize(
    "body", [b"", b"\x2c", b"\x2c\x01\x00", b"\x2c\x05", b"\x2c\x05\xee", b"\x2c\x63\x01", b"\x18"]
)
def test_requests_without_a_meaning_are_passed_over(body: bytes) -> None:
    port = agreed(Port(), ADA)
    port.send(ADA, telnet.subnegotiation(body))
    assert port.sent[ADA] == b"" and port.set == [] and port.closed == []


def test_a_baud_rate_is_set_and_then_confirmed() -> None:
    port = agreed(Port(), ADA)
    port.send(ADA, message(Setting.BAUD, 19200))
    assert port.set == [Set(ADA, Setting.BAUD, 19200)] and port.sent[ADA] == b""
    port.do(port.exchange.applied(ADA, Setting.BAUD, 19200))
    assert port.sent[ADA] == message(Setting.BAUD + REPLY, 19200)
    port.do(port.exchange.applied(ADA, Setting.BAUD, 1, "Invalid argument"))
    assert port.sent[ADA].endswith(message(Setting.BAUD + REPLY, 19200))


@pytest.mark.parametrize(
    ("family", "line"), [("", b"aFD"), ("mcode", b"aMR 5"), ("mcode", b"aFD\r"), ("pmx", b"@01STORE")]
)
def test_a_line_that_another_one_has_begun_is_made_harmless_at_the_baud_rate_of_its_beginning(
    family: str, line: bytes
) -> None:
    """A client that looks for drives sets another rate first, and comes back to this one."""
    port = agreed(Port(family), ADA, BOB)
    port.settles = False
    port.send(ADA, line)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, message(Setting.BAUD, 19200), 1.0)
    harmless = port.written.removeprefix(line)
    assert b"~~~" in harmless and harmless.endswith((b"\r", b"\n", b"\x05")) and port.set == []
    until = port.exchange.deadline
    assert until is not None
    assert until - 1.0 >= len(harmless) * 10 / 9600, "it has left, and the drives have replied"
    port.do(port.exchange.advance(until))
    assert port.set == [Set(BOB, Setting.BAUD, 19200)]
    port.do(port.exchange.applied(BOB, Setting.BAUD, 19200))
    port.send(BOB, b"\n", 2.0)
    assert port.written == line + harmless + b"\n", "once"


def test_so_is_ones_own_text_but_whole_lines_stop_nothing_at_another_baud_rate() -> None:
    port = agreed(Port("mcode"), ADA)
    port.send(ADA, b"aPR P\r" + message(Setting.BAUD, 19200))
    assert port.written == b"aPR P\r" and port.set == [Set(ADA, Setting.BAUD, 19200)]
    port = agreed(Port("mcode", party=True), ADA)
    port.send(ADA, b"aFD" + message(Setting.BAUD, 19200))
    assert port.written == b"aFD" + b"~" * 65 + b"\r\n" and port.set == [Set(ADA, Setting.BAUD, 19200)]
    assert b"FD" not in port.written.removeprefix(b"aFD")


def test_a_change_by_another_client_is_answered_with_what_holds() -> None:
    port = agreed(Port(), ADA, BOB)
    port.send(ADA, b"PR P\r")
    for setting, value, holds in (
        (Setting.BAUD, 19200, 9600),
        (Setting.CONTROL, Control.BREAK_ON, Control.BREAK_OFF),
    ):
        port.send(BOB, message(setting, value))
        assert port.sent[BOB].endswith(message(setting + REPLY, holds))
    assert port.set == [] and port.closed == []
    assert "bob setting refused another client has set baud to 9600" in port.said


def test_the_baud_rate_of_the_first_opener_counts_until_it_leaves() -> None:
    port = agreed(Port(), ADA, BOB)
    port.send(ADA, message(Setting.BAUD, 9600))
    port.send(BOB, message(Setting.BAUD, 19200))
    assert port.set == [] and port.sent[BOB] == message(Setting.BAUD + REPLY, 9600)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, message(Setting.BAUD, 19200))
    assert port.set == [Set(BOB, Setting.BAUD, 19200)]


def test_only_the_writers_purge_drops_what_waits() -> None:
    port = agreed(Port(slow=True), ADA, BOB)
    port.send(ADA, b"MR 51200\r")
    port.send(BOB, message(Setting.PURGE, 3))
    port.send(ADA, message(Setting.PURGE, 1))
    assert port.waiting
    port.send(ADA, message(Setting.PURGE, 2))
    assert port.waiting == b"" and port.sent[BOB] == message(Setting.PURGE + REPLY, 3)


def test_a_refused_client_of_rfc_2217_is_told_in_a_signature() -> None:
    port = agreed(Port(), BOB)
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"PR P\r")
    why = b"refused: ada writes, until it leaves or is silent for 10 s"
    assert port.sent[BOB] == message(Setting.SIGNATURE + REPLY, why)


def test_a_refused_telnet_terminal_is_sent_a_line(port: Port) -> None:
    port.send(BOB, telnet.option(telnet.WILL, telnet.SGA))
    port.sent[BOB] = b""
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"PR P\r")
    assert port.sent[BOB] == b"multidrop share: refused: ada writes, until it leaves or is silent for 10 s\r\n"


def test_while_the_port_is_lost_a_client_is_closed_once_it_is_known_how_to_tell_it() -> None:
    port = agreed(Port(), BOB)
    port.do(port.exchange.lose("gone", 0.0))
    assert port.closed == [ADA, BOB, EVE]
    port.do(port.exchange.connect(4, "new"))
    port.sent[4] = b""
    port.send(4, HELLO + message(Setting.BAUD, 19200))
    assert port.closed[-1] == 4 and port.sent[4].endswith(message(Setting.SIGNATURE + REPLY, b"lost: gone"))
    port.exchange.back()
    port.do(port.exchange.connect(5, "later"))
    port.send(5, b"PR P\r")
    assert port.written == b"PR P\r" and port.set == []


def test_a_client_that_suspends_the_flow_is_sent_it_later_and_dropped_in_the_end() -> None:
    port = agreed(Port(), ADA)
    suspend, resume = message(Setting.SUSPEND, b""), message(Setting.RESUME, b"")
    port.send(ADA, suspend)
    port.do(port.exchange.printed(b"held", 0.0))
    assert port.sent[ADA] == b""
    port.send(ADA, resume)
    assert port.sent[ADA] == b"held"
    port.send(ADA, suspend)
    for _ in range(70):
        port.do(port.exchange.printed(b"x" * 1000, 0.0))
    assert port.closed == [ADA]


def flood(requests: int) -> bytes:
    return message(Setting.DATA_SIZE, 7) * requests


def replies(actions: list[Action]) -> int:
    """The number of requests that were worked off."""
    return sum(each.data.count(message(Setting.DATA_SIZE + REPLY, 8)) for each in actions if isinstance(each, Send))


@pytest.mark.parametrize("where", [0, 1, 300, 600])
def test_a_stop_is_written_before_any_request_of_its_read(where: int) -> None:
    port = agreed(Port(), ADA)
    actions = port.exchange.receive(ADA, flood(where) + b"\x1b" + flood(600 - where), 0.0)
    [stop] = [at for at, each in enumerate(actions) if isinstance(each, Stop)]
    assert replies(actions[:stop]) == 0 and replies(actions) <= WRITES_A_TURN


def test_a_few_requests_of_each_client_are_worked_off_before_the_others_are_read() -> None:
    port = agreed(Port(), ADA, BOB, EVE)
    for client in (ADA, BOB, EVE):
        assert replies(port.exchange.receive(client, flood(500), 0.0)) <= WRITES_A_TURN
    assert port.exchange.deadline == 0.0
    worked = [replies(port.exchange.advance(0.0)) for _ in range(100)]
    assert (
        max(worked) <= 3 * WRITES_A_TURN and sum(worked) == 3 * (500 - WRITES_A_TURN) and port.exchange.deadline != 0.0
    )


def test_escape_within_a_request_is_no_stop() -> None:
    port = agreed(Port(), ADA)
    actions = port.exchange.receive(ADA, message(Setting.BAUD, 0x1B1B1B1B) + message(Setting.LINE_MASK, 0x1B), 0.0)
    assert not [each for each in actions if isinstance(each, Stop)]


def test_bytes_keep_their_place_among_requests_and_those_that_wait_are_dropped_by_a_stop() -> None:
    port = agreed(Port(), ADA, BOB)
    port.send(ADA, b"PR P\r" + flood(20) + b"PR V\rMR 5")
    assert port.written == b"PR P\r"
    port.send(BOB, b"\x1b")
    assert port.written == b"PR P\r" + b"\x1b" + b"~" * 65 + b"\r\x1b"
    assert "ada unsent 9 bytes that came before a stop were dropped" in port.said
    port.send(ADA, b"1200\rPR A\r")  # the rest of a line that was dropped
    while port.exchange.deadline == 0.0:
        port.do(port.exchange.advance(0.0))
    assert port.written.endswith(b"\x1bPR A\r") and port.sent[ADA].count(message(Setting.DATA_SIZE + REPLY, 8)) == 20


def test_bytes_after_a_change_of_the_baud_rate_wait_for_it_and_a_stop_does_not() -> None:
    port = agreed(Port(), ADA)
    port.send(ADA, message(Setting.BAUD, 19200) + b"PR P\r")
    assert port.written == b"" and port.exchange.deadline != 0.0
    port.do(port.exchange.applied(ADA, Setting.BAUD, 19200))
    port.do(port.exchange.advance(0.0))
    assert port.written == b"PR P\r"
    port.send(ADA, message(Setting.BAUD, 38400) + b"\x1b")
    assert port.written == b"PR P\r\x1b"


def test_bytes_that_wait_are_written_although_their_client_has_left() -> None:
    port = agreed(Port(), ADA)
    port.send(ADA, flood(20) + b"PR P\r")
    port.do(port.exchange.leave(ADA))
    assert port.written == b"PR P\r"


def test_a_client_that_never_waits_for_replies_is_dropped_and_its_stop_still_passes() -> None:
    port = agreed(Port(), ADA)
    actions: list[Action] = []
    while not any(isinstance(each, Close) for each in actions):
        actions = port.exchange.receive(ADA, flood(400), 0.0)
    assert len(port.exchange.clients[ADA].waiting) <= WAITING + 400
    later = port.exchange.receive(ADA, flood(400) + b"\x1bMR 1\r", 0.0)
    assert isinstance(later[0], Stop) and not [each for each in later if isinstance(each, ClientWrite)]


def test_a_purge_and_a_stop_in_one_read_do_not_drop_the_stop() -> None:
    port = agreed(Port(slow=True), ADA)
    port.send(ADA, b"MR 51200\r")
    actions = port.exchange.receive(ADA, message(Setting.PURGE, 2) + b"\x1b", 0.0)
    assert [type(each) for each in actions if isinstance(each, Stop | Purge)] == [Stop]
    assert Send(ADA, message(Setting.PURGE + REPLY, 2)) in actions
