"""The part of a transcript in view: a filter, the line at the bottom, a search, a selection. It paints nothing.

A view follows the newest line until its reader goes up, pauses, searches or selects. Then it stays on the line at its
bottom, named by its number, however much arrives, until that line is dropped.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from multidrop.shell.transcripts import EVERYTHING, Filter
from multidrop.tui.screen_model import Record
from multidrop.tui.widgets.finding import Holding, Index, Shown
from multidrop.tui.widgets.records import Records


class Sight:
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

    def shown(self) -> Shown | None:
        """Make what chooses the shown records, from the first one on; None: all are shown."""
        return Shown(self.filter, self._filtered_from) if self.filter else None

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
        """The number of shown records below the view."""
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
        """Stop the scrolling, or let it go on."""
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
        """Bring a record to the bottom of the view."""
        self._stay(bisect_right(self.numbers, number))

    def _stay(self, end: int) -> None:
        """Put the bottom at a place, and do not follow there either."""
        numbers = self.numbers
        if numbers:
            self._bottom = numbers[min(max(end, 1), len(numbers)) - 1]


class Search:
    """A search in what is shown; it grows with what arrives."""

    def __init__(self, sight: Sight) -> None:
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
        """The numbers of all records that hold the text."""
        return self._index.numbers if self._index is not None else ()

    def find(self, text: str) -> None:
        """Search for a text: the newest record from the bottom of the view upwards, else the next one below."""
        self.text = text
        sight = self._sight
        self._index = Index(sight.records, Holding(text, sight.records, sight.shown())) if text else None
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

    def __init__(self, sight: Sight) -> None:
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
        """The picked records, oldest first."""
        numbers = self._sight.numbers
        low, high = sorted((self._anchor, self.cursor))
        kept = numbers[bisect_left(numbers, low) : bisect_right(numbers, high)]
        return [self._sight.records[number] for number in kept]

    def end(self) -> None:
        """End: follow again where that was so."""
        if self._followed:
            self._sight.look_end(newest=True)
