"""The settings of a controller: what is read, what may be written, and in which order (PMX-2ED-SA manual 7, 9, A).

A controller prints one value a command, so each setting is one short request. Positions, outputs, motor drivers and the
joystick's switch are states of the moment and no settings. A low speed above the high speed is refused, and the times
of ACC and DEC depend on both: speeds go first.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.parameters import (
    COMMUNICATION,
    VARIABLES,
    Change,
    Parameters,
    Permission,
    Plan,
    Progress,
    Reading,
    Readings,
    Value,
    number,
    read_each,
    reference_lost,
    same,
)
from multidrop.dialects.pmx.host.codec import PmxState
from multidrop.dialects.pmx.host.exchange import answered, who
from multidrop.dialects.pmx.host.operations import LATER, busy, moving, perform
from multidrop.dialects.pmx.manual.table import AXES, COMMANDS

WIRE = ("DN", "DB")
LOOP = ("SLR", "SLT", "SLE", "SLA")
"""StepNLoop: while it is on, a change can make it correct the position by a move."""
JOYSTICK = ("JV", "JL")
"""Speeds, dead zones and limits of the joystick, whose switch cannot be read."""
STATES = frozenset({"P", "E", "EO", "DO", "SA"})
UNREAD = (("JO", "the controller does not report whether the joystick is on"),)
SPEEDS = ("LSPD", "HSPD")
FASTEST = 6_000_000
LARGEST = 2**31 - 1
RANGES: Mapping[str, tuple[int, int]] = {
    "LSPD": (0, FASTEST), "HSPD": (0, FASTEST), "SCV": (0, 1), "EDEC": (0, 1), "IERR": (0, 1), "RZ": (0, 1),
    "SL": (0, 1), "SSPDM": (0, 9), "EOBOOT": (0, 3), "DOBOOT": (0, 255), "SLOAD": (0, 3), "DB": (1, 5),
}  # fmt: skip
"""Ranges of whole numbers; others are whole numbers of 32 bits."""
SIGNED = ("V", "JL")
RATIO = "SLR"
_AXIS = re.compile(rf"([A-Z]+?)([{''.join(AXES)}])\Z")


def base(name: str) -> str:
    if name in COMMANDS:
        return name
    found = _AXIS.match(name)
    return found[1] if found is not None and found[1] in COMMANDS else name.rstrip("0123456789")


def axis(name: str) -> str:
    found = _AXIS.match(name)
    return found[2] if found is not None and name not in COMMANDS and found[1] in COMMANDS else ""


def reading(name: str, value: Value) -> Reading:
    word = base(name)
    if word == "V":
        return Reading(name, value, VARIABLES, default=0)
    unit = "ms" if word in ("ACC", "DEC", "TOC") else "pulses/s" if word in SPEEDS else ""
    return Reading(name, value, unit=unit, fixed=name in WIRE)


NAMES = tuple(
    sorted(
        (word for row in COMMANDS.values() if row.access == "RW" and row.name not in STATES for word in row.words()),
        key=lambda name: (base(name) not in SPEEDS, base(name) in (*LOOP, "SL")),
    )
)
"""The settings in the order in which they are written."""


def plan(state: PmxState, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values. Raises Diagnostic for a value that the controller refuses."""
    now = present.values
    changed = {name.upper(): value for name, value in wanted.items() if not same(value, now.get(name.upper()))}
    withheld = {name: reason for name in changed if (reason := _risk(name, changed[name], now, allowed))}
    goal = {name: value for name, value in changed.items() if name not in withheld}
    for name, value in goal.items():
        _check(name, value)
    order = sorted(goal, key=NAMES.index)
    for low in [name for name in order if base(name) == "LSPD"]:
        order = _speeds_in_order(order, low, now, goal)
    steps = [Change(name, now.get(name), goal[name], f"{name}={_text(name, goal[name])}") for name in order]
    scale = [name for name in goal if base(name) in ("POL", "SLR", "SL")]
    return Plan(tuple(steps), tuple(withheld.items()), remarks=reference_lost(steps, scale))


