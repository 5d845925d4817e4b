"""How the motions of a controller begin and end, axis by axis.

Theory of operation. A limit that is hit during a motion is latched in MSTX and MSTY until CLR, unless IERR=1: then only
the switch shows it, so an axis that is short of its target with a switch on has met that limit. StepNLoop keeps its
errors in SLSX and SLSY (8 to 11) and goes on correcting after the pulses have ended (2). The target is compared with
the pulse counter, or within SLT with the encoder where StepNLoop is on. Nothing here is changed by reading.
(PMX-2ED-SA manual 7.4, 7.5, 7.8 to 7.12, 7.17, 7.19.3; docs/rulings/pmx.md.)
"""

from __future__ import annotations

import re
from dataclasses import replace

from multidrop.dialects.codec import Procedure
from multidrop.dialects.family import ADDRESSES
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
from multidrop.dialects.state import who
from multidrop.families.pmx.host.codec import PmxState
from multidrop.families.pmx.host.operations import PROGRAMS, number
from multidrop.families.pmx.manual import table

BOTH = frozenset(axis.lower() for axis in table.AXES)
VALUE = r"(-?\d{1,10})"
PLACE = re.compile(rf"(?:X{VALUE})?(?:Y{VALUE})?|I{VALUE}:{VALUE}", re.ASCII)
FLYING = re.compile(rf"T([XY]){VALUE}", re.ASCII)
JOG = re.compile(r"J([XY]?)[+-]", re.ASCII)
HOMING = re.compile(rf"({'|'.join(table.HOMINGS)})([XY])[+-]", re.ASCII)
STOP = re.compile(r"(?:STOP|ABORT)([XY]?)", re.ASCII)
STARTS = re.compile(r"SR[01]=[13]|GS\d+", re.ASCII)
REFERS = re.compile(rf"(?:{'|'.join(table.RECOUNTING)})([XY])=.*", re.ASCII)
CLEARS = re.compile(r"CLR[XY]", re.ASCII)
JOYSTICK = re.compile(r"JO|JF|JO=.*", re.ASCII)
JOYSTICK_OFF = ("JF", "JO=0")
OVERSHOOTS = "H"
"""The homing that slows down behind the place that it has found; the others end on 0 (7.10)."""
DISTANCES = 1
"""The value of MM with which a move counts from where the axis is."""
LOOP_OFF = 12
LOOP_STALLED, LOOP_LIMIT = 10, 11
LOOP_BUSY = frozenset(table.LOOP) - table.LOOP_ERRORS - {0, LOOP_OFF}
"""The values of SLS with which the axis is not at rest, though it may make no pulses in this moment."""
SWITCHES = {1 << 4: "plus", 1 << 5: "minus"}
LATCHED = {table.LIMIT_PLUS: "plus", table.LIMIT_MINUS: "minus"}
LOST = "HSPD"
"""A setting that a power-up sets to its factory value: STORE keeps none of speed and acceleration (7.20)."""
RUNNING, FAILED_PROGRAM = 1, 4
"""The values of SASTAT of a program that runs, and of one that an error has ended."""


def _effect(line: str) -> Effect:
    if (match := PLACE.fullmatch(line)) is not None:
        targets = zip("xyxy", match.groups(), strict=True)
        moves = {axis: int(value) for axis, value in targets if value is not None}
        group = frozenset(moves if len(moves) > 1 else ())  # an interpolated move: a stop of one axis stops both (7.7)
        return Effect(
            begins=tuple(Move(MoveKind.POSITION, axis, relative=by, group=group) for axis, by in moves.items())
        )
    if (match := FLYING.fullmatch(line)) is not None:
        return Effect(begins=(Move(MoveKind.POSITION, match[1].lower(), target=int(match[2])),))
    if (match := JOG.fullmatch(line)) is not None:
        return Effect(begins=_without_target(_axes(match[1]), endless=True))
    if (match := HOMING.fullmatch(line)) is not None:
        target = None if match[1] == OVERSHOOTS else 0
        return Effect(begins=(Move(MoveKind.HOMING, match[2].lower(), target),))
    if (match := STOP.fullmatch(line)) is not None:
        return Effect(ends=_axes(match[1]))
    if STARTS.fullmatch(line):
        return Effect(begins=tuple(Move(MoveKind.PROGRAM, axis) for axis in sorted(BOTH)))
    if (match := REFERS.fullmatch(line)) is not None:
        return Effect(unknown=_axes(match[1]))
    if CLEARS.fullmatch(line):
        return Effect(clears=True)
    if JOYSTICK.fullmatch(line):
        return Effect(unknown=BOTH) if line in JOYSTICK_OFF else Effect(begins=_without_target(BOTH))
    return NOTHING


def _without_target(axes: frozenset[str], endless: bool = False) -> tuple[Move, ...]:
    return tuple(Move(MoveKind.VELOCITY, axis, endless=endless) for axis in sorted(axes))


def _axes(named: str) -> frozenset[str]:
    return frozenset(named.lower()) or BOTH


def _program_runs(state: PmxState) -> Procedure[bool]:
    """Whether a program runs now, which may have ended the motion."""
    for program in PROGRAMS:
        if (yield from number(state, f"SASTAT{program}")) == RUNNING:
            return True
    return False


def _is_short(state: PmxState, ending: Ending, move: Move, loop: int) -> Procedure[bool]:
    """Whether an axis did not reach its target, which is one of the encoder where StepNLoop is on."""
    if move.target is None:
        return False
    if loop == LOOP_OFF:
        return ending.position != move.target
    name = ending.axis.upper()
    encoder = yield from number(state, f"E{name}")
    return abs(encoder - move.target) > (yield from number(state, f"SLT{name}"))


