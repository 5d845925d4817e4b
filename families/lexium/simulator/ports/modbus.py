"""One client's connection to a simulated drive over Modbus/TCP, and the drive's registers: bytes in, bytes out.

Theory of operation. A message is seven bytes of header (transaction, protocol, length, unit) and a PDU. A whole message
is carried out, in order, when its last byte arrives, however the bytes were cut up. Each gets one reply, with its own
transaction and unit, whatever the unit is. A message of another protocol is skipped. After an impossible length (less
than a unit and a function, or more than a PDU of 253 bytes) the begin of the next message is unknown: the port is
`closed`, and the client should be disconnected once the replies so far are sent. A drive without power takes and sends
nothing.

Function codes 1, 2, 3, 5, 16, 43/14, 65 and 66; any other is exception 1. A structure that the standard calls wrong (a
length, a byte count or a count that does not fit) is exception 3. Nothing here shares code with the host's framing.
(Modbus/TCP manual 3.2 and 4; MODBUS application protocol V1.1b3, 6; docs/rulings.md.)

Registers, inputs, coils and named functions are the drive's state, seen from Modbus. Everything goes through the lines
that MCode/TCP would send to the device. So a value has one range, one side effect and one error by either way; a
register has a range of its own as well, and a write must satisfy both. Exceptions: 2, there is no such register in that
direction; 3, a wrong value or count, or a part of a value; 4, the drive refuses (ER says why). A value that the drive
itself finds out of range is a 3 too, and sets ER as on MCode/TCP. (Modbus/TCP manual 4 and 5; docs/rulings.md.)

Decisions where the manual is silent (facts that a unit may correct):

- IC and DC take the address of the variable's (first) register: they have room for one byte only.
- TA holds the mask in its low word and the address of the subroutine in its high word.
- TS is the divider: the drive's speed is 10 MHz / (TS + 2). Each side has its own range for it; 0 is 0 on both.
- S, IP, CF and SC have their effect with any value. O1 to O3 can be read (4.2.2, note).
- What a product does not support (an encoder's register in open loop) is refused by the drive: exception 4, ER 37.
- Registers are no lines: in program mode they are read and written, not stored.
- Two registers of one byte each are written one after the other, once both values are in range.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from struct import pack, unpack

from multidrop.families.lexium.manual.grammar import NameTerm, Number
from multidrop.families.lexium.manual.groups import MOTIONS
from multidrop.families.lexium.manual.modbus.registers import (
    AT,
    CONTROLS,
    IDENTITY,
    OUTPUTS,
    POINTS,
    REGISTERS,
    SETUPS,
    ModbusRegister,
)
from multidrop.families.lexium.simulator.device import MCodeDevice, PrintedAnswer
from multidrop.families.lexium.simulator.motion.counters import HMT, RELATIVE

ILLEGAL_ADDRESS, ILLEGAL_VALUE, FAILURE = 2, 3, 4
VALUE_ERRORS = frozenset({21, 22, 23, 76, 77})
"""Codes of ER that say that a number is out of range."""
MOST_REGISTERS = 2
"""Registers in one request (4.2.4)."""
COUNTED_POINTS = 4
"""Inputs; outputs are counted to four too, though there are three."""
INPUT_REGISTERS = REGISTERS["I1"].address
OSCILLATOR = 10_000_000
MASKS = range(32)
CRLF = "\r\n"
READ_BY_NAME = SETUPS | POINTS.keys()
WRITTEN_BY_NAME = CONTROLS | READ_BY_NAME
END = "E"
"""Both functions take it (4.3.1)."""
LONGEST_DATA = 28
LONGEST_TEXT = 250


class ModbusRefusal(Exception):
    """An exception response with this code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class DriveRegisters:
    """One drive's registers. Times are the drive's; raises ModbusRefusal."""

    def __init__(self, device: MCodeDevice) -> None:
        self._drive, self._errors, self._program = device, device.errors, device.program
        self._inputs, self._trips, self._torque = device.motor.inputs, device.motor.trips, device.motor.torque

    # Registers.

    def read(self, start: int, count: int, now: float) -> list[int]:
        """Read registers; one word of a value of two words is that word."""
        rows = _rows(start, count)
        if not all(row.readable or row.name in READ_ALSO for row in rows):
            raise ModbusRefusal(ILLEGAL_ADDRESS)
        if count == 2 and rows[0] is rows[1]:
            return self._words(rows[0], now)
        return [self._words(row, now)[address - row.address] for address, row in enumerate(rows, start)]

    def write(self, start: int, words: Sequence[int], now: float) -> None:
        """Write registers; a value of two words needs both."""
        rows = _rows(start, len(words))
        if not all(row.writable for row in rows):
            raise ModbusRefusal(ILLEGAL_ADDRESS)
        values = _values(start, rows, words)
        for (row, value), line in [(each, _line(*each)) for each in values]:
            self.carry_out(line, now)
            if row.name == "TS":  # a divider, whose speed can be beyond the range of MCode: no line can set it
                self._torque.set_speed(round(OSCILLATOR / (value + 2)) if value else 0)

    def _words(self, row: ModbusRegister, now: float) -> list[int]:
        match row.name:
            case "O1" | "O2" | "O3":
                value = int(self.coils(int(row.name[1:]) - 1, 1, now)[0])
            case "IT":
                value = self.number("IT 1", now)
            case "TA":
                value = self._trip(now)
            case _:
                value = self.number(row.name, now)
        if row.name in SHOWN_VALUES:
            value = SHOWN_VALUES[row.name](value)
        return [value >> 16 * place & 0xFFFF for place in range(row.count)]

    def number(self, word: str, now: float) -> int:
        """Read a number as PR does, with its side effects."""
        return int(self.carry_out(f"PR {word}", now).lines[0])

    # Inputs and coils.

    def inputs(self, start: int, count: int, now: float) -> list[bool]:
        """Read digital inputs: at 0 to 3, and at the addresses of their registers."""
        first = start - INPUT_REGISTERS if start >= INPUT_REGISTERS else start
        _check_points(first, count)
        return [bool(self.number(f"I{n}", now)) for n in range(first + 1, first + count + 1)]

    def coils(self, start: int, count: int, now: float) -> list[bool]:
        """Read digital outputs, active or not; the fourth reads 0."""
        _check_points(start, count)
        self._drive.advance(now)
        active = self._drive.outputs(self._drive.now)
        return [active.get(n, False) for n in range(start + 1, start + count + 1)]

    def write_coil(self, address: int, on: bool, now: float) -> None:
        if not address < len(OUTPUTS):
            raise ModbusRefusal(ILLEGAL_ADDRESS)
        self.carry_out(f"O{address + 1}={int(on)}", now)

    # Functions by name.

    def read_named(self, name: str, now: float) -> str:
        """Carry out function 65: give the text that PR prints, or carry out E."""
        if name == END:
            self.carry_out(END, now)
            return ""
        if name not in READ_BY_NAME:
            raise ModbusRefusal(ILLEGAL_VALUE)
        if name in POINTS:
            self._drive.advance(now)
            return ", ".join(str(level) for level in (*self._inputs.types[POINTS[name]], 0)[:3])
        if name == "TR" and RELATIVE not in self._trips.defined:
            return "0, 0, 0"
        return CRLF.join(self.carry_out(f"PR {name}", now).lines)[:LONGEST_TEXT]

    def write_named(self, name: str, data: bytes, now: float) -> None:
        """Carry out function 66: a name and what follows it in the drive's own language."""
        if name != END and name not in WRITTEN_BY_NAME:
            raise ModbusRefusal(ILLEGAL_VALUE)
        if len(data) > LONGEST_DATA or any(not 0x20 <= byte < 0x7F for byte in data):
            raise ModbusRefusal(ILLEGAL_VALUE)
        text = data.decode("ascii")
        if name in POINTS:
            kind, active, *_ = (*text.removeprefix("=").split(","), "", "")
            name, text = "IS", f"={POINTS[name]},{kind},{active}".removesuffix(",")
        self.carry_out(f"{name}{text}" if text.startswith("=") else f"{name} {text}", now)

    def _trip(self, now: float) -> int:
        """Read TA: its mask, and the address of its subroutine in the high word."""
        self.carry_out("PR TA", now)
        trip = self._trips.defined.get(HMT)
        if trip is None:
            return 0
        place = 0
        if isinstance(trip.target, NameTerm):
            place = self._program.labels.get(trip.target.word, 0)
        elif isinstance(trip.target, Number):
            place = int(trip.target.value)
        return trip.value | place << 16

    # Lines.

    def text(self, word: str, now: float) -> str:
        """Return the first line that PR prints of a word."""
        return self.carry_out(f"PR {word}", now).lines[0]

    def carry_out(self, line: str, now: float) -> PrintedAnswer:
        """Carry out one line at once, in program mode too. Raises ModbusRefusal (3, 4) if the drive refuses it."""
        answer = self._drive.execute(line, now, immediate=True)
        if answer.refused:
            code = self._errors.code
            raise ModbusRefusal(ILLEGAL_VALUE if code in VALUE_ERRORS else FAILURE)
        return answer


