"""The record of the Modbus family: Lexium Ethernet drives by their registers, with MCode's words."""

from __future__ import annotations

from functools import partial

from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import Family, Guard, Guards, Registers
from multidrop.families.lexium.host.mcode import classify
from multidrop.families.lexium.host.modbus import operations
from multidrop.families.lexium.host.modbus.codec import USER, Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.mapping import lines_of
from multidrop.families.lexium.host.modbus.operations import identify
from multidrop.families.lexium.manual import grammar, guards, points
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
    referencing=classify.referencing,
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
    vouched=vouched,
    protection=guards.CYBER_SECURITY,
    prepare=pdu_codec,
    certifying_at="multidrop.families.lexium.host.modbus.operations:CERTIFYING",
    motions_at="multidrop.families.lexium.host.modbus.motions:MOTIONS",
    values_at="multidrop.families.lexium.host.modbus.values:VALUES",
    units_at="multidrop.families.lexium.host.modbus.values:UNITS",
)
