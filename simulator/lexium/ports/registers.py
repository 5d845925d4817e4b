"""The registers, inputs, coils and named functions of a simulated Ethernet drive: one state, seen from Modbus.

Everything goes through the lines that MCode/TCP would send to the device, so a value has the same range, the same side
effects and the same error on both ways in; what a register accepts besides is its own range. A write has to satisfy
both. Exceptions: 2, no such register, or not in that direction; 3, a value, a count or a part of a value that cannot
be; 4, the drive refuses (ER says why). A value that the drive itself finds out of range is a 3 too, and sets ER as it
does on MCode/TCP. (Modbus/TCP manual 4 and 5; docs/rulings.md.)

Decisions where the manual is silent (facts that a unit may correct):

- IC and DC take the address of the variable's (first) register: one byte is what they have room for.
- TA holds the mask in its low word and the address of the subroutine in its high word.
- TS is the divider: the drive's speed is 10 MHz / (TS + 2). Each side has its own range for it; 0 is 0 on both.
- S, IP, CF and SC do what they do whatever is written. O1 to O3 can be read (4.2.2, note).
- What a product has no use for (an encoder's register in open loop) is refused by the drive: exception 4, ER 37.
- Registers are no lines: in program mode they are read and written, not stored.
- Two registers of one byte each are written one after the other, once both values are in range.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from dialects.mcode.manual.grammar import Name, Number
from dialects.modbus.manual.registers import AT, REGISTERS, Register
from simulator.lexium.motion.trips import HMT, RELATIVE

if TYPE_CHECKING:
    from simulator.lexium.device import Answer, MCodeDevice

ILLEGAL_ADDRESS, ILLEGAL_VALUE, FAILURE = 2, 3, 4
VALUE_ERRORS = frozenset({21, 22, 23, 76, 77})
"""Codes of ER that say that a number is out of range."""
MOST_REGISTERS = 2
"""Registers in one request (4.2.4)."""
POINTS = 4
"""Inputs; outputs are counted to four too, though there are three."""
OUTPUTS = 3
INPUT_REGISTERS = REGISTERS["I1"].address
OSCILLATOR = 10_000_000
MASKS = range(32)
CRLF = "\r\n"
READ_BY_NAME = ("IS", "OS", "TR", "MU", *(f"S{n}" for n in range(1, 6)))
WRITTEN_BY_NAME = ("EX", "PS", "RS", *READ_BY_NAME)
END = "E"
"""Both functions take it (4.3.1)."""
LONGEST_DATA = 28
LONGEST_TEXT = 250


class Refusal(Exception):
    """An exception response with this code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Registers:
    """One drive's registers. Times are the device's; raises Refusal."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device

    # Registers.

    def read(self, start: int, count: int, now: float) -> list[int]:
        """Registers from `start` on; one word of a value of two is that word."""
        rows = _rows(start, count)
        if not all(row.readable or row.name in READ_ALSO for row in rows):
            raise Refusal(ILLEGAL_ADDRESS)
        if count == 2 and rows[0] is rows[1]:
            return self._words(rows[0], now)
        return [self._words(row, now)[address - row.address] for address, row in enumerate(rows, start)]

    def write(self, start: int, words: Sequence[int], now: float) -> None:
        """Give registers values: a value of two words needs both."""
        rows = _rows(start, len(words))
        if not all(row.writable for row in rows):
            raise Refusal(ILLEGAL_ADDRESS)
        for line in [_line(row, value) for row, value in _values(start, rows, words)]:
            if callable(line):
                line(self, now)
            else:
                self.carry_out(line, now)

    def _words(self, row: Register, now: float) -> list[int]:
        value = READERS[row.name](self, now) if row.name in READERS else self.number(row.name, now)
        if row.name in SHOWN:
            value = SHOWN[row.name](value)
        return [value >> 16 * place & 0xFFFF for place in range(row.count)]

    def number(self, word: str, now: float) -> int:
        """What PR prints of a number, and does to it."""
        return int(self.carry_out(f"PR {word}", now).lines[0])

    # Inputs and coils.

    def inputs(self, start: int, count: int, now: float) -> list[bool]:
        """Digital inputs: at 0 to 3, and where their registers are."""
        first = start - INPUT_REGISTERS if start >= INPUT_REGISTERS else start
        _check_points(first, count)
        return [bool(self.number(f"I{n}", now)) for n in range(first + 1, first + count + 1)]

    def coils(self, start: int, count: int, now: float) -> list[bool]:
        """Digital outputs, active or not; the fourth reads 0."""
        _check_points(start, count)
        self.device.advance(now)
        active = self.device.outputs(self.device.now)
        return [active.get(n, False) for n in range(start + 1, start + count + 1)]

    def write_coil(self, address: int, on: bool, now: float) -> None:
        """Switch one output."""
        if not address < OUTPUTS:
            raise Refusal(ILLEGAL_ADDRESS)
        self.carry_out(f"O{address + 1}={int(on)}", now)

    # Functions by name.

    def read_named(self, name: str, now: float) -> str:
        """What function 65 gives: the text that PR prints, or E carried out."""
        if name == END:
            self.carry_out(END, now)
            return ""
        if name not in READ_BY_NAME:
            raise Refusal(ILLEGAL_VALUE)
        if name in POINT_OF:
            return self._point(POINT_OF[name], now)
        if name == "TR" and RELATIVE not in self.device.motor.trips.defined:
            return "0, 0, 0"
        return CRLF.join(self.carry_out(f"PR {name}", now).lines)[:LONGEST_TEXT]

    def write_named(self, name: str, data: bytes, now: float) -> None:
        """Function 66: a name and what follows it in the drive's own language."""
        if name != END and name not in WRITTEN_BY_NAME:
            raise Refusal(ILLEGAL_VALUE)
        if len(data) > LONGEST_DATA or any(not 0x20 <= byte < 0x7F for byte in data):
            raise Refusal(ILLEGAL_VALUE)
        text = data.decode("ascii")
        if name in POINT_OF:
            kind, active, *_ = (*text.removeprefix("=").split(","), "", "")
            name, text = "IS", f"={POINT_OF[name]},{kind},{active}".removesuffix(",")
        self.carry_out(f"{name}{text}" if text.startswith("=") else f"{name} {text}", now)

    def _point(self, n: int, now: float) -> str:
        self.device.advance(now)
        return ", ".join(str(each) for each in (*self.device.inputs.types[n], 0)[:3])

    # The device.

    def text(self, word: str, now: float) -> str:
        """The first line that PR prints of something."""
        return self.carry_out(f"PR {word}", now).lines[0]

    def carry_out(self, line: str, now: float) -> Answer:
        """One line at once, in program mode too. Raises Refusal (3, 4) where the drive refuses it."""
        answer = self.device.execute(line, now, immediate=True)
        if answer.refused:
            code = self.device.errors.code
            raise Refusal(ILLEGAL_VALUE if code in VALUE_ERRORS else FAILURE)
        return answer


