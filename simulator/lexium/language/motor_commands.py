"""Instructions of the motor: moves, homing, locked rotor, make-up, configuration test.

Manual 5.1.20, 5.1.52 to 5.1.54, 5.1.80, 5.1.84, 5.1.87, 5.1.115, 5.1.117.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Number, Statement
from multidrop.simulator.lexium.language.arguments import Compile, bare, numbers, only
from multidrop.simulator.lexium.language.program_mode import Action
from multidrop.simulator.lexium.language.variable_access import VariableAccess
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import whole
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.timeline import Timeline


class MotorCommands:
    """The instructions of the motor of one drive. `begun` counts the motions that they have begun."""

    def __init__(self, memory: Memory, timeline: Timeline, variables: VariableAccess, motor: Motor) -> None:
        self._memory, self._timeline, self._variables, self._motor = memory, timeline, variables, motor
        self.begun = 0

    def commands(self) -> Mapping[str, Compile]:
        """By word."""
        moves = {"MA": self._move, "MR": self._move, "SL": self._slew, "SC": self._test}
        homings = dict.fromkeys(("HM", "HI", "HF"), self._home)
        return {
            **{word: partial(self._counting, word, compiler) for word, compiler in {**moves, **homings}.items()},
            "CF": bare(self._motor.hmt.clear),
            "MU": self._make_up,
        }

    def _counting(self, word: str, compiler: Compile, statement: Statement) -> Action:
        return self.counted(word, compiler(statement))

    def counted(self, word: str, action: Action) -> Action:
        """Count the motions that an action begins; one that only slows down does not count. No word: as MD says."""
        axis = self._motor.axis

        def move() -> None:
            before, kind = axis.profile, word or self._memory.texts["MD"]
            action()
            profile = axis.profile
            self.begun += profile is not before and (kind != "SL" or profile.end == inf)

        return move

    def _move(self, statement: Statement) -> Action:
        """MA and MR (manual 5.1.80, 5.1.84)."""
        kind, arguments = statement.word, statement.arguments
        if not 1 <= len(arguments) <= 3:
            raise Fault(E.ILLEGAL_DATA)
        value = self._variables.value(arguments[0])
        options = [self._variables.value(each or Number(0)) for each in arguments[1:]]

        def go() -> None:
            chosen = [whole(each()) for each in options]
            if any(each not in (0, 1) for each in chosen):
                raise Fault(E.OUT_OF_RANGE)
            announce, run_on = (*chosen, 0, 0)[:2]
            self._motor.axis.go(kind, whole(value()), self._timeline.now, bool(announce), bool(run_on))
            self._begun(kind)

        return go

    def _slew(self, statement: Statement) -> Action:
        """SL (manual 5.1.117)."""
        value = self._variables.value(only(statement))

        def go() -> None:
            self._motor.slew(whole(value()), self._timeline.now)
            self._begun("SL")

        return go

    def _begun(self, kind: str) -> None:
        self._memory.texts["MD"] = kind
        self._timeline.replan()

    def _home(self, statement: Statement) -> Action:
        """HM, HI, HF. Without a type it is error 81 as for an unknown one."""
        word = statement.word
        if len(statement.arguments) > 1:
            raise Fault(E.ILLEGAL_DATA)
        if not statement.arguments:
            raise Fault(E.NO_HOMING_TYPE)
        read = self._variables.value(statement.arguments[0])
        return lambda: self._motor.homing.start(word, whole(read()), self._timeline.now)

    def _make_up(self, statement: Statement) -> Action:
        """MU: the mode, and 1 to clear lead and lag."""
        read = numbers(self._variables, statement, 1, 2)

        def set_up() -> None:
            mode, clearing = (*read(), 0)[:2]
            if mode not in (0, 1, 2) or clearing not in (0, 1):
                raise Fault(E.OUT_OF_RANGE)
            self._motor.hmt.make_up(mode, clearing, self._timeline.now)

        return set_up

    def _test(self, statement: Statement) -> Action:
        """SC 1. Raises Fault (24) without its number."""
        if not statement.arguments:
            raise Fault(E.ILLEGAL_DATA)
        read = numbers(self._variables, statement, 1, 1)

        def start() -> None:
            if read() != [1]:
                raise Fault(E.OUT_OF_RANGE)
            self._motor.test.start(self._timeline.now)

        return start
