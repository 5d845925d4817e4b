"""TMCL on the wire: frames of the manuals, replies whole and byte by byte, what is late, what is damaged, the stop."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import End
from multidrop.families.tmcl.host.codec import STOP_BYTES, Tmcl, replies_in
from multidrop.families.tmcl.manual.commands import parse

FRAMES = [
    ("ROR 0, 1000", "01 01 00 00 00 00 03 E8 ED"),
    ("ROR 0, -1000", "01 01 00 00 FF FF FC 18 14"),
    ("MST 0", "01 03 00 00 00 00 00 00 04"),
    ("MVP ABS, 0, 51200", "01 04 00 00 00 00 C8 00 CD"),
    ("MVP REL, 0, -1000", "01 04 01 00 FF FF FC 18 18"),
    ("SAP 4, 0, 100000", "01 05 04 00 00 01 86 A0 31"),
    ("GAP 1, 0", "01 06 01 00 00 00 00 00 08"),
    ("GGP 66, 0", "01 0A 42 00 00 00 00 00 4D"),
    ("RFS STATUS, 0", "01 0D 02 00 00 00 00 00 10"),
]
CODEC = Tmcl()
POSITION = bytes.fromhex("02 01 64 06 FF FF FC 18 7F")


def asked(text, address="1"):
    return CODEC.request(address, text, parse(text))


@pytest.mark.parametrize(("text", "frame"), FRAMES)
def test_what_a_line_puts_on_the_wire(text, frame):
    assert CODEC.encode(asked(text)) == bytes.fromhex(frame)


def test_a_reply_is_found_once_it_is_whole():
    for count in range(9):
        assert CODEC.decode(asked("GAP 1, 0"), POSITION[:count]) is None
    found = CODEC.decode(asked("GAP 1, 0"), POSITION + b"\x02")
    assert found is not None and (found.reply.lines, found.reply.end, found.used) == (("-1000",), End.DONE, 9)


def test_a_command_prints_nothing():
    found = CODEC.decode(asked("ROR 0, 1000"), bytes.fromhex("02 01 64 01 00 00 03 E8 53"))
    assert found is not None and found.reply.lines == () and found.reply.acknowledged


def test_a_status_below_100_is_a_refusal():
    found = CODEC.decode(asked("GAP 250, 0"), bytes.fromhex("02 01 03 06 00 00 00 00 0C"))
    assert found is not None and (found.reply.end, found.reply.text) == (End.REFUSED, "3")


@pytest.mark.parametrize("other", ["02 02 64 06 00 00 00 00 6E", "02 01 64 0A 00 00 00 05 76"])
def test_frames_of_another_module_or_command_are_passed_over(other):
    found = CODEC.decode(asked("GAP 1, 0"), bytes.fromhex(other) + POSITION)
    assert found is not None and found.reply.lines == ("-1000",)
    assert len(found.strays) == 1 and "late reply to" in found.strays[0]


def test_a_wrong_checksum_damages_the_reply_once_the_wire_was_quiet_for_as_long_as_a_module_needs():
    damaged = POSITION[:-1] + b"\x00"
    assert CODEC.decode(asked("GAP 1, 0"), damaged) is None
    assert CODEC.on_timeout(asked("GAP 1, 0"), damaged).reply.end is End.DAMAGED
    assert CODEC.quiet_time(asked("GAP 1, 0"), damaged) == 1.0


def test_a_damaged_request_is_refused_after_that_time_too():
    refused = bytes.fromhex("02 01 01 06 00 00 00 00 0A")
    assert CODEC.decode(asked("GAP 1, 0"), refused) is None
    reply = CODEC.on_timeout(asked("GAP 1, 0"), refused).reply
    assert (reply.end, reply.text) == (End.REFUSED, "1")


def test_what_download_mode_has_stored_was_not_executed():
    found = CODEC.decode(asked("MST 0"), bytes.fromhex("02 01 65 03 00 00 00 00 6B"))
    assert found is not None and (found.reply.end, found.reply.text) == (End.REFUSED, "101")


def test_a_version_that_looks_like_a_frame_is_a_version():
    text = b"1161V115"
    host = (text[-1] - sum(text[:-1])) % 256
    found = CODEC.decode(asked("136 0, 0, 0"), bytes([host]) + text)
    assert found is not None and found.reply.lines == ("1161V115",)


def test_a_reached_target_answers_nothing():
    reached = bytes.fromhex("02 01 80 8A 00 00 00 01 0E")
    found = CODEC.decode(asked("138 0, 0, 1"), reached + bytes.fromhex("02 01 64 8A 00 00 00 01 F2"))
    assert found is not None and found.reply.end is End.DONE
    assert found.strays == ("module 1: target reached, motor 0",)
    assert CODEC.parse_unsolicited(reached) == (("module 1: target reached, motor 0",), 9)


def test_the_version_as_text_has_no_checksum():
    found = CODEC.decode(asked("136 0, 0, 0"), b"\x021161V115")
    assert found is not None and found.reply.lines == ("1161V115",)


def test_replies_to_a_stop_are_no_news():
    assert CODEC.parse_unsolicited(bytes.fromhex("02 01 64 03 00 00 00 00 6A") + b"\x02") == ((), 9)


def test_the_stop_goes_to_each_motor_of_each_module_a_frame_at_a_time_and_again():
    codec = Tmcl((("1", 2), ("7", 1)))
    first = codec.stop(["1", "7"])
    assert first == bytes.fromhex("01 03 00 00 00 00 00 00 04")
    again = codec.stop_again(["1", "7"])
    frames = [(data[0], data[1], data[3]) for data in (first, *(piece.data for piece in again))]
    whole = [(1, 128, 0), (7, 128, 0), (1, 3, 0), (7, 3, 0), (1, 3, 1), (1, 13, 0), (7, 13, 0), (1, 13, 1)]
    assert frames == [(1, 3, 0), (7, 3, 0), *whole, *whole]
    assert [piece.quiet for piece in again] == [*[0.03] * 9, 1.0, *[0.03] * 7]
    assert {data[2] for data in (piece.data for piece in again) if data[1] == 13} == {1}


def test_the_stop_of_a_module_in_download_mode_ends_that_first_both_times():
    codec = Tmcl((("1", 1),), storing=True)
    pieces = codec.stop_again(["1"])
    assert [data[1] for data in (codec.stop(["1"]), *(piece.data for piece in pieces))] == [133, 128, 3, 13] * 2
    assert [piece.quiet for piece in pieces] == [0.03, 0.03, 0.03, 1.0, 0.03, 0.03, 0.03]
    assert all(STOP_BYTES.fullmatch(piece.data) for piece in pieces)


def test_a_module_whose_motors_are_not_counted_is_stopped_with_as_many_as_any_has():
    codec = Tmcl((("1", 1),))
    frames = [codec.stop(["9", "1"]), *(piece.data for piece in codec.stop_again(["9", "1"]))]
    stops = [(data[0], data[3]) for data in frames[4:11]]
    assert stops == [(9, 0), (1, 0), *((9, motor) for motor in range(1, 6))]


@pytest.mark.parametrize("name", ["999", "0", "a", "\u0663", "01"])
def test_a_name_that_is_no_address_keeps_no_module_from_its_stop(name):
    assert CODEC.stop([name, "7"])[0] == 7


def test_whose_stop_is_heard():
    codec = Tmcl((("1", 1), ("7", 1)))
    first = codec.stop(["1", "7"])
    assert codec.hears_stop(first, "1") and not codec.hears_stop(first, "7")
    assert not Tmcl((("1", 2),)).hears_stop(first, "1")  # its second motor is not in it


def test_without_a_known_module_the_stop_is_for_the_factory_address():
    assert CODEC.stop([]) == bytes.fromhex("01 03 00 00 00 00 00 00 04")


@pytest.mark.parametrize("address", ["0", "256", "a", "", "\u0663", "1 ", "01"])
def test_an_address_is_1_to_255(address):
    with pytest.raises(Inexpressible, match="valid: 1 to 255"):
        asked("GAP 1, 0", address)


@given(st.binary(max_size=40), st.sampled_from(["GAP 1, 0", "ROR 0, 1", "136 0, 0, 0", "RFS STATUS, 0"]))
def test_any_bytes_give_a_reply_or_wait(data, text):
    request = asked(text)
    found = CODEC.decode(request, data)
    assert found is None or found.used <= len(data)
    late = CODEC.on_timeout(request, data)
    assert late.used == len(data) or (late.reply.end is End.DONE and late.used == 9)
    assert CODEC.parse_unsolicited(data)[1] % 9 == 0


@given(st.binary(max_size=12), st.binary(max_size=12))
def test_a_reply_is_recognised_wherever_it_begins(before, after):
    assert "1" in replies_in(before + bytes.fromhex("02 01 64 06 00 00 00 05 72") + after)


@given(st.lists(st.sampled_from([b"PR VR", b"LMDCM 6.002, Hw: 3.2", b"\r\n", b"?", b">", b"100", b"dd"]), max_size=30))
def test_text_is_taken_for_no_reply(words):
    assert not replies_in(b"".join(words))


@pytest.mark.parametrize(
    ("received", "replied"),
    [
        ("02 01 64 06 FF FF FC 18 7F", True),
        ("00 02 01 64 06 FF FF FC 18 7F", True),
        ("02 02 64 06 00 00 00 00 6E", None),
        ("02 01 64 0A 00 00 00 05 76", None),
        ("02 01 64 06 FF FF FC 18", None),
        ("", None),
    ],
)
def test_only_a_frame_with_the_address_and_the_command_of_a_request_shows_that_it_was_replied_to(received, replied):
    assert CODEC.replied(CODEC.encode(asked("GAP 1, 0")), bytes.fromhex(received)) is replied
