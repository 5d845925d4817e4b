"""Modbus/TCP at a simulated drive, byte for byte: every function code, every way a message can be wrong or cut up.

The bytes are worked out by hand from the Modbus/TCP manual (sections 3.2 and 4, with the printed slips of its examples
put right) and the MODBUS standard, not by any code of ours.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.modbus import ModbusPort
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from tests.support.cases import for_each
from tests.support.examples import examples

CELL = '[[bus]]\nname = "eth"\n[[bus.drive]]\npersonality = "{}"\n'


def drive(personality: str = "LMDCE") -> tuple[ModbusPort, MCodeDevice, Floor]:
    floor = Floor(read(CELL.format(personality)))
    return floor.own_port("eth"), floor.drives[0].device, floor


def message(pdu: str, transaction: str = "0001", unit: str = "01") -> bytes:
    """A whole message around a PDU in hex."""
    body = bytes.fromhex(pdu)
    return bytes.fromhex(transaction) + b"\0\0" + (len(body) + 1).to_bytes(2) + bytes.fromhex(unit) + body


def ask(port: ModbusPort, pdu: str, now: float = 0.0) -> str:
    """The PDU of the answer, as hex."""
    answer = port.receive(message(pdu), now)
    assert answer[:4] == bytes.fromhex("00010000") and answer[6] == 1
    assert int.from_bytes(answer[4:6]) == len(answer) - 6
    return answer[7:].hex(" ")


# Each function code.


def test_a_whole_message_with_its_header():
    port, _, _ = drive()
    assert port.receive(bytes.fromhex("1234 0000 0006 11 03 008B 0002"), 0.0) == bytes.fromhex(
        "1234 0000 0007 11 03 04 B800 000B"  # 768000 = 0x000BB800, low word first
    )


def test_a_register_of_two_words_is_written_low_word_first():
    port, device, _ = drive()
    assert ask(port, "10 008B 0002 04 27C0 0009") == "10 00 8b 00 02"
    assert device.memory.values["VM"] == 600_000


def test_negative_numbers_are_twos_complement_over_both_words():
    port, device, _ = drive()
    assert ask(port, "10 0057 0002 04 FFFF FFFF") == "10 00 57 00 02"
    assert device.position(0.0) == -1
    assert ask(port, "03 0057 0002") == "03 04 ff ff ff ff"


def test_coils_are_the_outputs_that_are_active_and_there_is_no_fourth():
    port, device, _ = drive()
    for line in ("OS=1,16,1", "OS=3,16,0", "O1=1", "O3=1"):
        assert not device.execute(line, 0.0).refused
    assert ask(port, "01 0000 0004") == "01 01 05"
    assert ask(port, "01 0002 0001") == "01 01 01"
    assert ask(port, "01 0003 0001") == "01 01 00"


@pytest.mark.parametrize("start", ["0000", "002D"])
def test_inputs_stand_at_0_and_at_their_registers(start):
    port, device, floor = drive()
    for n in (1, 2, 4):
        floor.command(f"/sim input ! {n} 0", 0.0)  # ground is active with IS=n,0,0
    assert ask(port, f"02 {start} 0004") == "02 01 0b"
    assert ask(port, f"02 {(int(start, 16) + 2):04X} 0002") == "02 01 02"


def test_a_coil_is_switched_and_echoed():
    port, device, _ = drive()
    assert ask(port, "05 0002 FF00") == "05 00 02 ff 00"
    assert device.outputs(0.0) == {1: False, 2: False, 3: True}
    assert ask(port, "05 0002 0000") == "05 00 02 00 00"
    assert device.outputs(0.0)[3] is False


def test_identification_tells_all_seven_objects():
    port, _, _ = drive()
    all_of_them = (
        "00 07 53454D20555341"  # SEM USA
        "01 08 4C4D444345353731"  # LMDCE571
        "02 07 342E302E302E30"  # 4.0.0.0
        "03 21 7777772E6D6F74696F6E2E7363686E65696465722D656C6563747269632E636F6D"
        "04 16 4C657869756D204D4472697665204574686572 6E6574"
        "05 09 303430313030303333"  # the simulated drive's serial number
        "06 14 4C4D44434520362E3030322C2048773A20332E32"  # LMDCE 6.002, Hw: 3.2
    )
    basic = all_of_them[: all_of_them.index("03 21")]
    for code, objects in (("01", basic), ("02", all_of_them), ("03", all_of_them)):
        count = "03" if code == "01" else "07"
        expected = bytes.fromhex(f"2B 0E {code} 83 00 00 {count} {objects}")
        assert ask(port, f"2B 0E {code} 00") == expected.hex(" ")


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("2B 0E 04 00", "2B 0E 04 83 00 00 01 00 07 53454D20555341"),
        ("2B 0E 04 02", "2B 0E 04 83 00 00 01 02 07 342E302E302E30"),
        ("2B 0E 04 07", "AB 02"),
        ("2B 0E 04 FF", "AB 02"),
        ("2B 0E 01 02", "2B 0E 01 83 00 00 01 02 07 342E302E302E30"),  # from an object on
        ("2B 0E 00 00", "AB 03"),
        ("2B 0E 05 00", "AB 03"),
        ("2B 0E 01", "AB 03"),
        ("2B 0E 01 00 00", "AB 03"),
        ("2B 0D 01 00", "AB 01"),  # another interface than device identification
        ("2B", "AB 03"),
    ],
)
def test_identification_answers_each_code_and_refuses_the_others(asked, answered):
    port, _, _ = drive()
    assert ask(port, asked) == bytes.fromhex(answered).hex(" ")


def test_identification_from_an_object_that_is_not_there_begins_anew():
    port, _, _ = drive()
    assert ask(port, "2B 0E 01 09") == ask(port, "2B 0E 01 00")


@pytest.mark.parametrize(
    ("mnemonic", "text"),
    [
        ("2020 5349", "IS = 1, 0, 0\r\nIS = 2, 0, 0\r\nIS = 3, 0, 0\r\nIS = 4, 0, 0\r\nIS = 6, 0, 0"),
        ("2020 534F", "OS = 1, 16, 0\r\nOS = 2, 16, 0\r\nOS = 3, 16, 0"),
        ("2020 5254", "0, 0, 0"),  # the manual's example
        ("2020 554D", "0"),
        ("2020 3153", "0, 0, 0"),
        ("2020 3553", "9, 0, 0"),
        ("2020 2045", ""),
    ],
)
def test_what_has_no_register_is_read_by_its_name_backwards(mnemonic, text):
    port, _, _ = drive()
    assert ask(port, f"41 {mnemonic}") == (bytes((0x41, len(text))) + text.encode()).hex(" ")


@pytest.mark.parametrize(
    ("asked", "answered", "line", "printed"),
    [
        ("42 2020 5349 06 3D312C312C30", "42 06 20 20 53 49", "IS", "IS = 1, 1, 0"),
        ("42 2020 3153 06 3D302C312C30", "42 06 20 20 31 53", "IS", "IS = 1, 0, 1"),  # the manual's example
        ("42 2020 534F 07 3D312C31372C31", "42 07 20 20 53 4f", "OS", "OS = 1, 17, 1"),
        ("42 2020 5254 06 3D3635303030", "42 06 20 20 52 54", "TR", "65000, 0, 0"),
        ("42 2020 554D 04 3D322C30", "42 04 20 20 55 4d", "MU", "2"),
    ],
)
def test_what_has_no_register_is_written_by_its_name_backwards(asked, answered, line, printed):
    port, device, _ = drive()
    assert ask(port, asked) == answered
    assert device.execute(f"PR {line}", 0.0).lines[0] == printed


def test_the_analog_input_is_set_up_like_the_others():
    port, device, _ = drive()
    assert ask(port, "42 2020 5349 07 3D352C31302C31") == "42 07 20 20 53 49"
    assert device.motor.inputs.types[5] == (10, 1)


def test_a_program_is_run_paused_resumed_and_ended():
    port, device, _ = drive()
    for line in ("PG 100", "LB A3", "H 1000", "BR A3", "E", "PG"):
        assert not device.execute(line, 0.0).refused
    assert ask(port, "42 2020 5845 02 4133", 1.0) == "42 02 20 20 58 45"  # EX A3
    assert ask(port, "03 0004 0001", 1.5) == "03 02 00 01"  # BY
    assert ask(port, "42 2020 5350 00", 2.0) == "42 00 20 20 53 50"  # PS
    assert device.core.thread.paused
    assert ask(port, "42 2020 5352 00", 3.0) == "42 00 20 20 53 52"  # RS
    assert not device.core.thread.paused
    assert ask(port, "42 2020 2045 00", 4.0) == "42 00 20 20 20 45"  # E
    assert ask(port, "03 0004 0001", 4.0) == "03 02 00 00"
    assert ask(port, "42 2020 5845 02 4133", 5.0) == "42 02 20 20 58 45"
    assert ask(port, "41 2020 2045", 6.0) == "41 00"  # E the other way
    assert ask(port, "03 0004 0001", 6.0) == "03 02 00 00"


@pytest.mark.parametrize("function", [0, 4, 6, 7, 8, 15, 17, 20, 22, 23, 24, 42, 64, 67, 100, 127, 128, 131, 255])
def test_other_functions_are_exception_1(function):
    port, _, _ = drive()
    assert ask(port, f"{function:02X} 0057 0001") == f"{function | 0x80:02x} 01"


@for_each(
    ("pdu", "code"),
    [
        ("01 0000 0000", 3), ("01 0000 0005", 3), ("01 0000 FFFF", 3), ("01 0001 0004", 2), ("01 0004 0001", 2),
        ("01 002D 0001", 2), ("01 0000", 3), ("01", 3), ("01 0000 0004 00", 3),
        ("02 0000 0000", 3), ("02 0000 0005", 3), ("02 0003 0002", 2), ("02 0004 0001", 2), ("02 002C 0001", 2),
        ("02 0030 0002", 2), ("02 0031 0001", 2), ("02 FFFF 0004", 2), ("02 002D 00", 3),
        ("03 0057 0000", 3), ("03 0057 0003", 3), ("03 0057 007D", 3), ("03 0057 FFFF", 3), ("03 00B7 0002", 2),
        ("03 00B8 0001", 2), ("03 FFFF 0001", 2), ("03 FFFF 0002", 2), ("03 0021 0002", 2), ("03 0023 0001", 2),
        ("03 00A2 0001", 2), ("03 0057", 3), ("03 0057 0002 00", 3),
        ("05 0003 FF00", 2), ("05 FFFF 0000", 2), ("05 0000 0001", 3), ("05 0000 00FF", 3), ("05 0003 1234", 3),
        ("05 0000 FF", 3), ("05 0000 FF00 00", 3),
        ("10 0057 0001 02 0000", 3), ("10 0058 0001 02 0000", 3),  # half a value
        ("10 0057 0003 06 0000 0000 0000", 3), ("10 0057 0000 00", 3), ("10 0057 0002 04 0000", 3),
        ("10 0057 0002 02 0000 0000", 3), ("10 0057 0002 04 0000 0000 00", 3), ("10 0057 0002", 3), ("10", 3),
        ("10 0006 0002 04 0000 0000", 3),  # halves of two values
        ("10 0002 0001 02 0000", 2), ("10 00B8 0001 02 0000", 2), ("10 00B7 0002 04 0000 0000", 2),
        ("10 0085 0002 04 0000 0000", 2),  # V cannot be written
        ("41 2020 4349", 3), ("41 5349 2020", 3), ("41 2020 5845", 3), ("41 2020 53", 3), ("41 2020 5349 00", 3),
        ("41 2020 5350", 3), ("41 2020 7369", 3), ("41 FFFF FFFF", 3),
        ("42 2020 2050 02 3D31", 3),  # P has a register
        ("42 2020 5349 06 3D312C312C", 3), ("42 2020 5349 05 3D312C312C30", 3), ("42 2020 5349", 3), ("42", 3),
        ("42 2020 5349 1D 3D" + "31" * 28, 3), ("42 2020 5349 02 3D0D", 3), ("42 2020 5349 02 3DE4", 3),
        ("42 2020 5845 02 5A39", 4),  # EX Z9: no such label
        ("42 2020 5350 00", 4), ("42 2020 5352 00", 4),  # nothing runs, nothing is paused
        ("42 2020 5349 06 3D372C302C30", 4),  # no input 7
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_request_is_told_by_its_exception(pdu, code):
    port, device, _ = drive()
    assert ask(port, pdu) == f"{int(pdu[:2], 16) | 0x80:02x} {code:02x}"
    assert device.memory.error_flag == (code == 4), "a refusal of the drive, and only that, sets its error"


# Messages in a stream.


def test_messages_cut_up_byte_by_byte_are_answered_when_they_are_whole():
    port, _, _ = drive()
    request = message("03 008B 0002")
    answers = [port.receive(bytes((byte,)), 0.0) for byte in request]
    assert answers[:-1] == [b""] * (len(request) - 1)
    assert answers[-1] == message("03 04 B800 000B")


def test_requests_in_one_piece_are_answered_in_their_order_each_as_itself():
    port, _, _ = drive()
    asked = (
        message("03 0057 0002", "0007", "00") + message("06 0057 0001", "0007", "FF") + message("03 0029 0001", "FFFF")
    )
    assert port.receive(asked + message("03 00")[:8], 0.0) == (
        message("03 04 0000 0000", "0007", "00") + message("86 01", "0007", "FF") + message("03 02 0005", "FFFF")
    )
    assert not port.closed


@pytest.mark.parametrize("unit", ["00", "01", "7F", "F7", "FF"])
def test_any_unit_is_answered_and_given_back(unit):
    port, _, _ = drive()
    assert port.receive(message("03 0029 0001", unit=unit), 0.0) == message("03 02 0005", unit=unit)


def test_another_protocol_is_passed_over():
    port, _, _ = drive()
    other = bytes.fromhex("0001 0001 0006 01 10 0057 0001")
    assert port.receive(other, 0.0) == b""
    assert port.receive(other + message("03 0029 0001"), 0.0) == message("03 02 0005")
    assert not port.closed


@pytest.mark.parametrize("length", [0, 1, 255, 256, 0x2F20, 0xFFFF])
def test_a_length_that_cannot_be_ends_the_connection_after_the_answers_so_far(length):
    port, _, _ = drive()
    wrong = b"\0\1\0\0" + length.to_bytes(2)
    assert port.receive(message("03 0029 0001") + wrong, 0.0) == message("03 02 0005")
    assert port.closed
    assert port.receive(message("03 0029 0001"), 0.0) == b""


def test_the_longest_message_there_can_be_is_heard():
    port, _, _ = drive()
    assert ask(port, "03" + "00" * 252) == "83 03"
    assert not port.closed


def test_clients_do_not_hear_each_others_halves():
    one, _, floor = drive()
    other = floor.own_port("eth")
    request = message("03 0029 0001")
    assert one.receive(request[:6], 0.0) == b""
    assert other.receive(request, 0.0) == message("03 02 0005")
    assert one.receive(request[6:], 0.0) == message("03 02 0005")


def test_a_drive_without_power_is_silent_and_forgets_what_had_begun():
    port, device, _ = drive()
    request = message("03 0029 0001")
    assert port.receive(request[:5], 0.0) == b""
    device.power(False, 1.0)
    assert port.receive(request, 1.0) == b""
    device.power(True, 2.0)
    assert port.receive(request, 3.0) == b"", "an Ethernet drive takes its time to begin"
    assert port.receive(request, 60.0) == message("03 02 0005")


# Any bytes.


def check(port: ModbusPort, answers: bytes) -> None:
    """Whole messages, each with an answer that a client can make sense of."""
    while answers:
        length = int.from_bytes(answers[4:6])
        assert answers[2:4] == b"\0\0" and 3 <= length <= 254 and len(answers) >= 6 + length
        pdu, answers = answers[7 : 6 + length], answers[6 + length :]
        if pdu[0] & 0x80:
            assert len(pdu) == 2 and pdu[1] in (1, 2, 3, 4)
        else:
            assert pdu[0] in (1, 2, 3, 5, 16, 43, 65, 66)
    assert len(port._begun) < 260


@examples(100, nightly=1000)
@given(st.lists(st.binary(max_size=60), max_size=8))
def test_any_bytes_are_answered_or_end_the_connection(pieces):
    port, _, _ = drive()
    for at, piece in enumerate(pieces):
        check(port, port.receive(piece, at / 10))


WORDS = st.sampled_from(["IS", "OS", "TR", "MU", "E", "EX", "PS", "RS", "S1", "P", "PR", "PG", "", "CP", "FD"])
NAMED = st.builds(
    lambda function, word, data: bytes((function,)) + word[::-1].rjust(4).encode() + bytes((len(data),)) + data,
    st.sampled_from([65, 66]),
    WORDS,
    st.text("=,0123456789-AZk. '\"", max_size=30).map(str.encode),
)
PAIRS = st.builds(
    lambda function, first, second, rest: bytes((function,)) + first.to_bytes(2) + second.to_bytes(2) + rest,
    st.sampled_from([1, 2, 3, 5]),
    st.integers(0, 0xC0),
    st.sampled_from([0, 1, 2, 3, 4, 5, 0xFF00, 0xFFFF]),
    st.sampled_from([b"", b"", b"\0"]),
)
WRITES = st.builds(
    lambda first, data: b"\x10" + first.to_bytes(2) + (len(data) // 2).to_bytes(2) + bytes((len(data),)) + data,
    st.integers(0, 0xC0),
    st.binary(min_size=1, max_size=5),
)
PDUS = st.one_of(NAMED, PAIRS, WRITES, st.binary(min_size=1, max_size=40))


@examples(100, nightly=1000)
@given(st.lists(PDUS, max_size=12), st.integers(1, 50), st.sampled_from(["LMDOE", "LMDCE"]))
def test_requests_of_every_kind_get_one_answer_each_however_they_are_cut(pdus, size, personality):
    whole, _, _ = drive(personality)
    cut, _, _ = drive(personality)
    stream = b"".join(message(pdu.hex(), f"{number:04X}") for number, pdu in enumerate(pdus))
    answers = whole.receive(stream, 1.0)
    pieces = b"".join(cut.receive(stream[at : at + size], 1.0) for at in range(0, len(stream), size))
    assert answers == pieces and not whole.closed
    check(whole, answers)
    transactions = []
    while answers:
        transactions.append(int.from_bytes(answers[:2]))
        answers = answers[6 + int.from_bytes(answers[4:6]) :]
    assert transactions == list(range(len(pdus)))
