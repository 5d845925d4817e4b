"""How the motions of an MCode drive begin and end; the same over Modbus, by registers.

Theory of operation. EF and ST change nothing when they are read; ER is cleared, so it is read for the reason of an own
motion only. ST stays set until ST=0, and the drive moves on with it: only a change from 0 to 1 is a sign. The target is
compared in the units of P, within DB where the encoder counts (EE=1), else within one step. Only words that the product
has are asked: an error could start a resident OE subroutine. (MCode reference 5.1.2, 5.1.28, 5.1.37, 5.1.40, 5.1.83,
5.1.91, 5.1.120; docs/rulings/motion.md.)
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

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
from multidrop.dialects.state import DriveState, who
from multidrop.dialects.values import Value
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.errors import described, earlier_error
from multidrop.families.lexium.manual import errors, groups, points
from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Number, Statement, parsed
from multidrop.families.lexium.manual.groups import RECOUNTING, RESTORING, those
from multidrop.families.lexium.manual.mnemonic import Mnemonic, MotionEffect, WordQuantity
from multidrop.families.lexium.manual.points import CAUSE
from multidrop.families.lexium.manual.table import lookup

AXIS = ""
ONLY = frozenset({AXIS})
LOST = "VM"
"""A setting that a power-up sets to what was saved last, often another value."""
SIGNS = ("EF", "MV", "BY", "ST", "P", "AF", "TE", LOST)
"""What is read before a motion."""
END = ("EF", "BY", "MP", "ST", "EE", "P", "DB", "AF", "AS")
"""What is read at its end."""
FLAGS = those(lambda row: row.kind == "flag")
"""Those of one digit: no separator follows them, as a line has at most 64 characters."""
FREE = sorted(groups.FREE, reverse=True)
"""What lets a drive move without a line of ours; TE first, which may have several digits."""
TORQUE = 3
"""The value of AS without targets."""
CLOSED_LOOP = (1, 2)
"""The values of AS with which the rotor is held near the steps, and steps that it lacks are made up."""
BOUNDS = 2
"""How far the rotor may be from the steps in these modes, full steps; the widest setting of CB is 1.7 (5.1.18)."""
TURNS_ROUND = (1, 4)
"""The values of LM with which a limit turns a homing round."""
FAULTS: Mapping[int, Outcome] = {
    8: Outcome.STALL,
    32: Outcome.ERROR,
    256: Outcome.ERROR,
    4: Outcome.ERROR,
    2: Outcome.ERROR,
    1: Outcome.ERROR,
}
"""Bits of AF that show a failure, most important first; the others are states (5.1.2)."""
FAULT_WORDS = {
    8: "locked rotor",
    32: "hMT hardware fault",
    256: "hMT is not initialized",
    4: "the maximum of lead or lag was reached",
    2: "the lag limit was reached",
    1: "the lead limit was reached",
}
LIMITS = frozenset({E.PLUS_LIMIT, E.MINUS_LIMIT})
OUTCOMES: Mapping[int, Outcome] = {
    **dict.fromkeys(LIMITS, Outcome.LIMIT),
    E.STALL: Outcome.STALL,
    E.LOCKED_ROTOR: Outcome.STALL,
    E.MOTOR_VOLTAGE: Outcome.POWER,
    E.NO_MOTOR_VOLTAGE: Outcome.POWER,
}
STALLED = "stalled"
POINTS = ("S1", "S2", "S3", "S4")
"""The set-ups of the inputs of an MDrivePlus."""
GO = 4
"""The type of an input that starts the program at address 1 (5.1.64)."""
RUNS = ("BY", "TE")
"""Not 0: a program runs, or a trip may start one; a trip disarms itself (5.1.125)."""


def effect(state: DriveState, text: str) -> Effect:
    """What a typed line of MCode does to the motion of its drive."""
    statement = parsed(text)
    if statement is None:
        return NOTHING
    row, value = lookup(statement.word, state.product), _whole(statement)
    if row is not None and (made := _of_instruction(row, statement, value)) is not None:
        return made
    if row is not None and value is not None and value == row.turns_at:
        return Effect(begins=(Move(MoveKind.VELOCITY, AXIS),))
    written = lookup(classify.written_word(text), state.product)
    if written is not None and written.sign:
        return Effect(clears=True)
    if written is not None and written.name in groups.FREE:
        return Effect(frees=True)
    if statement.word in RESTORING or (written is not None and written.name in RECOUNTING):
        return Effect(unknown=ONLY)
    return NOTHING


def _of_instruction(row: Mnemonic, statement: Statement, value: int | None) -> Effect | None:
    """What an instruction does to motion; None for other words."""
    match row.motion:
        case MotionEffect.MOVE:
            absolute, relative = (value, None) if row.quantity is WordQuantity.PLACE else (None, value)
            return Effect(begins=(Move(MoveKind.POSITION, AXIS, absolute, relative),))
        case MotionEffect.SLEW if value == 0:
            return Effect(ends=ONLY)
        case MotionEffect.SLEW:  # a velocity that is not a number may be 0
            return Effect(begins=(Move(MoveKind.VELOCITY, AXIS, endless=value is not None),))
        case MotionEffect.HOMING if statement.arguments:
            return Effect(begins=(Move(MoveKind.HOMING, AXIS),))
        case MotionEffect.PROGRAM:
            return Effect(begins=(Move(MoveKind.PROGRAM, AXIS),))
        case MotionEffect.PAUSE:
            return Effect(ends=ONLY)
        case MotionEffect.END:  # a motion that is under way goes on (5.1.35)
            return Effect(halts=True)
        case MotionEffect.RELEASE:
            return Effect(clears=True)
        case MotionEffect.RESUME:  # what PS has paused goes on, perhaps to another target
            return Effect(unknown=ONLY, resumes=True)
    return None


def _whole(statement: Statement) -> int | None:
    first = statement.arguments[0] if statement.arguments else None
    return int(first.value) if isinstance(first, Number) and first.value == int(first.value) else None


class LexiumMotions(Motions, ABC):
    """How the motions of a Lexium drive begin and end. A protocol reads the words of MCode in its own way."""

    @abstractmethod
    def read(self, words: Sequence[str]) -> Procedure[Mapping[str, int]]:
        """Read those of these words that the product has; nothing is cleared."""

    @abstractmethod
    def error(self) -> Procedure[int | None]:
        """Read ER, which clears it; None: it could not be read."""

    def handles_errors(self) -> Procedure[bool]:
        """Whether the program in the drive has an OE routine."""
        return False
        yield  # a conversation

    @abstractmethod
    def program_input(self) -> Procedure[bool]:
        """Whether an input is set up to start a program (type 4, 5.1.64)."""

    def carried(self, text: str) -> None:
        """Raise Inexpressible for a line that no frame can carry, before anything is asked for it."""

    def effect(self, text: str) -> Effect:
        own = effect(self.state, text)
        if own.begins:
            self.carried(text)
        return own

    def signs(self) -> Procedure[Signs]:
        signs = yield from self.read(SIGNS)
        if "EF" in signs:
            self.state.error_flag_read(bool(signs["EF"]))
        return signs

    def old(self, signs: Signs, own: bool) -> Procedure[Signs]:
        state = self.state
        if not signs.get("EF"):
            return signs
        if not own:
            state.note(f"{who(state)}: its error flag was set before (EF=1); PR ER shows and clears the error")
            return signs
        code = yield from self.error()
        if code:
            state.note(f"{who(state)}: {earlier_error(code, state)}")
        return signs if code is None else {**signs, "EF": 0}

    def place(self, signs: Signs, axis: str) -> int | None:
        return None if signs.get("MV") or signs.get("BY") else signs.get("P")

    def runs(self, signs: Signs) -> bool:
        return any(signs.get(sign) for sign in RUNS)

    def fails(self, code: int) -> bool:
        return code in errors.BY_ITSELF

    def judge(self, axis: str, evidence: Evidence) -> Procedure[Ending | None]:
        state = self.state
        signs = yield from self.read(END)
        before, move, position = evidence.before, evidence.move, signs.get("P")
        ending = Ending(Outcome.REACHED, AXIS, position)
        if position == 0 and evidence.alone and not evidence.program and LOST in before:
            speed = (yield from self.read((LOST,))).get(LOST, before[LOST])
            if speed != before[LOST]:
                return restarted(ending, f"{LOST} {before[LOST]} before, {speed} now")
        if move is None:
            seen = _seen(signs, before, ending)
            return None if seen is ending and (yield from self._makes_up(signs)) else seen
        homing, program = move.kind is MoveKind.HOMING, move.kind is MoveKind.PROGRAM
        codes = [code for code in evidence.errors if code in errors.BY_ITSELF]
        if signs.get("EF") and not before.get("EF"):
            state.error_flag_read(True)
            count = state.errors.count
            if program and (yield from self.handles_errors()):
                return ending
            reported = state.errors.since(count)  # the list has reported it, and cleared it
            code = reported[-1] if reported else (yield from self.error())
            if code is None:
                return replace(
                    ending, outcome=Outcome.UNKNOWN, reason="an error is set, and its number could not be read"
                )
            codes += [code] if code and (code in errors.BY_ITSELF or not evidence.stopped) else []
        if homing and codes and set(codes) <= LIMITS:
            turns = yield from self.read(("LM",))
            if turns.get("LM") in TURNS_ROUND:
                state.note(f"{who(state)}: the homing met a limit and turned round: {described(codes[-1], state)}")
                codes = []
        if codes:
            return _failed(ending, codes[-1], state)
        if (fault := _new_fault(signs, before)) is not None:
            return replace(ending, outcome=fault[0], reason=fault[1])
        if (yield from self._makes_up(signs)):
            return None
        if evidence.program or signs.get("BY") or signs.get("AS") == TORQUE:
            return ending
        if move.endless:
            return (yield from self._unexplained(ending, evidence))
        target = move.target
        if target is None or position is None or abs(position - target) <= _tolerance(signs):
            return ending
        if signs.get("EE") and signs.get("MP"):
            return None  # position maintenance may still correct it
        return (yield from self._unexplained(ending, evidence))

    def _unexplained(self, ending: Ending, evidence: Evidence) -> Procedure[Ending]:
        """Judge a motion that ended short of its target, or that only a command ends: did the drive end it itself?"""
        free = yield from self.read((*FREE, "DE"))
        if not free.get("DE", 1):
            return replace(ending, outcome=Outcome.POWER, reason="its output bridges are off (DE=0)")
        if any(free.get(flag) for flag in FREE):
            return ending
        if not evidence.stopped and (yield from self.program_input()):
            return ending
        return replace(ending, outcome=Outcome.STOPPED)

    def _makes_up(self, found: Mapping[str, int]) -> Procedure[bool]:
        """Whether the rotor is not where the steps are yet: with hMT P counts steps, and makes up what is missing."""
        if found.get("AS") not in CLOSED_LOOP:
            return False
        lag = yield from self.read(("LL", "MS"))
        return abs(lag.get("LL", 0)) > BOUNDS * lag.get("MS", 1)


def _seen(found: Mapping[str, int], before: Signs, ending: Ending) -> Ending:
    """Judge a motion that somebody else began: only by signs that are new since the wait began."""
    if (fault := _new_fault(found, before)) is not None:
        return replace(ending, outcome=fault[0], reason=fault[1])
    if found.get("EF") and not before.get("EF", 1):
        return replace(ending, outcome=Outcome.ERROR, reason="its error flag was set; PR ER shows and clears the error")
    return ending


def _failed(ending: Ending, code: int, state: DriveState) -> Ending:
    outcome = OUTCOMES.get(code, Outcome.ERROR)
    reason = STALLED if code == E.STALL else f"error {code}: {errors.text(code, state.product)}"
    return replace(ending, outcome=outcome, reason=reason)


def _new_fault(found: Mapping[str, int], before: Signs) -> tuple[Outcome, str] | None:
    if found.get("ST") and before.get("ST") == 0:
        return Outcome.STALL, STALLED
    new = found.get("AF", 0) & ~before.get("AF", -1)
    return next(((outcome, FAULT_WORDS[bit]) for bit, outcome in FAULTS.items() if new & bit), None)


def cause(product: str, found: Mapping[str, Value], before: Mapping[str, Value]) -> str:
    """What caused the error that is set, as far as two readings of the conditions show it; empty: they do not.

    Only a sign that came with the error is its cause: ST stays set from an earlier stall. It stays the cause.
    """
    if not found.get("EF") or "EF" not in before:
        return ""
    fault = _new_fault(_whole_numbers(found), _whole_numbers(before))
    if fault is not None:
        return fault[1]
    if before["EF"]:
        return str(before.get(CAUSE, ""))
    met = [point for point in points.met(product, {**before, **found}) if point not in points.met(product, before)]
    return f"{met[0]} is active" if met else ""


def _whole_numbers(facts: Mapping[str, Value]) -> dict[str, int]:
    return {name: value for name, value in facts.items() if isinstance(value, int)}


def _tolerance(found: Mapping[str, int]) -> int:
    """How far from its target a move may end: DB where the encoder counts (not with hMT), else one step."""
    counts = found.get("EE") and not found.get("AS")
    return max(found.get("DB", 0), 1) if counts else 1


def starts_program(lines: Sequence[str]) -> bool:
    """Whether a line that `PR IS` prints is of an input that starts a program: `IS = 1, 4, 0`."""
    return any(re.fullmatch(rf" *IS *= *\d+ *, *{GO} *,.*", line) for line in lines)
