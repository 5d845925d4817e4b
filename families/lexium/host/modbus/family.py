"""The record of the Modbus family: Lexium Ethernet drives by their registers, with MCode's words."""

from __future__ import annotations

from multidrop.dialects.certifying import Certifying
from multidrop.dialects.codec import Codec, Procedure
from multidrop.dialects.family import Guard, Hints, Registers
from multidrop.dialects.motions import Motions
from multidrop.dialects.state import DriveState, who
from multidrop.dialects.units import Units
from multidrop.dialects.values import Values
from multidrop.families.lexium.host.family import LexiumFamily
from multidrop.families.lexium.host.modbus.codec import USER, Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.identity import WARNING, announced, recognise
from multidrop.families.lexium.host.modbus.operations import ModbusCertifying, ModbusOperations, flagged
from multidrop.families.lexium.manual import grammar, guards
from multidrop.families.lexium.manual.guards import NAMES
from multidrop.families.lexium.manual.modbus import help
from multidrop.families.lexium.manual.modbus.registers import ALTERNATIVE, REGISTERS


class ModbusFamily(ModbusOperations, LexiumFamily):
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
        state = ModbusState(Modbus())
        recognise(state, (yield from announced(state)))
        if state.stranger:
            state.note(WARNING)
        elif (yield from flagged(state)):
            state.note(f"{who(state)}: its error flag is set (EF=1); PR ER shows and clears the error")
        return [state]

    def guard(self, text: str) -> Guard | None:
        """A word that has no register is refused, so it needs no agreement."""
        if self.word_of(text) not in REGISTERS:
            return None
        state = self.state
        return guards.find(text, address=state.address, party=False, product=state.product, starts=lambda line: True)

    @property
    def registers(self) -> Registers:
        from multidrop.families.lexium.host.modbus.registers import ModbusRegisters

        return ModbusRegisters(self.state)

    @classmethod
    def vouched(cls, text: str, product: str) -> bool:
        """Whether the tables show nothing for which a drive would refuse a line: a value that its register takes."""
        statement = grammar.parsed(text, USER)
        if statement is None or statement.word == "PR":
            return super().vouched(text, product)
        register, values = (
            REGISTERS.get(statement.word),
            [getattr(argument, "value", None) for argument in statement.arguments],
        )
        if register is None or len(values) != 1 or not isinstance(values[0], int):
            return False
        return register.writable and register.allows(values[0])

    @classmethod
    def prepare(cls) -> None:
        pdu_codec()

    @property
    def certifying(self) -> Certifying:
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
        from multidrop.families.lexium.host.modbus.units import ModbusUnits

        return ModbusUnits(self.state)
