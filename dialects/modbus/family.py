"""The record of the Modbus family: Lexium Ethernet drives by their registers, with MCode's words."""

from __future__ import annotations

from functools import partial

from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import Family, Guard, Guards, Registers
from multidrop.dialects.mcode.host.classify import referencing
from multidrop.dialects.mcode.manual import guards, help, points
from multidrop.dialects.modbus.host import operations
from multidrop.dialects.modbus.host.codec import Modbus, ModbusState, pdu_codec
from multidrop.dialects.modbus.host.mapping import ALTERNATIVE, lines_of
from multidrop.dialects.modbus.host.operations import identify
from multidrop.dialects.modbus.manual.registers import REGISTERS


def guarded(state: ModbusState, text: str) -> Guard | None:
    """Find the guard of a typed line for a drive. A word that has no register is refused, so it needs no agreement."""
    if guards.word_of(text) not in REGISTERS:
        return None
    return guards.find(text, address=state.address, party=False, product=state.product, starts=lambda line: True)


def homed(state: ModbusState) -> Procedure[bool]:
    return not (yield from operations.flag(state, "EF"))


MODBUS = Family(
    name=Modbus.family,
    codec=Modbus(),
    new_state=ModbusState,
    identify=identify,
    perform=operations.perform,
    check=operations.parsed,
    motion=operations.motion,
    moving=partial(operations.flag, name="MV"),
    busy=partial(operations.flag, name="BY"),
    status=operations.status,
    referencing=referencing,
    homed=homed,
    language=help,
    rests_in_place=False,
    question="PR {}".format,
    move=points.move,
    move_to=points.move_to,
    assign=points.assign,
    no_programs=f"programs are neither listed nor written over Modbus; {ALTERNATIVE} does both with the same drive",
    registers=Registers(
        read=operations.read_registers,
        write=operations.write_registers,
        lines=lines_of,
        read_coil=operations.read_coil,
        write_coil=operations.write_coil,
        device=operations.device,
    ),
    guards=Guards(guards.NAMES, guarded, guards.word_of, guards.only_ends, guards.only_reads),
    protection=guards.CYBER_SECURITY,
    prepare=pdu_codec,
    certifying_at="multidrop.dialects.modbus.host.operations:CERTIFYING",
    motions_at="multidrop.dialects.modbus.host.motions:MOTIONS",
    values_at="multidrop.dialects.modbus.host.values:VALUES",
    units_at="multidrop.dialects.modbus.host.values:UNITS",
)
