"""What a person edits and switches of a drive besides its settings: variables, outputs, programs, checksums.

A family declares what its drives have. A front end shows it, and sends the lines that the family gives.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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


class PointField(NamedTuple):
    """One value of a set-up, by its number: what each number means, in words."""

    label: str
    choices: Mapping[int, str]
    mask: int = 0
    """The bits of a whole number that it is; 0: it is a field of its own, or the whole number."""

    @property
    def _shift(self) -> int:
        return (self.mask & -self.mask).bit_length() - 1

    def of(self, value: object, number: int) -> int | None:
        """Return its number in the value of a setting, where it is the field with this place; None: it has none."""
        if isinstance(value, tuple):
            value = value[number] if number < len(value) else None
        if not isinstance(value, int):
            return None
        return (value & self.mask) >> self._shift if self.mask else value

    def put(self, value: Fields, number: int, chosen: int) -> Fields:
        """Return the value of a setting with another number in it."""
        if isinstance(value, tuple):
            return tuple(chosen if at == number else each for at, each in enumerate(value))
        if self.mask and isinstance(value, int):
            return (value & ~self.mask) | (chosen << self._shift)
        return chosen

    def shown(self, number: int) -> str:
        """Return a number with its word: `1 home`."""
        return f"{number} {self.choices.get(number, '')}".rstrip()

    def read(self, text: str) -> int:
        """Return the number of a typed choice: the number, its word, or the beginning of that. Raises Diagnostic."""
        typed = " ".join(text.split()).casefold()
        exact = [n for n, word in self.choices.items() if typed in (str(n), word.casefold(), self.shown(n).casefold())]
        begun = [n for n, word in self.choices.items() if typed and word.casefold().startswith(typed)]
        found = exact or begun
        if len(found) != 1:
            valid = ", ".join(map(self.shown, self.choices))
            raise Diagnostic(f"no {self.label} {text.strip()[:20]}".rstrip(), "", f"valid: {valid}")
        return found[0]


@dataclass(frozen=True)
class PointSetup:
    """The set-up of one input or output: a setting, and its fields."""

    setting: str
    label: str
    fields: tuple[PointField, ...]


Fields = Any
"""The value of a setting: a number, or the fields of a set-up."""
Progress = Callable[[int, int], None]


class ByHand(OfDrive):
    """What a person edits and switches of a drive. By default nothing."""

    outputs_by_type = False
    """A point is an output only where its set-up says so; the conditions have it then."""
    no_variables = "drives of this family have no variables of their own"
    no_outputs = "drives of this family have no outputs that a line switches"
    no_points = "drives of this family have no inputs and outputs that can be set up"
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

    def points(self) -> Sequence[PointSetup]:
        """Return the set-ups of inputs and outputs, by the names of their settings."""
        return ()