def _speeds_in_order(order: list[str], low: str, now: Mapping[str, Value], goal: Mapping[str, Value]) -> list[str]:
    """The order in which the low speed is never above the high one: the high one first, unless it falls too far."""
    high = low.replace("LSPD", "HSPD")
    rest = [name for name in order if name not in (low, high)]
    falls = high in goal and number(goal[high]) < number(now.get(low))
    pair = [name for name in ((low, high) if falls else (high, low)) if name in goal]
    return [*pair, *rest]


def _risk(name: str, value: Value, now: Mapping[str, Value], allowed: Permission) -> str:
    """The reason for which a setting waits for a person's word; empty: there is none."""
    word, on = base(name), now.get(f"SL{axis(name)}")
    if name in allowed.named or (name in WIRE and allowed.communication):
        return ""
    if name in WIRE:
        return COMMUNICATION
    if word == "SL" and value:
        return "StepNLoop corrects the position by moves"
    if word in JOYSTICK:
        return "the joystick may be on, and then it can turn the motor"
    if word in LOOP and on:
        return "StepNLoop is on and may correct the position by a move"
    return "programs run after power-up" if name == "SLOAD" and value else ""


def _check(name: str, value: Value) -> None:
    """Raise Diagnostic for an unknown setting, or a value out of range."""
    if name not in NAMES:
        raise Diagnostic(f"{name}: is not a setting of the controller")
    if name == "DN":
        if not re.fullmatch(r"2ED\d\d", str(value)):
            raise Diagnostic(f"DN = {value}: valid: 2ED00 to 2ED99")
        return
    if isinstance(value, (str, tuple)):
        raise Diagnostic(f"{name} = {value}: takes a number")
    if base(name) == RATIO:
        low, high = 0.001, 999.999
    else:
        low, high = RANGES.get(base(name), (-LARGEST - 1 if base(name) in SIGNED else 0, LARGEST))
        if not float(value).is_integer():
            raise Diagnostic(f"{name} = {value}: takes a whole number")
    if not low <= value <= high:
        raise Diagnostic(f"{name} = {value}: valid: {low} to {high}")


def _text(name: str, value: Value) -> str:
    if base(name) == RATIO:
        return f"{number(value):.3f}"
    return value if isinstance(value, str) else str(int(number(value)))


NAME_FORM, RATIO_FORM, WHOLE_FORM = r"[0-9A-Za-z]{1,8}", r"\d{1,6}(?:\.\d+)?", r"-?\d{1,19}"


def read(state: PmxState, progress: Progress) -> Procedure[Readings]:
    """Read every setting; a refused word is listed. Raises NoAnswer. Nothing is changed."""
    return (yield from read_each(NAMES, partial(_read, state), progress, UNREAD))


def _read(state: PmxState, name: str) -> Procedure[Reading]:
    ratio = base(name) == RATIO
    form = NAME_FORM if name == "DN" else RATIO_FORM if ratio else WHOLE_FORM
    reply = yield from answered(state, replace(state.codec.request(state.address, name), expect=form))
    return reading(name, reply.text if name == "DN" else float(reply.text) if ratio else int(reply.text))


def conflict(plan: Plan, others: Collection[str]) -> str:
    """Return the reason for which a device name is another controller's; empty: it is none's."""
    numbers = [str(change.after)[-2:] for change in plan if change.name == "DN"]
    return f"another controller of the line has number {numbers[0]}" if numbers and numbers[0] in others else ""


def ready(state: PmxState) -> Procedure[str]:
    if (yield from moving(state)):
        return f"{who(state)} moves: stop it first"
    if (yield from busy(state)):
        return f"{who(state)} runs a program: SR0=0 and SR1=0 end them"
    return ""


PARAMETERS = Parameters(
    read=read,
    plan=plan,
    ready=ready,
    write=lambda state, change: perform(state, change.text),
    save=lambda state: perform(state, "STORE"),  # not speeds, times and variables below V32
    language="PMX",
    saving="STORE",
    conflict=conflict,
    later=frozenset(LATER),
)
