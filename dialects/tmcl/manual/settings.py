"""The settings of a module, named as in a cell file: `4` is an axis parameter, `4_1` of motor 1, `G65` a global one.

Target, position and velocity are states of the moment: setting one starts a move.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.parameters import (
    COMMUNICATION,
    Change,
    Permission,
    Plan,
    Reading,
    Readings,
    Value,
    reference_lost,
    same,
)
from multidrop.dialects.tmcl.manual.commands import STARTING_PARAMETERS, Call, Command
from multidrop.dialects.tmcl.manual.parameters import AXIS, GLOBAL, Axis, Global, Parameter

GLOBAL_PREFIX = "G"
ADDRESS = f"{GLOBAL_PREFIX}{int(Global.ADDRESS)}"
MOTION = frozenset({Axis.TARGET_POSITION, Axis.ACTUAL_POSITION, Axis.TARGET_VELOCITY})
WIRE = frozenset({Global.BAUD, Global.ADDRESS, Global.PAUSE, Global.HOST_ADDRESS})
NOT_STORED = (3, 6)
"""The statuses of a module that lacks a parameter, or does not store it: wrong type, command not available."""
_NAME = re.compile(r"(G?)(\d{1,3})(?:_(\d))?", re.ASCII)


def names(motors: int) -> tuple[str, ...]:
    """The settings of a module, in the order in which they are written."""
    axis = [number for number, each in AXIS.items() if each.writable and number not in MOTION]
    own = [f"{int(number)}{f'_{motor}' if motor else ''}" for motor in range(motors) for number in axis]
    own_globals = [number for number, each in GLOBAL.items() if each.writable]
    ordered = sorted(own_globals, key=lambda number: (number in WIRE, number == Global.ADDRESS, number == Global.BAUD))
    return (*own, *(f"{GLOBAL_PREFIX}{int(number)}" for number in ordered))


def call(name: str, command: Command, value: int = 0) -> Call:
    """The command for a setting; `command` is the one for an axis parameter."""
    prefix, number, motor = _parts(name)
    if prefix:
        command = {Command.GAP: Command.GGP, Command.SAP: Command.SGP}[command]
    return Call(command, number, motor, value)


def reading(name: str, value: int) -> Reading:
    """Put unit and default to a value."""
    row, (prefix, number, _) = _row(name), _parts(name)
    unit = ", ".join(each for each in (row.title, row.unit) if each)
    return Reading(name, value, unit=unit, default=row.fresh, fixed=bool(prefix) and number in WIRE)


def plan(motors: int, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Order the steps to the wanted values. Raises Diagnostic for a value that the module refuses."""
    now = present.values
    changed = {name.upper(): value for name, value in wanted.items() if not same(value, now.get(name.upper()))}
    withheld = {name: reason for name in changed if (reason := _risk(name, changed[name], now, allowed))}
    goal = {name: _checked(name, value, motors) for name, value in changed.items() if name not in withheld}
    order = [name for name in names(motors) if name in goal]
    steps = [Change(name, now.get(name), goal[name], str(call(name, Command.SAP, goal[name]))) for name in order]
    scale = [name for name in goal if _parts(name)[:2] == ("", Axis.MICROSTEPS)]
    return Plan(tuple(steps), tuple(withheld.items()), remarks=reference_lost(steps, scale))


def _parts(name: str) -> tuple[str, int, int]:
    found = _NAME.fullmatch(name)
    return (found[1], int(found[2]), int(found[3] or 0)) if found else ("", -1, 0)


def _row(name: str) -> Parameter:
    prefix, number, _ = _parts(name)
    return (GLOBAL if prefix else AXIS)[number]


def _checked(name: str, value: Value, motors: int) -> int:
    """Return the value as a whole number. Raises Diagnostic."""
    if name not in names(motors):
        raise Diagnostic(f"{name}: is not a setting of the module")
    limits = _row(name).limits
    if isinstance(value, (str, tuple)) or not float(value).is_integer() or int(value) not in limits:
        raise Diagnostic(f"{name} = {value}: valid: {limits.start} to {limits.stop - 1}")
    return int(value)


def _risk(name: str, value: Value, now: Mapping[str, Value], allowed: Permission) -> str:
    """The reason for which a setting waits for a person's word; empty: there is none."""
    prefix, number, _ = _parts(name)
    communicates = bool(prefix) and number in WIRE
    if name in allowed.named or (communicates and allowed.communication):
        return ""
    if communicates:
        return COMMUNICATION
    if prefix and number == Global.AUTOSTART and value:
        return "the stored program starts at power-up"
    if not prefix and number in (Axis.RIGHT_LIMIT_OFF, Axis.LEFT_LIMIT_OFF) and value:
        return "a move that the limit switch holds back may go on"
    waits = not prefix and number in STARTING_PARAMETERS and now.get(name) == 0
    return "a move may wait for it" if waits else ""
