"""The table of MCode instructions: each compiles its statement into a closure that carries it out.

`compile` is the one way from a statement to an action, for typed lines and program lines alike. What is wrong with the
form of a line is raised as DriveFault when it is compiled; what is wrong with a value, when it runs. The instructions
on programs are in `program_commands`, those of the motor and with several settings in `motor_commands`.

PR prints numbers, texts, and the lists of parameters, variables and set-ups. Manual 5.1.4, 5.1.64, 5.1.78, 5.1.93,
5.1.97, 5.1.101, 5.1.102, 5.1.119, 5.1.122, 5.1.134, 5.1.141, 5.1.142.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument, NameTerm, Number, Statement, Text
from multidrop.families.lexium.manual.groups import LISTS, TRIPS, TRIPS_WITH_VALUE
from multidrop.families.lexium.manual.mnemonic import Mnemonic
from multidrop.families.lexium.manual.table import MNEMONICS
from multidrop.families.lexium.simulator.event_loop import EventLoop
from multidrop.families.lexium.simulator.language.motor_commands import MotorCommands, Setups
from multidrop.families.lexium.simulator.language.program_commands import ProgramCommands
from multidrop.families.lexium.simulator.language.variables import Compile, Variables, bare, is_place, only
from multidrop.families.lexium.simulator.state.errors import CRLF, DriveFault
from multidrop.families.lexium.simulator.state.expressions import FLOATS, Read, Value, whole, wrap
from multidrop.families.lexium.simulator.state.memory import slot
from multidrop.families.lexium.simulator.state.program_memory import Action

Item = Callable[[], str]
Optional = Callable[[int], str]

REGISTERS = FLOATS - {"PI"}
VOLTS = 24
AUXILIARY_VOLTS = 12
_ESCAPES = {"b": "\b", "c": "\x03", "e": "\x1b", "g": "\a", "n": "\n", "r": "\r", "t": "\t"}


def unescape(text: str) -> str:
    """A text with its backslash codes carried out."""
    return re.sub(r"\\(.)", lambda found: _ESCAPES.get(found[1], found[0]), text, flags=re.DOTALL)


class PrintInstruction:
    """PR of one drive with this serial number."""

    def __init__(self, serial: str, drive: EventLoop, variables: Variables) -> None:
        core, self._variables, self._motor, self._outputs = drive.core, variables, drive.motor, drive.output_lines
        self._memory, self._program, self._timeline = core.memory, core.program, core.timeline
        self._printer, self._errors, self._bridges = core.printer, core.errors, drive.bridges
        values, model, texts = core.values, core.model, self._text
        self._shapes: Mapping[str, Item] = {
            "ER": self._error,
            "AL": lambda: _listed(self._parameters()),
            "UV": lambda: _listed(self._names()),
            **{word: partial(self._joined, word) for word in LISTS},
            "DN": lambda: f'"{texts("DN")}"',
            "MD": lambda: texts("MD"),
            "PF": lambda: texts("PF") or str(MNEMONICS["PF"].default),
            "PW": lambda: texts("PW") or "0,0,0,0",
            "PN": lambda: model.part,
            "SA": lambda: f"{values['SA']:.6f}",
            "SN": lambda: serial,
            "VR": lambda: model.version,
            "CR": lambda: f"{values['CR']:.3f}",
            **{f"S{n}": partial(self._point, n) for n in (*range(1, 6), *range(7, 14))},
            **{word: partial(self._trip, word) for word in TRIPS},
        }
        self._with_option: Mapping[str, Optional] = {"IT": self._temperature, "VT": self._voltage}

    def compile(self, statement: Statement) -> Action:
        """PR. Raises DriveFault (35) for what cannot be printed."""
        items, emit = list(self._items(statement)), self._printer.emit
        ending = "" if statement.quiet else CRLF
        return lambda: emit("".join(item() for item in items) + ending)

    def _items(self, statement: Statement) -> Iterator[Item]:
        rest = [each for each in statement.arguments if each is not None]
        while rest:
            argument = rest.pop(0)
            word = argument.word if isinstance(argument, NameTerm) else ""
            if word in self._with_option and self._memory.row(word):
                option = rest.pop(0) if rest and isinstance(rest[0], Number) else None
                number = option.value if isinstance(option, Number) else 0
                if number not in (0, 1, 2):
                    raise DriveFault(E.OUT_OF_RANGE)
                if word == "VT" and number == 1 and not self._memory.model.auxiliary:
                    raise DriveFault(E.NOT_AVAILABLE)
                yield partial(self._with_option[word], int(number))
            else:
                yield self._item(argument)

    def _item(self, argument: Argument) -> Item:
        if isinstance(argument, Text):
            text = unescape(argument.value)
            return lambda: text
        if isinstance(argument, Number) and not isinstance(argument.value, float):
            constant = str(argument.value)
            return lambda: constant
        if not isinstance(argument, NameTerm):
            raise DriveFault(E.NOT_PRINTABLE)
        word, row = argument.word, self._memory.readable(argument.word)
        if row is not None and row.access in ("-", "WO"):
            raise DriveFault(E.NOT_PRINTABLE)
        if row is not None and word in self._shapes:
            return self._shapes[word]
        read = self._variables.reader(word)
        if row is None:
            return lambda: self._user(word)
        if word in REGISTERS:
            return lambda: self._floating(read())
        return lambda: str(read())

    def _floating(self, value: Value) -> str:
        """An F register as PF says; unpadded with six decimals while PF has its default."""
        setting = self._memory.texts["PF"]
        if not setting:
            return f"{value:.6f}"
        width, decimals, scientific, left = (int(number) for number in setting.split(","))
        text = f"{value:.{decimals}E}" if scientific else f"{value:.{decimals}f}"
        return text.ljust(width) if left else text.rjust(width)

    def _user(self, word: str) -> str:
        if word not in self._memory.scopes:
            raise DriveFault(E.NOT_PRINTABLE)
        return str(self._memory.values[slot(word)])

    def _error(self) -> str:
        """PR ER clears EF, and ER too (manual 5.1.40). In a program ER stays: samples test it after the print."""
        code = self._memory.values["ER"]
        self._errors.clear()
        if not self._printer.immediate:
            self._memory.values["ER"] = code
        return str(code)

    # Lists.

    def _joined(self, word: str) -> str:
        return CRLF.join(self._setups(word))

    def _text(self, word: str) -> str:
        return self._memory.texts.get(word, "")

    def _names(self) -> list[str]:
        """The lines of PR UV: variables with their scope, labels with their address."""
        memory = self._memory
        rows = {name: f"{scope} {memory.values[slot(name)]}" for name, scope in memory.scopes.items()}
        rows.update({name: str(address) for name, address in self._program.labels.items()})
        return [f"{name} = {rows[name]}" for name in sorted(rows)]

    def _parameters(self) -> list[str]:
        """The lines of PR AL: every variable and flag of this drive, in alphabetical order. Nothing is cleared."""
        rows: list[str] = []
        for name, row in self._memory.words.items():
            if row.kind not in ("variable", "flag") or row.access == "WO" or self._memory.product not in row.products:
                continue
            if name in LISTS:
                rows += self._setups(name)
            else:
                rows.append(f"{name} = {self._parameter(name)}")
        return rows

    def _parameter(self, name: str) -> str:
        if name == "ER":
            return str(self._memory.values["ER"])
        if name in self._with_option:
            return self._with_option[name](0)
        return self._item(NameTerm(name))()

    def _setups(self, word: str) -> list[str]:
        """The lines of PR IS, PR OS or PR LS."""
        if word == "IS":
            return [f"IS = {n}, {self._point(n)}" for n in LISTS["IS"]]
        rows = self._outputs.types if word == "OS" else self._motor.limits.software
        return [f"{word} = {n}, {_fields(row)}" for n, row in rows.items()]

    def _point(self, n: int) -> str:
        return _fields(self._motor.inputs.types[n])

    def _trip(self, word: str) -> str:
        """PR of a trip; 0 for one that is not set up."""
        trip = self._motor.trips.defined.get(TRIPS[word])
        if trip is None:
            return "0"
        target = trip.target
        name = target.word if isinstance(target, NameTerm) else str(target.value if isinstance(target, Number) else 0)
        if word not in TRIPS_WITH_VALUE:
            return name
        return f"{trip.value}, {name}" + (f", {trip.repeats}" if word == "TR" else "")

    # Words that may be followed by a number that chooses.

    def _voltage(self, option: int) -> str:
        """Status, then the volts (manual 5.1.142; status 0 both good, 1 no auxiliary, 2 no +V, 3 neither)."""
        auxiliary, supply = self._memory.model.auxiliary, self._bridges.supply
        status = (0 if auxiliary else 1) + (0 if supply else 2)
        bridge = VOLTS if supply else 0
        volts = {1: (AUXILIARY_VOLTS,), 2: (bridge,)}.get(option, (AUXILIARY_VOLTS, bridge) if auxiliary else (bridge,))
        return _fields((status, *volts))

    def _temperature(self, option: int) -> str:
        """The bridge, the controller, or both (manual 5.1.67)."""
        heat, t = self._motor.heat, self._timeline.now
        both = (round(heat.bridge(t)), round(heat.controller(t)))
        return _fields(both if not option else both[option - 1 : option])


def _listed(lines: list[str]) -> str:
    """Lines, and then an empty one."""
    return "".join(line + CRLF for line in lines)


def _fields(values: tuple[int, ...]) -> str:
    return ", ".join(str(value) for value in values)


class Instructions:
    """The instructions of one drive. `commands` gives the compiler of a word."""

    def __init__(self, serial: str, drive: EventLoop) -> None:
        power, nvm = drive.power_unit, drive.power_unit.nvm
        self._memory, self._program = drive.core.memory, drive.core.program
        self._variables = variables = Variables(drive)
        self._programs = programs = ProgramCommands(drive, variables)
        self.motions = MotorCommands(drive, variables)
        setups = Setups(drive, variables)
        prints = PrintInstruction(serial, drive, variables)
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
        if self._memory.readable(word) is None and not self._variables.declared(word):
            return None
        try:
            return self._variables.reader(word)
        except DriveFault:
            return None

    def compile(self, statement: Statement, stored: bool) -> Action:
        """Return a closure that carries a line out; `stored`: it is a program's. Raises DriveFault for a wrong line."""
        word = statement.word
        if not word:
            return self.motions.counted(word, self._programs.number(statement))
        row = self._memory.row(word)
        if row is None:
            if not self._variables.declared(word) and word not in self._program.labels:
                raise DriveFault(E.UNKNOWN_VARIABLE if statement.equals else E.UNKNOWN_COMMAND)
            return self._assignment(statement)
        if row.kind in ("math", "reserved"):
            illegal = row.kind == "reserved" and statement.arguments
            raise DriveFault(E.ILLEGAL_DATA if illegal else E.UNKNOWN_COMMAND)
        if not (row.program if stored else row.immediate):
            raise DriveFault(E.ILLEGAL_DATA if stored else E.NOT_IN_PROGRAM_MODE)
        if stored and word == "PR" and NameTerm("AL") in statement.arguments:  # for immediate use only (manual 5.1.4)
            raise DriveFault(E.ILLEGAL_DATA)
        if word in self.commands:
            return self.commands[word](statement)
        if row.kind == "instruction":
            return self._without_effect(row, statement)
        return self._assignment(statement)

    def compile_stored(self, statement: Statement) -> Action:
        """The action of a stored line; one that cannot be carried out any more is an error when it is reached."""
        try:
            return self.compile(statement, stored=True)
        except DriveFault as fault:
            code, fatal = fault.code, fault.fatal

            def refuse() -> None:
                raise DriveFault(code, fatal)

            return refuse

    def _assignment(self, statement: Statement) -> Action:
        """`VM=5` or `VM 5`, and what is computed."""
        if not statement.arguments:
            raise DriveFault(E.ILLEGAL_DATA if statement.equals else E.NOT_EXECUTABLE)
        write = self._variables.writer(statement.word)
        read = self._variables.value(only(statement), statement.word in REGISTERS)
        return lambda: write(read())

    def _without_effect(self, row: Mnemonic, statement: Statement) -> Action:
        """An instruction without effect in the simulation; it checks its value."""
        reads = [self._variables.value(argument) for argument in statement.arguments if not is_place(argument)]

        def check() -> None:
            if reads and not row.accepts(reads[0]()):
                raise DriveFault(E.OUT_OF_RANGE)

        return check

    def _step(self, by: int, statement: Statement) -> Action:
        """IC and DC: add to a variable. Raises DriveFault (25, 26) for one that may not be stepped."""
        target, variables = only(statement), self._variables
        if not isinstance(target, NameTerm):
            raise DriveFault(E.ILLEGAL_DATA)
        word = target.word
        row = self._memory.row(word)
        if row is not None and row.step:
            raise DriveFault(E.ILLEGAL_DATA if row.kind == "reserved" else row.step)
        if row is None and not variables.declared(word):
            raise DriveFault(E.READ_ONLY)
        read, write = variables.reader(word), variables.writer(word)
        if row is not None and isinstance(row.default, float):
            return lambda: write(read() + by)
        scopes = self._memory.scopes

        def add() -> None:
            if row is None and word not in scopes:
                raise DriveFault(E.READ_ONLY)
            write(wrap(whole(read()) + by))

        return add


def _refused(statement: Statement) -> Action:
    """UG: refuse to replace the firmware."""
    raise DriveFault(E.ILLEGAL_DATA)
