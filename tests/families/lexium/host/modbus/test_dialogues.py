"""Dialogues with an Ethernet drive: each call of the family with its requests, byte for byte, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from multidrop.dialects import Hints, Kind, Priority, Request
from multidrop.dialects.motions import Evidence, Move, MoveKind
from multidrop.dialects.values import ORDINARY, Change, Permission, Readings
from multidrop.families.lexium.host.mcode import units as mcode_units
from multidrop.families.lexium.host.modbus import (
    codec,
    family,
    framing,
    identity,
    limits,
    mapping,
    motions,
    operations,
    pdu,
    values,
)
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState, pdu_codec
from multidrop.families.lexium.host.modbus.family import ModbusFamily
from multidrop.families.lexium.host.modbus.motions import ModbusMotions
from multidrop.families.lexium.host.modbus.registers import ModbusRegisters
from multidrop.families.lexium.host.modbus.units import ModbusUnits
from multidrop.families.lexium.host.modbus.values import ModbusParameters, ModbusValues
from multidrop.families.lexium.manual.grammar import parse
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from tests.support.dialogues import dialogue_tests

USED = (
    identity, ModbusRegisters,
    replace, Hints, Kind, Priority, mcode_units, family, ModbusFamily, codec, framing, limits, mapping, motions,
    operations, pdu, values, ModbusMotions, ModbusParameters, ModbusUnits, ModbusValues, REGISTERS, Evidence,
    Move, MoveKind, ORDINARY, Change, Permission, Readings, pdu_codec,
)  # fmt: skip
"""The names that calls in the files use."""
ERRORS = (framing.NotModbus,)


def drive(product="LMDCE", stranger="", unit=1, **known):
    return ModbusState(Modbus(unit), product=product, stranger=stranger, **known)


def unread():
    """A device whose identification was not read."""
    return ModbusState(Modbus())


def type_(state, text):
    return ModbusFamily(state).perform(text)


def asked(pdu, tag=0):
    return Request("", "a line", Kind.PRINT, Modbus(), tag=tag, body=bytes.fromhex(pdu))


def decoded(pdu, heard, tag=0x1234):
    """How a reply is read, then what silence makes of the same bytes."""
    request, data = asked(pdu, tag), bytes.fromhex(heard)
    return Modbus().decode(request, data), Modbus().on_timeout(request, data)


def command(text):
    """The request of a typed line."""
    return mapping.command(parse(text, codec.USER)).hex()


def progress(shown):
    """A progress that is kept."""
    return lambda done, total: shown.append((done, total))


def parts_read(state, facts):
    """Read every part of the conditions, one after the other."""
    for part in ModbusValues(state).parts(facts):
        found = yield from part.read()
        facts = {**facts, **found}
    return facts


globals().update(dialogue_tests(Path(__file__).parent, globals()))
