"""Settings of an Ethernet drive over Modbus: one request for each register, and one for each group of set-ups.

The drive and its rules are those of MCode, so the order of the steps is, too. What has no register, or another form in
it, is left to MCode/TCP.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import NoAnswer, Refused
from multidrop.dialects.mcode.host.parameters import rows_of_list
from multidrop.dialects.mcode.host.state import who
from multidrop.dialects.mcode.manual import parameter_plan
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual.parameters import reading_of
from multidrop.dialects.mcode.manual.table import words
from multidrop.dialects.modbus.host import mapping
from multidrop.dialects.modbus.host.exchange import request, sure
from multidrop.dialects.modbus.host.messages import pdu_codec
from multidrop.dialects.modbus.host.operations import flag, perform
from multidrop.dialects.modbus.host.state import ModbusState
from multidrop.dialects.modbus.manual.registers import REGISTERS
from multidrop.dialects.parameters import Change, Parameters, Permission, Plan, Progress, Readings, Value, number, same

OTHER_FORM = frozenset({"TS", "TA"})
"""Registers whose values are not those of the word."""
NO_REGISTER = "no Modbus register; MCode/TCP (tcp://HOST:503) reads it"
DECLARED = tuple((f"V{n}", "reading it is an error unless a program declares it") for n in range(1, 9))


def read(state: ModbusState, progress: Progress) -> Procedure[Readings]:
    """Read every setting that a register has. Raises NoAnswer; nothing is changed or cleared."""
    settings = [each.name for each in manual.settings(state.product, state.version, state.part)]
    names = [name for name in settings if name in REGISTERS and name not in OTHER_FORM]
    lists = {word: rows for word, rows in manual.lists(state.product, state.version).items() if word != "LS"}
    found: dict[str, Value] = {}
    unread = [*manual.unread(state.product), *DECLARED]
    unread += [(name, NO_REGISTER) for name in settings if name not in names]
    for done, name in enumerate(names):
        progress(done, len(names) + len(lists))
        try:
            found[name] = yield from _value(state, name)
        except Refused as refusal:
            unread.append((name, str(refusal)))
    for done, (word, numbers) in enumerate(lists.items(), len(names)):
        progress(done, len(names) + len(lists))
        shown = yield from _text(state, word)
        found |= rows_of_list(word, numbers, shown.replace("\r", "").split("\n"))
    progress(1, 1)
    counts, table = manual.counting(found), words(state.product)
    rows = [reading_of(name, value, table.get(name), counts) for name, value in found.items()]
    return Readings(tuple(rows), tuple(unread))


def _text(state: ModbusState, word: str) -> Procedure[str]:
    """Print a word without a look at the drive's error, which would clear it."""
    asked = mapping.reading(word)
    wanted = request(state, f"PR {word}", asked.pdu)
    reply = yield wanted
    return asked.shown(sure(state, wanted, reply))


def _value(state: ModbusState, name: str) -> Procedure[Value]:
    text = yield from _text(state, name)
    if not re.fullmatch(r"-?\d+", text):
        raise NoAnswer(f"{who(state)}: the reply to 'PR {name}' is damaged")
    return int(text)


def plan(state: ModbusState, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values; a value that its register does not take is left alone."""
    given = {name.upper(): value for name, value in wanted.items()}
    changed = {name: value for name, value in given.items() if not same(value, present.values.get(name))}
    outside = {name: _why_not(name, value) for name, value in changed.items()}
    aside = {name: reason for name, reason in outside.items() if reason}
    inside = {name: value for name, value in given.items() if name not in aside}
    made = parameter_plan.plan(state.product, present, inside, allowed)
    return Plan(made.changes, made.withheld, (*made.impossible, *aside.items()), made.remarks)


def _why_not(name: str, value: Value) -> str:
    """The reason for which a register does not take a value; empty: it does."""
    if re.fullmatch(r"[IO]S\d", name):
        return ""
    row = REGISTERS.get(name)
    if row is None or name in OTHER_FORM:
        return NO_REGISTER.replace("reads", "writes")
    if isinstance(value, (int, float)) and not row.allows(int(number(value))):
        return f"its register takes {row.limits}; MCode/TCP (tcp://HOST:503) may take it"
    return ""


def ready(state: ModbusState) -> Procedure[str]:
    """Return the reason for which settings must not change now; empty: there is none."""
    if (yield from flag(state, "MV")):
        return f"{who(state)} moves: stop it first"
    if (yield from flag(state, "BY")):
        return f"{who(state)} runs a program: E ends it"
    asked = request(state, "PR TE", mapping.read(REGISTERS["TE"]))
    reply = yield asked
    armed = pdu_codec().registers(sure(state, asked, reply))[0]
    return f"{who(state)} has armed trips (TE={armed}): TE=0 disarms them" if armed else ""


def write(state: ModbusState, change: Change) -> Procedure[None]:
    """Send one step, and make sure of it."""
    yield from perform(state, change.text)


def save(state: ModbusState) -> Procedure[None]:
    """Send S."""
    yield from perform(state, "S")


PARAMETERS = Parameters(read=read, plan=plan, ready=ready, write=write, save=save, language="MCode")
