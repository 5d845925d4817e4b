"""Which records of a transcript are shown, and which of them hold a searched text.

Both are kept as rising lists of record numbers, brought up to date when they are needed. So a record that arrives costs
nothing, and a frame costs as much as what arrived since the one before.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Sequence
from typing import Protocol

from multidrop.shell.lines import EVERYONE
from multidrop.shell.transcripts import Filter
from multidrop.tui.screen_model import Record
from multidrop.tui.widgets.records import Records

SENT = frozenset(">»")
TALK = frozenset({">", "", "x"})
"""Marks of typed lines, their replies and failures."""
TROUBLE = frozenset("x!")
BY_ITSELF = frozenset("<↑↓")
"""Marks of what no line asked for: prints of a program, bytes of the wire."""


def concerns(wanted: Filter, record: Record) -> bool:
    """Whether a record is of the drive and of the person that are wanted, whatever it says."""
    by_itself = record.mark in BY_ITSELF
    of_drive = record.address in (wanted.address, *EVERYONE) or not (record.address or by_itself)
    of_person = record.mark == "!" or (record.mine and not by_itself)
    return (of_drive or not wanted.address) and (of_person or not wanted.mine)


class Chooser(Protocol):
    """Chooses records: given each one in turn, it returns the numbers to add, of that one or of earlier ones."""

    def __call__(self, number: int, record: Record) -> tuple[int, ...]:
        """Return the numbers to add."""


class Shown:
    """Chooses the records that a filter shows.

    What a person types from record `since` on is shown with its replies, whatever the filter says.
    """

    def __init__(self, wanted: Filter, since: int | None = None) -> None:
        self._wanted, self._text, self._since = wanted, wanted.text.casefold(), since
        self._line: dict[tuple[str, bool], int] = {}
        """The last line that was sent to an address, by a person or not: what a failure there is about."""

    def __call__(self, number: int, record: Record) -> tuple[int, ...]:
        """Return the record's number, and that of the line that failed."""
        if self._since is not None and number >= self._since and record.mine and record.mark in TALK:
            return (number,)
        if not concerns(self._wanted, record) or self._text not in record.text.casefold():
            return ()
        if not self._wanted.errors:
            return (number,)
        key = (record.address, record.mine)
        if record.mark in SENT:
            self._line[key] = number
            return ()
        if record.mark not in TROUBLE:
            return ()
        line = self._line.pop(key, None) if record.mark == "x" else None
        return (number,) if line is None else (line, number)


class Holding:
    """Chooses those of the shown records that hold a text, in capitals or not."""

    def __init__(self, text: str, records: Records, shown: Chooser | None) -> None:
        """`shown` chooses the records that are shown; None: all are."""
        self._text, self._records, self._shown = text.casefold(), records, shown

    def __call__(self, number: int, record: Record) -> tuple[int, ...]:
        """Return the numbers of those that hold the text."""
        if self._shown is None:
            return (number,) if self._text in record.text.casefold() else ()
        shown = self._shown(number, record)
        return tuple(each for each in shown if self._text in self._records[each].text.casefold())


class Index:
    """The numbers of the chosen records, rising."""

    def __init__(self, records: Records, choose: Chooser) -> None:
        self._records, self._choose = records, choose
        self._numbers: list[int] = []
        self._seen = records.first

    @property
    def numbers(self) -> Sequence[int]:
        """The numbers, up to date."""
        first = self._records.first
        if self._numbers and self._numbers[0] < first:
            del self._numbers[: bisect_left(self._numbers, first)]
        if self._seen < self._records.taken:
            for number, record in self._records.since(self._seen):
                self._add(self._choose(number, record), first)
            self._seen = self._records.taken
        return self._numbers

    def _add(self, chosen: tuple[int, ...], first: int) -> None:
        for number in chosen:
            if not self._numbers or number > self._numbers[-1]:
                self._numbers.append(number)
            elif number >= first and self._numbers[bisect_left(self._numbers, number)] != number:
                insort(self._numbers, number)
