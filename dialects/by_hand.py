"""What a person edits and switches of a drive besides its settings: variables, outputs, programs, checksums.

A family declares what its drives have. A front end shows it, and sends the lines that the family gives.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.dialects.codec import Procedure
from multidrop.dialects.state import OfDrive, who

_NUMBER = re.compile(r"[+-]?[0-9]{1,20}(?:\.[0-9]{0,20})?")
LOW, HIGH = -(2**31), 2**31 - 1
"""The range of a whole number of 32 bits."""


@dataclass(frozen=True)
class Variable:
    """One variable of the programs in a drive, with the value that it had when it was read."""

    name: str
    value: int | float
    kept: str = ""
    """Whether the value survives a power-off, in words."""
    low: int = LOW
    high: int = HIGH
    fraction: bool = False
    """It takes numbers with a fraction, too."""

    def taken(self, text: str) -> str:
        """Return a typed value as a line has it. Raises Diagnostic."""
        number = float(text) if _NUMBER.fullmatch(text.strip()) else None
        if number is None:
            raise Diagnostic(f"{text.strip()[:20]!r} is not a number", self.name, f"valid: {self.low} to {self.high}")
        if not self.fraction and not float(number).is_integer():
            raise Diagnostic(f"{text.strip()[:20]} is not a whole number", self.name, "it holds whole numbers")
        if not self.low <= number <= self.high:
            raise Diagnostic(f"{text.strip()[:20]} is out of range", self.name, f"valid: {self.low} to {self.high}")
        return str(number) if self.fraction and not float(number).is_integer() else str(int(number))


class Output(NamedTuple):
    """One output that a line switches."""

    number: int
    on: str
    """The line that switches it on."""
    off: str


RUN, STOP, PAUSE, GO_ON = "run", "stop", "pause", "continue"
ACTIONS = (RUN, PAUSE, GO_ON, STOP)


@dataclass(frozen=True)
class ProgramSlot:
    """One of the programs that a drive can run, and the lines that act on it."""

    name: str
    lines: Mapping[str, str]
    """By `ACTIONS`; a missing action does not exist."""


Progress = Callable[[int, int], None]


class ByHand(OfDrive):
    """What a person edits and switches of a drive. By default nothing."""

    no_variables = "drives of this family have no variables of their own"
    no_outputs = "drives of this family have no outputs that a line switches"
    no_programs = "drives of this family have no programs that can be paused by a line"

    def variables(self, progress: Progress) -> Procedure[tuple[Variable, ...]]:
        """Read the variables of the programs. Raises Inexpressible for a drive without any, Refused or NoAnswer."""
        raise Inexpressible(f"{who(self.state)}: {self.no_variables}; nothing was sent")
        yield  # a conversation

    def assign(self, variable: Variable, value: str) -> str:
        """Return the line that gives a variable a value, as `Variable.taken` returns it."""
        raise Inexpressible(f"{who(self.state)}: {self.no_variables}; nothing was sent")

    def keep(self, variable: Variable) -> str:
        """Return the line that makes the value survive a power-off; empty: none does."""
        return ""

    def outputs(self) -> Sequence[Output]:
        """Return the outputs that lines switch."""
        return ()

    def programs(self) -> Sequence[ProgramSlot]:
        """Return the programs that lines run, pause and stop."""
        return ()
