"""Reading of an Ethernet drive what Modbus gives of it. Nothing moves, and nothing is cleared."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Procedure
from multidrop.dialects.mcode.host.readings import SNAPSHOT_WORDS, snapshot_of
from multidrop.dialects.mcode.manual.table import words
from multidrop.dialects.modbus.host import mapping, parameters
from multidrop.dialects.modbus.host.exchange import request, sure
from multidrop.dialects.modbus.host.operations import identification
from multidrop.dialects.modbus.host.state import ModbusState
from multidrop.dialects.parameters import Progress
from multidrop.dialects.snapshots import Snapshot

SERIAL = 5
"""The object of the identification."""
DIVIDED = 4
"""Counts of the analog input in one count of its register."""
NO_PROGRAM = ("its program and variables", "Modbus reads neither; MCode/TCP (tcp://HOST:503) does")


def take(state: ModbusState, progress: Progress) -> Procedure[Snapshot]:
    """Read a drive. Raises Refused or NoAnswer."""
    readings = yield from parameters.read(state, progress)
    if not state.serial:
        state.serial_read((yield from identification(state)).get(SERIAL, ""))
    known, now = words(state.product), {}
    for word in SNAPSHOT_WORDS:
        if word in known and state.product in known[word].products:
            now[word] = yield from _value(state, word)
    if "I5" in now:
        now["I5"] *= DIVIDED
    return snapshot_of(state, replace(readings, unread=(*readings.unread, NO_PROGRAM)), now)


def _value(state: ModbusState, word: str) -> Procedure[int]:
    """Read a register without a look at the drive's error, which would clear it."""
    reading = mapping.reading(word)
    asked = request(state, f"PR {word}", reading.pdu)
    reply = yield asked
    return int(reading.shown(sure(state, asked, reply)))
