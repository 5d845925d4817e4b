"""Program mode: between PG with an address and PG lines are stored (manual 3.3, 5.1.98)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.dialects.mcode.manual.grammar import Argument, Name, Statement, is_name
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.memory import TABLE_SIZE, Memory
from multidrop.simulator.lexium.state.program_memory import Program

# Program memory compiled to closures in a list; labels are no lines of it (they are marks and take no time).


Action = Callable[[], None]
"""What a line does."""


class LinkedProgram:
    """The lines of program memory as they were when a program was last started.

    `actions` and `texts` are by line, `index` gives the line of an address. Where a gap or the end of memory follows a
    line, `finish` ends the program.
    """

    def __init__(self, program: Program, compile_line: Callable[[Statement], Action], finish: Action) -> None:
        self._program, self._compile_line, self._finish = program, compile_line, finish
        self.actions: list[Action] = [finish]
        self.texts: list[str] = [""]
        self.index: dict[int, int] = {}
        self._linked = False

    def forget(self) -> None:
        """Compile again when something is started: program memory has changed."""
        self._linked = False

    def entry(self, target: Argument | None) -> int:
        """The line at which a program starts. Raises Fault (24, 30, 34, 42)."""
        address = self._program.resolve(target)
        if not self._linked:
            self._link()
        return self.index[address]

    def place(self, target: Argument | None) -> int:
        """Where the program that runs goes on. Raises Fault (30, 34, 42), 42 too for what was stored since it began."""
        address = self._program.resolve(target)
        if address not in self.index:
            raise Fault(E.NO_SUCH_ADDRESS, fatal=True)
        return self.index[address]

    def _link(self) -> None:
        self.actions, self.texts, self.index = [], [], {}
        program, expected = self._program, None
        for address in program.order:
            line = program.lines[address]
            if expected not in (None, address):
                self._append(self._finish, "")
            expected = address + line.size
            self.index[address] = len(self.actions)
            if line.statement.word != "LB":
                self._append(self._compile_line(line.statement), f"{address}  {line.text}")
        self._append(self._finish, "")
        self._linked = True

    def _append(self, action: Action, text: str) -> None:
        self.actions.append(action)
        self.texts.append(text)


# The operations on memory that lasts which the language needs.


class Storage(Protocol):
    """NVM, as the language sees it."""

    def save(self) -> None:
        """S. Raises Fault (73)."""

    def initialise(self) -> None:
        """IP. Raises Fault (74)."""

    def factory_defaults(self) -> None:
        """FD. Raises Fault (73)."""

    def program_changed(self) -> None:
        """Take note of a change of program memory; some products keep it at once, without S."""


# The names that a user gives: labels and variables share one table (manual 3.2.2, 3.3.1, 5.1.71, 5.1.136).


class Names:
    """The table of names of one drive."""

    def __init__(self, memory: Memory, program: Program) -> None:
        self._memory, self._program = memory, program

    def known(self) -> frozenset[str]:
        """Every name that is there."""
        return frozenset((*self._memory.scopes, *self._program.labels, *self._program.declared))

    def check_new(self, word: str) -> None:
        """Check that a name may be given. Raises Fault (24 bad or reserved, 28 taken, 29 a mnemonic)."""
        row = lookup(word, self._memory.product)
        if row is not None:
            raise Fault(E.ILLEGAL_DATA if row.kind == "reserved" else E.NAME_IS_COMMAND)
        if not is_name(word) or len(word) > self._memory.model.longest_name:
            raise Fault(E.ILLEGAL_DATA)
        if word in self._program.labels or self._memory.scopes.get(word) == "G":
            raise Fault(E.NAME_EXISTS)

    def check_room(self) -> None:
        """Check that one more name fits. Raises Fault (31)."""
        if len(self._program.labels) + len(self._memory.scopes) >= TABLE_SIZE:
            raise Fault(E.NAME_TABLE_FULL)

    def new_label(self, statement: Statement) -> str:
        """The name that an LB line gives. Raises Fault (24, 28, 29, 31)."""
        name = statement.arguments[0]
        if not isinstance(name, Name):
            raise Fault(E.ILLEGAL_DATA)
        if name.word == "SU":
            if "SU" in self._program.labels:
                raise Fault(E.NAME_EXISTS)
        else:
            self.check_new(name.word)
            if name.word in self._memory.scopes or name.word in self._program.declared:
                raise Fault(E.NAME_EXISTS)
        self.check_room()
        return name.word


class ProgramMode:
    """Program mode of one drive. `address` is where the next line is stored; None: it is not on."""

    def __init__(self, program: Program, names: Names, linked: LinkedProgram, storage: Storage) -> None:
        self._program, self._names, self._linked, self._storage = program, names, linked, storage
        self.address: int | None = None

    def store(self, statement: Statement, text: str) -> None:
        """Store one more line, which compiles. Raises Fault (24, 28, 29, 31, 45)."""
        address = self.address or 0
        name = self._names.new_label(statement) if statement.word == "LB" else ""
        self.address = self._program.store(address, text, statement)
        if name:
            self._program.labels[name] = address
        self.changed()

    def changed(self) -> None:
        """Take note of a change of program memory."""
        self._storage.program_changed()
        self._linked.forget()
