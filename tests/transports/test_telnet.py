"""The telnet codec: any bytes, in any grouping."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.transports import telnet
from multidrop.transports.telnet import (
    Data,
    Decoder,
    Event,
    Interrupt,
    Option,
    Setting,
    Subnegotiation,
    message,
    parsed,
)

PIECES = st.lists(
    st.one_of(
        st.binary(min_size=1).map(Data),
        st.builds(Option, st.sampled_from([telnet.WILL, telnet.WONT, telnet.DO, telnet.DONT]), st.integers(0, 255)),
        st.binary(max_size=telnet.LONGEST_SUBNEGOTIATION).map(Subnegotiation),
        st.just(Interrupt()),
    )
)


def encoded(event: Event) -> bytes:
    if isinstance(event, Data):
        return telnet.escaped(event.data)
    if isinstance(event, Option):
        return telnet.option(event.verb, event.option)
    return telnet.subnegotiation(event.body) if isinstance(event, Subnegotiation) else b"\xff\xf4"


def joined(events: list[Event]) -> list[Event]:
    """Events with neighbouring data in one."""
    found: list[Event] = []
    for each in events:
        if isinstance(each, Data) and found and isinstance(found[-1], Data):
            found[-1] = Data(found[-1].data + each.data)
        else:
            found.append(each)
    return found


@given(PIECES, st.integers(1, 9))
def test_what_is_encoded_is_decoded_in_any_grouping(events: list[Event], size: int) -> None:
    data = b"".join(map(encoded, events))
    decoder = Decoder()
    found = [each for at in range(0, len(data), size) for each in decoder.receive(data[at : at + size])]
    assert joined(found) == joined(events)


@given(st.binary(), st.integers(1, 5))
def test_any_bytes_are_decoded_alike_one_by_one_and_together(data: bytes, size: int) -> None:
    one_by_one = Decoder()
    found = [each for at in range(0, len(data), size) for each in one_by_one.receive(data[at : at + size])]
    assert joined(found) == joined(Decoder().receive(data))


def test_a_subnegotiation_without_an_end_keeps_no_more_than_its_length() -> None:
    decoder = Decoder()
    assert decoder.receive(b"\xff\xfa" + b"x" * 5000) == []
    (found,) = decoder.receive(b"\xff\xf0")
    assert found == Subnegotiation(b"x" * telnet.LONGEST_SUBNEGOTIATION)


@pytest.mark.parametrize("stray", [b"\xff\xf0", b"\xff\xf1", b"\xff\xf9"])
def test_commands_without_a_meaning_are_passed_over(stray: bytes) -> None:
    assert joined(Decoder().receive(b"a" + stray + b"b")) == [Data(b"ab")]


@pytest.mark.parametrize(
    ("made", "data"),
    [
        (message(Setting.BAUD, 9600), b"\xff\xfa\x2c\x01\x00\x00\x25\x80\xff\xf0"),
        (message(Setting.BAUD, 0xFF), b"\xff\xfa\x2c\x01\x00\x00\x00\xff\xff\xff\xf0"),
        (message(Setting.PURGE, 2), b"\xff\xfa\x2c\x0c\x02\xff\xf0"),
        (message(Setting.SIGNATURE, b""), b"\xff\xfa\x2c\x00\xff\xf0"),
    ],
)
def test_the_messages_of_rfc_2217(made: bytes, data: bytes) -> None:
    assert made == data


@pytest.mark.parametrize("body", [b"", b"\x2c", b"\x18\x01\x05"])
def test_other_subnegotiations_are_none_of_rfc_2217(body: bytes) -> None:
    assert parsed(body) is None
