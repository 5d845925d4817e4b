"""A drive and its twin: what the drive took reaches the twin, and each sample is compared with it."""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign, inf
from typing import Generic, Protocol, TypeVar

from multidrop.dialects import End, Priority
from multidrop.dialects.family import Motion
from multidrop.dialects.values import Conditions
from multidrop.drives.conversations import ASKING
from multidrop.drives.drive import Drive
from multidrop.drives.events import Concluded, Sample, Transaction
from multidrop.shell.events import Agreed, Diverged, Predicted, TwinEvent
from multidrop.shell.twins.causes import Known, Pair, causes
from multidrop.shell.twins.comparing import Comparison, Verdict
from multidrop.shell.twins.twin import Twin

# The requests of a conversation that the drive has taken: only these reach its twin.
#
# A request counts once the whole conversation is over, at the time at which its last byte had left. In a conversation
# that succeeded, every request counts but those that the drive refused as damaged, which were repeated. In one that
# failed, the last command counts only if the drive acknowledged it. Otherwise its execution is doubtful.


NOT_TAKEN = (End.REFUSED, End.NAK, End.STOPPED)


def reading_took(concluded: Concluded) -> float | None:
    """The time between the first and the last request of a reading of motion, s; None for another conversation."""
    result = concluded.outcome.result[0] if concluded.outcome.result else None
    first = result[0] if isinstance(result, tuple) and result else None
    if not isinstance(first, Motion) or not concluded.transactions:
        return None
    return concluded.transactions[-1].transmitted_at - concluded.transactions[0].transmitted_at


def taken(concluded: Concluded) -> Iterator[Transaction]:
    """Yield the transactions of which the drive has taken the request; no polls."""
    commands = [each for each in concluded.transactions if each.request.kind not in ASKING]
    failed_with = commands[-1] if concluded.outcome.error is not None and commands else None
    for each in concluded.transactions:
        doubtful = each is failed_with and not each.reply.acknowledged
        polled = each.request.priority is Priority.POLL
        if each.sent and each.reply.end not in NOT_TAKEN and not doubtful and not polled:
            yield each


DRIFT = 0.005
"""The part of the time by which a program may run faster or slower than in the twin."""
LONGEST = 30.0
"""Seconds without a steady move whose drift is made good at once, at most."""
FADING = 0.95
"""The part of a delay that is still expected after a further reply."""
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
        self.axes: dict[str, Comparison] = {}
        self.differences: dict[str, int] = {}
        """The last difference of each axis."""
        self._causes: dict[str, tuple[str, ...]] = {}
        """The candidates for the present difference of each axis."""
        self._took = 0.0
        """Seconds that the last sample may be uncertain: from its first to its last request, and its delay."""
        self._limits: dict[str, tuple[str, ...]] = {}

    def velocities(self, at: float) -> dict[str, int]:
        """The predicted velocity of each axis."""
        return {axis: motion.velocity for axis, motion in self.twin.motion(at).items()}

    @property
    def causes(self) -> tuple[str, ...]:
        """The candidates for the differences that are above the limit now, of all axes."""
        return tuple(dict.fromkeys(each for named in self._causes.values() for each in named))

    def comparison(self, axis: str) -> Comparison:
        """The comparison of an axis."""
        return self.axes.setdefault(axis, Comparison())

    def disturbed(self, at: float, late: float = 0.0) -> None:
        """Note a command or an input at this time, or up to `late` s later.

        The end of a move that is under way depends on the moment.
        """
        for axis, velocity in self.velocities(at).items():
            self.comparison(axis).disturbed(velocity, late)

    def conditions(self, found: tuple[Conditions, ...]) -> None:
        """Take the lamps of the drive, which others read."""
        for each in found:
            lit = [SWITCHES[lamp.function] for lamp in each.lamps if lamp.on and lamp.function in SWITCHES]
            self._limits[each.axis] = tuple(lit)

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
            self._settle(axis, pair, sample)

    def news(self, verdict: Verdict, comparison: Comparison, address: str, axis: str, rest: int) -> Diverged | Agreed:
        """Make the event of a verdict; an agreement shows that no line was lost."""
        pairs = list(comparison.pairs)
        if verdict is Verdict.AGREED:
            self.doubtful = ""
            self._causes.pop(axis, None)
            return Agreed(pairs[-1].at, address, axis)
        known = Known(self.doubtful, self._limits.get(axis, ()))
        first = next((each for each in pairs if abs(each.difference) > comparison.limit(each, rest)), pairs[-1])
        last, self._causes[axis] = pairs[-1], causes(pairs, known)
        return Diverged(first.at, address, last.difference, comparison.limit(last, rest), self._causes[axis], axis)

    def _settle(self, axis: Comparison, pair: Pair, sample: Sample) -> None:
        """Have the twin take the place of the drive after a move whose end could not be known to the step."""
        if axis.slack and pair.difference:
            self.twin.align(sample.axis, sample.position, sample.at)
        axis.calm()