def _rows(start: int, count: int) -> list[ModbusRegister]:
    """Find the values of registers, one for each. Raises ModbusRefusal (2, 3)."""
    if not 1 <= count <= MOST_REGISTERS:
        raise ModbusRefusal(ILLEGAL_VALUE)
    try:
        return [AT[address] for address in range(start, start + count)]
    except KeyError:
        raise ModbusRefusal(ILLEGAL_ADDRESS) from None


def _check_points(start: int, count: int) -> None:
    if not 1 <= count <= COUNTED_POINTS:
        raise ModbusRefusal(ILLEGAL_VALUE)
    if not 0 <= start <= start + count <= COUNTED_POINTS:
        raise ModbusRefusal(ILLEGAL_ADDRESS)


def _values(start: int, rows: Sequence[ModbusRegister], words: Sequence[int]) -> list[tuple[ModbusRegister, int]]:
    """Combine words to the values of registers. Raises ModbusRefusal (3) for a part of a value."""
    if len(rows) == 2 and rows[0] is rows[1]:
        value = words[0] | words[1] << 16
        if rows[0].width == 4 and value >> 31:
            value -= 1 << 32
        return [(rows[0], value)]
    if any(row.width > 2 or address != row.address for address, row in enumerate(rows, start)):
        raise ModbusRefusal(ILLEGAL_VALUE)
    return list(zip(rows, words, strict=True))


