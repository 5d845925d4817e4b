"""The register map is whole, and its ranges say what they seem to say."""

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.manual.modbus.registers import AT, REGISTERS, ROWS
from multidrop.families.lexium.manual.table import lookup


def test_no_two_names_share_a_register():
    assert len(AT) == sum(row.count for row in ROWS)
    assert len(REGISTERS) == len(ROWS)
    assert all(AT[address] is row for row in ROWS for address in row.addresses)


def test_every_name_is_a_word_of_the_drive():
    own = {f"V{number}" for number in range(1, 9)}  # user variables, which a program declares
    assert {name for name in REGISTERS if lookup(name) is None} == own


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("HT", [0, 2, 65535], [1, 65536, -1]),
        ("MS", [1, 108, 256], [0, 3, 257]),
        ("P", [-(2**31), 2**31 - 1], [2**31, -(2**31) - 1]),
        ("SL", [-5_000_000, 5_000_000], [5_000_001]),
        ("VI", [1, 4_999_999], [0, 5_000_000]),
        ("VM", [2, 5_000_000], [1, 5_000_001]),
        ("LL", [-2147483647], [-2147483648]),
        ("IP", [0, 65535], []),
    ],
)
def test_ranges(name, good, bad):
    assert [v for v in good if not REGISTERS[name].allows(v)] == []
    assert [v for v in bad if REGISTERS[name].allows(v)] == []


def test_access():
    assert REGISTERS["ER"].readable and REGISTERS["ER"].writable
    assert REGISTERS["MA"].writable and not REGISTERS["MA"].readable
    assert REGISTERS["V"].readable and not REGISTERS["V"].writable
    assert (REGISTERS["VM"].address, REGISTERS["VM"].count, 0x23 in AT, 0xA2 in AT) == (0x8B, 2, False, False)


def test_a_write_of_raw_registers_is_guarded_as_the_word_that_it_writes():
    family = FAMILIES["modbus"](ModbusState(Modbus()))

    def named(address, *values):
        found = [family.guard(line) for line in family.registers.lines(address, values)]
        return [each.name for each in found if each]

    assert named(0x3C, 1) == ["IP"]
    assert named(0x8E, 3) == named(0x8D, 84, 3) == ["AS"]
    assert named(0x8E, 2) == named(0x8D, 84) == named(0x57, 5) == named(0x57, 5, 0) == named(0x3, 1) == []


def test_a_word_without_a_register_is_refused_and_not_guarded():
    family = FAMILIES["modbus"](ModbusState(Modbus()))
    assert [family.guard(text) for text in ("CP", "FD", 'DN="a"', "PR IP", "SL 0")] == [None] * 5
    assert [family.guard(text).name for text in ("IP", "AS=3")] == ["IP", "AS"]
