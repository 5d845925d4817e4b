"""Where macros are listed and changed: in a session, or at a terminal without one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic

if TYPE_CHECKING:
    from multidrop.macros import MacroStore
    from multidrop.shell.session import Call


class Macros:
    """The macros, and the person who changes them, in a session."""

    def __init__(self, call: Call) -> None:
        self.call = call

    @property
    def store(self) -> MacroStore:
        return self.call.session.macros

    def say(self, *lines: str) -> None:
        """Say what was done."""
        for line in lines:
            self.call.session.notify(line)
        self.call.session.changed()

    def warn(self, line: str) -> None:
        self.call.session.notify(line, warning=True)

    def output(self, line: str) -> None:
        self.call.output(line)

    def row(self, line: str) -> None:
        """Print a line of a table."""
        self.call.output(line, columns=True)

    def written(self, file: str) -> str:
        """The path of a file to write. Raises Diagnostic for one that a macro may not write."""
        return self.call.output_file(file)

    def text(self, file: str) -> tuple[str, str]:
        """The text of a file, and its name for messages. Raises Diagnostic."""
        from multidrop.base.files import text_of

        return text_of(file), file


class AtTerminal(Macros):
    """The macros, and the person who changes them, without a session: what was done is said on standard error."""

    def __init__(self) -> None:
        from multidrop.macros import MacroStore
        from multidrop.shell.configuration import Settings

        self.settings = Settings()
        self._store = MacroStore(self.settings.macros, self.settings.project_macros)

    @property
    def store(self) -> MacroStore:
        return self._store

    def say(self, *lines: str) -> None:
        for line in lines:
            self.warn(line)

    def warn(self, line: str) -> None:
        from multidrop.shell.streams.stdout import write

        write(sys.stderr, line)

    def output(self, line: str) -> None:
        from multidrop.shell.streams.stdout import write

        write(sys.stdout, line)

    row = output

    def written(self, file: str) -> str:
        return file

    def text(self, file: str) -> tuple[str, str]:
        from multidrop.base.files import bounded, utf8

        if file != "-":
            return super().text(file)
        name = "standard input"
        return utf8(bounded(sys.stdin.buffer, name), name), name


def changing(call: Call) -> Macros:
    """The macros, for a person who changes them. Raises Diagnostic for a macro."""
    from multidrop.shell.events import By

    if call.by is By.MACRO:
        raise Diagnostic("a macro does not change macros", "/macro", "type the line")
    return Macros(call)


def at_terminal(work: Callable[[AtTerminal], object]) -> None:
    work(AtTerminal())
