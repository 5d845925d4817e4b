"""Keys of single step on the wire, and what can follow a traced line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.dialects.codec import Decoded, End
from multidrop.dialects.program_files import Stored
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.debugging import (
    ENTER,
    SPACE,
    MCodeDebugging,
    key,
)
from multidrop.families.lexium.host.mcode.state import MCodeState

PROGRAM = [
    Stored(1, "LB SU"),
    Stored(6, "VA Q1=0"),
    Stored(14, "LB K1"),
    Stored(19, "MR 51200"),
    Stored(26, "CL K2"),
    Stored(31, "BR K1,Q1<3"),
    Stored(43, "E"),
    Stored(45, "LB K2"),
    Stored(50, "IC Q1"),
    Stored(55, "RT"),
]
MODES = [MCode(em=em) for em in range(4)]


def state(codec: MCode = MODES[0]) -> MCodeState:
    return MCodeState(codec, "", "!", "LMDCE")


def fed(codec: MCode, data: bytes, pieces: list[int], body: bytes = SPACE) -> Decoded | None:
    """Decode bytes that arrive in pieces, up to the first reply."""
    request, at = key(state(codec), body), 0
    for size in [*pieces, len(data)]:
        at = min(at + size, len(data))
        if (found := request.codec.decode(request, data[:at])) is not None:
            return found
    return None


@pytest.mark.parametrize("codec", MODES)
@pytest.mark.parametrize("data", [b" ", b"\r"])
def test_a_key_is_one_byte_without_name_terminator_or_checksum(codec: MCode, data: bytes) -> None:
    request = key(state(codec), data)
    assert request.codec.encode(request) == data


@pytest.mark.parametrize("codec", MODES)
@given(pieces=st.lists(st.integers(1, 9), max_size=30))
def test_the_line_of_a_step_is_found_however_it_arrives(codec: MCode, pieces: list[int]) -> None:
    found = fed(codec, b"at 12\r\n19  MR 51200\r\n\r\n>", pieces)
    assert found is not None and found.reply.lines == ("19  MR 51200",) and found.reply.end is End.DONE
    assert found.strays == ("at 12",) and found.used == len(b"at 12\r\n19  MR 51200\r\n")


@pytest.mark.parametrize(
    "data, end",
    [
        (b"", End.TIMEOUT),
        (b" ", End.REFUSED),
        (b"19  MR 51200", End.TIMEOUT),
        (b"19 MR 51200\r\n", End.TIMEOUT),
        (b"\r\n>", End.TIMEOUT),
    ],
)
@pytest.mark.parametrize("codec", MODES)
def test_without_its_whole_line_a_step_is_not_known(codec: MCode, data: bytes, end: End) -> None:
    request = key(state(codec), SPACE)
    assert request.codec.decode(request, data) is None and request.codec.on_quiet(request, data) is None
    assert request.codec.on_timeout(request, data).reply.end is end


@given(data=st.binary(max_size=80), em=st.integers(0, 3))
def test_any_bytes_are_a_line_or_nothing(data: bytes, em: int) -> None:
    for body in (SPACE, ENTER):
        request = key(state(MCode(em=em)), body)
        found = request.codec.decode(request, data) or request.codec.on_timeout(request, data)
        assert 0 <= found.used <= len(data)
        if body == SPACE and found.reply.end is End.DONE:
            assert MCodeDebugging(MCodeState(MCode())).traced(found.reply.text) is not None


def test_enter_ends_with_quiet_and_prints_are_strays() -> None:
    request = key(state(), ENTER)
    assert request.codec.decode(request, b"3\r\n") is None
    found = request.codec.on_quiet(request, b"3\r\n")
    assert found is not None and found.reply.end is End.DONE and found.strays == ("3",)


@pytest.mark.parametrize(
    "last, place, follows",
    [
        (6, "K1", True),
        (6, "19", True),
        (6, "14", True),
        (6, "26", False),
        (19, "26", True),
        (31, "K1", True),
        (31, "43", True),
        (31, "26", False),
        (26, "K2", True),
        (26, "31", True),
        (26, "K1", False),
        (55, "31", True),
        (43, "K2", False),
        (19, "ZZ", False),
        (19, "99", False),
    ],
)
def test_what_can_follow_a_line(last: int, place: str, follows: bool) -> None:
    row = next(each for each in PROGRAM if each.at == last)
    assert MCodeDebugging(MCodeState(MCode())).may_follow(PROGRAM, row, place) is follows


def test_a_return_proves_nothing_where_it_may_lead_back_to_a_hold() -> None:
    program = [*PROGRAM, Stored(60, "LB K3"), Stored(65, "H 10000")]
    assert not MCodeDebugging(MCodeState(MCode())).may_follow(program, Stored(55, "RT"), "31")
    assert not MCodeDebugging(MCodeState(MCode())).may_follow(
        [*PROGRAM[:5], Stored(29, "LK=1"), *PROGRAM[5:]], Stored(29, "LK=1"), "31"
    )


def test_the_time_of_a_hold() -> None:
    assert [MCodeDebugging(MCodeState(MCode())).hold(text) for text in ("H 250", "H", "H 0", "MR 5", "H Q1")] == [
        0.25,
        0,
        0,
        0,
        None,
    ]


def test_a_program_begins_at_su_or_at_address_1() -> None:
    assert (
        MCodeDebugging(MCodeState(MCode())).entry(PROGRAM) == "SU"
        and MCodeDebugging(MCodeState(MCode())).entry(PROGRAM[1:]) == "1"
        and MCodeDebugging(MCodeState(MCode())).entry([]) == "1"
    )


@pytest.mark.parametrize(
    "line, row",
    [
        ("19  MR 51200", Stored(19, "MR 51200")),
        (">19  MR 51200", Stored(19, "MR 51200")),
        ("19  MR 51200\x9f", Stored(19, "MR 51200")),
        ("19", None),
        ("at 19  MR", None),
        ("19 MR 51200", None),
    ],
)
def test_a_traced_line_is_told_from_a_print(line: str, row: Stored | None) -> None:
    assert MCodeDebugging(MCodeState(MCode())).traced(line) == row
