"""The names that a user gives: labels and variables share one table (manual 3.2.2, 3.3.1, 5.1.71, 5.1.136)."""

from __future__ import annotations

from dialects.mcode.manual.errors import ErrorNumber as E
from dialects.mcode.manual.grammar import Name, Statement, is_name
from dialects.mcode.manual.table import lookup
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.memory import TABLE_SIZE, Memory
from simulator.lexium.state.program_memory import Program


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
