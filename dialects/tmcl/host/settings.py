"""Settings of a module: GAP and GGP for each, SAP and SGP to write, STAP to save."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.parameters import Change, Parameters, Permission, Plan, Progress, Reading, Readings, Value
from multidrop.dialects.tmcl.host.exchange import read as read_value
from multidrop.dialects.tmcl.host.exchange import who
from multidrop.dialects.tmcl.host.motors import motors
from multidrop.dialects.tmcl.host.operations import moving, perform
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual import settings as manual
from multidrop.dialects.tmcl.manual.commands import Command


def read(state: TmclState, progress: Progress) -> Procedure[Readings]:
    """Read every setting; modules differ, so a refused one is listed. Raises NoAnswer."""
    names = manual.names((yield from motors(state)))
    found: list[Reading] = []
    unread: list[tuple[str, str]] = []
    for done, name in enumerate(names):
        progress(done, len(names))
        try:
            found.append(manual.reading(name, (yield from read_value(state, manual.call(name, Command.GAP)))))
        except Refused as refusal:
            unread.append((name, str(refusal)))
    progress(len(names), len(names))
    return Readings(tuple(found), tuple(unread))


def plan(state: TmclState, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values. Raises Diagnostic."""
    return manual.plan(state.motors or 1, present, wanted, allowed)


def conflict(plan: Plan, others: Collection[str]) -> str:
    """Return the reason for which an address is another module's; empty: it is none's."""
    numbers = [str(change.after) for change in plan if change.name == manual.ADDRESS]
    return f"another module of the line has address {numbers[0]}" if numbers and numbers[0] in others else ""


def ready(state: TmclState) -> Procedure[str]:
    """Return the reason for which settings must not change now; empty: there is none."""
    return f"{who(state)} moves: stop it first" if (yield from moving(state)) else ""


def write(state: TmclState, change: Change) -> Procedure[None]:
    """Send one step, and make sure of it. A module keeps global parameters by itself."""
    yield from perform(state, change.text)


def save(state: TmclState) -> Procedure[None]:
    """Store the axis parameters in EEPROM, one by one; a module may lack some."""
    for name in manual.names((yield from motors(state))):
        if not name.startswith(manual.GLOBAL_PREFIX):
            call = manual.call(name, Command.GAP)
            try:
                yield from perform(state, f"STAP {call.type}, {call.motor}")
            except Refused as refusal:
                if refusal.code not in manual.NOT_STORED:
                    raise


PARAMETERS = Parameters(
    read=read, plan=plan, ready=ready, write=write, save=save, language="TMCL", saving="STAP", conflict=conflict
)
