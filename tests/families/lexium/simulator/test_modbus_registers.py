"""Every register of a simulated Ethernet drive: read, written at both ends and beyond, and seen from MCode as well."""

from __future__ import annotations

import struct

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from multidrop.families.lexium.manual.modbus.registers import AT, REGISTERS, ROWS, ModbusRegister
from multidrop.families.lexium.simulator.ports.modbus import DriveRegisters
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from tests.support.cases import for_each
from tests.support.examples import examples

UNREADABLE = {"DC", "IC", "HI", "HM", "IP", "MA", "MR", "OT", "S", "SL", "CF", "SC"}
CLOSED_LOOP_ONLY = {row.name for row in ROWS if row.only}
READ_ONLY = {row.name for row in ROWS if row.access == "RO"}
USER = {f"V{n}" for n in range(1, 9)}
ILLEGAL_ADDRESS, ILLEGAL_VALUE, FAILURE = 2, 3, 4


class Drive:
    """A simulated drive and a Modbus connection to it; `now` goes on by a second a request."""

    def __init__(self, personality: str = "LMDCE") -> None:
        cell = f'[[bus]]\nname = "eth"\n[[bus.drive]]\npersonality = "{personality}"\n'
        self.floor = Floor(read(cell))
        self.port = self.floor.own_port("eth")
        self.device = self.floor.drives[0].device
        self.now = 0.0

    def ask(self, pdu: bytes) -> bytes:
        self.now += 1.0
        return self.port.receive(struct.pack(">HHHB", 9, 0, len(pdu) + 1, 1) + pdu, self.now)[7:]

    def read(self, address: int, count: int) -> tuple[int, ...] | int:
        """Words, or the exception's code."""
        answer = self.ask(struct.pack(">BHH", 3, address, count))
        if answer[0] == 0x83:
            return answer[1]
        assert answer[:2] == bytes((3, 2 * count)) and len(answer) == 2 + 2 * count
        return struct.unpack(f">{count}H", answer[2:])

    def write(self, address: int, *words: int) -> int:
        """0, or the exception's code."""
        answer = self.ask(struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words))
        if answer[0] == 0x90:
            return answer[1]
        assert answer == struct.pack(">BHH", 16, address, len(words))
        return 0

    def put(self, name: str, value: int) -> int:
        row = row_of(name)
        return self.write(row.address, *words_of(row, value))

    def get(self, name: str) -> int:
        row = row_of(name)
        words = self.read(row.address, row.count)
        assert isinstance(words, tuple), (name, words)
        value = sum(word << 16 * place for place, word in enumerate(words))
        return value - (1 << 32) if row.width == 4 and value >> 31 else value

    def mcode(self, line: str) -> str:
        """What a line prints at once; it is taken."""
        answer = self.device.execute(line, self.now)
        assert not answer.refused, (line, self.error)
        return answer.lines[0] if answer.lines else ""

    @property
    def error(self) -> int:
        return int(self.device.memory.values["ER"])


def row_of(name: str) -> ModbusRegister:
    return REGISTERS[name]


def words_of(row: ModbusRegister, value: int) -> list[int]:
    return [value >> 16 * place & 0xFFFF for place in range(row.count)]


# Every register.


@pytest.mark.parametrize("personality", ["LMDCE", "LMDOE"])
def test_reading(personality):
    for row in ROWS:
        found, error, halves = _read(personality, row)
        if row.name in UNREADABLE:
            assert (found, error) == (ILLEGAL_ADDRESS, 0), row.name
        elif row.name in USER:
            assert found == FAILURE and error in (20, 35), row.name
        elif personality == "LMDOE" and row.only:
            assert (found, error) == (FAILURE, 37), row.name
        else:
            assert isinstance(found, tuple) and error == 0, row.name
            assert halves == [(word,) for word in found], f"half of {row.name} is that word"


def _read(personality, row):
    """What is read of a new drive: the whole register, the error, then each of its words alone."""
    drive = Drive(personality)
    found, error = drive.read(row.address, row.count), drive.error
    return found, error, [drive.read(address, 1) for address in row.addresses]


@pytest.mark.parametrize("addresses", [range(0x60), range(0x60, 0xC0), (0x100, 0xFFFF)], ids=["low", "high", "beyond"])
def test_what_is_not_in_the_map_is_reserved(addresses):
    for address in addresses:
        drive = Drive()
        if address not in AT:
            assert drive.read(address, 1) == drive.write(address, 0) == ILLEGAL_ADDRESS, address
        if address not in AT or address + 1 not in AT:
            assert drive.read(address, 2) == drive.write(address, 0, 0) == ILLEGAL_ADDRESS, address
        assert drive.error == 0, address


