"""The conditions of a module: target and switches of each motor; currents and ramps are settings.

The extended error flags (207) are not read, since that clears them. (TMCL firmware manuals, "Axis parameters".)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.conditions import Conditions, Facts, Lamp, Pace, Part, Reader
from multidrop.dialects.errors import Refused
from multidrop.dialects.tmcl.host.exchange import read
from multidrop.dialects.tmcl.host.motors import motors
from multidrop.dialects.tmcl.host.state import TmclState
from multidrop.dialects.tmcl.manual.commands import Call, Command
from multidrop.dialects.tmcl.manual.parameters import Axis

STATE = (Axis.TARGET_POSITION, Axis.POSITION_REACHED)
SWITCHES = ((Axis.HOME_SWITCH, "home"), (Axis.RIGHT_SWITCH, "lim+"), (Axis.LEFT_SWITCH, "lim-"))
RAMP = (Axis.MAXIMUM_VELOCITY, Axis.MAXIMUM_ACCELERATION)
SETTINGS = (Axis.RUN_CURRENT, Axis.STANDBY_CURRENT, Axis.FREEWHEELING, *RAMP)
ABSENT = "absent"
"""A parameter that the module refuses: it lacks it."""
FULL_CURRENT = 255


def parts(state: TmclState, facts: Facts) -> Sequence[Part[TmclState]]:
    """The parts of a module, for each motor that was counted; at first they are counted."""
    if not state.motors:
        return (Part("motors", _count),)
    found: list[Part[TmclState]] = []
    for motor in range(state.motors):
        asked = [*STATE, *(axis for axis, _ in SWITCHES if facts.get(_key(axis, motor)) != ABSENT)]
        found.append(Part(f"motor {motor}", partial(_parameters, motor=motor, wanted=asked)))
        found += [
            Part(_key(axis, motor), partial(_parameters, motor=motor, wanted=(axis,)), slow=True) for axis in SETTINGS
        ]
    return found


def _key(axis: Axis, motor: int) -> str:
    return f"{axis.name} {motor}"


def _count(state: TmclState) -> Procedure[Facts]:
    yield from motors(state, Priority.POLL)
    return {}


def _parameters(state: TmclState, motor: int, wanted: Sequence[Axis]) -> Procedure[Facts]:
    found: dict[str, int | str] = {}
    for axis in wanted:
        try:
            found[_key(axis, motor)] = yield from read(state, Call(Command.GAP, axis, motor), Priority.POLL)
        except Refused:
            found[_key(axis, motor)] = ABSENT
    return found


def fold(state: TmclState, facts: Facts) -> tuple[Conditions, ...]:
    """The conditions of each motor."""
    return tuple(_conditions(state, facts, motor) for motor in range(state.motors))


def _conditions(state: TmclState, facts: Facts, motor: int) -> Conditions:
    target = _whole(facts, Axis.TARGET_POSITION, motor)
    reached = _whole(facts, Axis.POSITION_REACHED, motor)
    return Conditions(
        axis=str(motor) if state.motors > 1 else "",
        lamps=tuple(_lamps(facts, motor)),
        target=None if reached else target,
        run_current=_percent(facts, Axis.RUN_CURRENT, motor),
        hold_current=_percent(facts, Axis.STANDBY_CURRENT, motor),
        released=_released(facts, motor),
        unit="microsteps",
        pace=_pace(facts, motor),
    )


def _whole(facts: Facts, axis: Axis, motor: int) -> int | None:
    value = facts.get(_key(axis, motor))
    return value if isinstance(value, int) else None


def _percent(facts: Facts, axis: Axis, motor: int) -> int | None:
    value = _whole(facts, axis, motor)
    return None if value is None else round(value * 100 / FULL_CURRENT)


def _released(facts: Facts, motor: int) -> str:
    """The reason for which no current holds the motor at rest."""
    if _whole(facts, Axis.STANDBY_CURRENT, motor) == 0:
        return "parameter 7 is 0"
    return "freewheels: parameter 204" if _whole(facts, Axis.FREEWHEELING, motor) else ""


def _lamps(facts: Facts, motor: int) -> Iterator[Lamp]:
    for axis, function in SWITCHES:
        if isinstance(value := facts.get(_key(axis, motor)), int):
            yield Lamp("", function, bool(value))


def _pace(facts: Facts, motor: int) -> Pace | None:
    """One ramp up and down; older modules count it in units of their chip, so it may be another."""
    speed, ramp = (_whole(facts, axis, motor) for axis in RAMP)
    return Pace(0, speed, ramp, ramp) if speed and ramp else None


READER = Reader(parts=parts, fold=fold)
