"""The samples of one quantity over the last minutes, decimated to columns of dots.

Each sample is looked at once, also while the picture scrolls or rescales.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator
from math import floor, nan
from typing import NamedTuple

from multidrop.drives.events import Sample, Valued
from multidrop.shell.events import Predicted
from multidrop.shell.roles import DIFFERENCE

KEPT_SECONDS = 660.0
"""Seconds of samples that are kept: the longest span, and some more to look back."""
MOST_POINTS = 65_536
"""Samples that are kept at most."""
OVERDUE = 1.5
"""Seconds after which a sample is missed."""
_SLACK = 1024
"""Samples that may be too old before they are dropped together."""


PREDICTED = {"position": "predicted position", "velocity": "predicted velocity"}
"""The predicted quantity for each measured one."""


class TraceQuantity(NamedTuple):
    """The quantity of a trace: `word` is `position`, `velocity`, one of a twin, or a word of the drive's language."""

    bus: str
    address: str
    axis: str
    word: str


class Trace:
    """Times and values of one quantity, times rising."""

    def __init__(self) -> None:
        self.at, self.values = array("d"), array("d")
        self.dropped = 0
        """Number of samples that were dropped at the beginning."""

    def add(self, at: float, value: float) -> None:
        """Take a sample; one that is older than the last one counts as simultaneous with it."""
        if self.at and at < self.at[-1]:
            at = self.at[-1]
        self.at.append(at)
        self.values.append(value)
        if len(self.at) > MOST_POINTS or (len(self.at) % _SLACK == 0 and at - self.at[_SLACK - 1] > KEPT_SECONDS):
            del self.at[:_SLACK], self.values[:_SLACK]
            self.dropped += _SLACK

    @property
    def count(self) -> int:
        """Number of samples so far, with those that were dropped."""
        return self.dropped + len(self.at)

    def since(self, count: int) -> Iterator[tuple[float, float]]:
        """The samples after the first `count` ones."""
        begin = max(0, count - self.dropped)
        return zip(self.at[begin:], self.values[begin:], strict=True)

    def count_at(self, at: float) -> int:
        """Number of samples before a time."""
        return self.dropped + bisect_left(self.at, at)

    def overdue(self, now: float) -> float:
        """The age of the last sample, s, if one should have come since; else 0."""
        if len(self.at) < 2:
            return 0.0
        age = now - self.at[-1]
        return age if age > max(OVERDUE, 3 * min(self.at[-1] - self.at[-2], OVERDUE)) else 0.0

    def rate(self, now: float) -> float:
        """Samples per second over the last two."""
        return (len(self.at) - bisect_left(self.at, now - 2.0)) / 2.0


class Traces:
    """The traces of all that is plotted or shown."""

    def __init__(self) -> None:
        self._traces: defaultdict[TraceQuantity, Trace] = defaultdict(Trace)

    def add(self, quantity: TraceQuantity, at: float, value: float) -> None:
        self._traces[quantity].add(at, value)

    def take(self, bus: str, event: Sample | Valued) -> None:
        if isinstance(event, Valued):
            self.add(TraceQuantity(bus, event.address, "", event.word), event.at, event.value)
        else:
            self.add(TraceQuantity(bus, event.address, event.axis, "position"), event.at, event.position)
            self.add(TraceQuantity(bus, event.address, event.axis, "velocity"), event.at, event.velocity)

    def predict(self, bus: str, event: Predicted) -> None:
        """Take a prediction of a drive's twin."""
        drive = (bus, event.address, event.axis)
        self.add(TraceQuantity(*drive, PREDICTED["position"]), event.at, event.position)
        self.add(TraceQuantity(*drive, PREDICTED["velocity"]), event.at, event.velocity)
        self.add(TraceQuantity(*drive, DIFFERENCE), event.at, event.difference)

    def get(self, quantity: TraceQuantity) -> Trace | None:
        """The trace of a quantity; None before its first sample."""
        return self._traces.get(quantity)

    def axes(self, bus: str, address: str) -> list[str]:
        """The axes of a drive that were read; empty before the first sample."""
        return [trace.axis for trace in self._traces if trace[:2] == (bus, address) and trace.word == "position"]

    def rename(self, before: str, now: str) -> None:
        for trace in [each for each in self._traces if each.bus == before]:
            self._traces[trace._replace(bus=now)] = self._traces.pop(trace)

    def forget(self, bus: str) -> None:
        for trace in [each for each in self._traces if each.bus == bus]:
            del self._traces[trace]


SHORTEST_GAP = 1.0
"""Seconds without a sample after which a line is interrupted, unless samples come more slowly."""
FIRST_INTERVAL = 2.0
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
        self._last_at, self._interval = nan, FIRST_INTERVAL

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
        joined = interval <= max(SHORTEST_GAP, 3 * self._interval)
        if (column := self.columns.get(x)) is not None:
            low, high, _, come = column
            self.columns[x] = Column(min(low, value), max(high, value), value, come)
        else:
            come = self._reach(x, value) if joined else nan
            self.columns[x] = Column(value, value, value, come)
        if interval > 0:
            self._interval = min(interval, FIRST_INTERVAL)
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
        return min(column.low for column in seen), max(column.high for column in seen)
