"""How the motions of an Ethernet drive begin and end over Modbus: as in MCode, by registers of the same names.

The program cannot be listed over Modbus, so an OE routine in it is not seen. A device that did not identify itself as a
Lexium is asked for nothing: its registers may mean other things, and reading one may clear something.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multidrop.base.errors import Refused
from multidrop.base.files import split_lines
from multidrop.dialects.codec import Procedure
from multidrop.families.lexium.host.modbus.codec import ModbusState
from multidrop.families.lexium.host.modbus.identity import PRODUCT
from multidrop.families.lexium.host.modbus.operations import error_number, printed, value
from multidrop.families.lexium.host.motions import LexiumMotions, starts_program
from multidrop.families.lexium.manual.modbus.registers import REGISTERS


class ModbusMotions(LexiumMotions):
    """How the motions of an Ethernet drive begin and end."""

    state: ModbusState

    def read(self, words: Sequence[str]) -> Procedure[Mapping[str, int]]:
        """Read each of these registers that the product has."""
        state = self.state
        numbers: dict[str, int] = {}
        if not PRODUCT.fullmatch(state.product):
            return numbers
        for word in words:
            register = REGISTERS.get(word)
            if register is None or not register.readable or (register.only and state.product.startswith("LMDO")):
                continue
            try:
                numbers[word] = yield from value(state, word)
            except Refused:
                continue  # this drive lacks the register
        return numbers

    def error(self) -> Procedure[int | None]:
        return error_number(self.state)

    def program_input(self) -> Procedure[bool]:
        """Read the set-ups of the inputs, which function 65 prints as text."""
        text = yield from printed(self.state, "IS")
        return starts_program(split_lines(text))
