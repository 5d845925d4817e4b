"""The conditions of an Ethernet drive over Modbus: a register or a group of points a part; nothing is cleared."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.conditions import Conditions, Facts, Part, Reader
from multidrop.dialects.mcode.host.parameters import rows_of_list
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual import points
from multidrop.dialects.mcode.manual.table import words
from multidrop.dialects.modbus.host import framing, mapping
from multidrop.dialects.modbus.host.exchange import request, sure
from multidrop.dialects.modbus.host.messages import pdu_codec
from multidrop.dialects.modbus.host.operations import OUTPUTS
from multidrop.dialects.modbus.host.state import ModbusState
from multidrop.dialects.modbus.manual.registers import REGISTERS

FLAGS = ("EF", "BY", "MV", "DE")
SETTINGS = ("EE", "AS", "RC", "HC", "VI", "VM", "A", "D")
INPUTS = 4


def parts(state: ModbusState, facts: Facts) -> Sequence[Part[ModbusState]]:
    """The parts of a drive: flags, points, settings, set-ups."""
    found = [Part("flags", partial(_registers, names=FLAGS)), Part("points", _points)]
    table = words(state.product)
    has = [n for n in SETTINGS if not manual.exact(state.product) or state.product in table[n].products]
    found += [Part(name, partial(_registers, names=(name,)), slow=True) for name in has]
    lists = manual.lists(state.product, state.version)
    found += [Part(word, partial(_setups, word=word), slow=True) for word in ("IS", "OS") if word in lists]
    return found


def _registers(state: ModbusState, names: Sequence[str]) -> Procedure[Facts]:
    found = {}
    for name in names:
        register = REGISTERS[name]
        asked = request(state, f"PR {name}", mapping.read(register), Priority.POLL)
        answer = sure(state, asked, (yield asked))
        found[name] = mapping.value_of(register, pdu_codec().registers(answer))
    if "EF" in found:
        state.error_flag_read(bool(found["EF"]))
    return found


def _points(state: ModbusState) -> Procedure[Facts]:
    """Read all inputs, then all outputs; an input's bit is 1 while it is active."""
    found: dict[str, int] = {}
    for letter, function, count in (("I", framing.READ_INPUTS, INPUTS), ("O", framing.READ_COILS, OUTPUTS)):
        asked = request(state, f"{letter}1 to {letter}{count}", pdu_codec().read(function, 0, count), Priority.POLL)
        bits = pdu_codec().bits(sure(state, asked, (yield asked)), count)
        found |= {f"{letter}{n}": bit for n, bit in enumerate(bits, 1)}
    return found


def _setups(state: ModbusState, word: str) -> Procedure[Facts]:
    reading = mapping.reading(word)
    asked = request(state, f"PR {word}", reading.pdu, Priority.POLL)
    shown = reading.shown(sure(state, asked, (yield asked)))
    return rows_of_list(word, manual.LISTS[word], shown.replace("\r", "").split("\n"))


def fold(state: ModbusState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of its only axis. No register holds the target."""
    return (points.conditions(state.product, facts, None),)


READER = Reader(parts=parts, fold=fold)