ENDS = {
    "A": (91, 1_100_000_000),
    "D": (91, 1_100_000_000),
    "VI": (1, 767_999),
    "VM": (1001, 2_560_000),
    "MF": (306, 768_000),
    "SL": (-2_560_000, 2_560_000),
    "HT": (0, 65535),
    "ER": (0, 0),
    "ST": (0, 0),
    "TE": (0, 0),
    "DB": (0, 65000),
    "MS": (1, 256),
    "TA": (0, 31),
    "AS": (0, 3),
}
"""Where the drive's own range is narrower than the register's, or the manual says nothing."""
ORDERS = {"MA", "MR", "SL", "HM", "HI", "OT", "O1", "O2", "O3"}


@for_each(
    "row", [row for row in ROWS if row.writable and row.name not in USER and row.spans or row.name in ENDS],
)  # fmt: skip
def test_both_ends_of_a_range_are_taken_and_nothing_beyond(row):
    low, high = ENDS.get(row.name) or (row.spans[0][0], row.spans[-1][1])
    for value in (low, high):
        drive = Drive()
        drive.mcode("IS=1,1,0")  # HM wants a home switch
        assert drive.put(row.name, value) == 0, (row.name, value, drive.error)
        if row.name not in ORDERS:
            assert drive.get(row.name) == value
    words = 2 if row.count == 2 else 1
    lowest, highest = (-(2**31), 2**31 - 1) if row.width == 4 else (0, 256 ** (2 * words) - 1)
    for value in (low - 1, high + 1):
        drive = Drive()
        if lowest <= value <= highest:
            expected = FAILURE if row.name == "TE" else ILLEGAL_VALUE
            assert drive.put(row.name, value) == expected, (row.name, value)


@pytest.mark.parametrize("name", sorted(READ_ONLY))
def test_what_is_read_only_is_no_address_to_write(name):
    drive = Drive()
    before = drive.get(name)
    assert drive.put(name, 0) == drive.put(name, 1) == ILLEGAL_ADDRESS
    assert (drive.get(name), drive.error) == (before, 0)


@for_each("name", [row.name for row in ROWS if row.width == 4 and row.writable])
def test_half_of_a_value_is_not_written(name):
    drive, row = Drive(), row_of(name)
    before = dict(drive.device.memory.values)
    assert drive.write(row.address, 1) == drive.write(row.address + 1, 1) == ILLEGAL_VALUE
    assert drive.device.memory.values == before


@pytest.mark.parametrize("name", sorted(CLOSED_LOOP_ONLY - READ_ONLY))
def test_an_open_loop_drive_refuses_what_it_has_no_use_for(name):
    drive = Drive("LMDOE")
    value = (row_of(name).spans or ((0, 0),))[0][0]
    assert (drive.put(name, value), drive.error) == (FAILURE, 37)


# One state, seen from both sides.


def test_what_is_written_here_is_read_there():
    drive = Drive()
    for name, value in (("VM", 600_000), ("P", -5), ("R1", -(2**31)), ("HC", 10), ("D2", 20), ("MS", 256)):
        assert drive.put(name, value) == 0
        assert drive.mcode(f"PR {name}") == str(value)
    for name, value in (("A", 250_000), ("P", 51200), ("R4", 2**31 - 1), ("JE", 1), ("LM", 4)):
        drive.mcode(f"{name}={value}")
        assert drive.get(name) == value


def test_motion_is_begun_and_watched_through_registers():
    drive = Drive()
    assert drive.put("MA", 5_000_000) == 0
    assert drive.get("MV") == drive.get("MP") == 1
    assert 0 < drive.get("P") < 5_000_000 and drive.get("V") == 768_000
    drive.now += 10
    assert (drive.get("P"), drive.get("MV")) == (5_000_000, 0)
    assert drive.put("MR", -400_000) == 0
    drive.now += 10
    assert drive.get("P") == 4_600_000
    assert drive.put("SL", -50_000) == 0
    assert drive.get("V") == -50_000
    assert drive.put("SL", 0) == 0
    drive.now += 10
    assert drive.get("MV") == 0


def test_homing_is_begun_through_its_register():
    drive = Drive()
    drive.mcode("IS=1,1,0")
    assert drive.put("HM", 1) == 0
    assert drive.get("MV") == 1 and drive.get("V") < 0


