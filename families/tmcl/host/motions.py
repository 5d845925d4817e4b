"""How the motions of a module begin and end, motor by motor.

Theory of operation. A module says of no motion that it failed. A move has reached its target where parameter 1 equals
parameter 0; short of it, a limit switch that counts (10 with 12, 11 with 13) explains it. Without a target a switch
explains an end that nothing here caused. The flags of the driver (208) are compared with those from before. A reference
search that ended well has set actual and target position (8 is 1); one that was stopped has not. Parameter 207 is
cleared by reading, so it is read only for the reason of a motion that has failed. A tick timer (132) that went back
shows a restart, after which actual and target position are both 0. (TMCL firmware manuals, "Axis
parameters", commands 1 to 6, 13, 128 to 130; docs/rulings/tmcl.md.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from multidrop.base.errors import Refused
from multidrop.dialects.codec import Procedure
from multidrop.dialects.motions import (
    NOTHING,
    Effect,
    Ending,
    Evidence,
    Motions,
    Move,
    MoveKind,
    Outcome,
    Signs,
    restarted,
)
from multidrop.families.tmcl.host.codec import MOST_MOTORS, TmclState
from multidrop.families.tmcl.host.operations import TmclOperations, motors, read
from multidrop.families.tmcl.manual import commands
from multidrop.families.tmcl.manual.commands import AxisParameter, Command, Global, SearchAction, TmclCall

ABSOLUTE, RELATIVE, TOGETHER = 0, 1, 2
"""The types of MVP; the third one, COORD, moves motors to coordinates that are stored in the module."""
SEVERAL = 0xC0
"""The motor of MVP COORD: one, or with a bit of SEVERAL the sum of bits."""
PROGRAM = "program"
"""Whether its program runs, among the signs."""
TICKS = "ticks"
"""Its time since power-up, among the signs."""
STARTS = (129, 130)
"""The commands that run or step the module's program."""
DRIVER_FAULTS: Mapping[int, str] = {
    1 << 1: "the driver is shut down: overtemperature",
    1 << 3: "short circuit to ground in coil A",
    1 << 4: "short circuit to ground in coil B",
}
"""Bits of parameter 208 that show a failure; the others are warnings and states."""
REASONS: Mapping[int, tuple[Outcome, str]] = {
    1 << 0: (Outcome.STALL, "stalled"),
    1 << 1: (Outcome.STALL, "stopped because the encoder deviates"),
}
"""Bits of parameter 207."""


def _begins(move: Move) -> Effect:
    return Effect(begins=(move,))


def _axis(state: TmclState, motor: int) -> str:
    return str(motor) if state.motors > 1 else ""


def _ticks(state: TmclState) -> Procedure[int | None]:
    """Read the time since power-up, ms, of 32 bits; None for a module without it."""
    try:
        return (yield from read(state, TmclCall(Command.GGP, Global.TICK_TIMER, 0)))
    except Refused:
        return None


def _went_back(state: TmclState, evidence: Evidence) -> Procedure[bool]:
    """Whether the time since power-up is shorter than before a motion, which no command of ours explains."""
    if not evidence.alone or evidence.program or TICKS not in evidence.before:
        return False
    now = yield from _ticks(state)
    return now is not None and (now - evidence.before[TICKS]) % (1 << 32) >= 1 << 31


def _flags(state: TmclState, motor: int) -> Procedure[int]:
    try:
        return (yield from read(state, TmclCall(Command.GAP, AxisParameter.DRIVER_FLAGS, motor)))
    except Refused:  # not every module has them
        return 0


def _short(state: TmclState, ending: Ending, motor: int, way: int, evidence: Evidence) -> Procedure[Ending]:
    """Why a motor did not reach where it was sent. `way`: the sign of what is missing; 0: either."""
    if (met := (yield from _switch(state, motor, way))) is not None:
        reason = f"{ending.reason}: {met}" if ending.reason else met
        return replace(ending, outcome=Outcome.LIMIT, reason=reason)
    if not evidence.stopped:
        try:
            flags = yield from _value(state, AxisParameter.ERROR_FLAGS, motor)
        except Refused:
            flags = 0
        for bit, (outcome, reason) in REASONS.items():
            if flags & bit:
                return replace(ending, outcome=outcome, reason=reason)
    homing = evidence.move is not None and evidence.move.kind is MoveKind.HOMING
    if not (evidence.stopped or homing) and (yield from TmclOperations(state).busy()):
        return ending  # its program runs now, which may have ended the motion
    return replace(ending, outcome=Outcome.STOPPED)


def _switch(state: TmclState, motor: int, way: int) -> Procedure[str | None]:
    """The limit switch that stops a motor on this way, in words."""
    for sign, switch, off, name in (
        (1, AxisParameter.RIGHT_SWITCH, AxisParameter.RIGHT_LIMIT_OFF, "right"),
        (-1, AxisParameter.LEFT_SWITCH, AxisParameter.LEFT_LIMIT_OFF, "left"),
    ):
        if way * sign < 0:
            continue
        try:
            if (yield from _value(state, switch, motor)) and not (yield from _value(state, off, motor)):
                return f"{name} limit switch is on"
        except Refused:  # a module without it
            continue
    return None


