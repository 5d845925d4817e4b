"""Lines of MCode as Modbus requests: the register, output or function of a word, and the text of its reply.

A person types the drive's own language; this module maps the part that registers carry. It evaluates nothing and checks
no range: the drive does. (Modbus/TCP manual 4.2, 4.3, 5.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from multidrop.base.errors import Inexpressible, Refused
from multidrop.families.lexium.host.modbus import framing
from multidrop.families.lexium.host.modbus.codec import pdu_codec
from multidrop.families.lexium.manual import errors
from multidrop.families.lexium.manual.errors import ErrorNumber
from multidrop.families.lexium.manual.grammar import Argument, NameTerm, Number, Statement
from multidrop.families.lexium.manual.modbus.registers import (
    ALTERNATIVE,
    AT,
    CONTROLS,
    IDENTITY,
    INPUTS,
    INT32,
    OUTPUTS,
    REGISTERS,
    SETUPS,
    ModbusRegister,
    WrittenValue,
)
from multidrop.families.lexium.manual.table import lookup

READ_ONLY, UNREADABLE = ErrorNumber.READ_ONLY, ErrorNumber.NOT_PRINTABLE
"""The drive's own errors for a word that can only be read, or not be printed."""
OBJECTS = ("vendor", "part number", "revision", "web page", "product", "serial number", "version")
"""The objects of the device identification on these drives (4.1.1)."""
EVERY_OBJECT, ONE_OBJECT = 3, 4


@dataclass(frozen=True)
class ReadRequest:
    """A request that reads a value, and the printed form of its reply."""

    pdu: bytes
    shown: Callable[[bytes], str]


def command(statement: Statement) -> bytes:
    """Build the request for a line that prints nothing. Raises Inexpressible, or Refused for a read-only word."""
    word, arguments = statement.word, statement.arguments
    if word == "E":
        _none(word, arguments)
        return pdu_codec().read_specific(word)
    if word in SETUPS or word in CONTROLS:
        return _specific(word, arguments)
    if word in OUTPUTS:
        value = _number(word, arguments)
        if value not in (0, 1):
            raise Inexpressible(f"{word} takes 0 or 1")
        return pdu_codec().write_coil(OUTPUTS[word], value == 1)
    register = REGISTERS.get(word)
    if register is None:
        raise unavailable(word)
    if not register.writable:
        raise Refused(f"{word} cannot be written: error {READ_ONLY}: {errors.text(READ_ONLY)}", READ_ONLY)
    return write(register, _value(register, arguments))


def _value(register: ModbusRegister, arguments: Sequence[Argument | None]) -> int:
    word = register.name
    if register.takes is WrittenValue.COMMAND and not arguments:
        return 1
    if register.takes is WrittenValue.VARIABLE:
        name = arguments[0] if len(arguments) == 1 else None
        if not isinstance(name, NameTerm):
            raise Inexpressible(f"{word} needs a variable, as in {word} R1")
        if name.word not in REGISTERS:
            raise unavailable(name.word)
        return REGISTERS[name.word].address
    return _number(word, arguments)


def _number(word: str, arguments: Sequence[Argument | None]) -> int:
    if not arguments:
        raise Inexpressible(f"{word} needs a value, as in {word}=1")
    if len(arguments) > 1:
        raise Inexpressible(f"a register carries one value; {ALTERNATIVE} takes more for {word}")
    value = arguments[0]
    if not isinstance(value, Number):
        raise Inexpressible(f"expressions are not evaluated over Modbus: give a number, or use {ALTERNATIVE}")
    if not isinstance(value.value, int):
        raise Inexpressible(f"{value.value} is not a whole number, which a register needs; {ALTERNATIVE} may take it")
    return value.value


def _none(word: str, arguments: Sequence[Argument | None]) -> None:
    if arguments:
        raise Inexpressible(f"{word} takes no value")


def _specific(word: str, arguments: Sequence[Argument | None]) -> bytes:
    """Build a manufacturer specific write: the parameters as text, after an equals sign for a set-up."""
    if word in ("PS", "RS"):
        _none(word, arguments)
    elif not arguments:
        raise Inexpressible(f"{word} needs its parameters; /help {word} shows them")
    text = ",".join(_parameter(argument) for argument in arguments)
    data = f"={text}" if word in SETUPS else text
    if len(data) > framing.LONGEST_STRING:
        raise Inexpressible(f"the parameters of {word} take {len(data)} characters, the drive {framing.LONGEST_STRING}")
    return pdu_codec().write_specific(word, data)


def _parameter(argument: Argument | None) -> str:
    if argument is None:
        return ""
    if isinstance(argument, Number) and isinstance(argument.value, int):
        return str(argument.value)
    if isinstance(argument, Number):
        raise Inexpressible(f"{argument.value} is not a whole number; {ALTERNATIVE} may take it")
    if isinstance(argument, NameTerm):
        return argument.word
    raise Inexpressible(f"expressions are not evaluated over Modbus: give numbers, or use {ALTERNATIVE}")