def test_a_refused_motion_is_a_failure_whose_code_reading_er_clears():
    drive = Drive()
    assert drive.put("DE", 0) == 0
    assert drive.put("MA", 1000) == FAILURE
    assert drive.get("EF") == 1
    assert drive.get("ER") == 94
    assert (drive.get("EF"), drive.get("ER")) == (0, 0)


def test_er_is_cleared_by_a_zero_and_takes_nothing_else():
    drive = Drive()
    drive.device.execute("QQQQ", 0.0)
    assert drive.get("EF") == 1
    assert drive.put("ER", 1) == ILLEGAL_VALUE and drive.get("EF") == 1
    assert drive.put("ER", 0) == 0 and drive.get("EF") == 0


def test_reading_reserved_registers_beside_er_does_not_clear_it():
    drive = Drive()
    drive.device.execute("QQQQ", 0.0)
    assert drive.read(0x21, 2) == drive.read(0x20, 2) == ILLEGAL_ADDRESS
    assert drive.error == 60


def test_a_value_that_only_the_drive_finds_out_of_range_sets_its_error_as_in_mcode():
    drive = Drive()
    assert drive.put("VM", 3_000_000) == ILLEGAL_VALUE
    assert drive.error == 21
    assert drive.put("ER", 0) == 0
    assert drive.put("VI", 768_000) == ILLEGAL_VALUE
    assert drive.error == 22
    assert drive.put("ER", 0) == 0
    assert drive.put("VM", 6_000_000) == ILLEGAL_VALUE
    assert drive.error == 0


def test_an_error_calls_the_drives_handler():
    drive = Drive()
    for line in ("PG 100", "LB K1", "R2=7", "RT", "PG", "OE K1"):
        drive.mcode(line)
    assert drive.put("VM", 3_000_000) == ILLEGAL_VALUE
    assert drive.get("R2") == 7


def test_user_variables_are_there_while_a_program_declares_them():
    drive = Drive()
    for line in ("PG 100", "LB A1", "VA V1=5", "VA V8=-6", "H 100000", "E", "PG", "EX A1"):
        drive.mcode(line)
    assert (drive.get("V1"), drive.get("V8")) == (5, -6)
    assert drive.put("V1", -7) == 0
    assert drive.mcode("PR V1") == "-7"
    assert drive.put("V2", 1) == FAILURE


# Values whose form differs.


def test_values_wider_than_their_registers(monkeypatch):
    drive = Drive()
    drive.floor.command("/sim analog ! 4095", 0.0)
    assert drive.get("I5") == 1023
    drive.mcode("D5=1000")
    assert drive.get("D5") == 255
    drive.mcode("CE=2")
    assert drive.get("CE") == 2 and drive.put("CE", 2) == ILLEGAL_VALUE
    for status, low in ((256, 0), (257, 1), (511, 255)):
        monkeypatch.setattr(DriveRegisters, "number", lambda registers, word, now, status=status: status)
        assert drive.get("AF") == low
    for faults, any_of_them in ((0, 0), (1, 1), (2, 1), (3, 1)):
        monkeypatch.setattr(DriveRegisters, "number", lambda registers, word, now, faults=faults: faults)
        assert drive.get("OF") == any_of_them


def test_the_locked_rotors_time_is_in_the_first_of_its_two_registers():
    drive = Drive()
    assert drive.read(0x9C, 2) == (2000, 0)
    assert drive.write(0x9C, 65535, 0) == 0 and drive.read(0x9C, 2) == (65535, 0)
    assert drive.write(0x9C, 3000) == 0 and drive.mcode("PR LT") == "3000"
    assert drive.write(0x9C, 3000, 1) == drive.write(0x9D, 0) == ILLEGAL_VALUE


def test_outputs_all_together_and_one_by_one():
    drive = Drive()
    assert drive.put("OT", 15) == 0
    assert [drive.get(f"O{n}") for n in (1, 2, 3)] == [1, 1, 1]
    assert drive.put("O2", 0) == 0
    assert drive.device.outputs(drive.now) == {1: True, 2: False, 3: True}
    assert drive.put("OT", 16) == drive.put("O1", 2) == ILLEGAL_VALUE
    drive.mcode("OS=1,17,0")
    assert (drive.put("O1", 1), drive.error) == (FAILURE, 9)


def test_ic_and_dc_step_the_variable_of_a_register():
    drive = Drive()
    assert drive.put("IC", row_of("R1").address) == drive.put("IC", row_of("R1").address) == 0
    assert drive.put("DC", row_of("R2").address) == 0
    assert (drive.get("R1"), drive.get("R2")) == (2, -1)
    assert drive.put("IC", row_of("R1").address + 1) == ILLEGAL_VALUE, "the second register of R1"
    assert drive.put("IC", 0x23) == drive.put("DC", 0xFFFF) == ILLEGAL_VALUE
    assert (drive.put("IC", row_of("V").address), drive.error) == (FAILURE, 25)


