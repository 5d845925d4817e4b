"""The stops that a shared port lets pass: every form that a stop of ours has, and no command."""

from __future__ import annotations

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.dialects import Codec
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.pmx.host.codec import Pmx
from multidrop.families.tmcl.host.codec import Tmcl
from multidrop.features.sharing.stop_bytes import CERTAIN, NOTICED, stop_bytes
from multidrop.features.sharing.writer_turns import NEVER, NOT_REACHED, OWED
from multidrop.transports import telnet
from multidrop.transports.telnet import OPTION, REPLY, Setting, message
from tests.support.shared_exchange import ADA, BOB, MST, ROR, Port

CODECS: list[tuple[str, Codec]] = [
    *(("mcode", MCode(party=party, escape=escape)) for party in (False, True) for escape in (0, 1, 2, 3)),
    ("pmx", Pmx()),
    ("pmx", Pmx(addressed=False)),
    ("tmcl", Tmcl((("1", 2), ("7", 1)))),
]
NAMES = {"mcode": ["a", "!", "9"], "pmx": ["00", "17"], "tmcl": ["1", "7"]}


@pytest.mark.parametrize(("family", "codec"), CODECS)
@pytest.mark.parametrize("sure", [True, False])
def test_every_form_of_our_stops_passes_whole(family: str, codec: Codec, sure: bool) -> None:
    names = NAMES[family]
    cut = codec.stop(names, sure, half_sent=True) + codec.invalidate() + codec.stop(names, sure)
    forms = [codec.stop(names, sure), cut, *(piece.data for piece in codec.stop_again(names, sure))]
    for given in {family, "" if family != "tmcl" else family}:
        for form in forms:
            assert stop_bytes(given).found(form) == (b"", form, b"")


@pytest.mark.parametrize("family", ["", "mcode", "pmx"])
@pytest.mark.parametrize(
    "line", [b"MR 51200\r", b"aPR P\n", b"\n", b"@00X1000\r", b"@00SR0=1\r", b"STOP\r", b"~\r", b"\x06"]
)
def test_a_command_is_no_stop(family: str, line: bytes) -> None:
    assert stop_bytes(family).found(line) == (line, b"", b"")


def test_a_name_before_a_key_is_no_end_of_another_line() -> None:
    assert stop_bytes("mcode").found(b"MR 5\x1brest") == (b"MR 5", b"\x1b", b"rest")
    assert stop_bytes("mcode").found(b"\rb\x1b\n") == (b"\r", b"b\x1b\n", b"")


@pytest.mark.parametrize("frame", [bytes([1, 3, 0, 6, 0, 0, 0, 0, 10]), bytes([1, 5, 0, 0, 0, 0, 0, 3, 9]), b"\x1b"])
def test_a_frame_that_is_not_mst_is_no_stop(frame: bytes) -> None:
    assert stop_bytes("tmcl").found(frame) == (frame, b"", b"")


def test_an_ethernet_drive_is_not_shared() -> None:
    with pytest.raises(Diagnostic, match="a line of modbus cannot be shared"):
        stop_bytes("modbus")


def test_the_stop_of_this_side_is_in_every_form_and_repeated() -> None:
    first, again = stop_bytes("", ["a"]).own
    assert first.data == again.data == b"\x1b\x05a\x05a\x1b\n\x1b\x05"
    pieces = [piece.data for piece in stop_bytes("pmx", ["00", "01"]).own]
    assert pieces[:2] == [b"@00ABORT\r", b"@01ABORT\r"] and b"@01SR0=0\r" in pieces


OWN = b"\x1b\x05!\x05!\x1b\n\x1b\x05"
MENDED = OWN.replace(b"\n", b"") + b"~" * 65 + b"\r" + OWN
GAP_3 = bytes([1, 6, 3, 0, 0, 0, 0, 0, 10])


def first_bytes(port: Port) -> list[bytes]:
    """What the port is written first after its return."""
    return [each.data for each in port.exchange.owed.pieces]


def test_a_stop_while_the_port_is_away_is_not_reached_and_is_the_first_thing_written_on_its_return(port: Port) -> None:
    port.do(port.exchange.lose("gone", 0.0))
    port.said.clear()
    port.do(port.exchange.stop(OWN, 1.0))
    assert port.written == b"" and port.said == [f"this terminal {NOT_REACHED} the port is lost; {OWED}"]
    pieces = port.exchange.owed.pieces
    port.exchange.back()
    assert [each.data for each in pieces] == [OWN, OWN] and pieces[0].quiet == 0.0
    port.do(port.exchange.stop(pieces[0].data, 2.0, owed=True))
    assert port.said[-1].startswith("this terminal stop ") and port.said[-1].endswith("owed since the loss of the port")
    assert port.written == MENDED
    port.do(port.exchange.lose("gone again", 2.5))
    assert [each.data for each in port.exchange.owed.pieces] == [OWN, OWN]
    assert port.said[-1].startswith(f"this terminal {NOT_REACHED} the stop may not have left")