def write(register: ModbusRegister, value: int) -> bytes:
    """Write a value into its registers, whatever its range. Raises Inexpressible where it does not fit.

    One register has no sign: -1 there is 65535, which HT and others accept.
    """
    low, high = INT32 if register.count == 2 else (0, 0xFFFF)
    if not low <= value <= high:
        bits = f"{16 * register.count} bits of {register.name}{', which have no sign' if not low else ''}"
        raise Inexpressible(f"{value} does not fit into the {bits}; nothing was sent")
    return pdu_codec().write_registers(register.address, framing.words_of(value, register.count))


def reading(word: str) -> ReadRequest:
    """Build the request for `PR word`. Raises Inexpressible, or Refused for a word that cannot be printed."""
    if word in INPUTS:
        asked = pdu_codec().read(framing.READ_INPUTS, INPUTS[word], 1)
        return ReadRequest(asked, lambda answer: str(pdu_codec().bits(answer, 1)[0]))
    if word in SETUPS - REGISTERS.keys():
        return ReadRequest(pdu_codec().read_specific(word), _set_up)
    if word in IDENTITY:
        thing = IDENTITY[word]
        asked = pdu_codec().identify(ONE_OBJECT, thing)
        return ReadRequest(asked, lambda answer: pdu_codec().objects(answer)[0].get(thing, ""))
    register = REGISTERS.get(word)
    if register is None and word != "E" and word not in CONTROLS:
        raise unavailable(word)
    if register is None or not register.readable:
        outputs = OUTPUTS if word == "OT" else [word] if word in OUTPUTS else []
        coils = " and ".join(f"/coil {OUTPUTS[output] + 1}" for output in outputs)
        reads = f"; {coils} {'reads' if len(outputs) == 1 else 'read'} it" if coils else ""
        raise Refused(f"{word} cannot be printed: error {UNREADABLE}: {errors.text(UNREADABLE)}{reads}", UNREADABLE)
    return ReadRequest(read(register), lambda answer: str(value_of(register, pdu_codec().registers(answer))))


def _set_up(answer: bytes) -> str:
    """Print a set-up as PR does: an unset trip has three zeros in the manual's example, and one in PR."""
    text = pdu_codec().specific(answer)
    return "0" if text == "0, 0, 0" else text


def read(register: ModbusRegister) -> bytes:
    return pdu_codec().read(framing.READ_REGISTERS, register.address, register.count)


def value_of(register: ModbusRegister, words: Sequence[int]) -> int:
    """Join the registers to a value; only values of four bytes are signed."""
    return framing.signed(words) if register.width == 4 else sum(word << 16 * n for n, word in enumerate(words))


def unavailable(word: str) -> Inexpressible:
    if lookup(word) is not None:
        return Inexpressible(f"{word} has no Modbus register; {ALTERNATIVE} knows it")
    return Inexpressible(
        f"{word} has no Modbus register (of variables only R1 to R4 and V1 to V8 have one); {ALTERNATIVE} may know it"
    )


def written(pdu: bytes) -> tuple[ModbusRegister | None, int | None]:
    """Return the name that a write of registers goes to, and the value; None for a part of a value or another request.

    Of two names the second one is given if its value is out of its range.
    """
    if pdu[0] != framing.WRITE_REGISTERS:
        return None, None
    address, count = int.from_bytes(pdu[1:3]), int.from_bytes(pdu[3:5])
    values = [int.from_bytes(pdu[6 + 2 * at : 8 + 2 * at]) for at in range(count)]
    if (row := AT.get(address)) is None:
        return None, None
    if row.address == address and row.count == count:
        return row, value_of(row, values)
    register = [(AT.get(address + at), value) for at, value in enumerate(values)]
    if parts := [place for place, _ in register if place is None or place.width == 4]:
        return parts[0], None
    outside = [(place, value) for place, value in register if place is not None and not place.allows(value)]
    return (outside or register)[0]


def place(pdu: bytes) -> str:
    """Describe the target of a request for a person: `register 0x0057 (P)`."""
    function, address = pdu[0], int.from_bytes(pdu[1:3])
    if function in (framing.READ_REGISTERS, framing.WRITE_REGISTERS):
        row = AT.get(address)
        return f"register 0x{address:04X}" + (f" ({row.name})" if row else "")
    if function in (framing.READ_COILS, framing.WRITE_COIL):
        return f"output 0x{address:04X} (O{address + 1})"
    if function == framing.READ_INPUTS:
        return f"input 0x{address:04X} (I{address + 1})"
    if function in (framing.READ_SPECIFIC, framing.WRITE_SPECIFIC):
        return f"function {function} ({pdu[1:5].decode('ascii').strip()[::-1]})"
    return f"device identification, object {pdu[3]}"
