"""A trace decimated to columns of dots: each sample is looked at once, also while the picture scrolls or rescales."""

from __future__ import annotations

from math import floor, nan
from typing import NamedTuple

from multidrop.tui.curves.trace import Trace

GAP = 1.0
"""Seconds without a sample after which a line is interrupted, unless samples come more slowly."""
FIRST = 2.0
"""The interval, s, that is supposed before it is known; it is not taken for longer than that."""


class Column(NamedTuple):
    """The values in one column of dots."""

    low: float
    high: float
    last: float
    come: float
    """The value from which the line comes; not a number after a gap."""


class Columns:
    """The columns of one trace at one width of a dot, in seconds. Columns count from time 0."""

    def __init__(self, trace: Trace, dot: float, oldest: int) -> None:
        self.trace, self.dot, self.oldest = trace, dot, oldest
        """`oldest`: the first column that is known."""
        self.columns: dict[int, Column] = {}
        self.taken = trace.count_at((oldest - 1) * dot)
        self.last = oldest
        """The newest column; samples to come change nothing before it."""
        self._last_at, self._interval = nan, FIRST

    def update(self, oldest: int) -> None:
        """Take the new samples, and forget columns before `oldest` once they are many."""
        if self.taken != self.trace.count:
            for at, value in self.trace.since(self.taken):
                self._take(at, value)
            self.taken = self.trace.count
        if oldest - self.oldest > 2 * max(1, self.last - oldest):
            self.columns = {x: column for x, column in self.columns.items() if x >= oldest}
            self.oldest = oldest

    def _take(self, at: float, value: float) -> None:
        x = floor(at / self.dot)
        interval = at - self._last_at  # not a number for the first sample
        joined = interval <= max(GAP, 3 * self._interval)
        if (column := self.columns.get(x)) is not None:
            low, high, _, come = column
            self.columns[x] = Column(min(low, value), max(high, value), value, come)
        else:
            come = self._reach(x, value) if joined else nan
            self.columns[x] = Column(value, value, value, come)
        if interval > 0:
            self._interval = min(interval, FIRST)
        self._last_at, self.last = at, x

    def _reach(self, x: int, value: float) -> float:
        """Fill the columns between the last one and column `x` with a straight line; return its last value."""
        come = start = self.columns[self.last].last
        for between in range(self.last + 1, x):
            reached = start + (value - start) * (between - self.last) / (x - self.last)
            self.columns[between] = Column(reached, reached, reached, come)
            come = reached
        return come

    def extent(self, first: int, last: int) -> tuple[float, float] | None:
        """The least and the greatest value in columns `first` to `last`; None where there are none."""
        seen = [self.columns[x] for x in range(first, last + 1) if x in self.columns]
        if not seen:
            return None
        return min(each.low for each in seen), max(each.high for each in seen)