@pytest.mark.parametrize(
    ("family", "stop"), [("", b"\x1b"), ("", b"PR P\r\x1b"), ("pmx", b"@17ABORT\r"), ("tmcl", MST), ("", b"\x80\x1b")]
)
def test_a_clients_stop_while_the_port_is_away_is_owed_in_its_own_form_and_in_every_form(
    family: str, stop: bytes
) -> None:
    port = Port(family)
    port.do(port.exchange.lose("gone", 0.0))
    port.send(ADA, stop)  # refused as the port was lost, and heard for a while
    assert port.written == b"" and f"ada {NOT_REACHED} the port is lost; {OWED}" in port.said
    pieces, (_, form, _) = first_bytes(port), stop_bytes(family).found(stop)
    first, *others = stop_bytes(family).own
    assert pieces == [first.data, form, *(each.data for each in others)]


def test_a_client_that_comes_with_a_stop_while_the_port_is_away_is_told_that_it_reached_nothing(port: Port) -> None:
    port.do(port.exchange.lose("gone", 0.0))
    port.do(port.exchange.connect(4, "new"))
    port.sent[4] = b""
    port.send(4, telnet.option(telnet.WILL, OPTION) + b"\x1b")
    reason = f"lost: gone; {NOT_REACHED}: {OWED}"
    assert port.sent[4].endswith(message(Setting.SIGNATURE + REPLY, reason.encode()))
    assert len(reason) < telnet.LONGEST_SUBNEGOTIATION - 2  # a longer one is cut


def test_a_stop_just_before_the_loss_may_not_have_left_and_is_owed_and_its_client_reads_that(port: Port) -> None:
    port.send(ADA, telnet.option(telnet.WILL, OPTION))
    port.send(ADA, b"\x1b", 1.0)
    port.do(port.exchange.printed(b"51200\r\n", 1.1))  # of a command before the stop, perhaps
    port.do(port.exchange.lose("gone", 1.2))
    assert f"ada {NOT_REACHED} the stop may not have left before the loss; {OWED}" in port.said
    assert NOT_REACHED.encode() in port.sent[ADA]
    assert first_bytes(port)[1:2] == [b"\x1b"]


@pytest.mark.parametrize(
    ("family", "after"),
    [("", b"bMR 51200\r"), ("", b"EX G1\n"), ("pmx", b"@00X1000\r"), ("tmcl", ROR)],
)
def test_a_stop_is_never_repeated_against_what_a_client_has_started_since(family: str, after: bytes) -> None:
    port = Port(family)
    port.do(port.exchange.stop(b"\x1b", 1.0))
    port.send(ADA, after, 1.1)
    assert port.exchange.owed.starts == 1
    port.do(port.exchange.lose("gone", 1.2))
    assert first_bytes(port) == [] and not [each for each in port.said if NOT_REACHED in each]


@pytest.mark.parametrize(
    ("family", "after"),
    [("", b"PR P\r"), ("", b"MR 5"), ("tmcl", GAP_3), ("tmcl", ROR[:5]), ("", b"aPR P\x9a\r"), ("pmx", b"@00PX\r")],
)
def test_reads_and_unfinished_lines_after_a_stop_start_nothing(family: str, after: bytes) -> None:
    port = Port(family)
    port.do(port.exchange.stop(MST, 1.0))
    port.send(ADA, after, 1.1)
    port.do(port.exchange.lose("gone", 1.2))
    assert port.exchange.owed.starts == 0 and first_bytes(port)


def test_a_stop_is_not_owed_once_the_drives_have_sent_something_later_or_a_loss_would_have_been_noticed() -> None:
    for answers, lost in ((1.0 + CERTAIN, 3.0), (None, 1.0 + NOTICED)):
        port = Port()
        port.send(BOB, b"\x1b", 1.0)
        if answers is not None:
            port.do(port.exchange.printed(b"0\r\n", answers))
        port.do(port.exchange.lose("gone", lost))
        assert first_bytes(port) == []


def test_a_stop_before_the_loss_of_a_port_without_a_stable_name_is_never_written_and_that_is_said(port: Port) -> None:
    port.do(port.exchange.stop(OWN, 1.0))
    port.do(port.exchange.lose("gone", 1.0, returns=False))
    assert any(each.startswith(f"this terminal {NOT_REACHED}") and each.endswith(NEVER) for each in port.said)
