"""TMCL's own notation: what each line says, what is wrong with others, and that every command can be written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.families.tmcl.manual.commands import Command, TmclCall, TmclLineError, parse

LINES = [
    ("ROR 0, 1000", TmclCall(1, 0, 0, 1000)),
    ("rol 0,-5", TmclCall(2, 0, 0, -5)),
    ("MST 2", TmclCall(3, 0, 2, 0)),
    ("MVP ABS, 0, 51200", TmclCall(4, 0, 0, 51200)),
    ("MVP rel, 1, -1000", TmclCall(4, 1, 1, -1000)),
    ("MVP 1, 1, +7", TmclCall(4, 1, 1, 7)),
    ("  SAP 4 , 0 , 100000 ", TmclCall(5, 4, 0, 100000)),
    ("GAP 1, 0", TmclCall(6, 1, 0, 0)),
    ("STAP 4, 0", TmclCall(7, 4, 0, 0)),
    ("SGP 66, 0, 3", TmclCall(9, 66, 0, 3)),
    ("GGP 66, 0", TmclCall(10, 66, 0, 0)),
    ("RFS STATUS, 0", TmclCall(13, 2, 0, 0)),
    ("137 0, 0, 1234", TmclCall(137, 0, 0, 1234)),
]
WRONG = [
    ("", "no command ''"),
    ("ROT 0, 1", "no command 'ROT'; did you mean"),
    ("XYZZY", "valid: ROR, ROL, MST"),
    ("ROR 0", "ROR takes 2 fields: ROR motor, value"),
    ("MST", "MST takes 1 field: MST motor"),
    ("MVP UP, 0, 1", "MVP has no type 'UP'; valid: ABS, REL, COORD"),
    ("MVP ABS|REL|COORD, 0, 1", "MVP has no type"),
    ("ROR 0, 1.5", "value cannot be '1.5'; valid: -2147483648 to 2147483647"),
    ("ROR 0, 2147483648", "value cannot be '2147483648'"),
    ("ROR 256, 1", "motor cannot be '256'; valid: 0 to 255"),
    ("ROR 0 1000", "ROR takes 2 fields"),
    ("ROR 0,, 1", "ROR takes 2 fields"),
    ("GAP \u0663, 0", "type cannot be"),
    ("300 0, 0, 0", "no command 300; valid: 0 to 255"),
    ("136 1", "a command by its number takes 3 fields: 136 type, motor, value"),
]


@pytest.mark.parametrize(("text", "call"), LINES)
def test_what_a_line_says(text, call):
    assert parse(text) == call


@pytest.mark.parametrize(("text", "why"), WRONG)
def test_a_wrong_line_says_why_and_what_is_valid(text, why):
    with pytest.raises(TmclLineError) as raised:
        parse(text)
    assert why in str(raised.value)


@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255), st.integers(-(2**31), 2**31 - 1))
def test_what_a_command_is_written_as_says_the_same(command, kind, motor, value):
    call = TmclCall(command, kind, motor, value)
    if call.row is not None:  # what the word has no field for is 0
        fields = call.row.fields
        call = TmclCall(command, kind if "type" in fields else 0, motor, value if "value" in fields else 0)
    assert parse(str(call)) == call


@given(st.text(max_size=40))
def test_any_text_is_a_command_or_a_line_error(text):
    try:
        call = parse(text)
    except TmclLineError as error:
        assert str(error)
    else:
        assert call.command in range(256)


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("ROR 0, 1", True),
        ("MVP ABS, 0, 0", True),
        ("SAP 0, 0, 5", True),
        ("SAP 2, 0, 5", True),
        ("SAP 1, 0, 5", True),
        ("SAP 4, 0, 5", True),
        ("SAP 5, 0, 5", False),
        ("RFS START, 0", True),
        ("RFS STATUS, 0", False),
        ("RFS STOP, 0", False),
        ("GAP 1, 0", False),
        ("MST 0", False),
        ("136 1, 0, 0", False),
        ("137 0, 0, 1234", True),
        ("129 0, 0, 0", True),
        ("130 0, 0, 0", True),
        ("128 0, 0, 0", False),
        ("131 0, 0, 0", False),
        ("132 0, 0, 0", False),
        ("133 0, 0, 0", False),
        ("135 0, 0, 0", False),
    ],
)
def test_what_can_start_motion(text, moves):
    assert parse(text).moves is moves


def test_every_command_can_be_called_by_its_number():
    assert [parse(f"{each.value} 0, 0, 0").command for each in Command] == [each.value for each in Command]
