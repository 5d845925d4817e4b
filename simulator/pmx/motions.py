"""The commands that begin and change motions of one axis of a PMX: moves, jogs, homing, changes on the fly."""

from __future__ import annotations

from simulator.pmx.axis import Axis
from simulator.pmx.homing import Homing
from simulator.pmx.settings import WINDOWS, Refusal
from simulator.pmx.states import Doing, Pace, own_pace


def check(axis: Axis, t: float) -> None:
    """Refuse a motion that may not begin."""
    if axis.pulses.moving(t) or axis.homing:
        raise Refusal("?Moving")
    if axis.loop.error:
        raise Refusal("?Clear SNL Error")
    if axis.trouble:
        raise Refusal("?Clear SNL Error" if axis.loop.on else "")


def check_pace(axis: Axis) -> Pace:
    """Work out the axis's own pace. Raises Refusal for a low speed that does not fit."""
    return own_pace(axis.settings, axis.name, _scale(axis))


def aim(axis: Axis, target: float, t: float) -> float:
    """Give the place of a target of the counter, pulses from power-up."""
    if axis.loop.on:
        return axis.pulses.whole(axis.pulses.place(t) + (target - axis.loop.target(t)) * axis.loop.ratio)
    return axis.pulses.place_of(target, t)


def go(axis: Axis, target: int, t: float) -> None:
    """`X1000`: move to a position of the counter (counts with StepNLoop)."""
    check(axis, t)
    pace = check_pace(axis)
    axis.loop.attempts, axis.goal = 0, target
    axis.start(Doing.MOVE, axis.pulses.to_place(aim(axis, target, t), t, pace), t, pace)


def jog(axis: Axis, direction: float, t: float) -> None:
    """`JX+`: turn until a stop."""
    check(axis, t)
    pace = check_pace(axis)
    axis.loop.attempts = 0
    axis.start(Doing.JOG, axis.pulses.to_speed(direction * pace.high, t, pace), t, pace)


def home(axis: Axis, word: str, direction: float, t: float) -> None:
    """`HX+`, `LX+`, ...: begin one of the homing routines (7.10)."""
    check(axis, t)
    pace = check_pace(axis)
    axis.loop.attempts = 0
    axis.homing = Homing(axis, word, direction, pace)
    axis.homing.begin(t)
    axis.live(t)


def retarget(axis: Axis, target: int, t: float) -> None:
    """`TX`: change the target on the fly, for a move of this axis alone."""
    pulses = axis.pulses
    if pulses.doing is not Doing.MOVE or not pulses.moving(t):
        raise Refusal("?ABS/INC is not in operation")
    axis.goal = target
    profile = pulses.to_place_on_the_fly(aim(axis, target, t), t, pulses.pace)
    axis.start(Doing.MOVE, profile, t, pulses.pace)


def respeed(axis: Axis, speed: int, t: float) -> None:
    """`SSPDX=`: change the speed on the fly, for a move or a jog; at rest only the value is checked."""
    _check_respeed(axis, speed)
    pulses = axis.pulses
    if not pulses.moving(t) or pulses.doing not in (Doing.MOVE, Doing.JOG):
        return
    wanted = speed * _scale(axis)
    pace = pulses.pace._replace(high=wanted, low=min(pulses.pace.low, wanted))
    if pulses.doing is Doing.JOG:
        axis.start(Doing.JOG, pulses.to_speed(pulses.profile.direction(t) * wanted, t, pace), t, pace)
    else:
        axis.start(Doing.MOVE, pulses.to_place_on_the_fly(pulses.profile.target, t, pace), t, pace)


def _check_respeed(axis: Axis, speed: int) -> None:
    """Refuse a speed that `SSPDX=` does not take."""
    if axis.doing is Doing.LINE:
        raise Refusal("?ICommandOn")
    if axis["SCV"]:
        raise Refusal("?S-curve on")
    mode = axis["SSPDM"]
    if not mode:
        raise Refusal("?SSPD Mode not Initialized")
    limits = WINDOWS[mode - 1]
    if not max(limits.low, 1) <= speed * _scale(axis) <= limits.high:
        raise Refusal("?Speed out of range")


def _scale(axis: Axis) -> float:
    """Pulses for a unit of position or speed: with StepNLoop units are encoder counts."""
    return axis.loop.ratio if axis.loop.on else 1.0
