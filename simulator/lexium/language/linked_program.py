"""Program memory compiled to closures in a list; labels are no lines of it (they are marks and take no time)."""

from __future__ import annotations

from collections.abc import Callable

from dialects.mcode.manual.errors import ErrorNumber as E
from dialects.mcode.manual.grammar import Argument, Statement
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.program_memory import Program

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
