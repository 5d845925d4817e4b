"""What is wrong with a program file, line by line."""

from __future__ import annotations

from dataclasses import dataclass


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
