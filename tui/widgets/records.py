"""The records of one bus: the last ones, by number, as many as fit into a bound of lines and of text.

A record keeps its number for as long as the program runs. So a view, a filter and a search can name it while older
records are dropped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice

from multidrop.tui.screen_model import KEPT, Record

MOST_TEXT = 8_000_000
"""Characters of all kept records: fifty thousand long lines would take gigabytes."""


class Records:
    """The kept records. Taking one in costs the same whatever is kept."""

    def __init__(self, most: int = KEPT, text: int = MOST_TEXT) -> None:
        self._kept: deque[Record] = deque()
        self._most, self._room = most, text
        self.taken = 0
        """The number of records so far; that of the next one."""
        self.cleared = 0
        """The number of the first record since the last `clear`."""
        self.began = 0.0
        """The time of the first record of all."""

    def __len__(self) -> int:
        return len(self._kept)

    def __iter__(self) -> Iterator[Record]:
        return iter(self._kept)

    def __reversed__(self) -> Iterator[Record]:
        return reversed(self._kept)

    def __getitem__(self, number: int) -> Record:
        return self._kept[number - self.first]

    @property
    def first(self) -> int:
        """The number of the oldest kept record."""
        return self.taken - len(self._kept)

    @property
    def dropped(self) -> int:
        """The records that were dropped because newer ones needed their room."""
        return self.first - self.cleared

    def take(self, new: Sequence[Record]) -> None:
        """Take in records, oldest first, and drop the oldest that do not fit; the newest one always stays."""
        kept = self._kept
        if not self.taken and new:
            self.began = new[0].at
        kept.extend(new)
        self.taken += len(new)
        self._room -= sum(len(record.text) for record in new)
        while len(kept) > self._most or (self._room < 0 and len(kept) > 1):
            self._room += len(kept.popleft().text)

    def clear(self) -> None:
        """Forget all records."""
        self._room += sum(len(record.text) for record in self._kept)
        self._kept.clear()
        self.cleared = self.taken

    def since(self, number: int) -> list[tuple[int, Record]]:
        """Return the records from a number on, with their numbers."""
        first = max(number, self.first)
        newest = list(islice(reversed(self._kept), self.taken - first))
        return list(zip(range(first, self.taken), reversed(newest), strict=True))
