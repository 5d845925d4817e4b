"""The registers and outputs of an Ethernet drive, read and written by their numbers, and its identification."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.base.errors import Inexpressible
from multidrop.dialects.family import Printed, Registers
from multidrop.families.lexium.host.modbus import framing, mapping
from multidrop.families.lexium.host.modbus.codec import ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.identity import WARNING, identification, recognise
from multidrop.families.lexium.host.modbus.operations import answered, carried_out, request
from multidrop.families.lexium.manual.modbus.registers import AT

MOST_REGISTERS = 2
"""Most registers in one request (4.2.4, 4.2.5)."""


class ModbusRegisters(Registers):
    """The registers and outputs of an Ethernet drive."""

    state: ModbusState

    def read(self, address: int, count: int | None) -> Printed:
        """Print raw registers, one line each, then the value that they hold where it is known."""
        row = AT.get(address)
        if count is None:
            count = row.count if row is not None and row.address == address else 1
        if not 1 <= count <= MOST_REGISTERS:
            raise Inexpressible(f"a request carries 1 or {MOST_REGISTERS} registers, not {count}")
        asked = request(
            self.state, f"/register 0x{address:04X} {count}", pdu_codec().read(framing.READ_REGISTERS, address, count)
        )
        numbers = pdu_codec().registers((yield from answered(self.state, asked)))
        lines = [f"0x{address + at:04X} = {word} (0x{word:04X})" for at, word in enumerate(numbers)]
        if row is not None and (row.address, row.count) == (address, count):
            lines.append(f"{row.name} = {mapping.value_of(row, numbers)}")
        return tuple(lines)

    def write(self, address: int, values: Sequence[int]) -> Printed:
        """Write one value into its one or two registers, or two words into one register each."""
        row = AT.get(address)
        if len(values) == 1 and row is not None and row.address == address:
            pdu = mapping.write(row, values[0])
        else:
            if not 1 <= len(values) <= MOST_REGISTERS:
                raise Inexpressible(f"a request carries 1 or {MOST_REGISTERS} registers, not {len(values)}")
            if wrong := [value for value in values if not -0x8000 <= value <= 0xFFFF]:
                raise Inexpressible(f"{wrong[0]} does not fit into a register at 0x{address:04X}")
            pdu = pdu_codec().write_registers(address, [value & 0xFFFF for value in values])
        text = ",".join(map(str, values))
        yield from carried_out(self.state, f"/register 0x{address:04X} ={text}", pdu)
        return ()

    def lines(self, address: int, values: Sequence[int]) -> tuple[str, ...]:
        """The typed lines that do the same as a write of raw registers, as far as words have them."""
        row = AT.get(address)
        if len(values) == 1 and row is not None and row.address == address:
            return (f"{row.name}={values[0]}",)
        return tuple(f"{AT[address + n].name}={value}" for n, value in enumerate(values) if address + n in AT)

    def read_coil(self, number: int) -> Printed:
        asked = request(self.state, f"/coil {number}", pdu_codec().read(framing.READ_COILS, number - 1, 1))
        answer = yield from answered(self.state, asked)
        return (f"O{number} = {pdu_codec().bits(answer, 1)[0]}",)

    def write_coil(self, number: int, on: bool) -> Printed:
        yield from carried_out(self.state, f"/coil {number} {int(on)}", pdu_codec().write_coil(number - 1, on))
        return ()

    def device(self) -> Printed:
        """Print the identification. What it says decides from now on whether the device is a stranger."""
        state = self.state
        objects = yield from identification(state)
        before = state.stranger
        recognise(state, objects)
        if before and not state.stranger:
            state.note(f"this device identified itself as {state.product} now, so it is used as a Lexium drive")
        elif state.stranger and not before:
            state.note(WARNING)
        names = dict(enumerate(mapping.OBJECTS))
        return tuple(f"{names.get(number, f'object {number}')}: {text}" for number, text in sorted(objects.items()))
