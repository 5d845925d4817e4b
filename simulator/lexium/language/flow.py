"""Instructions of a running program: branches, calls, holds, its end, declarations, IV and the bare number.

Manual 3.3, 5.1.14, 5.1.22, 5.1.35, 5.1.50, 5.1.68, 5.1.89, 5.1.103, 5.1.112, 5.1.136.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Compare, Name, Number, Statement, Text
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.simulator.lexium.language.arguments import Compile, bare, is_place, only, pair
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.language.pausing import Pausing
from multidrop.simulator.lexium.language.program_mode import Action, Names
from multidrop.simulator.lexium.language.variable_access import VariableAccess
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import compile_condition, whole
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.printer import Printer
from multidrop.simulator.lexium.state.program_memory import Program
from multidrop.simulator.lexium.state.ranges import within
from multidrop.simulator.lexium.state.timeline import Timeline


class Flow:
    """The instructions of a running program, for one drive."""

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        printer: Printer,
        variables: VariableAccess,
        names: Names,
        interpreter: Interpreter,
        pausing: Pausing,
        motor: Motor,
    ) -> None:
        self._memory, self._program, self._timeline, self._printer = memory, program, timeline, printer
        self._variables, self._names, self._motor = variables, names, motor
        self._interpreter, self._thread, self._pausing = interpreter, interpreter.thread, pausing

    def commands(self) -> Mapping[str, Compile]:
        """By word."""
        return {
            "E": bare(self._end),
            "RT": bare(self._thread.give_back),
            "PS": bare(self._pausing.pause),
            "RS": bare(self._pausing.resume),
            "BR": lambda statement: self._jump(statement, self._interpreter.branch),
            "CL": lambda statement: self._jump(statement, self._interpreter.call),
            "H": self._hold,
            "IV": self._input_variable,
            "VA": self._declare,
        }

    def _end(self) -> None:
        """E: a program's own ends it at once, a typed one after the motion (manual 5.1.35)."""
        thread, t = self._thread, self._timeline.now
        if self._printer.immediate and thread.running and not thread.paused and self._motor.status.moving(t):
            thread.finish_after_motion()
        else:
            thread.finish()

    def _check_running(self) -> None:
        """Raise Fault (40) for a typed line that needs a program to act on."""
        if self._printer.immediate and not self._thread.running:
            raise Fault(E.NO_PROGRAM_RUNNING)

    def _jump(self, statement: Statement, jump: Callable[[Argument], None]) -> Action:
        """BR, CL; a condition may also be a value, which holds while it is not 0 (manual 5.1.2, 5.1.14)."""
        target, condition = pair(statement)
        if target is None or not is_place(target) or isinstance(condition, Text):
            raise Fault(E.ILLEGAL_DATA)

        def go() -> None:
            self._check_running()
            jump(target)

        if condition is None:
            return go
        holds = compile_condition(condition, self._variables.reader, self._memory.model.floating)

        def go_if() -> None:
            if holds():
                go()

        return go_if

    def _hold(self, statement: Statement) -> Action:
        """H (manual 5.1.50). Where 0 is taken it is for motion."""
        if len(statement.arguments) > 1:
            raise Fault(E.ILLEGAL_DATA)
        read = self._variables.value(statement.arguments[0]) if statement.arguments else None
        row = lookup("H", self._memory.product)

        def wait() -> None:
            self._check_running()
            milliseconds = None if read is None else whole(read())
            if row is None or not (milliseconds is None or row.accepts(milliseconds)):
                raise Fault(E.OUT_OF_RANGE)
            if milliseconds:
                self._thread.hold(milliseconds / 1000)
            elif self._motor.status.settled_at() > self._timeline.now:
                self._thread.hold_for_motion()

        return wait

    def _input_variable(self, statement: Statement) -> Action:
        """IV: the next number that comes goes to a variable (manual 5.1.68)."""
        target, more = pair(statement)
        if not isinstance(target, Name) or more is not None:
            raise Fault(E.ILLEGAL_DATA)
        word = target.word
        self._variables.writer(word)

        def wait() -> None:
            if self._memory.awaited:
                raise Fault(E.INPUT_PENDING)
            self._memory.await_input(word)

        return wait

    def number(self, statement: Statement) -> Action:
        """A bare number: what IV waits for, or with NE=1 another move of the last kind (manual 5.1.68, 5.1.89)."""
        figure, memory, motor = statement.arguments[0], self._memory, self._motor
        if not isinstance(figure, Number):
            raise Fault(E.UNKNOWN_COMMAND)
        read = self._variables.value(figure)

        def take() -> None:
            if memory.awaited:
                name = memory.awaited
                memory.await_input("")
                self._variables.writer(name)(read())
            elif memory.values["NE"]:
                kind, value, t = memory.texts["MD"], whole(read()), self._timeline.now
                if kind == "SL":
                    motor.slew(value, t)
                else:
                    motor.axis.go(kind, value, t)
                self._timeline.replan()
            else:
                raise Fault(E.UNKNOWN_COMMAND)

        return take

    def _declare(self, statement: Statement) -> Action:
        """VA: global from outside, local in a program (manual 3.2.2, 5.1.136)."""
        target, memory = only(statement), self._memory
        read: Callable[[], int | float] = lambda: 0  # noqa: E731
        if isinstance(target, Compare) and target.op == "=":
            read = self._variables.value(target.right)
            target = target.left
        if not isinstance(target, Name):
            raise Fault(E.ILLEGAL_DATA)
        word = target.word
        self._names.check_new(word)

        def make() -> None:
            scope = "G" if self._printer.immediate else "L"
            if word in self._program.labels or memory.scopes.get(word, "L") != "L":
                raise Fault(E.NAME_EXISTS)
            value = within(whole(read()), -0x80000000, 0x7FFFFFFF)
            if word not in memory.scopes:
                self._names.check_room()
            memory.declare(word, scope, value)

        return make
