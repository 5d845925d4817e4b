"""The part of a transcript in view: a filter, the line at the bottom, a search, a selection. It paints nothing.

A view follows the newest line until its reader goes up, pauses, searches or selects. Then it stays on the line at its
bottom, named by its number, however much arrives, until that line is dropped.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from multidrop.shell.line_syntax import EVERYONE
from multidrop.shell.roles import EVERYTHING, Filter
from multidrop.tui.screen_model import MOST_FRESH_RECORDS, Record

# The records of one bus: the last ones, by number, as many as fit into a bound of lines and of text.
#
# A record keeps its number for as long as the program runs. So a view, a filter and a search can name it while older
# records are dropped.


MOST_BETWEEN = 200
"""Records after one that a later record may still replace."""
MOST_TEXT = 8_000_000
"""Characters of all kept records: fifty thousand long lines would take gigabytes."""


class Records:
    """The kept records. Taking one in costs the same whatever is kept."""

    def __init__(self, most: int = MOST_FRESH_RECORDS, text: int = MOST_TEXT) -> None:
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

    def __getitem__(self, number: int) -> Record:
        return self._kept[number - self.first]

    @property
    def first(self) -> int:
        return self.taken - len(self._kept)

    @property
    def dropped(self) -> int:
        """The records that were dropped because newer ones needed their room."""
        return self.first - self.cleared

    def take(self, new: Sequence[Record]) -> list[int]:
        """Take in records, oldest first, and drop the oldest that do not fit; the newest one always stays.

        Return the numbers of earlier records that were replaced.
        """
        kept, replaced, further = self._kept, list[int](), list[Record]()
        for record in new:
            number = self._joined(record.joins) if record.joins else None
            if number is None:
                further.append(record)
                continue
            self._room += len(self[number].text) - len(record.text)
            kept[number - self.first] = record
            replaced.append(number)
        new = further
        if not self.taken and new:
            self.began = new[0].at
        kept.extend(new)
        self.taken += len(new)
        self._room -= sum(len(record.text) for record in new)
        while len(kept) > self._most or (self._room < 0 and len(kept) > 1):
            self._room += len(kept.popleft().text)
        return replaced

    def _joined(self, joins: int) -> int | None:
        """The number of the record among the last ones that one with this mark replaces."""
        last = islice(reversed(self._kept), MOST_BETWEEN)
        return next((self.taken - 1 - n for n, record in enumerate(last) if record.joins == joins), None)

    def clear(self) -> None:
        self._room += sum(len(record.text) for record in self._kept)
        self._kept.clear()
        self.cleared = self.taken

    def since(self, number: int) -> list[tuple[int, Record]]:
        """Return the records from a number on, with their numbers."""
        first = max(number, self.first)
        newest = list(islice(reversed(self._kept), self.taken - first))
        return list(zip(range(first, self.taken), reversed(newest), strict=True))


# Which records of a transcript are shown, and which of them hold a searched text.
#
# Both are kept as rising lists of record numbers, brought up to date when they are needed. So a record that arrives
# costs nothing, and a frame costs as much as what arrived since the one before.


SENT = frozenset(">»")
TALK = frozenset({">", "", "x"})
"""Marks of typed lines, their replies and failures."""
TROUBLE = frozenset("x!")
BY_ITSELF = frozenset("<↑↓")
"""Marks of what no line asked for: prints of a program, bytes of the wire."""


def concerns(wanted: Filter, record: Record) -> bool:
    """True if a record is of the drive and of the person that are wanted, whatever it says."""
    by_itself = record.mark in BY_ITSELF
    of_drive = record.address in (wanted.address, *EVERYONE) or not (record.address or by_itself)
    of_person = record.mark == "!" or (record.mine and not by_itself)
    return (of_drive or not wanted.address) and (of_person or not wanted.mine)


Chooser = Callable[[int, Record], tuple[int, ...]]
"""Chooses records: given each one in turn, it returns the numbers to add, of that one or of earlier ones."""


class RecordFilter:
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


def holding(text: str, records: Records, shown: Chooser | None) -> Chooser:
    """Choose those of the shown records that hold a text, in capitals or not. `shown`: None shows all."""
    wanted = text.casefold()

    def holds(number: int, record: Record) -> tuple[int, ...]:
        if shown is None:
            return (number,) if wanted in record.text.casefold() else ()
        return tuple(line for line in shown(number, record) if wanted in records[line].text.casefold())

    return holds


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
                for index in self._choose(number, record):
                    if not self._numbers or index > self._numbers[-1]:
                        self._numbers.append(index)
                    elif index >= first and self._numbers[bisect_left(self._numbers, index)] != index:
                        insort(self._numbers, index)
            self._seen = self._records.taken
        return self._numbers


class VisibleRecords:
    """The records that are shown, and the one at the bottom."""

    def __init__(self, records: Records) -> None:
        self.records = records
        self.filter = EVERYTHING
        self.paused = False
        """A person has stopped the scrolling, and nothing but a person lets it go on."""
        self.height = 1
        """Rows of the view."""
        self.top = 0
        """The number of the record at the top, as last painted."""
        self._index: Index | None = None
        self._filtered_from: int | None = None
        self._bottom: int | None = None

    @property
    def numbers(self) -> Sequence[int]:
        """The numbers of the shown records, rising."""
        return range(self.records.first, self.records.taken) if self._index is None else self._index.numbers

    def choose(self, wanted: Filter, *, typed: bool = False) -> None:
        """Show the records of a filter. `typed`: also what a person types from now on, with its replies."""
        self.filter, self._filtered_from = wanted, self.records.taken if typed else None
        shown = self.shown()
        self._index = Index(self.records, shown) if shown is not None else None

    def shown(self) -> RecordFilter | None:
        """Make what chooses the shown records, from the first one on; None: all are shown."""
        return RecordFilter(self.filter, self._filtered_from) if self.filter else None

    @property
    def following(self) -> bool:
        """True if the newest line is in view and new ones scroll."""
        return self._bottom is None

    @property
    def end(self) -> int:
        """The place after the record at the bottom, among those shown; no place above the first full view."""
        numbers = self.numbers
        if self._bottom is None:
            return len(numbers)
        return max(bisect_right(numbers, self._bottom), self._least(numbers))

    def _least(self, numbers: Sequence[int]) -> int:
        return min(max(1, self.height - 1), len(numbers))

    @property
    def at_oldest(self) -> bool:
        """True if the oldest record is in view and the newest is not."""
        return not self.following and self.end <= self._least(self.numbers)

    @property
    def below(self) -> int:
        return len(self.numbers) - self.end

    def hold(self) -> None:
        """Stay on the newest line, if the view follows."""
        if self._bottom is None:
            self._bottom = self.records.taken - 1

    def look(self, lines: int) -> None:
        """Scroll up (negative) or down; scrolling past the newest follows new lines again, unless paused."""
        self._end_at(self.end + lines)

    def look_page(self, direction: int) -> None:
        """Scroll up or down by one view, less one line."""
        self.look(direction * max(1, self.end - 1 - bisect_left(self.numbers, self.top)))

    def look_end(self, newest: bool) -> None:
        """Go to the newest line and follow, which ends a pause; or to the oldest line."""
        if newest:
            self.paused, self._bottom = False, None
        else:
            self._end_at(0)

    def _end_at(self, end: int) -> None:
        numbers = self.numbers
        if end >= len(numbers) and not self.paused:
            self._bottom = None
        elif numbers:
            self._bottom = numbers[min(max(end, self._least(numbers)), len(numbers)) - 1]

    def pause(self) -> None:
        if self.paused:
            self.look_end(newest=True)
        else:
            self.hold()
            self.paused = True

    def show(self, number: int) -> None:
        """Bring a record into view, and stay there."""
        self.hold()
        place, end = bisect_left(self.numbers, number), self.end
        if not bisect_left(self.numbers, self.top) <= place < end:
            self._stay(place + 1 + self.height // 3)

    def show_last(self, number: int) -> None:
        self._stay(bisect_right(self.numbers, number))

    def _stay(self, end: int) -> None:
        """Put the bottom at a place, and do not follow there either."""
        numbers = self.numbers
        if numbers:
            self._bottom = numbers[min(max(end, 1), len(numbers)) - 1]


class RecordSearch:
    """A search in what is shown; it grows with what arrives."""

    def __init__(self, sight: VisibleRecords) -> None:
        self._sight = sight
        self._index: Index | None = None
        self.text = ""
        self.at: int | None = None
        """The number of the record that was found."""
        self._from = sight.records.taken if sight.following else sight.numbers[sight.end - 1] if sight.end else 0
        """The number where the search begins: what is typed narrows from there."""
        self._followed = sight.following and not sight.paused

    @property
    def numbers(self) -> Sequence[int]:
        return self._index.numbers if self._index is not None else ()

    def find(self, text: str) -> None:
        """Search for a text: the newest record from the bottom of the view upwards, else the next one below."""
        self.text = text
        sight = self._sight
        self._index = Index(sight.records, holding(text, sight.records, sight.shown())) if text else None
        numbers = self.numbers
        place = bisect_right(numbers, self._from)
        self.at = numbers[max(place - 1, 0)] if numbers else None
        self._show()

    def step(self, by: int) -> None:
        """Go to an older record (negative) or a newer one; stay at the last."""
        numbers = self.numbers
        if numbers and self.at is not None:
            place = bisect_left(numbers, self.at) + by
            self.at = self._from = numbers[min(max(place, 0), len(numbers) - 1)]
            self._show()

    def _show(self) -> None:
        if self.at is not None:
            self._sight.show(self.at)

    @property
    def place(self) -> tuple[int, int]:
        """The place of the record that was found, from 1, and the number of all."""
        numbers = self.numbers
        at = bisect_right(numbers, self.at) if self.at is not None else 0
        return (max(at, 1) if numbers else 0), len(numbers)

    def end(self) -> None:
        """End: a search that found nothing leaves the view where it was."""
        if self.at is None and self._followed:
            self._sight.look_end(newest=True)


class Picked:
    """Lines picked to be copied: those between two records."""

    def __init__(self, sight: VisibleRecords) -> None:
        self._sight = sight
        numbers = sight.numbers
        self.cursor = numbers[sight.end - 1] if sight.end else 0
        self._anchor = self.cursor
        self._followed = sight.following and not sight.paused
        sight.hold()

    def move(self, by: int, extend: bool) -> None:
        """Move by lines; `extend` picks the lines between, too."""
        numbers = self._sight.numbers
        if not numbers:
            return
        place = min(max(bisect_left(numbers, self.cursor) + by, 0), len(numbers) - 1)
        self.cursor = numbers[place]
        if not extend:
            self._anchor = self.cursor
        self._sight.show(self.cursor)

    def __contains__(self, number: int) -> bool:
        return min(self._anchor, self.cursor) <= number <= max(self._anchor, self.cursor)

    @property
    def records(self) -> list[Record]:
        numbers = self._sight.numbers
        low, high = sorted((self._anchor, self.cursor))
        kept = numbers[bisect_left(numbers, low) : bisect_right(numbers, high)]
        return [self._sight.records[number] for number in kept]

    def end(self) -> None:
        """End: follow again where that was so."""
        if self._followed:
            self._sight.look_end(newest=True)
