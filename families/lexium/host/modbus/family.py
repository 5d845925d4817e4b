"""The record of the Modbus family: Lexium Ethernet drives by their registers, with MCode's words."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.family import Guard, Hints, Motion, Printed, Referencing, Registers
from multidrop.dialects.motions import Motions
from multidrop.dialects.state import DriveState
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.lexium.host.family import LexiumFamily
from multidrop.families.lexium.host.mcode import classify
from multidrop.families.lexium.host.modbus import operations
from multidrop.families.lexium.host.modbus.codec import USER, Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.mapping import lines_of
from multidrop.families.lexium.host.modbus.operations import identify
from multidrop.families.lexium.manual import grammar, guards
from multidrop.families.lexium.manual.guards import NAMES
from multidrop.families.lexium.manual.modbus import help
from multidrop.families.lexium.manual.modbus.registers import ALTERNATIVE, REGISTERS


def guarded(state: ModbusState, text: str) -> Guard | None:
    """Find the guard of a typed line for a drive. A word that has no register is refused, so it needs no agreement."""
    if guards.word_of(text) not in REGISTERS:
        return None
    return guards.find(text, address=state.address, party=False, product=state.product, starts=lambda line: True)


def homed(state: ModbusState) -> Procedure[bool]:
    return not (yield from operations.flag(state, "EF"))


def vouched(text: str, product: str) -> bool:
    """Whether the tables show nothing for which a drive would refuse a line: a value that its register takes."""
    statement = grammar.parsed(text, USER)
    if statement is None or statement.word == "PR":
        return classify.vouched(text, product)
    register, values = REGISTERS.get(statement.word), [getattr(each, "value", None) for each in statement.arguments]
    if register is None or len(values) != 1 or not isinstance(values[0], int):
        return False
    return register.writable and register.allows(values[0])


class ModbusRegisters(Registers):
    """The registers and outputs of an Ethernet drive."""

    state: ModbusState

    def read(self, address: int, count: int | None) -> Printed:
        return operations.read_registers(self.state, address, count)

    def write(self, address: int, values: Sequence[int]) -> Printed:
        return operations.write_registers(self.state, address, values)

    def lines(self, address: int, values: Sequence[int]) -> tuple[str, ...]:
        return lines_of(address, values)

    def read_coil(self, number: int) -> Printed:
        return operations.read_coil(self.state, number)

    def write_coil(self, number: int, on: bool) -> Printed:
        return operations.write_coil(self.state, number, on)

    def device(self) -> Printed:
        return operations.device(self.state)


class ModbusFamily(LexiumFamily):
    """A Lexium Ethernet drive over Modbus/TCP, with the words of MCode."""

    state: ModbusState

    guards = NAMES

    name = Modbus.family
    codec = Modbus()
    language = help.LANGUAGE
    no_programs = f"programs are neither listed nor written over Modbus; {ALTERNATIVE} does both with the same drive"

    @classmethod
    def new_state(cls, codec: Codec, address: str) -> DriveState:
        assert isinstance(codec, Modbus)
        return ModbusState(codec, address)

    @classmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        return [*(yield from identify(hints))]

    def guard(self, text: str) -> Guard | None:
        return guarded(self.state, text)

    def perform(self, text: str) -> Printed:
        return operations.perform(self.state, text)

    def check(self, text: str) -> None:
        operations.parsed(self.state, text)

    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        return operations.motion(self.state, priority)

    def moving(self) -> Procedure[bool]:
        return operations.flag(self.state, name="MV")

    def busy(self) -> Procedure[bool]:
        return operations.flag(self.state, name="BY")

    def status(self) -> Printed:
        return operations.status(self.state)

    def referencing(self, text: str) -> Referencing | None:
        return classify.referencing(self.state, text)

    def homed(self) -> Procedure[bool]:
        return homed(self.state)

    @property
    def registers(self) -> Registers | None:
        return ModbusRegisters(self.state)

    @classmethod
    def vouched(cls, text: str, product: str) -> bool:
        return vouched(text, product)

    @classmethod
    def prepare(cls) -> None:
        pdu_codec()

    @property
    def certifying(self) -> Certifying:
        from multidrop.families.lexium.host.modbus.operations import ModbusCertifying

        return ModbusCertifying(self.state)

    @property
    def motions(self) -> Motions:
        from multidrop.families.lexium.host.modbus.motions import ModbusMotions

        return ModbusMotions(self.state)

    @property
    def values(self) -> Values:
        from multidrop.families.lexium.host.modbus.values import ModbusValues

        return ModbusValues(self.state)

    @property
    def units(self) -> Units:
        from multidrop.families.lexium.host.modbus.values import ModbusUnits

        return ModbusUnits(self.state)
