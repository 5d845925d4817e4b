"""Who writes on a shared port: bytes and times in, what is written and sent out."""

from __future__ import annotations

import pytest

from dialects.visible import visible
from shell.sharing.actions import Action, Close, Purge, Say, Send, Set, Stop, Write
from shell.sharing.exchange import SILENT, Exchange
from shell.sharing.stop_bytes import stop_bytes
from transports import telnet
from transports.com_port import OPTION, REPLY, Control, Setting, message

ADA, BOB, EVE = 1, 2, 3
HELLO = telnet.option(telnet.WILL, OPTION)
MST = bytes([1, 3, 0, 0, 0, 0, 0, 0, 4])
ROR = bytes([1, 1, 0, 0, 0, 0, 0, 100, 102])


class Port:
    """An exchange whose port takes all bytes at once, unless it is `slow`: then they wait until they are dropped."""

    def __init__(self, family: str = "", slow: bool = False) -> None:
        self.exchange = Exchange(stop_bytes(family), 9600)
        self.slow = slow
        self.written = b""
        self.waiting = b""
        self.sent: dict[int, bytes] = {ADA: b"", BOB: b"", EVE: b""}
        self.said: list[str] = []
        self.set: list[Set] = []
        self.closed: list[int] = []
        for client, name in ((ADA, "ada"), (BOB, "bob"), (EVE, "eve")):
            self.do(self.exchange.connect(client, name))
        self.said.clear()

    def send(self, client: int, data: bytes, now: float = 0.0) -> None:
        self.do(self.exchange.receive(client, data, now))

    def do(self, actions: list[Action]) -> None:
        for each in actions:
            match each:
                case Write(_, data):
                    self._take(data)
                case Stop(data, mended):
                    self.written += mended if self._drop() else data
                case Purge():
                    self._drop()
                case Send(client, data):
                    self.sent[client] += data
                case Close(client, farewell):
                    self.sent[client] += farewell
                    self.closed.append(client)
                case Set():
                    self.set.append(each)
                case Say(client, event, detail):
                    self.said.append(" ".join(filter(None, (client, event, detail))))

    def _take(self, data: bytes) -> None:
        if self.slow:
            self.waiting += data
        else:
            self.written += data

    def _drop(self) -> int:
        dropped, self.waiting = len(self.waiting), b""
        self.do(self.exchange.dropped(dropped))
        return dropped


def test_the_first_to_write_is_the_writer_and_bytes_of_another_are_refused() -> None:
    port = Port()
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"MR 51200\r", 9.9)
    assert port.written == b"PR P\r"
    assert port.closed == [BOB]
    assert port.sent[BOB] == b""  # a program would take a reason for a reply
    assert port.said == ["ada writes", "bob refused ada writes, until it leaves or is silent for 10 s"]


def test_every_client_hears_what_the_drives_send_but_one_that_was_refused() -> None:
    port = Port()
    port.send(ADA, b"PR P\r")
    port.send(EVE, b"x")
    port.sent[EVE] = b""
    port.do(port.exchange.printed(b"51200\r\n\xff"))
    assert port.sent == {ADA: b"51200\r\n\xff", BOB: b"51200\r\n\xff", EVE: b""}


def test_after_ten_seconds_of_silence_another_writes_and_the_first_is_refused() -> None:
    port = Port()
    port.send(ADA, b"PR P\r", 1.0)
    port.send(ADA, b"PR V\r", 5.0)
    assert port.exchange.deadline == 5.0 + SILENT
    port.do(port.exchange.advance(14.9))
    assert port.exchange.writer == ADA
    port.do(port.exchange.advance(15.0))
    assert port.said[-1] == "ada silent another client may write" and port.exchange.deadline is None
    port.send(BOB, b"PR P\r", 15.0)
    port.send(ADA, b"PR P\r", 15.1)
    assert port.exchange.writer == BOB and port.closed == [ADA]


def test_silence_counts_although_nothing_has_looked_at_the_clock() -> None:
    port = Port()
    port.send(ADA, b"PR P\r", 1.0)
    port.send(BOB, b"PR V\r", 11.0)
    assert port.written == b"PR P\rPR V\r" and port.closed == []


def test_a_writer_that_leaves_makes_room_at_once() -> None:
    port = Port()
    port.send(ADA, b"PR P\r")
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"PR V\r", 0.1)
    assert port.written == b"PR P\rPR V\r" and port.closed == []


@pytest.mark.parametrize("key", [b"\x1b", b"\x03", b"\x05", b"a\x1bb\x1b\n", b"@00ABORT\r", b"\xff\xf4\xff\xfd\x06"])
def test_a_stop_passes_from_any_client_which_stays_connected_and_does_not_write(key: bytes) -> None:
    port = Port()
    port.send(ADA, b"MR 51200\r")
    port.send(BOB, key)
    expected = b"\x03" if key[0] == telnet.IAC else key
    assert port.written == b"MR 51200\r" + expected
    assert port.closed == [] and port.exchange.writer == ADA
    assert port.said[-1] == f"bob stop {visible(expected.decode())}"


def test_a_stop_passes_from_a_client_that_was_refused_and_in_the_read_that_is_refused() -> None:
    port = Port()
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"MR 1\r\x1bMR 2\r")
    assert port.closed == [BOB] and port.written == b"PR P\r\x1b"
    port.send(BOB, b"MR 3\r")
    port.send(BOB, b"MR 4\r\x1b\r")
    assert port.written == b"PR P\r\x1b\x1b"