class Beside(Compared[Twin]):
    """One drive with its twin. Times are those of the host's clock."""

    def __init__(self, drive: Drive, twin: Twin, begun: float) -> None:
        super().__init__(twin)
        self.drive, self.begun = drive, begun
        self._read_at = begun
        """When the inputs were last read."""
        self._in_step_at = begun
        self._quickest = inf
        """The shortest time from a reading's request to its reply, s."""
        self._delay = 0.0
        """Seconds by which the last replies came later than that: a request or a stop may take as much on its way."""

    def sample(self, sample: Sample, rest: int) -> Iterator[TwinEvent]:
        """Compare a sample with the twin, and keep the twin in step."""
        yield from super().sample(sample, rest)
        if (comparison := self.axes.get(sample.axis)) is not None:
            self._keep_step(comparison)

    def _keep_step(self, comparison: Comparison) -> None:
        """Shift the twin's time a little where a drive is early or late at an equal velocity.

        The lines of its program take another time than the simulator's. No shift changes where the two rest.
        """
        if not comparison.steady:
            return
        before, pair = list(comparison.pairs)[-2:]
        most = DRIFT * min(pair.at - self._in_step_at, LONGEST)
        late = pair.difference / copysign(pair.fastest, pair.predicted - before.predicted)
        self.twin.shift(max(-most, min(most, late)))
        self._in_step_at = pair.at

    # What reaches the twin

    def concluded(self, concluded: Concluded) -> None:
        """Take a conversation with the drive, or with all drives."""
        if (took := reading_took(concluded)) is not None:
            last = concluded.transactions[-1]
            self._quickest = min(self._quickest, last.ended_at - last.transmitted_at)
            self._note_delay(last)
            self._took = took + self._delay
        for each in taken(concluded):
            data = each.request.codec.encode(each.request)
            disturbs = each.request.kind not in ASKING
            if disturbs and each.reply.acknowledged:
                self._note_delay(each)
            self._acts(data, each.transmitted_at, disturbs)
        if concluded.unproven:
            self.doubtful = concluded.unproven

    def _note_delay(self, transaction: Transaction) -> None:
        """Note how late a reply came. A delay that was seen fades with further replies."""
        delay = transaction.ended_at - transaction.transmitted_at - self._quickest
        self._delay = max(0.0, delay, FADING * self._delay)

    def stopped(self, data: bytes, at: float) -> None:
        """Take the bytes of a stop, or those that a person typed in raw mode."""
        self._acts(data, at)

    def inputs(self, value: int, at: float) -> None:
        """Take the inputs as they were read; they may have changed at any time since the reading before."""
        before = self.velocities(at)
        if self.twin.put(value, at):
            for axis, velocity in before.items():
                self.comparison(axis).disturbed(velocity, at - self._read_at)
        self._read_at = at

    def _acts(self, data: bytes, at: float, disturbs: bool = True) -> None:
        if disturbs:
            self.disturbed(at, self._delay)
        self.twin.hear(data, at)
