"""Modbus messages, byte for byte as the manual (4.1 to 4.3, with the standard where it misprints) has them."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects import End, Kind, Request
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from tests.support.cases import for_each

DRIVE = Modbus()


def h(text: str) -> bytes:
    return bytes.fromhex(text)


def request(pdu: bytes, tag: int = 0x1234) -> Request:
    return Request("", "a line", Kind.PRINT, DRIVE, tag=tag, body=pdu)


GOLDEN = {
    # 4.2.2: O1 and O3 are on, four asked for: 05
    "read coils": (
        pdu_codec().read(framing.READ_COILS, 0, 4),
        "1234 0000 0006 01 01 0000 0004",
        "1234 0000 0004 01 01 01 05",
        lambda answer: pdu_codec().bits(answer, 4) == (1, 0, 1, 0),
    ),
    # 4.2.1: I1, I2 and I4 are on: 0B
    "read inputs": (
        pdu_codec().read(framing.READ_INPUTS, 0x2D, 4),
        "1234 0000 0006 01 02 002D 0004",
        "1234 0000 0004 01 02 01 0B",
        lambda answer: pdu_codec().bits(answer, 4) == (1, 1, 0, 1),
    ),
    # 4.2.4: VM is 768000 = 000B B800, low word first
    "read registers": (
        mapping.read(REGISTERS["VM"]),
        "1234 0000 0006 01 03 008B 0002",
        "1234 0000 0007 01 03 04 B800 000B",
        lambda answer: mapping.value_of(REGISTERS["VM"], pdu_codec().registers(answer)) == 768000,
    ),
    # P is -2 = FFFF FFFE
    "read a negative value": (
        mapping.read(REGISTERS["P"]),
        "1234 0000 0006 01 03 0057 0002",
        "1234 0000 0007 01 03 04 FFFE FFFF",
        lambda answer: mapping.value_of(REGISTERS["P"], pdu_codec().registers(answer)) == -2,
    ),
    # HT is one register of two bytes, without a sign: 65535
    "read one register": (
        mapping.read(REGISTERS["HT"]),
        "1234 0000 0006 01 03 002C 0001",
        "1234 0000 0005 01 03 02 FFFF",
        lambda answer: mapping.value_of(REGISTERS["HT"], pdu_codec().registers(answer)) == 65535,
    ),
    # 4.2.3: output 3 on
    "write coil": (
        pdu_codec().write_coil(2, True),
        "1234 0000 0006 01 05 0002 FF00",
        "1234 0000 0006 01 05 0002 FF00",
        lambda answer: True,
    ),
    "write coil off": (
        pdu_codec().write_coil(0, False),
        "1234 0000 0006 01 05 0000 0000",
        "1234 0000 0006 01 05 0000 0000",
        lambda answer: True,
    ),
    # 4.2.5: VM=600000 = 0009 27C0
    "write registers": (
        mapping.write(REGISTERS["VM"], 600000),
        "1234 0000 000B 01 10 008B 0002 04 27C0 0009",
        "1234 0000 0006 01 10 008B 0002",
        lambda answer: True,
    ),
    "write a negative value": (
        mapping.write(REGISTERS["MR"], -51200),
        "1234 0000 000B 01 10 0046 0002 04 3800 FFFF",
        "1234 0000 0006 01 10 0046 0002",
        lambda answer: True,
    ),
    "write one register": (
        mapping.write(REGISTERS["HM"], 3),
        "1234 0000 0009 01 10 002B 0001 02 0003",
        "1234 0000 0006 01 10 002B 0001",
        lambda answer: True,
    ),
    # 4.1.1: vendor and part number, the rest cut short
    "identification": (
        pdu_codec().identify(3, 0),
        "1234 0000 0005 01 2B 0E 03 00",
        "1234 0000 0019 01 2B 0E 03 83 FF 02 02 00 07 53454D20555341 01 06 4C4D44434535",
        lambda answer: pdu_codec().objects(answer) == ({0: "SEM USA", 1: "LMDCE5"}, 2),
    ),
    # 4.3.2: TR reads "0, 0, 0"
    "read specific": (
        pdu_codec().read_specific("TR"),
        "1234 0000 0006 01 41 2020 5254",
        "1234 0000 000A 01 41 07 302C20302C2030",
        lambda answer: pdu_codec().specific(answer) == "0, 0, 0",
    ),
    # 4.3.1: E, without parameters
    "end program": (
        pdu_codec().read_specific("E"),
        "1234 0000 0006 01 41 2020 2045",
        "1234 0000 0003 01 41 00",
        lambda answer: pdu_codec().specific(answer) == "",
    ),
    # 4.3.3: S1=0,1,0, and the count of the data string
    "write specific": (
        pdu_codec().write_specific("S1", "=0,1,0"),
        "1234 0000 000D 01 42 2020 3153 06 3D302C312C30",
        "1234 0000 0007 01 42 06 2020 3153",
        lambda answer: True,
    ),
    "execute": (
        pdu_codec().write_specific("EX", "A3"),
        "1234 0000 0009 01 42 2020 5845 02 4133",
        "1234 0000 0007 01 42 02 2020 5845",
        lambda answer: True,
    ),
    "pause": (
        pdu_codec().write_specific("PS", ""),
        "1234 0000 0007 01 42 2020 5350 00",
        "1234 0000 0007 01 42 00 2020 5350",
        lambda answer: True,
    ),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_requests_are_written_byte_for_byte(name):
    pdu, asked, _, _ = GOLDEN[name]
    assert DRIVE.encode(request(pdu)).hex() == h(asked).hex()


@pytest.mark.parametrize("name", GOLDEN)
def test_answers_are_read_whole_and_byte_by_byte(name):
    pdu, _, answer, means = GOLDEN[name]
    data = h(answer)
    for size in range(len(data)):
        assert DRIVE.decode(request(pdu), data[:size]) is None
    found = DRIVE.decode(request(pdu), data + b"\x12")
    assert found and found.reply.end is End.DONE and found.used == len(data)
    assert means(found.reply.body)


@for_each("name", GOLDEN)
@for_each("number", [1, 2, 3, 4])
def test_exceptions_of_every_function(name, number):
    pdu = GOLDEN[name][0]
    data = h("1234 0000 0003 01") + bytes((pdu[0] | 0x80, number))
    found = DRIVE.decode(request(pdu), data)
    assert found and found.reply.end is End.REFUSED and found.reply.body[1] == number
    assert found.reply.detail == framing.EXCEPTIONS[number]


def test_an_exception_may_leave_the_function_out():
    found = DRIVE.decode(request(pdu_codec().read_specific("E")), h("1234 0000 0003 01 80 01"))
    assert found and found.reply.end is End.REFUSED and found.reply.body[1] == 1


@pytest.mark.parametrize(
    "late",
    [
        "1233 0000 0007 01 03 04 0000 0001",  # another request's number
        "1234 0000 0006 01 10 0057 0002",  # another function
        "1233 0000 0003 01 83 02",
    ],
)
def test_an_answer_with_another_number_or_function_is_passed_over(late):
    pdu = mapping.read(REGISTERS["P"])
    right = h("1234 0000 0007 01 03 04 0005 0000")
    assert DRIVE.decode(request(pdu), h(late)) is None
    found = DRIVE.decode(request(pdu), h(late) + right)
    assert found and found.used == len(h(late) + right) and pdu_codec().registers(found.reply.body) == (5, 0)


@pytest.mark.parametrize("unit", [0, 1, 7, 255])
def test_any_unit_may_answer(unit):
    found = DRIVE.decode(request(mapping.read(REGISTERS["HT"])), h("1234 0000 0005") + bytes((unit,)) + h("03 02 0007"))
    assert found and found.reply.end is End.DONE


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        (mapping.read(REGISTERS["P"]), "1234 0000 0005 01 03 02 0005"),  # one register for two
        (mapping.read(REGISTERS["P"]), "1234 0000 0007 01 03 02 0005 0000"),  # a count that is wrong
        (mapping.read(REGISTERS["P"]), "1234 0000 0002 01 03"),
        (mapping.write(REGISTERS["P"], 0), "1234 0000 0006 01 10 0057 0001"),
        (mapping.write(REGISTERS["P"], 0), "1234 0000 0006 01 10 0059 0002"),
        (pdu_codec().write_coil(0, True), "1234 0000 0006 01 05 0000 0000"),
        (pdu_codec().read(framing.READ_COILS, 0, 4), "1234 0000 0003 01 01 00"),
        (pdu_codec().identify(4, 6), "1234 0000 0003 01 2B 0E"),
        (pdu_codec().read_specific("IS"), "1234 0000 0005 01 41 07 30 2C"),
        (mapping.read(REGISTERS["P"]), "1234 0000 0002 01 83"),  # an exception without its number
    ],
)
def test_an_answer_that_does_not_fit_the_question_is_damaged(asked, answer):
    found = DRIVE.decode(request(asked), h(answer))
    assert found and found.reply.end is End.DAMAGED and found.used == len(h(answer))


def test_what_is_no_modbus_is_damaged_and_shown():
    found = DRIVE.decode(request(mapping.read(REGISTERS["P"])), b"HTTP/1.1 400 Bad Request\r\n")
    assert found and found.reply.end is End.DAMAGED and "not Modbus" in found.reply.detail
    assert DRIVE.parse_unsolicited(b"SSH-2.0-OpenSSH\r\n") == (
        ("heard 53 53 48 2d 32 2e 30 2d 4f 70 65 6e 53 53 48 0d..., which is not Modbus/TCP",),
        17,
    )


def test_the_stop_ends_the_program_and_then_slews_at_nothing():
    end = h("FFFE 0000 0006 01 41 2020 2045")
    slew = h("FFFF 0000 000B 01 10 0078 0002 04 0000 0000")
    assert DRIVE.stop([""]) == end + slew
    assert [piece.data for piece in DRIVE.stop_again([""])] == [end, slew]
    assert DRIVE.invalidate() == b""


def test_the_answers_to_a_stop_are_no_lines_and_credited_to_nobody():
    answers = h("FFFE 0000 0003 01 41 00 FFFF 0000 0006 01 10 0078 0002")
    assert DRIVE.parse_unsolicited(answers) == ((), len(answers))
    assert DRIVE.parse_unsolicited(answers[:-1]) == ((), 9)
    for tag in (0, 0xFFFE, 0xFFFF, 0xFFEF):
        assert DRIVE.decode(request(pdu_codec().read_specific("E"), tag), answers) is None
        assert DRIVE.decode(request(mapping.write(REGISTERS["SL"], 0), tag), answers) is None


def test_time_is_up_with_half_an_answer_whose_rest_may_still_come():
    asked = request(mapping.read(REGISTERS["P"]))
    late, half = h("0001 0000 0003 01 83 02"), h("1234 0000 0007 01 03")
    assert (DRIVE.on_timeout(asked, b"").reply.end, DRIVE.on_timeout(asked, late).used) == (End.TIMEOUT, len(late))
    found = DRIVE.on_timeout(asked, late + half)
    assert (found.reply.end, found.used, found.reply.detail) == (End.DAMAGED, len(late), "it ends after 8 bytes")


@given(st.binary(max_size=300))
def test_any_bytes_are_decoded_without_an_error(data):
    for pdu, _, _, _ in GOLDEN.values():
        found = DRIVE.decode(request(pdu), data)
        assert found is None or 0 < found.used <= len(data)
    lines, used = DRIVE.parse_unsolicited(data)
    assert 0 <= used <= len(data)
    assert all(line.isprintable() for line in lines)


@given(st.binary(max_size=120), st.sampled_from(sorted(GOLDEN)))
def test_whatever_stands_in_an_answer_of_the_right_number_ends_the_request(data, name):
    pdu = GOLDEN[name][0]
    body = pdu[:1] + data
    found = DRIVE.decode(request(pdu), pdu_codec().message(0x1234, body, 1))
    assert found and found.reply.end in (End.DONE, End.DAMAGED)
    if found.reply.end is End.DONE and name == "identification":
        with contextlib.suppress(framing.NotModbus):
            pdu_codec().objects(found.reply.body)


@given(st.integers(-(2**31), 2**31 - 1))
def test_values_survive_their_words(value):
    assert framing.signed(framing.words_of(value, 2)) == value


def test_numbers_wrap_below_those_of_the_stop():
    state = ModbusState(DRIVE)
    assert state.codec.encode(request(b"\x01", 0xFFF0))[:2] == b"\x00\x00"
    assert state.codec.encode(request(b"\x01", 0xFFEF))[:2] == b"\xff\xef"


@for_each(
    ("came", "named"),
    [
        ("0000 0000 0007 01 03 04 0005 0000", "a reply with transaction number 0 came, and the request has 4660"),
        ("3412 0000 0003 01 83 02", "a reply with transaction number 13330 came, and the request has 4660"),
        ("1234 0000 0007 01 04 04 0005 0000", "a reply with function 4 came, and the request has function 3"),
        ("FFFE 0000 0003 01 41 00 FFFF 0000 0006 01 10 0078 0002", ""),  # replies to a stop
        ("", ""),
    ],
)
def test_silence_names_the_wrong_number_of_what_came(came, named):
    found = DRIVE.on_timeout(request(mapping.read(REGISTERS["P"])), h(came))
    assert (found.reply.end, found.reply.detail, found.used) == (End.TIMEOUT, named, len(h(came)))