def test_enter_after_a_stop_is_not_refused() -> None:
    port = Port()
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


def test_the_writers_own_stop_drops_what_came_with_it_and_what_follows_is_written() -> None:
    port = Port()
    port.send(ADA, b"PR P\r")
    port.send(ADA, b"MR 51200\r\x1bPR V\r")
    assert port.written == b"PR P\r\x1bPR V\r"
    assert "ada unsent 9 bytes that came with a stop were dropped" in port.said


def test_a_stop_of_this_side_is_one_of_any_client() -> None:
    port = Port(slow=True)
    port.send(ADA, b"MR 5")
    port.do(port.exchange.stop(b"\x1b"))
    port.send(ADA, b"1200\rPR P\r")
    assert port.written == b"\x1b" + b"~" * 65 + b"\r" + b"\x1b" and port.waiting == b"PR P\r"
    assert r"this terminal stop \x1b" in port.said


def test_bytes_of_no_language_of_text_pass_as_they_are_and_a_stop_among_anothers_does_too() -> None:
    port = Port()
    port.send(ADA, bytes(range(256)))
    assert port.written == bytes(range(256))
    port.send(BOB, b"\x80\x1b\x81")
    assert port.written.endswith(b"\xff\x1b") and port.closed == [BOB]


def test_in_frames_only_a_whole_stop_is_one() -> None:
    port = Port("tmcl")
    port.send(ADA, ROR)
    port.send(ADA, bytes([3, 0x1B, 5]))
    port.send(BOB, MST * 2)
    assert port.written == ROR + bytes([3, 0x1B, 5]) + MST * 2
    port.send(BOB, b"\x1b")
    assert port.closed == [BOB]


@pytest.mark.parametrize(
    ("family", "line", "harmless"),
    [
        ("", b"MR 5", b"~" * 65 + b"\r"),
        ("mcode", b"PR P\raSL 2", b"~" * 65 + b"\r"),
        ("pmx", b"@00X10", b"~~~\r"),
        ("", b"PR P", b""),
        ("", b"hello", b""),
        ("", b"MR 5\r", b""),
        ("", b"\r", b""),
    ],
)
def test_a_motion_that_a_writer_left_unfinished_is_not_executed_by_the_next_one(
    family: str, line: bytes, harmless: bytes
) -> None:
    port = Port(family)
    port.send(ADA, line)
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"\n")
    assert port.written == line + harmless + b"\n"


def test_a_writer_that_was_silent_ends_its_own_line() -> None:
    port = Port()
    port.send(ADA, b"MR 5", 0.0)
    port.send(ADA, b"0\r", 20.0)
    assert port.written == b"MR 50\r"


def test_a_stop_leaves_no_unfinished_line() -> None:
    port = Port()
    port.send(ADA, b"MR 5")
    port.send(ADA, b"\x1b")
    port.do(port.exchange.leave(ADA))
    port.send(BOB, b"\n")
    assert port.written == b"MR 5\x1b\n"


# RFC 2217


def agreed(port: Port, *clients: int) -> Port:
    for each in clients:
        port.send(each, HELLO)
        port.sent[each] = b""
    return port


def test_a_client_that_negotiates_nothing_is_sent_nothing_but_the_drives_bytes() -> None:
    port = Port()
    assert port.sent[ADA] == b""
    port.send(ADA, b"\x00\xff\xfb\x2c")
    assert port.written == b"\x00\xff\xfb\x2c" and port.sent[ADA] == b""


def test_the_option_is_agreed_on_once() -> None:
    port = Port()
    port.send(ADA, HELLO * 3 + telnet.option(telnet.DO, 1) * 2 + telnet.option(telnet.WONT, 9))
    yes = [(telnet.DO, OPTION), (telnet.WILL, 0), (telnet.DO, 0)]
    expected = b"".join(telnet.option(*each) for each in yes)
    modem = message(Setting.MODEM_STATE + REPLY, 0)
    assert port.sent[ADA] == expected + modem * 3 + telnet.option(telnet.WONT, 1)


def test_iac_is_doubled_for_telnet_and_a_nul_after_a_terminals_cr_is_left_out() -> None:
    port = Port()
    port.send(ADA, telnet.option(telnet.WILL, telnet.SGA) + b"PR P\r\0")
    port.sent[ADA] = b""
    port.do(port.exchange.printed(b"\xff"))
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


def test_a_refused_telnet_terminal_is_sent_a_line() -> None:
    port = Port()
    port.send(BOB, telnet.option(telnet.WILL, telnet.SGA))
    port.sent[BOB] = b""
    port.send(ADA, b"PR P\r")
    port.send(BOB, b"PR P\r")
    assert port.sent[BOB] == b"multidrop share: refused: ada writes, until it leaves or is silent for 10 s\r\n"


def test_while_the_port_is_lost_a_client_is_closed_once_it_is_known_how_to_tell_it() -> None:
    port = agreed(Port(), BOB)
    port.do(port.exchange.lose("gone"))
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
    port.do(port.exchange.printed(b"held"))
    assert port.sent[ADA] == b""
    port.send(ADA, resume)
    assert port.sent[ADA] == b"held"
    port.send(ADA, suspend)
    for _ in range(70):
        port.do(port.exchange.printed(b"x" * 1000))
    assert port.closed == [ADA]
