"""Quantities in lines of MCode over Modbus: as on a serial line, of the settings that have registers."""

from __future__ import annotations

from multidrop.dialects.codec import Procedure
from multidrop.dialects.mcode.host import units
from multidrop.dialects.modbus.host import operations
from multidrop.dialects.modbus.host.codec import ModbusState
from multidrop.dialects.modbus.manual.registers import REGISTERS
from multidrop.dialects.units import Basis, Units


def basis(state: ModbusState, axis: str, full_steps: int | None) -> Procedure[Basis]:
    values = {}
    for word in units.rests_on(state.product):
        if word in REGISTERS:
            values[word] = str((yield from operations.value(state, word)))
    return units.counted(state.product, values, full_steps)


UNITS = Units(units.UNITS.axes, units.fields, units.UNITS.words, basis, units.disturbs, units.reads)
