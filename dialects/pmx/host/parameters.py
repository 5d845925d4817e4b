"""Settings of a controller: one short request for each, since it prints one value a command (PMX-2ED-SA manual 9)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.parameters import Change, Parameters, Permission, Plan, Progress, Readings, Value
from multidrop.dialects.pmx.host.exchange import answered, who
from multidrop.dialects.pmx.host.operations import LATER, busy, moving, perform
from multidrop.dialects.pmx.host.state import PmxState
from multidrop.dialects.pmx.manual import parameters as manual

FORM = r"-?\d{1,19}"
RATIO_FORM = r"\d{1,6}(?:\.\d+)?"
NAME_FORM = r"[0-9A-Za-z]{1,8}"


def read(state: PmxState, progress: Progress) -> Procedure[Readings]:
    """Read every setting; a refused word is listed. Raises NoAnswer. Nothing is changed."""
    names = manual.names()
    found, unread = [], [*manual.UNREAD]
    for done, name in enumerate(names):
        progress(done, len(names))
        try:
            found.append(manual.reading(name, (yield from _value(state, name))))
        except Refused as refusal:
            unread.append((name, str(refusal)))
    progress(len(names), len(names))
    return Readings(tuple(found), tuple(unread))


def _value(state: PmxState, name: str) -> Procedure[Value]:
    form = {"DN": NAME_FORM}.get(name, RATIO_FORM if manual.base(name) == manual.RATIO else FORM)
    asked = replace(state.codec.request(state.address, name), expect=form)
    text = (yield from answered(state, asked)).text
    if name == "DN":
        return text
    return float(text) if manual.base(name) == manual.RATIO else int(text)


def plan(state: PmxState, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values. Raises Diagnostic."""
    return manual.plan(present, wanted, allowed)


def conflict(plan: Plan, others: Collection[str]) -> str:
    """Return the reason for which a device name is another controller's; empty: it is none's."""
    numbers = [str(change.after)[-2:] for change in plan if change.name == "DN"]
    return f"another controller of the line has number {numbers[0]}" if numbers and numbers[0] in others else ""


def ready(state: PmxState) -> Procedure[str]:
    """Return the reason for which settings must not change now; empty: there is none."""
    if (yield from moving(state)):
        return f"{who(state)} moves: stop it first"
    if (yield from busy(state)):
        return f"{who(state)} runs a program: SR0=0 and SR1=0 end them"
    return ""


def write(state: PmxState, change: Change) -> Procedure[None]:
    """Send one step, and make sure of it."""
    yield from perform(state, change.text)


def save(state: PmxState) -> Procedure[None]:
    """Send STORE, which keeps all but speeds, times and variables below V32."""
    yield from perform(state, "STORE")


PARAMETERS = Parameters(
    read=read,
    plan=plan,
    ready=ready,
    write=write,
    save=save,
    language="PMX",
    saving="STORE",
    conflict=conflict,
    later=frozenset(LATER),
)
