"""Program memory: lines at byte addresses, labels, the listing, and the lines compiled to closures.

The manual gives neither the size of the memory nor the depth of subroutines.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.manual.grammar import Argument, Compare, NameTerm, Number, Statement
from multidrop.families.lexium.manual.statements import size_of
from multidrop.families.lexium.manual.table import lookup
from multidrop.families.lexium.simulator.state.errors import DriveFault

FIRST_ADDRESS, PROGRAM_BYTES = 1, 6384
"""The lowest address, and the size of program memory in bytes (that of the maker's older drives)."""


class StoredLine(NamedTuple):
    """A stored line: its address, its size in bytes, its text as it came, and what it says."""

    address: int
    size: int
    text: str
    statement: Statement


@dataclass
class ProgramContents:
    """What program memory holds. `declared` are the variables of its VA lines, `product` is whose words count."""

    lines: dict[int, StoredLine] = field(default_factory=dict)
    labels: dict[str, int] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)
    product: str = ""
    _declared: set[str] | None = None

    @property
    def declared(self) -> set[str]:
        if self._declared is None:
            self._declared = {name for line in self.lines.values() if (name := declared_by(line.statement))}
        return self._declared

    def copy(self) -> ProgramContents:
        return ProgramContents(dict(self.lines), dict(self.labels), list(self.order), self.product)

    def load(self, other: ProgramContents) -> None:
        self.lines, self.labels, self.order = dict(other.lines), dict(other.labels), list(other.order)
        self._declared = None

    def store(self, address: int, text: str, statement: Statement) -> int:
        """Store a line, and delete those that it overlaps. Return the next address. Raises DriveFault (45)."""
        size = size_of(statement, self.product)
        if address + size > FIRST_ADDRESS + PROGRAM_BYTES:
            raise DriveFault(E.PROGRAM_MEMORY_FULL)
        if self._make_room(address, address + size) or declared_by(statement):
            self._declared = None
        self.lines[address] = StoredLine(address, size, text, statement)
        insort(self.order, address)
        return address + size

    def resolve(self, target: Argument | None) -> int:
        """The address that a label or a number means. Raises DriveFault (30, 34, 42)."""
        if isinstance(target, Number):
            if target.value not in self.lines:
                raise DriveFault(E.NO_SUCH_ADDRESS, fatal=True)
            return int(target.value)
        if not isinstance(target, NameTerm):
            raise DriveFault(E.ILLEGAL_DATA)
        if target.word in self.labels:
            return self.labels[target.word]
        row = lookup(target.word, self.product)
        if row and row.kind == "reserved":
            raise DriveFault(E.ILLEGAL_DATA, fatal=True)
        raise DriveFault(E.NOT_EXECUTABLE if row and row.name != "SU" else E.NO_SUCH_NAME, fatal=True)

    def check(self, target: Argument | None) -> None:
        """Check that a place exists, for an instruction that only names it. Raises DriveFault; that ends no program."""
        try:
            self.resolve(target)
        except DriveFault as fault:
            raise DriveFault(fault.code) from None

    def clear(self, start: int = 0) -> None:
        """Delete the lines from an address on, with their labels."""
        self._declared = None
        for address in [each for each in self.order if each >= start]:
            del self.lines[address]
        del self.order[bisect_left(self.order, start) :]
        self.labels = {name: at for name, at in self.labels.items() if at < start}

    def listing(self, start: int = FIRST_ADDRESS) -> list[str]:
        """Address, two spaces, text: a row for each line from an address on."""
        return [f"{address}  {self.lines[address].text}" for address in self.order if address >= start]

    def _make_room(self, start: int, stop: int) -> bool:
        """Delete the lines that overlap; whether there were any."""
        before = len(self.order)
        at = max(bisect_left(self.order, start) - 1, 0)
        for address in self.order[at : bisect_left(self.order, stop)]:
            if address + self.lines[address].size > start:
                del self.lines[address]
                self.order.remove(address)
                self.labels = {name: place for name, place in self.labels.items() if place != address}
        return len(self.order) < before


def declared_by(statement: Statement) -> str:
    """The name that a VA line declares; empty for any other line."""
    if statement.word != "VA" or not statement.arguments:
        return ""
    first = statement.arguments[0]
    if isinstance(first, Compare):
        first = first.left
    return first.word if isinstance(first, NameTerm) else ""


Action = Callable[[], None]
"""What a line does."""


class LinkedProgram:
    """The lines of program memory as they were when a program was last started, compiled to closures.

    `actions` and `texts` are by line, `index` gives the line of an address. Where a gap or the end of memory follows a
    line, `finish` ends the program. Labels are no lines of it: they are marks and take no time. `places` has the lines
    of the targets that were resolved; it is another dictionary whenever they may have moved.
    """

    def __init__(self, program: ProgramContents, compile_line: Callable[[Statement], Action], finish: Action) -> None:
        self._program, self._compile_line, self._finish = program, compile_line, finish
        self.actions: list[Action] = [finish]
        self.texts: list[str] = [""]
        self.index: dict[int, int] = {}
        self.places: dict[Argument | None, int] = {}
        self._linked = False

    def forget(self) -> None:
        """Compile again when something is started: program memory has changed."""
        self._linked = False
        self.places = {}

    def entry(self, target: Argument | None) -> int:
        """The line at which a program starts. Raises DriveFault (24, 30, 34, 42)."""
        address = self._program.resolve(target)
        if not self._linked:
            self._link()
        return self.index[address]

    def place(self, target: Argument | None) -> int:
        """Where the program that runs goes on.

        Raises DriveFault (30, 34, 42), 42 also for what was stored since it began.
        """
        place = self.places.get(target)
        if place is None:
            address = self._program.resolve(target)
            if address not in self.index:
                raise DriveFault(E.NO_SUCH_ADDRESS, fatal=True)
            place = self.places[target] = self.index[address]
        return place

    def _link(self) -> None:
        self.actions, self.texts, self.index, self.places = [], [], {}, {}
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