def _program_ended(state: PmxState, ending: Ending, before: Signs) -> Procedure[Ending]:
    for program in PROGRAMS:
        name = f"SASTAT{program}"
        if (yield from number(state, name)) == FAILED_PROGRAM and before.get(name) != FAILED_PROGRAM:
            return replace(ending, outcome=Outcome.ERROR, reason=f"program {program} was ended by an error")
    return ending


def _loop_failed(ending: Ending, loop: int, name: str) -> Ending:
    if loop == LOOP_STALLED:
        return replace(ending, outcome=Outcome.STALL, reason="stalled")
    outcome = Outcome.LIMIT if loop == LOOP_LIMIT else Outcome.ERROR
    words = table.loop_words(loop).removeprefix("error: ")
    return replace(ending, outcome=outcome, reason=f"StepNLoop {words}; CLR{name} clears the error")


class PmxMotions(Motions):
    """How the motions of a PMX begin and end."""

    state: PmxState

    def effect(self, text: str) -> Effect:
        """What a typed command does to the motions. Raises Inexpressible for what no frame can carry."""
        state = self.state
        effect = _effect(text.strip())
        if effect.begins and state.address not in ADDRESSES:
            state.codec.encode(state.codec.request(state.address, text))  # before anything is asked for it
        return effect

    def signs(self) -> Procedure[Signs]:
        """Read what shows a failure, and where distances count from: MM=0 makes every target a position."""
        state = self.state
        signs: dict[str, int] = {}
        for word in ("MM", "EO", LOST):
            signs[word] = yield from number(state, word)
        for axis in table.AXES:
            words = ("MST", "SLS", "P") if signs["MM"] == DISTANCES else ("MST", "SLS")
            for word in words:
                signs[f"{word}{axis}"] = yield from number(state, f"{word}{axis}")
        for program in PROGRAMS:
            signs[f"SASTAT{program}"] = yield from number(state, f"SASTAT{program}")
        return signs

    def old(self, signs: Signs, own: bool) -> Procedure[Signs]:
        """Report latched errors to who waits for another's motion; before an own one the move is refused."""
        for axis in table.AXES if not own else ():
            words = table.trouble_words(signs[f"MST{axis}"] & table.LIMIT_ERROR)
            if signs[f"SLS{axis}"] in table.LOOP_ERRORS:
                words = ", ".join(filter(None, (words, f"StepNLoop {table.loop_words(signs[f'SLS{axis}'])}")))
            if words:
                self.state.note(f"{who(self.state)}: {axis} has an error from before: {words}; CLR{axis} clears it")
        return signs
        yield  # nothing is asked

    def place(self, signs: Signs, axis: str) -> int | None:
        """Where the distance of a move counts from: from 0 with ABS, from the axis at rest with INC; None: not read."""
        if (mode := signs.get("MM")) != DISTANCES:
            return None if mode is None else 0
        return None if signs[f"MST{axis.upper()}"] & table.MOVING else signs[f"P{axis.upper()}"]

    def runs(self, signs: Signs) -> bool:
        """Whether a program runs."""
        return any(signs.get(f"SASTAT{program}") == RUNNING for program in PROGRAMS)

    def judge(self, axis: str, evidence: Evidence) -> Procedure[Ending | None]:
        """Judge the motion of an axis at rest."""
        state = self.state
        name, before = axis.upper(), evidence.before
        status = yield from number(state, f"MST{name}")
        loop = yield from number(state, f"SLS{name}")
        if loop in LOOP_BUSY or status & table.MOVING:
            return None
        ending = Ending(Outcome.REACHED, axis, (yield from number(state, f"P{name}")))
        if evidence.alone and ending.position == 0 and not evidence.program and LOST in before:
            speed = yield from number(state, LOST)
            if speed != before[LOST]:
                return restarted(ending, f"{LOST} {before[LOST]} before, {speed} now")
        new = status & ~before.get(f"MST{name}", -1)
        for bit, way in LATCHED.items():
            if new & bit:
                return replace(ending, outcome=Outcome.LIMIT, reason=f"{way} limit; CLR{name} clears the error")
        if loop in table.LOOP_ERRORS and before.get(f"SLS{name}", loop) != loop:
            return _loop_failed(ending, loop, name)
        output = 1 << table.AXES.index(name)
        drivers = yield from number(state, "EO")
        if (before.get("EO", drivers) ^ drivers) & output:
            return replace(ending, outcome=Outcome.POWER, reason="its motor driver was switched on or off (EO)")
        if evidence.move is None:
            return ending
        if evidence.move.kind is MoveKind.PROGRAM:
            return (yield from _program_ended(state, ending, before))
        move = evidence.move
        short = not evidence.program and (move.endless or (yield from _is_short(state, ending, move, loop)))
        met = next((way for bit, way in SWITCHES.items() if status & bit), "")
        no_target = move.target is None and move.kind is not MoveKind.POSITION
        unexplained = (short or no_target) and not (evidence.stopped or evidence.program)
        if met and unexplained and (yield from number(state, "IERR")):  # else it would be latched
            return replace(ending, outcome=Outcome.LIMIT, reason=f"{met} limit switch is on (IERR=1 keeps no error)")
        if short and not evidence.stopped and (yield from _program_runs(state)):
            return ending
        return replace(ending, outcome=Outcome.STOPPED) if short else ending
