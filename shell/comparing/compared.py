"""A drive and what predicts its motion: each sample is compared, axis by axis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, Protocol, TypeVar

from multidrop.dialects.family import Motion
from multidrop.dialects.values import Conditions
from multidrop.drives.events import Sample
from multidrop.shell.comparing.differences import AxisComparison, Pair, Verdict, causes
from multidrop.shell.events import Agreed, Diverged, Predicted, TwinEvent

SWITCHES = {"lim+": "limit+", "lim-": "limit-"}
"""Limits by the function of their lamps."""


class Predicts(Protocol):
    """The part of a twin that a sample is compared with."""

    def motion(self, at: float) -> dict[str, Motion]:
        """Position and velocity of each axis at a time."""

    def align(self, axis: str, position: int, at: float) -> None:
        """Set the position of an axis at rest."""


T = TypeVar("T", bound=Predicts)


class Compared(Generic[T]):
    """A drive and what predicts its motion, axis by axis."""

    def __init__(self, twin: T) -> None:
        self.twin = twin
        self.doubtful = ""
        """The last line of which it is not known whether the drive executed it."""
        self.axes: dict[str, AxisComparison] = {}
        self.differences: dict[str, int] = {}
        """The last difference of each axis."""
        self._causes: dict[str, tuple[str, ...]] = {}
        """The candidates for the present difference of each axis."""
        self._took = 0.0
        """Seconds that the last sample may be uncertain: from its first to its last request, and its delay."""
        self._limits: dict[str, tuple[str, ...]] = {}

    def velocities(self, at: float) -> dict[str, int]:
        return {axis: motion.velocity for axis, motion in self.twin.motion(at).items()}

    @property
    def causes(self) -> tuple[str, ...]:
        """The candidates for the differences that are above the limit now, of all axes."""
        return tuple(dict.fromkeys(cause for named in self._causes.values() for cause in named))

    def comparison(self, axis: str) -> AxisComparison:
        return self.axes.setdefault(axis, AxisComparison())

    def disturbed(self, at: float, late: float = 0.0) -> None:
        """Note a command or an input at this time, or up to `late` s later.

        The end of a move that is under way depends on the moment.
        """
        for axis, velocity in self.velocities(at).items():
            self.comparison(axis).disturbed(velocity, late)

    def conditions(self, found: tuple[Conditions, ...]) -> None:
        """Take the lamps of the drive, which others read."""
        for conditions in found:
            lit = [SWITCHES[lamp.function] for lamp in conditions.lamps if lamp.on and lamp.function in SWITCHES]
            self._limits[conditions.axis] = tuple(lit)

    def sample(self, sample: Sample, rest: int) -> Iterator[TwinEvent]:
        """Compare a sample with the twin. `rest`: the limit at rest, steps."""
        expected = self.twin.motion(sample.at).get(sample.axis)
        if expected is None:  # a motor that the simulated module does not have
            return
        pair = Pair(sample.at, sample.position, sample.velocity, expected.position, expected.velocity)
        axis = self.comparison(sample.axis)
        self.differences[sample.axis] = pair.difference
        yield Predicted(sample.at, sample.address, expected.position, expected.velocity, pair.difference, sample.axis)
        axis.took = self._took
        verdict = axis.take(pair, rest)
        if verdict is not None:
            yield self.news(verdict, axis, sample.address, sample.axis, rest)
        if axis.rests(rest):
            if axis.slack and pair.difference:  # the end of the move could not be known to the step
                self.twin.align(sample.axis, sample.position, sample.at)
            axis.calm()

    def news(
        self, verdict: Verdict, comparison: AxisComparison, address: str, axis: str, rest: int
    ) -> Diverged | Agreed:
        """Make the event of a verdict; an agreement shows that no line was lost."""
        pairs = list(comparison.pairs)
        if verdict is Verdict.AGREED:
            self.doubtful = ""
            self._causes.pop(axis, None)
            return Agreed(pairs[-1].at, address, axis)
        first = comparison.since or pairs[-1]
        last, self._causes[axis] = pairs[-1], causes(pairs, self.doubtful, self._limits.get(axis, ()))
        return Diverged(first.at, address, last.difference, comparison.limit(last, rest), self._causes[axis], axis)
