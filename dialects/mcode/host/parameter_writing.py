"""Writing settings of an MCode drive: the moment for it, one step, and S."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.mcode.host.attend import attend
from multidrop.dialects.mcode.host.exchange import answered
from multidrop.dialects.mcode.host.operations import perform
from multidrop.dialects.mcode.host.parameters import read
from multidrop.dialects.mcode.host.signatures import question, value
from multidrop.dialects.mcode.host.state import MCodeState
from multidrop.dialects.mcode.host.wording import who
from multidrop.dialects.mcode.manual import parameter_plan
from multidrop.dialects.parameters import Change, Parameters, Permission, Plan, Readings, Value


def plan(state: MCodeState, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values. Raises Diagnostic for values that the drive refuses."""
    return parameter_plan.plan(state.product, present, wanted, allowed)


def conflict(plan: Plan, others: Collection[str]) -> str:
    """Return the reason for which a name or party mode would disturb other drives of the line; empty: none."""
    final = {change.name: change.after for change in plan}
    if final.get("DN") in others:
        return f"another drive of the line is named {final['DN']}"
    return (
        "other drives share the line, and PY=0 would make this one reply to all of it"
        if (others and final.get("PY") == 0)
        else ""
    )


def ready(state: MCodeState) -> Procedure[str]:
    """Return the reason for which settings must not change now; empty: there is none."""
    if state.programming:
        return f"{who(state)} is in program mode and would store the settings: PG ends that"
    yield from attend(state, question(state, "MV", "[01]"))
    reply = yield from answered(state, question(state, "MV,BY,TE", r"[01][01]\d{1,3}"))
    said = value(state, reply)
    if said[:1] == "1":
        return f"{who(state)} moves: stop it first"
    if said[1:2] == "1":
        return f"{who(state)} runs a program: E ends it"
    if said[2:] not in ("", "0"):
        return f"{who(state)} has armed trips (TE={said[2:]}): TE=0 disarms them"
    return ""


def write(state: MCodeState, change: Change) -> Procedure[None]:
    """Send one step, and make sure of it."""
    yield from perform(state, change.text)


def save(state: MCodeState) -> Procedure[None]:
    """Send S."""
    if state.programming:
        raise Refused(f"{who(state)} is in program mode and would store S: PG ends that")
    yield from perform(state, "S")


LATER = frozenset({"BD"})
PARAMETERS = Parameters(
    read=read, plan=plan, ready=ready, write=write, save=save, language="MCode", conflict=conflict, later=LATER
)
