"""The limits of what is published: samples a second of a drive, unchanged values, lines a second of a transcript.

Every time is given; no function here reads a clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from multidrop.dialects import Diagnostic

DEFAULT = "2"
"""The usual rate, samples a second of each drive."""
SLOWEST, FASTEST = 0.01, 50.0
UNCHANGED = 5.0
"""The time after which a value that has not changed is published again, s."""
LINES = 20.0
"""Lines a second of one transcript."""
BURST = 100.0
"""Lines of one transcript that are published at once after a pause."""


def parse_rate(text: str) -> float:
    """The period between two samples of a drive, s. Raises Diagnostic."""
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not SLOWEST <= rate <= FASTEST:
        valid = f"valid: {SLOWEST:g} to {FASTEST:g} samples a second of each drive"
        raise Diagnostic(f"invalid rate {text!r}", "--rate", valid)
    return 1 / rate


class Point(NamedTuple):
    """A value and its time."""

    at: float
    value: int


@dataclass
class SampleLimit:
    """The limit of one drive's samples. A poll may come early by half a period; the rate stays."""

    period: float
    due: float = float("-inf")

    def passes(self, at: float) -> bool:
        """Whether a sample is published; count it if so."""
        if at < self.due - self.period / 2:
            return False
        self.due = max(self.due, at) + self.period
        return True


@dataclass
class Curve:
    """The published points of one value."""

    shown: Point | None = None
    held: Point | None = None
    """The newest point that was not published, as its value was that of the one before."""

    def take(self, point: Point) -> Iterator[Point]:
        """Yield the points to publish now.

        A change is published with the point before it, so that a chart shows when it began.
        """
        if self.shown is not None and point.value == self.shown.value and point.at - self.shown.at < UNCHANGED:
            self.held = point
            return
        if self.held is not None and point.value != self.held.value:
            yield self.held
        self.shown, self.held = point, None
        yield point


@dataclass
class LineLimit:
    """The limit of one transcript: so many lines a second, more of them after a pause."""

    left: float = BURST
    at: float = field(default=float("-inf"))
    dropped: int = 0
    """The lines that were not published since the last one that was."""

    def passes(self, now: float) -> bool:
        """Whether a line is published now; count it either way."""
        self.left = min(BURST, self.left + (now - self.at) * LINES)
        self.at = now
        if self.left < 1:
            self.dropped += 1
            return False
        self.left -= 1
        return True

    def missing(self, now: float) -> int:
        """The number of dropped lines, once one may be published in their place; 0 otherwise."""
        if not self.dropped or not self._room(now):
            return 0
        self.left, self.at = self.left + min(BURST, (now - self.at) * LINES) - 1, now
        dropped, self.dropped = self.dropped, 0
        return dropped

    def _room(self, now: float) -> bool:
        return self.left + (now - self.at) * LINES >= 1