def _line(row: ModbusRegister, value: int) -> str:
    """Translate a write to a line of the drive. Raises ModbusRefusal (3) for a value that the register refuses."""
    if not row.allows(value):
        raise ModbusRefusal(ILLEGAL_VALUE)
    name = row.name
    match name:
        case "S" | "IP" | "CF":
            return name
        case "SC":
            return "SC 1"
        case "TS":
            return "PR TS"
        case "ER" if value:
            raise ModbusRefusal(ILLEGAL_VALUE)
        case "IC" | "DC":
            stepped = AT.get(value)
            if stepped is None or stepped.address != value:
                raise ModbusRefusal(ILLEGAL_VALUE)
            return f"{name} {stepped.name}"
        case "OT":
            return f"OT={value & 7}"
        case "TA":
            mask, place = value & 0xFFFF, value >> 16 & 0xFFFF
            if mask not in MASKS:
                raise ModbusRefusal(ILLEGAL_VALUE)
            return f"TA={mask},{place}"
    return f"{name} {value}" if name in MOTIONS else f"{name}={value}"


READ_ALSO = OUTPUTS.keys()
"""Write only by name, but a note of 4.2.2 has them read."""

SHOWN_VALUES: Mapping[str, Callable[[int], int]] = {
    "I5": lambda counts: counts // 4,
    "AF": lambda status: status & 0xFF,
    "OF": lambda faults: int(faults != 0),
    "D5": lambda weight: min(weight, 255),
    "TS": lambda speed: min(max(round(OSCILLATOR / speed) - 2, 0), 255) if speed else 0,
}
"""Where a register's form is another than MCode's."""

HEADER = 6
"""Bytes before those that the length counts."""
SHORTEST_MESSAGE, LONGEST_MESSAGE = 2, 254
"""The range of the length."""
ILLEGAL_FUNCTION = 1
EXCEPTION = 0x80
ON, OFF = 0xFF00, 0x0000
DEVICE_ID = 0x0E
CONFORMITY = 0x83
"""All objects at once, and each alone."""
OBJECTS = 7
BASIC, INDIVIDUAL = 3, 4