def _rows(start: int, count: int) -> list[Register]:
    """The values behind registers, one for each. Raises Refusal (2, 3)."""
    if not 1 <= count <= MOST_REGISTERS:
        raise Refusal(ILLEGAL_VALUE)
    try:
        return [AT[address] for address in range(start, start + count)]
    except KeyError:
        raise Refusal(ILLEGAL_ADDRESS) from None


def _check_points(start: int, count: int) -> None:
    if not 1 <= count <= POINTS:
        raise Refusal(ILLEGAL_VALUE)
    if not 0 <= start <= start + count <= POINTS:
        raise Refusal(ILLEGAL_ADDRESS)


def _values(start: int, rows: Sequence[Register], words: Sequence[int]) -> list[tuple[Register, int]]:
    """The values that words give to registers. Raises Refusal (3) for a part of one."""
    if len(rows) == 2 and rows[0] is rows[1]:
        value = words[0] | words[1] << 16
        if rows[0].width == 4 and value >> 31:
            value -= 1 << 32
        return [(rows[0], value)]
    if any(row.width > 2 or address != row.address for address, row in enumerate(rows, start)):
        raise Refusal(ILLEGAL_VALUE)
    return list(zip(rows, words, strict=True))


Hand = Callable[[Registers, float], None]


def _line(row: Register, value: int) -> str | Hand:
    """What writing a value means in the drive's language. Raises Refusal (3) for one that the register refuses."""
    if not row.allows(value):
        raise Refusal(ILLEGAL_VALUE)
    name = row.name
    if name in WRITERS:
        return WRITERS[name](name, value)
    return f"{name} {value}" if name in ORDERS else f"{name}={value}"


