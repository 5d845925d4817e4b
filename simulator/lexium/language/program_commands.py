"""Instructions that act on program memory, and start a program: EX, L, LB, PG, CP, OE, BP.

Manual 3.3, 5.1.13, 5.1.23, 5.1.42, 5.1.70, 5.1.71, 5.1.91, 5.1.98.
"""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Name, Number, Statement
from multidrop.simulator.lexium.language.arguments import Compile, is_place, pair
from multidrop.simulator.lexium.language.interpreter import Interpreter
from multidrop.simulator.lexium.language.program_mode import Action, ProgramMode, Storage
from multidrop.simulator.lexium.language.variable_access import VariableAccess
from multidrop.simulator.lexium.motion.motion_status import MotionStatus
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import whole
from multidrop.simulator.lexium.state.memory import Memory
from multidrop.simulator.lexium.state.printer import CRLF, Printer
from multidrop.simulator.lexium.state.program_memory import FIRST, SPACE, Program
from multidrop.simulator.lexium.state.timeline import Timeline

MOST_PASSES = 65535
OPTIONS = (Number(0), Number(1))
"""CP's parameter: keep the user's variables, or delete them too."""


class ProgramCommands:
    """The instructions on program memory, for one drive."""

    def __init__(
        self,
        memory: Memory,
        program: Program,
        timeline: Timeline,
        printer: Printer,
        variables: VariableAccess,
        interpreter: Interpreter,
        mode: ProgramMode,
        status: MotionStatus,
        storage: Storage,
    ) -> None:
        self._memory, self._program, self._timeline, self._printer = memory, program, timeline, printer
        self._variables, self._interpreter, self._mode = variables, interpreter, mode
        self._status, self._storage = status, storage

    def commands(self) -> Mapping[str, Compile]:
        """By word."""
        return {
            "EX": self._execute,
            "L": self._listing,
            "LB": self._label,
            "PG": self._program_mode,
            "CP": self._clear,
            "OE": self._on_error,
            "BP": self._break_point,
        }

    def _check_unlocked(self) -> None:
        """Raise Fault (44) while the program is locked (manual 5.1.75)."""
        if self._memory.values["LK"]:
            raise Fault(E.PROGRAM_LOCKED)

    def _check_idle(self, moving: E) -> None:
        """Raise Fault (41) while a program runs, and the given one while the motor moves."""
        if self._interpreter.running:
            raise Fault(E.PROGRAM_RUNNING)
        if self._status.moving(self._timeline.now):
            raise Fault(moving)

    def _execute(self, statement: Statement) -> Action:
        """EX (manual 5.1.42)."""
        target, option = pair(statement)
        read = self._variables.value(option or Number(0))

        def start() -> None:
            mode = whole(read())
            if mode not in (0, 1, 2):
                raise Fault(E.OUT_OF_RANGE)
            if mode:  # which shows the program line by line, and so lists it
                self._check_unlocked()
            if isinstance(target, Name) and target.word in self._memory.scopes:
                raise Fault(E.NOT_EXECUTABLE)
            self._interpreter.start(target, self._timeline.now, mode)

        return start

    def _listing(self, statement: Statement) -> Action:
        """L (manual 5.1.70)."""
        if len(statement.arguments) > 1:
            raise Fault(E.ILLEGAL_DATA)

        def show() -> None:
            self._check_unlocked()
            start = self._program.resolve(statement.arguments[0]) if statement.arguments else FIRST
            for row in self._program.listing(start):
                self._printer.emit(row + CRLF)

        return show

    def _label(self, statement: Statement) -> Action:
        """LB: a mark, which takes no time. Its name is entered when the line is stored."""
        if len(statement.arguments) != 1 or not isinstance(statement.arguments[0], Name) or statement.equals:
            raise Fault(E.ILLEGAL_DATA)
        return lambda: None

    def _program_mode(self, statement: Statement) -> Action:
        """PG with an address; without one it ends program mode, which is not on here (manual 5.1.98)."""
        if len(statement.arguments) > 1:
            raise Fault(E.ILLEGAL_DATA)

        def enter() -> None:
            if not statement.arguments:
                raise Fault(E.NOT_IN_PROGRAM_MODE)
            self._check_idle(E.MOVING_SAVE)
            self._check_unlocked()
            self._mode.address = self._address(statement.arguments[0])

        return enter

    def _address(self, target: Argument | None) -> int:
        """Where program mode begins. Raises Fault (30, 34, 42)."""
        if isinstance(target, Name):
            return self._program.resolve(target)
        if not isinstance(target, Number) or not isinstance(target.value, int):
            raise Fault(E.NO_SUCH_ADDRESS)
        if not FIRST <= target.value < FIRST + SPACE:
            raise Fault(E.NO_SUCH_ADDRESS)
        return target.value

    def _on_error(self, statement: Statement) -> Action:
        """OE; 0 or nothing takes the handler away (manual 5.1.91)."""
        target = statement.arguments[0] if statement.arguments else Number(0)
        if len(statement.arguments) > 1 or not is_place(target):
            raise Fault(E.ILLEGAL_DATA)

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
        if not statement.arguments and breaks_here:
            return self._break_here
        target, count = pair(statement)
        if not is_place(target):
            raise Fault(E.ILLEGAL_DATA)
        place = None if target == Number(0) else target
        if count is None and place is not None and not breaks_here:
            raise Fault(E.NO_SEPARATOR)
        read = self._variables.value(count or Number(1))

        def set_up() -> None:
            passes = whole(read())
            if not 1 <= passes <= MOST_PASSES:
                raise Fault(E.OUT_OF_RANGE)
            if place is not None:
                self._check_unlocked()
            self._interpreter.break_at(place, passes)

        return set_up

    def _break_here(self) -> None:
        self._check_unlocked()
        self._interpreter.break_here()

    # CP (manual 5.1.23): CP; CP <0/1>; CP <label>; CP <0/1>,<label>; CP S also saves.

    def _clear(self, statement: Statement) -> Action:
        arguments, takes_option = statement.arguments, self._memory.model.clears_variables
        if len(arguments) > (2 if takes_option else 1):
            raise Fault(E.ILLEGAL_DATA)
        if arguments == (Name("S"),) and takes_option:
            return self._clear_and_save
        if len(arguments) == 1 and arguments[0] in OPTIONS and takes_option:
            return lambda: self._clear_locked(variables=arguments[0] == Number(1))
        option = arguments[0] if len(arguments) == 2 else Number(0)
        if option not in OPTIONS:
            raise Fault(E.OUT_OF_RANGE)
        target = arguments[-1] if arguments else None
        return lambda: self._clear_from(target, variables=option == Number(1))

    def _clear_and_save(self) -> None:
        self._clear_from(None, variables=False)
        self._storage.save()

    def _clear_locked(self, variables: bool) -> None:
        """CP 0 and CP 1: all of program memory; only CP without a parameter opens a lock (manual 5.1.75)."""
        self._check_unlocked()
        self._clear_from(None, variables)

    def _clear_from(self, target: Argument | None, variables: bool) -> None:
        memory, interpreter = self._memory, self._interpreter
        self._check_idle(E.MOVING_CLEAR)
        if target is None:
            memory.values["LK"] = 0
        self._check_unlocked()
        everything = target is None or target == Number(FIRST)  # the beginning of memory is there in an empty one too
        self._program.clear(FIRST if everything else self._program.resolve(target))
        self._mode.changed()
        if target is None and memory.model.clear_ends_handler:
            interpreter.handler = None
        if variables:
            for name in list(memory.scopes):
                memory.forget(name)
        else:
            memory.forget_local()
