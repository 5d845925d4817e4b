"""What positions and velocities of an Ethernet drive count, read by registers."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure, Request
from multidrop.dialects.units import Basis
from multidrop.families.lexium.host import units
from multidrop.families.lexium.host.modbus import framing
from multidrop.families.lexium.host.modbus.codec import ModbusState
from multidrop.families.lexium.host.modbus.operations import value
from multidrop.families.lexium.manual.groups import RESTORING, SCALES
from multidrop.families.lexium.manual.modbus.registers import AT, REGISTERS


class ModbusUnits(units.LexiumUnits):
    """The quantities in its lines."""

    state: ModbusState

    def basis(self, axis: str, full_steps: int | None) -> Procedure[Basis]:
        values = {}
        for word in units.rests_on(self.state.product):
            if word in REGISTERS:
                values[word] = str((yield from value(self.state, word)))
        return units.counted(self.state.product, values, full_steps)

    def recounts(self, request: Request) -> bool:
        """Whether it writes such a register, or one that restores all of them, by a word or by its number."""
        if super().recounts(request):
            return True
        if request.body[:1] != bytes([framing.WRITE_REGISTERS]):
            return False
        first, count = int.from_bytes(request.body[1:3]), int.from_bytes(request.body[3:5])
        written = (AT.get(address) for address in range(first, first + count))
        return any(row.name in (*SCALES, *RESTORING) for row in written if row is not None)
