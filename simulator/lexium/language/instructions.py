"""The table of MCode instructions: each compiles its statement into a closure that carries it out.

`compile` is the one way from a statement to an action, for typed lines and program lines alike. What is wrong with the
form of a line is raised as Fault when it is compiled; what is wrong with a value, when it runs.
The instructions on programs are in `program_commands`, those of the motor and with several settings in
`motor_commands`, PR in `prints`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Name, Statement
from multidrop.dialects.mcode.manual.table import Mnemonic
from multidrop.simulator.lexium.event_loop import EventLoop
from multidrop.simulator.lexium.language.motor_commands import MotorCommands, Setups
from multidrop.simulator.lexium.language.prints import REGISTERS, Prints
from multidrop.simulator.lexium.language.program_commands import ProgramCommands
from multidrop.simulator.lexium.language.variables import Compile, Variables, bare, is_place, only
from multidrop.simulator.lexium.motion.motor import Motor
from multidrop.simulator.lexium.motion.outputs import Outputs
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import Read, whole, wrap
from multidrop.simulator.lexium.state.interpreter import Action, Core


class Instructions:
    """The instructions of one drive. `commands` gives the compiler of a word."""

    def __init__(self, serial: str, core: Core, motor: Motor, outputs: Outputs, loop: EventLoop) -> None:
        power, nvm = loop.power, loop.power.nvm
        self._memory, self._program = core.memory, core.program
        self._variables = variables = Variables(core, motor, outputs, nvm)
        self._programs = programs = ProgramCommands(core, variables, motor, nvm)
        self.motions = MotorCommands(core, variables, motor)
        setups = Setups(core, variables, motor, outputs, loop)
        prints = Prints(serial, core, variables, motor, outputs)
        self.commands: Mapping[str, Compile] = {
            "IC": partial(self._step, 1),
            "DC": partial(self._step, -1),
            "PR": prints.compile,
            "S": bare(nvm.save),
            "IP": bare(nvm.initialise),
            "FD": bare(power.factory_defaults),
            "UG": _refused,
            **programs.commands(),
            **self.motions.commands(),
            **setups.commands(),
        }

    def reader(self, word: str) -> Read | None:
        """Return a closure that reads a variable; None for a name that is no variable, now or in the program."""
        if self._memory.row(word) is None and not self._variables.declared(word):
            return None
        try:
            return self._variables.reader(word)
        except Fault:
            return None

    def compile(self, statement: Statement, stored: bool) -> Action:
        """Return a closure that carries a line out; `stored`: it is a program's. Raises Fault for a wrong line."""
        word = statement.word
        if not word:
            return self.motions.counted(word, self._programs.number(statement))
        row = self._memory.row(word)
        if row is None:
            if not self._variables.declared(word) and word not in self._program.labels:
                raise Fault(E.UNKNOWN_VARIABLE if statement.equals else E.UNKNOWN_COMMAND)
            return self._assignment(statement)
        if row.kind in ("math", "reserved"):
            illegal = row.kind == "reserved" and statement.arguments
            raise Fault(E.ILLEGAL_DATA if illegal else E.UNKNOWN_COMMAND)
        if not (row.program if stored else row.immediate):
            raise Fault(E.ILLEGAL_DATA if stored else E.NOT_IN_PROGRAM_MODE)
        if stored and word == "PR" and Name("AL") in statement.arguments:  # for immediate use only (manual 5.1.4)
            raise Fault(E.ILLEGAL_DATA)
        if word in self.commands:
            return self.commands[word](statement)
        if row.kind == "instruction":
            return self._without_effect(row, statement)
        return self._assignment(statement)

    def compile_stored(self, statement: Statement) -> Action:
        """The action of a stored line; one that cannot be carried out any more is an error when it is reached."""
        try:
            return self.compile(statement, stored=True)
        except Fault as fault:
            code, fatal = fault.code, fault.fatal

            def refuse() -> None:
                raise Fault(code, fatal)

            return refuse

    def _assignment(self, statement: Statement) -> Action:
        """`VM=5` or `VM 5`, and what is computed."""
        if not statement.arguments:
            raise Fault(E.ILLEGAL_DATA if statement.equals else E.NOT_EXECUTABLE)
        write = self._variables.writer(statement.word)
        read = self._variables.value(only(statement), statement.word in REGISTERS)
        return lambda: write(read())

    def _without_effect(self, row: Mnemonic, statement: Statement) -> Action:
        """An instruction without effect in the simulation; it checks its value."""
        reads = [self._variables.value(each) for each in statement.arguments if not is_place(each)]

        def check() -> None:
            if reads and not row.accepts(reads[0]()):
                raise Fault(E.OUT_OF_RANGE)

        return check

    def _step(self, by: int, statement: Statement) -> Action:
        """IC and DC: add to a variable. Raises Fault (25, 26) for one that may not be stepped."""
        target, variables = only(statement), self._variables
        if not isinstance(target, Name):
            raise Fault(E.ILLEGAL_DATA)
        word = target.word
        row = self._memory.row(word)
        if row is not None and row.step:
            raise Fault(E.ILLEGAL_DATA if row.kind == "reserved" else row.step)
        if row is None and not variables.declared(word):
            raise Fault(E.READ_ONLY)
        read, write = variables.reader(word), variables.writer(word)
        if row is not None and isinstance(row.default, float):
            return lambda: write(read() + by)
        scopes = self._memory.scopes

        def add() -> None:
            if row is None and word not in scopes:
                raise Fault(E.READ_ONLY)
            write(wrap(whole(read()) + by))

        return add


def _refused(statement: Statement) -> Action:
    """UG: refuse to replace the firmware."""
    raise Fault(E.ILLEGAL_DATA)