def _value(state: TmclState, parameter: AxisParameter, motor: int) -> Procedure[int]:
    return (yield from read(state, TmclCall(Command.GAP, parameter, motor)))


class TmclMotions(Motions):
    """How the motions of a TMCL module begin and end."""

    state: TmclState

    def effect(self, text: str) -> Effect:
        """What a typed command does to the motions of its module."""
        state = self.state
        call = commands.parsed(text)
        if call is None:
            return NOTHING
        axis = _axis(state, call.motor)
        only = frozenset({axis})
        match call.command, call.type:
            case Command.ROR | Command.ROL, _:
                return _begins(Move(MoveKind.VELOCITY, axis, endless=True)) if call.value else Effect(ends=only)
            case Command.MST, _:
                return Effect(ends=only)
            case Command.MVP, kind if kind == ABSOLUTE:
                return _begins(Move(MoveKind.POSITION, axis, target=call.value))
            case Command.MVP, kind if kind == RELATIVE:
                return _begins(Move(MoveKind.POSITION, axis, relative=call.value))
            case Command.MVP, kind if kind == TOGETHER:
                named = [n for n in range(MOST_MOTORS) if call.motor >> n & 1] if call.motor & SEVERAL else [call.motor]
                # Where it ends is read from parameter 0, as after MVP REL.
                return Effect(tuple(Move(MoveKind.POSITION, _axis(state, each), relative=0) for each in named))
            case Command.SAP, AxisParameter.TARGET_POSITION:
                return _begins(Move(MoveKind.POSITION, axis, target=call.value))
            case Command.SAP, AxisParameter.TARGET_VELOCITY:
                return _begins(Move(MoveKind.VELOCITY, axis, endless=True)) if call.value else Effect(ends=only)
            case Command.SAP | Command.RSAP, AxisParameter.ACTUAL_POSITION | AxisParameter.MICROSTEPS:
                return Effect(unknown=only)
            case Command.RFS, SearchAction.START:
                return _begins(Move(MoveKind.HOMING, axis))
            case Command.RFS, SearchAction.STOP:
                return Effect(ends=only)
            case command, _ if command in STARTS:
                every = [_axis(state, motor) for motor in range(max(1, state.motors))]
                return Effect(begins=tuple(Move(MoveKind.PROGRAM, program) for program in every))
            case Command.FACTORY, _:
                return Effect(unknown=frozenset({"", *map(str, range(MOST_MOTORS))}))
        return NOTHING

    def signs(self) -> Procedure[Signs]:
        """Read the flags of each motor's driver, 0 for a module without them, and whether its program runs."""
        state = self.state
        signs = {PROGRAM: int((yield from TmclOperations(state).busy()))}
        if (ticks := (yield from _ticks(state))) is not None:
            signs[TICKS] = ticks
        for motor in range((yield from motors(state))):
            signs[f"208_{motor}"] = yield from _flags(state, motor)
        return signs

    def runs(self, signs: Signs) -> bool:
        """Whether its program runs."""
        return bool(signs.get(PROGRAM))

    def judge(self, axis: str, evidence: Evidence) -> Procedure[Ending | None]:
        """Judge the motion of a motor at rest."""
        state = self.state
        motor = int(axis or 0)
        position = yield from _value(state, AxisParameter.ACTUAL_POSITION, motor)
        ending = Ending(Outcome.REACHED, axis, position)
        if (yield from _went_back(state, evidence)):
            return restarted(ending, "its tick timer began again")
        new = (yield from _flags(state, motor)) & ~evidence.before.get(f"208_{motor}", -1)
        for bit, reason in DRIVER_FAULTS.items():
            if new & bit:
                return replace(ending, outcome=Outcome.ERROR, reason=reason)
        move = evidence.move
        if move is None or move.kind is MoveKind.PROGRAM or evidence.program:
            return ending
        if move.kind is MoveKind.HOMING:
            if (yield from _value(state, AxisParameter.POSITION_REACHED, motor)):
                return ending
            return (yield from _short(state, replace(ending, reason="home was not found"), motor, 0, evidence))
        target = move.target
        if target is None and move.relative is not None:  # parameter 127 says from where MVP REL counts
            target = yield from _value(state, AxisParameter.TARGET_POSITION, motor)
        if target is None:
            if move.endless and not evidence.stopped:
                return (yield from _short(state, ending, motor, 0, evidence))
            met = None if evidence.stopped else (yield from _switch(state, motor, 0))
            return ending if met is None else replace(ending, outcome=Outcome.LIMIT, reason=met)
        ending = replace(ending, target=target)
        return ending if position == target else (yield from _short(state, ending, motor, target - position, evidence))
