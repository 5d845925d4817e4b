"""The registers R1 to R4 over Modbus; variables with VA have no register."""

from __future__ import annotations

from multidrop.dialects.by_hand import Progress, Variable
from multidrop.dialects.codec import Procedure
from multidrop.families.lexium.host.by_hand import KEPT, REGISTERS, LexiumByHand
from multidrop.families.lexium.host.modbus.codec import ModbusState
from multidrop.families.lexium.host.modbus.operations import value


class ModbusByHand(LexiumByHand):
    """What a person edits and switches of an Ethernet drive over Modbus."""

    state: ModbusState

    def variables(self, progress: Progress) -> Procedure[tuple[Variable, ...]]:
        found = []
        for done, name in enumerate(REGISTERS):
            progress(done, len(REGISTERS))
            found.append(Variable(name, (yield from value(self.state, name)), KEPT))
        return tuple(found)