def _bare(name: str, value: int) -> str:
    return name


def _clear(name: str, value: int) -> str:
    if value:
        raise Refusal(ILLEGAL_VALUE)
    return f"{name}=0"


def _stepped(name: str, value: int) -> str:
    row = AT.get(value)
    if row is None or row.address != value:
        raise Refusal(ILLEGAL_VALUE)
    return f"{name} {row.name}"


def _trip(name: str, value: int) -> str:
    mask, place = value & 0xFFFF, value >> 16 & 0xFFFF
    if mask not in MASKS:
        raise Refusal(ILLEGAL_VALUE)
    return f"{name}={mask},{place}"


def _divider(name: str, value: int) -> Hand:
    """The speed that a divider gives goes beyond what MCode takes, so no line can say it."""

    def write(registers: Registers, now: float) -> None:
        registers.carry_out("PR TS", now)
        registers.device.motor.torque.set_speed(round(OSCILLATOR / (value + 2)) if value else 0)

    return write


def _read_trip(registers: Registers, now: float) -> int:
    registers.carry_out("PR TA", now)
    device = registers.device
    trip = device.motor.trips.defined.get(HMT)
    if trip is None:
        return 0
    place = 0
    if isinstance(trip.target, Name):
        place = device.program.labels.get(trip.target.word, 0)
    elif isinstance(trip.target, Number):
        place = int(trip.target.value)
    return trip.value | place << 16


def _output(n: int) -> Callable[[Registers, float], int]:
    return lambda registers, now: int(registers.coils(n - 1, 1, now)[0])


ORDERS = frozenset({"MA", "MR", "SL", "HM", "HI"})
"""Instructions with a value."""

WRITERS: Mapping[str, Callable[[str, int], str | Hand]] = {
    **dict.fromkeys(("S", "IP", "CF"), _bare),
    "SC": lambda name, value: "SC 1",
    "ER": _clear,
    "IC": _stepped,
    "DC": _stepped,
    "OT": lambda name, value: f"OT={value & 7}",
    "TA": _trip,
    "TS": _divider,
}
"""What is more than an assignment."""

READERS: Mapping[str, Callable[[Registers, float], int]] = {
    **{f"O{n}": _output(n) for n in range(1, OUTPUTS + 1)},
    "IT": lambda registers, now: registers.number("IT 1", now),
    "TA": _read_trip,
}
"""What is more than PR."""
READ_ALSO = frozenset({"O1", "O2", "O3"})
"""Write only by name, but a note of 4.2.2 has them read."""

SHOWN: Mapping[str, Callable[[int], int]] = {
    "I5": lambda counts: counts // 4,
    "AF": lambda status: status & 0xFF,
    "OF": lambda faults: int(faults != 0),
    "D5": lambda weight: min(weight, 255),
    "TS": lambda speed: min(max(round(OSCILLATOR / speed) - 2, 0), 255) if speed else 0,
}
"""Where a register's form is another than MCode's."""

POINT_OF: Mapping[str, int] = {f"S{n}": n for n in range(1, 6)}
"""The inputs by the name that the manual's example has for their set-up (4.3.3), the older drives' own."""