class ModbusPort:
    """A connection. `closed`: the bytes made no sense, and no more are taken."""

    def __init__(self, device: MCodeDevice) -> None:
        self.closed = False
        self._drive, self._registers = device, DriveRegisters(device)
        self._begun = bytearray()

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes; return the replies to the messages that they complete."""
        if not self._drive.powered:
            self._drive.advance(now)
        if not self._drive.powered:
            self._begun.clear()
            return b""
        if self.closed:
            return b""
        begun = self._begun
        begun += data
        out, at = bytearray(), 0
        while len(begun) - at >= HEADER:
            protocol, length = unpack(">HH", begun[at + 2 : at + HEADER])
            if not SHORTEST_MESSAGE <= length <= LONGEST_MESSAGE:
                self.closed = True
                begun.clear()
                return bytes(out)
            end = at + HEADER + length
            if len(begun) < end:
                break
            if not protocol:
                answer = self._answer(bytes(begun[at + HEADER + 1 : end]), now)
                out += begun[at : at + 4] + pack(">HB", len(answer) + 1, begun[at + HEADER]) + answer
            at = end
        del begun[:at]
        return bytes(out)

    def _answer(self, pdu: bytes, now: float) -> bytes:
        try:
            return pdu[:1] + self._carry_out(pdu[0], pdu[1:], now)
        except ModbusRefusal as refusal:
            return bytes((pdu[0] | EXCEPTION, refusal.code))

    def _carry_out(self, function: int, body: bytes, now: float) -> bytes:
        """Carry out a function; return what follows its code. Raises ModbusRefusal."""
        registers = self._registers
        match function:
            case 1:
                return _bits(registers.coils(*_pair(body), now))
            case 2:
                return _bits(registers.inputs(*_pair(body), now))
            case 3:
                words = registers.read(*_pair(body), now)
                return pack(f">B{len(words)}H", 2 * len(words), *words)
            case 5:
                address, value = _pair(body)
                if value not in (ON, OFF):
                    raise ModbusRefusal(ILLEGAL_VALUE)
                registers.write_coil(address, value == ON, now)
                return body
            case 16:
                if len(body) < 5:
                    raise ModbusRefusal(ILLEGAL_VALUE)
                start, count, size = unpack(">HHB", body[:5])
                if not 1 <= count <= MOST_REGISTERS or size != 2 * count or len(body) != 5 + size:
                    raise ModbusRefusal(ILLEGAL_VALUE)
                registers.write(start, unpack(f">{count}H", body[5:]), now)
                return body[:4]
            case 43:
                return self._identify(body, now)
            case 65:
                if len(body) != 4:
                    raise ModbusRefusal(ILLEGAL_VALUE)
                text = registers.read_named(_mnemonic(body), now).encode("latin-1")
                return bytes((len(text),)) + text
            case 66:
                if len(body) < 5 or len(body) != 5 + body[4]:
                    raise ModbusRefusal(ILLEGAL_VALUE)
                registers.write_named(_mnemonic(body[:4]), body[5:], now)
                return body[4:5] + body[:4]
        raise ModbusRefusal(ILLEGAL_FUNCTION)

    def _identify(self, body: bytes, now: float) -> bytes:
        """Function 43/14."""
        if body[:1] != bytes((DEVICE_ID,)):
            raise ModbusRefusal(ILLEGAL_FUNCTION if body else ILLEGAL_VALUE)
        if len(body) != 3 or not 1 <= body[1] <= INDIVIDUAL:
            raise ModbusRefusal(ILLEGAL_VALUE)
        code, first = body[1:]
        if code == INDIVIDUAL:
            if first >= OBJECTS:
                raise ModbusRefusal(ILLEGAL_ADDRESS)
            wanted = range(first, first + 1)
        else:
            last = BASIC if code == 1 else OBJECTS
            wanted = range(first if first < last else 0, last)
        listed = b""
        for number in wanted:
            given = PRINTED.get(number)
            value = (self._registers.text(given, now) if given else TEXTS[number]).encode("ascii")
            listed += bytes((number, len(value))) + value
        return bytes((DEVICE_ID, code, CONFORMITY, 0, 0, len(wanted))) + listed


def _pair(body: bytes) -> tuple[int, int]:
    """Read two words and nothing else. Raises ModbusRefusal (3)."""
    if len(body) != 4:
        raise ModbusRefusal(ILLEGAL_VALUE)
    first, second = unpack(">HH", body)
    return first, second


def _bits(states: list[bool]) -> bytes:
    """Pack up to eight states, the first one lowest, after the number of bytes."""
    return bytes((1, sum(state << place for place, state in enumerate(states))))


def _mnemonic(raw: bytes) -> str:
    """Read a name that is written backwards, with spaces before it."""
    return raw.decode("latin-1").lstrip(" ")[::-1]


TEXTS: Mapping[int, str] = {
    0: "SEM USA",
    2: "4.0.0.0",
    3: "www.motion.schneider-electric.com",
    4: "Lexium MDrive Ethernet",
}
"""The objects that are the same in every drive."""
PRINTED: Mapping[int, str] = {number: word for word, number in IDENTITY.items()}
"""Those that a drive prints: its part number, serial number and firmware."""
