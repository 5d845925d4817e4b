"""What is wrong with a program file, line by line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dialects.errors import Diagnostic


@dataclass(frozen=True)
class Problem:
    """Something wrong: line and column from 1, what, and what to do. A warning does not keep a program from running."""

    line: int
    column: int
    what: str
    hint: str = ""
    warning: bool = False

    def where(self, name: str) -> str:
        """`file:line:column`."""
        return f"{name}:{self.line}:{self.column}"


def errors(problems: Sequence[Problem]) -> list[Problem]:
    """Those that are no warnings."""
    return [each for each in problems if not each.warning]


def refuse(problems: Sequence[Problem], name: str) -> None:
    """Raise a Diagnostic for the first error, if there is one; it says how many more there are."""
    wrong = sorted(errors(problems), key=lambda each: (each.line, each.column))
    if not wrong:
        return
    more = f" ({len(wrong) - 1} more: multidrop program check)" if len(wrong) > 1 else ""
    raise Diagnostic(wrong[0].what + more, wrong[0].where(name), wrong[0].hint)
