"""The stops that a shared port lets pass: every form that a stop of ours has, and no command."""

from __future__ import annotations

import pytest

from dialects import Codec, Diagnostic
from dialects.mcode.host.codec import MCode
from dialects.pmx.host.codec import Pmx
from dialects.tmcl.host.codec import Tmcl
from shell.sharing.stop_bytes import own_stop, stop_bytes

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
    first, again = own_stop("", ["a"])
    assert first.data == again.data == b"\x1b\x05a\x05a\x1b\n\x1b\x05"
    pieces = [piece.data for piece in own_stop("pmx", ["00", "01"])]
    assert pieces[:2] == [b"@00ABORT\r", b"@01ABORT\r"] and b"@01SR0=0\r" in pieces
