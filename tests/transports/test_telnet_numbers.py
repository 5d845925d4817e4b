"""The numbers of telnet and of RFC 2217, which other makers' servers and clients know."""

from __future__ import annotations

from multidrop.transports import telnet
from multidrop.transports.telnet import Control, Data, Decoder, Interrupt, Option, Setting, Subnegotiation
from tests.support.cases import for_each


@for_each(
    "number, value",
    [
        (telnet.IAC, 255),
        (telnet.DONT, 254),
        (telnet.DO, 253),
        (telnet.WONT, 252),
        (telnet.WILL, 251),
        (telnet.SB, 250),
        (telnet.IP, 244),
        (telnet.SE, 240),
        (telnet.BINARY, 0),
        (telnet.SGA, 3),
        (telnet.OPTION, 44),
        (telnet.REPLY, 100),
        (telnet.PURGE_RECEIVED, 1),
        (telnet.PURGE_UNSENT, 2),
        (telnet.PURGE_BOTH, 3),
        (telnet.LONGEST_SUBNEGOTIATION, 256),
    ],
)
def test_a_number_of_telnet_is_as_the_rfcs_say(number: int, value: int) -> None:
    assert number == value


def test_the_requests_and_the_controls_have_the_numbers_of_rfc_2217() -> None:
    assert {each.name: int(each) for each in Setting} == {
        "SIGNATURE": 0,
        "BAUD": 1,
        "DATA_SIZE": 2,
        "PARITY": 3,
        "STOP_SIZE": 4,
        "CONTROL": 5,
        "LINE_STATE": 6,
        "MODEM_STATE": 7,
        "SUSPEND": 8,
        "RESUME": 9,
        "LINE_MASK": 10,
        "MODEM_MASK": 11,
        "PURGE": 12,
    }
    assert {each.name: int(each) for each in Control} == {
        "ASK_FLOW": 0,
        "NO_FLOW": 1,
        "ASK_BREAK": 4,
        "BREAK_ON": 5,
        "BREAK_OFF": 6,
        "ASK_DTR": 7,
        "DTR_ON": 8,
        "DTR_OFF": 9,
        "ASK_RTS": 10,
        "RTS_ON": 11,
        "RTS_OFF": 12,
        "ASK_FLOW_IN": 13,
        "NO_FLOW_IN": 14,
    }
    assert telnet.NEEDED == {2: 8, 3: 1, 4: 1}, "8N1"


def test_each_value_of_a_control_belongs_to_what_it_sets() -> None:
    groups = [telnet.group_of(value) for value in range(256)]
    flow, inward = "flow control", "inbound flow control"
    assert groups[:20] == [
        *[flow] * 4,
        *["break"] * 3,
        *["DTR"] * 3,
        *["RTS"] * 3,
        *[inward] * 4,
        flow,
        inward,
        flow,
    ]
    assert set(groups[20:]) == {""}


@for_each(
    "setting, value, data",
    [
        (Setting.BAUD, 115200, b"\x2c\x01\x00\x01\xc2\x00"),
        (Setting.BAUD + 100, 9600, b"\x2c\x65\x00\x00\x25\x80"),
        (Setting.CONTROL, Control.DTR_ON, b"\x2c\x05\x08"),
        (Setting.CONTROL + 100, 255, b"\x2c\x69\xff\xff"),
        (Setting.SIGNATURE + 100, b"PC\xff", b"\x2c\x64PC\xff\xff"),
    ],
)
def test_a_message_is_a_subnegotiation_that_reads_back(setting: int, value: int | bytes, data: bytes) -> None:
    made = telnet.message(setting, value)
    assert made == b"\xff\xfa" + data + b"\xff\xf0"
    (event,) = Decoder().receive(made)
    assert isinstance(event, Subnegotiation)
    number, read = telnet.parsed(event.body) or (0, b"")
    assert (number, read if isinstance(value, bytes) else int.from_bytes(read)) == (setting, value)


@for_each(
    "body, found",
    [
        (b"\x2c\x00", (0, b"")),
        (b"\x2c\x07\x05", (7, b"\x05")),
        (b"\x2c", None),
        (b"", None),
        (b"\x01\x2c", None),
        (b"\x2d\x01\x05", None),
    ],
)
def test_only_a_whole_subnegotiation_of_the_com_port_option_is_one(
    body: bytes, found: tuple[int, bytes] | None
) -> None:
    assert telnet.parsed(body) == found


@for_each(
    "data, events",
    [
        (b"", []),
        (b"ab", [Data(b"ab")]),
        (b"a\xff\xffb", [Data(b"a\xffb")]),
        (b"a\xff\xf4b", [Data(b"a"), Interrupt(), Data(b"b")]),
        (
            b"\xff\xfb\x00\xff\xfc\x01\xff\xfd\x03\xff\xfe\x2c",
            [Option(251, 0), Option(252, 1), Option(253, 3), Option(254, 44)],
        ),
        (b"a\xff\xfa\x2c\x00\xff\xff\xff\xf0b", [Data(b"a"), Subnegotiation(b"\x2c\x00\xff"), Data(b"b")]),
        (b"a\xff\xf0b\xff\xf1c", [Data(b"abc")]),
        (b"\xff\xfa\xff\xf0", [Subnegotiation(b"")]),
        (b"\xff\xfa12\xff\xfa3\xff\xf0", [Subnegotiation(b"3")]),
        (b"\xff\xfa1\xff\xfb\x002\xff\xf0", [Option(251, 0), Subnegotiation(b"12")]),
    ],
)
def test_the_bytes_of_a_telnet_stream_are_these_events(data: bytes, events: list[telnet.Event]) -> None:
    assert Decoder().receive(data) == events
    one_by_one, found = Decoder(), list[telnet.Event]()
    for byte in data:
        found += one_by_one.receive(bytes([byte]))
    assert [each for each in found if not isinstance(each, Data)] == [
        each for each in events if not isinstance(each, Data)
    ]


def test_data_that_came_in_pieces_is_delivered_as_it_comes() -> None:
    decoder = Decoder()
    assert [decoder.receive(each) for each in (b"\xff", b"\xfb", b"\x01", b"a", b"\xff", b"\xff")] == [
        [],
        [],
        [Option(251, 1)],
        [Data(b"a")],
        [],
        [Data(b"\xff")],
    ]