def test_save_and_initialise():
    drive = Drive()
    assert drive.put("VM", 500_000) == drive.put("S", 0) == 0
    assert drive.put("VM", 400_000) == drive.put("IP", 1) == 0
    assert drive.get("VM") == 500_000


def test_the_speed_of_torque_mode_is_a_divider_here():
    drive = Drive()
    drive.mcode("TS=100000")
    assert drive.get("TS") == 98  # 10 MHz / 100
    assert drive.put("TS", 48) == 0
    assert drive.mcode("PR TS") == "200000"


def test_the_trip_on_hmt_status_is_mask_and_address():
    drive = Drive()
    for line in ("PG 100", "LB k6", "RT", "PG", "TA=4,k6"):
        drive.mcode(line)
    assert drive.read(0xA3, 2) == (4, 100)
    assert drive.write(0xA3, 8, 100) == 0
    assert drive.mcode("PR TA") == "8, 100"
    assert drive.read(0xA3, 2) == (8, 100)
    assert (drive.write(0xA3, 8, 101), drive.error) == (FAILURE, 42), "there is no line"
    assert drive.write(0xA3, 32, 0) == ILLEGAL_VALUE


def test_two_registers_of_one_word_each_are_two_values():
    drive = Drive()
    assert drive.write(0x0F, 5, 6) == 0
    assert drive.read(0x0F, 2) == (5, 6)
    assert drive.write(0x0F, 7, 256) == ILLEGAL_VALUE
    assert drive.read(0x0F, 2) == (5, 6), "neither is taken where one is out of range"
    assert drive.read(0x06, 2) == (0, 0), "the second word of C1 and the first of C2"


def test_a_drive_in_program_mode_stores_nothing_of_what_registers_say():
    drive = Drive()
    drive.mcode("PG 100")
    assert drive.put("HC", 33) == 0
    assert drive.get("HC") == 33
    assert drive.device.programming == 100 and not drive.device.program.lines
    drive.mcode("R1=1")
    drive.mcode("PG")
    assert len(drive.device.program.lines) == 1


# Both ranges hold, and nothing else does.

PLAIN = [
    row for row in ROWS if row.spans and row.writable and row.name not in {"TS", "TA", "OT", "ST", "HI", "HM"} | USER
]
NUMBERS = st.one_of(
    st.integers(-(2**31), 2**31 - 1), st.integers(-3, 300), st.integers(64990, 65540), st.integers(767_990, 768_010)
)


@settings(deadline=None)
@given(st.sampled_from(PLAIN), NUMBERS, st.sampled_from(["LMDCE", "LMDOE"]))
@example(REGISTERS["A"], 90, "LMDCE")
@example(REGISTERS["A"], 1_100_000_001, "LMDCE")
@example(REGISTERS["TE"], 0, "LMDOE")
def test_a_write_is_taken_where_both_ranges_have_room_for_it_and_does_the_same_as_in_mcode(row, value, personality):
    fits = -(2**31) <= value < 2**31 if row.width == 4 else 0 <= value < 1 << 16 * row.count
    here, there = Drive(personality), Drive(personality)
    there.now += 1.0
    refused = there.device.execute(f"{row.name}={value}", there.now).refused
    if fits:
        assert (here.put(row.name, value) == 0) == (row.allows(value) and not refused)
        if not refused and row.allows(value):
            assert here.device.memory.values == there.device.memory.values
            assert here.device.motor.axis.profile == there.device.motor.axis.profile
            assert here.device.outputs(here.now) == there.device.outputs(there.now)


@examples(25, nightly=300)
@given(st.lists(st.floats(0.0, 8.0), max_size=30), st.sampled_from(["P", "V", "BY", "I1", "R1", "MV"]))
def test_being_watched_changes_nothing(times, name):
    def run(polls: list[float]) -> tuple[object, ...]:
        drive = Drive()
        for line in ("PG 100", "LB A1", "MR 51200", "H", "IC R1", "PR R1,P", "BR A1, R1<5", "E", "PG", "EX A1"):
            drive.device.execute(line, 0.0)
        for at in sorted(polls):
            drive.now = at - 1.0
            drive.get(name)
        drive.device.advance(20.0)
        return drive.device.prints(), drive.device.position(20.0), drive.device.memory.values["R1"]

    assert run(times) == run([])
