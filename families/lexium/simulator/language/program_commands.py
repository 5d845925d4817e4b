"""Instructions on programs: program memory, start, branches, calls, holds, errors, declarations, IV, bare numbers.

Manual 3.3, 5.1.13, 5.1.14, 5.1.22, 5.1.23, 5.1.35, 5.1.42, 5.1.50, 5.1.68, 5.1.70, 5.1.71, 5.1.89, 5.1.91, 5.1.98,
5.1.103, 5.1.112, 5.1.136.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Compare, NameTerm, Number, Statement, Text
from multidrop.families.lexium.manual.table import lookup
from multidrop.families.lexium.simulator.event_loop import EventLoop
from multidrop.families.lexium.simulator.language.variables import Compile, Variables, bare, is_place, only, pair
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault
from multidrop.families.lexium.simulator.state.expressions import whole
from multidrop.families.lexium.simulator.state.memory import within
from multidrop.families.lexium.simulator.state.program_memory import FIRST_ADDRESS, PROGRAM_BYTES, Action

ADDRESSES = range(FIRST_ADDRESS, FIRST_ADDRESS + PROGRAM_BYTES)
MOST_PASSES = 65535
OPTIONS = (Number(0), Number(1))
"""CP's parameter: keep the user's variables, or delete them too."""


class ProgramCommands:
    """The instructions on programs, for one drive."""

    def __init__(self, drive: EventLoop, variables: Variables) -> None:
        core, self._variables, self._motor, self._nvm = drive.core, variables, drive.motor, drive.power_unit.nvm
        self._memory, self._program, self._timeline = core.memory, core.program, core.timeline
        self._printer, self._interpreter, self._thread, self._mode = (
            core.printer,
            core.interpreter,
            core.thread,
            core.mode,
        )

    def commands(self) -> Mapping[str, Compile]:
        return {
            "E": bare(self._end),
            "RT": bare(self._thread.give_back),
            "PS": bare(self._motor.pause_program),
            "RS": bare(self._motor.resume_program),
            "BR": self._jump,
            "CL": self._jump,
            "H": self._hold,
            "IV": self._input_variable,
            "VA": self._declare,
            "EX": self._execute,
            "L": self._listing,
            "LB": self._label,
            "PG": self._program_mode,
            "CP": self._clear,
            "OE": self._on_error,
            "BP": self._break_point,
        }

    # A program that runs.

    def _end(self) -> None:
        """E: a program's own ends it at once, a typed one after the motion (manual 5.1.35)."""
        thread, t = self._thread, self._timeline.now
        if self._printer.immediate and thread.running and not thread.paused and self._motor.status.moving(t):
            thread.hold_for_motion(ending=True)
        else:
            thread.finish()

    def _jump(self, statement: Statement) -> Action:
        """BR, CL; a condition may also be a value, which holds while it is not 0 (manual 5.1.2, 5.1.14)."""
        target, condition = pair(statement)
        if target is None or not is_place(target) or isinstance(condition, Text):
            raise DriveFault(E.ILLEGAL_DATA)

        holds = None if condition is None else self._variables.compiler.condition(condition)
        printer, thread, linked = self._printer, self._thread, self._interpreter.linked
        calls, places, place = statement.word == "CL", linked.places, -1

        def go() -> None:
            nonlocal places, place
            if holds is not None and not holds():
                return
            if printer.immediate and not thread.running:
                raise DriveFault(E.NO_PROGRAM_RUNNING)
            if place < 0 or places is not linked.places:
                place = linked.place(target)
                places = linked.places
            if calls:
                thread.call(place)
            else:
                thread.pc = place

        return go

    def _hold(self, statement: Statement) -> Action:
        """H (manual 5.1.50). Where 0 is taken it is for motion."""
        if len(statement.arguments) > 1:
            raise DriveFault(E.ILLEGAL_DATA)
        read = self._variables.value(statement.arguments[0]) if statement.arguments else None
        row = lookup("H", self._memory.product)

        def wait() -> None:
            if self._printer.immediate and not self._thread.running:
                raise DriveFault(E.NO_PROGRAM_RUNNING)
            milliseconds = None if read is None else whole(read())
            if row is None or not (milliseconds is None or row.accepts(milliseconds)):
                raise DriveFault(E.OUT_OF_RANGE)
            if milliseconds:
                self._thread.hold(milliseconds / 1000)
            elif self._motor.status.settled_at() > self._timeline.now:
                self._thread.hold_for_motion()

        return wait

    def _input_variable(self, statement: Statement) -> Action:
        """IV: the next number that comes goes to a variable (manual 5.1.68)."""
        target, more = pair(statement)
        if not isinstance(target, NameTerm) or more is not None:
            raise DriveFault(E.ILLEGAL_DATA)
        word = target.word
        self._variables.writer(word)

        def wait() -> None:
            if self._memory.awaited:
                raise DriveFault(E.INPUT_PENDING)
            self._memory.await_input(word)

        return wait

    def number(self, statement: Statement) -> Action:
        """A bare number: what IV waits for, or with NE=1 another move of the last kind (manual 5.1.68, 5.1.89)."""
        figure, memory, motor = statement.arguments[0], self._memory, self._motor
        if not isinstance(figure, Number):
            raise DriveFault(E.UNKNOWN_COMMAND)
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
                raise DriveFault(E.UNKNOWN_COMMAND)

        return take

    def _declare(self, statement: Statement) -> Action:
        """VA: global from outside, local in a program (manual 3.2.2, 5.1.136)."""
        target, memory = only(statement), self._memory
        read: Callable[[], int | float] = lambda: 0  # noqa: E731
        if isinstance(target, Compare) and target.op == "=":
            read = self._variables.value(target.right)
            target = target.left
        if not isinstance(target, NameTerm):
            raise DriveFault(E.ILLEGAL_DATA)
        word = target.word
        self._mode.check_new(word)

        def make() -> None:
            scope = "G" if self._printer.immediate else "L"
            if word in self._program.labels or memory.scopes.get(word, "L") != "L":
                raise DriveFault(E.NAME_EXISTS)
            value = within(whole(read()), -0x80000000, 0x7FFFFFFF)
            if word not in memory.scopes:
                self._mode.check_room()
            memory.declare(word, scope, value)

        return make

    # Program memory.

    def _check_unlocked(self) -> None:
        """Raise DriveFault (44) while the program is locked (manual 5.1.75)."""
        if self._memory.values["LK"]:
            raise DriveFault(E.PROGRAM_LOCKED)

    def _check_idle(self, moving: E) -> None:
        """Raise DriveFault (41) while a program runs, and the given one while the motor moves."""
        if self._thread.running:
            raise DriveFault(E.PROGRAM_RUNNING)
        if self._motor.status.moving(self._timeline.now):
            raise DriveFault(moving)

    def _execute(self, statement: Statement) -> Action:
        """EX (manual 5.1.42)."""
        target, option = pair(statement)
        read = self._variables.value(option or Number(0))

        def start() -> None:
            mode = whole(read())
            if mode not in (0, 1, 2):
                raise DriveFault(E.OUT_OF_RANGE)
            if mode:  # which shows the program line by line, and so lists it
                self._check_unlocked()
            if isinstance(target, NameTerm) and target.word in self._memory.scopes:
                raise DriveFault(E.NOT_EXECUTABLE)
            self._interpreter.start(target, self._timeline.now, mode)

        return start

    def _listing(self, statement: Statement) -> Action:
        """L (manual 5.1.70)."""
        if len(statement.arguments) > 1:
            raise DriveFault(E.ILLEGAL_DATA)

        def show() -> None:
            self._check_unlocked()
            start = self._program.resolve(statement.arguments[0]) if statement.arguments else FIRST_ADDRESS
            for row in self._program.listing(start):
                self._printer.emit(row + CRLF)

        return show

    def _label(self, statement: Statement) -> Action:
        """LB: a mark, which takes no time. Its name is entered when the line is stored."""
        if len(statement.arguments) != 1 or not isinstance(statement.arguments[0], NameTerm) or statement.equals:
            raise DriveFault(E.ILLEGAL_DATA)
        return lambda: None

    def _program_mode(self, statement: Statement) -> Action:
        """PG with an address; without one it ends program mode, which is not on here (manual 5.1.98)."""
        if len(statement.arguments) > 1:
            raise DriveFault(E.ILLEGAL_DATA)

        def enter() -> None:
            if not statement.arguments:
                raise DriveFault(E.NOT_IN_PROGRAM_MODE)
            self._check_idle(E.MOVING_SAVE)
            self._check_unlocked()
            target = statement.arguments[0]
            if isinstance(target, NameTerm):
                self._mode.address = self._program.resolve(target)
            elif isinstance(target, Number) and isinstance(target.value, int) and target.value in ADDRESSES:
                self._mode.address = target.value
            else:
                raise DriveFault(E.NO_SUCH_ADDRESS)

        return enter

    def _on_error(self, statement: Statement) -> Action:
        """OE; 0 or nothing takes the handler away (manual 5.1.91)."""
        target = statement.arguments[0] if statement.arguments else Number(0)
        if len(statement.arguments) > 1 or not is_place(target):
            raise DriveFault(E.ILLEGAL_DATA)

        def declare() -> None:
            if target == Number(0):
                self._interpreter.handler = None
            else:
                self._program.check(target)
                self._interpreter.handler = target

        return declare

    def _break_point(self, statement: Statement) -> Action:
        """BP with a place and how often; BP=0 takes it away; BP alone breaks a running program (manual 5.1.13)."""
        breaks_here = self._memory.model.break_here

        def break_here() -> None:
            self._check_unlocked()
            self._interpreter.break_here()

        if not statement.arguments and breaks_here:
            return break_here
        target, count = pair(statement)
        if not is_place(target):
            raise DriveFault(E.ILLEGAL_DATA)
        place = None if target == Number(0) else target
        if count is None and place is not None and not breaks_here:
            raise DriveFault(E.NO_SEPARATOR)
        read = self._variables.value(count or Number(1))

        def set_up() -> None:
            passes = whole(read())
            if not 1 <= passes <= MOST_PASSES:
                raise DriveFault(E.OUT_OF_RANGE)
            if place is not None:
                self._check_unlocked()
            self._interpreter.break_at(place, passes)

        return set_up

    # CP (manual 5.1.23): CP; CP <0/1>; CP <label>; CP <0/1>,<label>; CP S also saves.

    def _clear(self, statement: Statement) -> Action:
        memory, arguments, takes_option = self._memory, statement.arguments, self._memory.model.clears_variables
        if len(arguments) > (2 if takes_option else 1):
            raise DriveFault(E.ILLEGAL_DATA)
        saves = arguments == (NameTerm("S"),) and takes_option
        all_of_it = len(arguments) == 1 and arguments[0] in OPTIONS and takes_option
        option = arguments[0] if all_of_it or len(arguments) == 2 else Number(0)
        if option not in OPTIONS:
            raise DriveFault(E.OUT_OF_RANGE)
        target = None if saves or all_of_it or not arguments else arguments[-1]

        def clear() -> None:
            if all_of_it:  # only CP without a parameter opens a lock (manual 5.1.75)
                self._check_unlocked()
            self._check_idle(E.MOVING_CLEAR)
            if target is None:
                memory.values["LK"] = 0
            self._check_unlocked()
            everything = target is None or target == Number(
                FIRST_ADDRESS
            )  # the beginning is there in an empty memory too
            self._program.clear(FIRST_ADDRESS if everything else self._program.resolve(target))
            self._interpreter.linked.forget()
            if target is None and memory.model.clear_ends_handler:
                self._interpreter.handler = None
            if option == Number(1):
                for name in list(memory.scopes):
                    memory.forget(name)
            else:
                memory.forget_local()
            if saves:
                self._nvm.save()

        return clear
