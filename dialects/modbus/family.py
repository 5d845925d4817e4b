"""The record of the Modbus family: Lexium Ethernet drives by their registers, with MCode's words."""

from __future__ import annotations

from functools import partial

from dialects.family import Family, Registers
from dialects.mcode.manual import help
from dialects.modbus.host import operations
from dialects.modbus.host.codec import Modbus
from dialects.modbus.host.identify import identify
from dialects.modbus.host.mapping import ALTERNATIVE
from dialects.modbus.host.messages import pdu_codec
from dialects.modbus.host.state import ModbusState

MODBUS = Family(
    name=Modbus.family,
    codec=Modbus(),
    new_state=ModbusState,
    identify=identify,
    perform=operations.perform,
    motion=operations.motion,
    moving=partial(operations.flag, name="MV"),
    busy=partial(operations.flag, name="BY"),
    status=operations.status,
    language=help,
    no_programs=f"programs are neither listed nor written over Modbus; {ALTERNATIVE} does both with the same drive",
    registers=Registers(
        read=operations.read_registers,
        write=operations.write_registers,
        read_coil=operations.read_coil,
        write_coil=operations.write_coil,
        device=operations.device,
    ),
    prepare=pdu_codec,
)
