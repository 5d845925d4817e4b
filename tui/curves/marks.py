"""What happened to a drive, as marks on its curves: a sent line, a limit, an error, a stop, each at its time."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from itertools import takewhile
from typing import NamedTuple

LONGEST_LABEL = 24
"""Cells of a label in a chart."""


class MarkKind(Enum):
    """The kind of a mark: its sign, its letter in ASCII, its role. The first ones go before the others."""

    STOP = ("■", "S", "error")
    ERROR = ("✗", "E", "error")
    LIMIT = ("!", "L", "error")
    SENT = ("›", ">", "strong")

    def __init__(self, sign: str, letter: str, role: str) -> None:
        self.sign, self.letter, self.role = sign, letter, role


URGENCY = {kind: number for number, kind in enumerate(MarkKind)}
"""The place of each kind in the order of urgency, most urgent first."""


class PlotMark(NamedTuple):
    """One mark. `address`: None for every drive of the bus; `axis`: empty for the first one of the drive."""

    at: float
    address: str | None
    kind: MarkKind
    text: str
    label: str = ""
    """The text in a chart where that is shorter."""
    axis: str = ""

    @property
    def short(self) -> str:
        """A few cells of text, one for each character."""
        text = "".join(sign if sign.isascii() and sign.isprintable() else "?" for sign in self.label or self.text)
        return text if len(text) <= LONGEST_LABEL else f"{text[: LONGEST_LABEL - 1]}…"

    def of(self, address: str, axis: str, first: bool) -> bool:
        """True if it belongs to the curve of an axis, which is the `first` one that is plotted of its drive."""
        return self.address in (None, address) and (self.axis == axis if self.axis else first)


LATE = 10.0
"""Seconds by which a mark may come after those that are younger than it: it is as old as the reading that found it."""


def between(marks: Sequence[PlotMark], begin: float, end: float) -> list[PlotMark]:
    """The marks of a time, in the order in which they came; those before it are not searched."""
    recent = takewhile(lambda mark: mark.at >= begin - LATE, reversed(marks))
    return [mark for mark in recent if begin <= mark.at < end][::-1]
