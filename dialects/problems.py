"""Problems in a program file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from multidrop.dialects.errors import Diagnostic


class Problem(NamedTuple):
    """A problem: line and column from 1, description, remedy. A program with mere warnings runs."""

    line: int
    column: int
    what: str
    hint: str = ""
    warning: bool = False

    def where(self, name: str) -> str:
        """Return `file:line:column`."""
        return f"{name}:{self.line}:{self.column}"

    def line_for(self, name: str) -> str:
        """Return the one line that a person reads of it."""
        hint = f"; {self.hint}" if self.hint else ""
        return f"{self.where(name)}: {'warning: ' if self.warning else ''}{self.what}{hint}"


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """The problems by their places in the file; errors precede warnings of one place."""
    return sorted(problems, key=lambda each: (each.line, each.column, each.warning))


def errors(problems: Sequence[Problem]) -> list[Problem]:
    """The problems that are not warnings."""
    return [each for each in problems if not each.warning]


def refuse(problems: Sequence[Problem], name: str) -> None:
    """Raise a Diagnostic for the first error, if any; it gives the number of the others."""
    wrong = in_order(errors(problems))
    if not wrong:
        return
    more = f" ({len(wrong) - 1} more: multidrop program check)" if len(wrong) > 1 else ""
    raise Diagnostic(wrong[0].what + more, wrong[0].where(name), wrong[0].hint)
