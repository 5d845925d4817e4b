"""Program mode: between PG with an address and PG lines are stored (manual 3.3, 5.1.98)."""

from __future__ import annotations

from dialects.mcode.manual.grammar import Statement
from simulator.lexium.language.linked_program import LinkedProgram
from simulator.lexium.language.names import Names
from simulator.lexium.language.storage import Storage
from simulator.lexium.state.program_memory import Program


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
