"""One axis beside its twin: when the two diverge, when they agree again, and the causes, the likeliest first.

Theory of operation. The limit at rest is in steps. A move adds `SKEW` seconds of the faster velocity, because the time
of requests and replies on their way is not measured. A reading in several requests adds the time that it takes. A
command or an input in the middle of a move adds as much once more, until both are at rest (`slack`): the place of the
end depends on the moment then. A reply that came late, or a gap between two readings, adds its time until both are at
rest or were seen to agree without it (`lag`): what was delayed may have been the command. A difference beyond the limit
counts once it has lasted for `LASTING`, and is over in the same way. Where the drive stands and its twin has moved on,
it lasts for `DOUBT_TIME`: meanwhile the lamps of the drive are read.

What a twin cannot follow (`lost`), it leaves uncompared until the drive has been at rest for `SETTLED`, or both have
agreed for as long; then it takes the position.

A cause is named of what was measured and predicted since the two last agreed. A drive at rest while its twin moves is
held up: by a limit, a stall or its load. Equal velocities with positions apart are a slip. Other velocities are other
settings, or a load. A drive that moves beside a twin that never did got a command from elsewhere.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

STALL = "stall"
SLIP = "slip"
LOAD = "load"
AT_LIMIT = "a limit"
SETTINGS = "settings changed"
UNSEEN = "a command not seen here"
PUSHED = "a push by hand"
HOMING = "homing"
EQUAL = 0.02
"""Velocities that differ by less than this part are equal."""


SKEW = 0.03
"""Seconds between the time of a request and its execution, at most."""
SPARSE = 0.5
"""Seconds between two readings beyond which their velocities do not explain what was between."""
JITTER = 20
"""Steps of a difference that are no jump."""


class Pair(NamedTuple):
    """Position and velocity of a drive as measured, and of its twin as predicted, at one time."""

    at: float
    position: int
    velocity: int
    predicted: int
    expected: int
    """The predicted velocity."""

    @property
    def difference(self) -> int:
        return self.position - self.predicted

    @property
    def fastest(self) -> int:
        return max(abs(self.velocity), abs(self.expected))

    @property
    def at_rest(self) -> bool:
        return not (self.velocity or self.expected)

    @property
    def equally_fast(self) -> bool:
        return abs(abs(self.velocity) - abs(self.expected)) <= EQUAL * self.fastest


def causes(pairs: Sequence[Pair], doubtful: str = "", limits: Sequence[str] = ()) -> tuple[str, ...]:
    """Name the causes. `pairs`: from the last that agreed to the present one.

    `doubtful`: the last line of which it is not known whether it was executed. `limits`: the active limits, by the
    function of their lamps.
    """
    likely = list(dict.fromkeys(_likely(pairs, limits)))
    if doubtful:
        likely.insert(0, f"it is not known whether '{doubtful}' was executed")
    return tuple(likely)


def _likely(pairs: Sequence[Pair], limits: Sequence[str]) -> Iterator[str]:
    if unmoved(pairs):  # a drive that reports velocity 0 was pushed
        yield from (UNSEEN, SETTINGS) if any(pair.velocity for pair in pairs) else (SLIP, PUSHED, UNSEEN)
    elif _left_behind([(pair.position, pair.predicted) for pair in pairs]):
        # The causes of a drive at rest: where it never began to move, its load comes before a stall.
        if limits:
            yield f"{AT_LIMIT} ({', '.join(limits)})"
        never = len({pair.position for pair in pairs}) == 1
        yield from (LOAD, STALL) if never else (STALL, LOAD)
        yield AT_LIMIT if not limits else SETTINGS
    elif _fell_short(pairs):
        yield from (STALL, LOAD, SLIP, AT_LIMIT, SETTINGS)
    elif _slipped(pairs):
        yield from (SLIP, LOAD, UNSEEN)
    elif _left_behind([(pair.predicted, pair.position) for pair in pairs]):
        yield from (UNSEEN, SETTINGS)
    elif _lost_speed(pairs):
        yield from (LOAD, SETTINGS, STALL)
    else:
        yield from (SETTINGS, LOAD, SLIP)


def unmoved(pairs: Sequence[Pair]) -> bool:
    """Whether the twin was at rest all the time."""
    return not any(pair.expected for pair in pairs) and len({pair.predicted for pair in pairs}) <= 1


def _left_behind(places: Sequence[tuple[int, int]]) -> bool:
    """Whether the first of two is at rest at the end, and most of the difference came since: the other one moved on."""
    stands, there = places[-1]
    first = places[-1]
    for place in reversed(places):
        if place[0] != stands:
            break
        first = place
    apart = abs(there - stands)
    return apart > abs(first[1] - stands) and 2 * abs(there - first[1]) >= apart


def _fell_short(pairs: Sequence[Pair]) -> bool:
    """Whether the drive came less far than its twin between two readings with a long time between them."""
    for before, after in pairwise(pairs):
        due, came = after.predicted - before.predicted, after.position - before.position
        most = 2 * abs(due - came) >= abs(pairs[-1].difference)
        if most and after.at - before.at > SPARSE and abs(due) > JITTER and 0 <= came * due < due * due:
            return True
    return False


def _slipped(pairs: Sequence[Pair]) -> bool:
    """Whether the difference has jumped: no velocity between two readings explains it."""
    for before, after in pairwise(pairs):
        apart = max(abs(pair.velocity - pair.expected) for pair in (before, after))
        explained = apart * (after.at - before.at) + max(before.fastest, after.fastest) * SKEW
        if abs(after.difference - before.difference) > explained + JITTER:
            return True
    return False


def _lost_speed(pairs: Sequence[Pair]) -> bool:
    """Whether the drive became slower after it had been as fast as its twin, which went on at a constant velocity."""
    top = max(abs(pair.expected) for pair in pairs)
    steady = [pair for pair in pairs if abs(pair.expected) >= (1 - EQUAL) * top]
    slower = [pair.equally_fast for pair in steady]
    return any(slower) and not slower[-1] and abs(steady[-1].velocity) < abs(steady[-1].expected)


DIFFERENCE_LIMIT = 50
"""Default limit at rest, steps."""
LASTING = 0.1
"""Seconds after which a difference, or an agreement, counts."""
DOUBT_TIME = 0.7
"""Seconds after which the difference of a drive counts that stands while its twin has moved on."""
SETTLED = 1.0
"""Seconds of rest, or of agreement, after which a twin takes a position that it could not follow."""
GAP_TIMES = 3
"""A time between two readings is a gap if it is more than so many times the usual one."""
FADING = 0.95
"""The part of a delay that is still expected after a further reading without it."""
MOST_KEPT_PAIRS = 400
"""Pairs that are kept to find a cause."""


class Verdict(Enum):
    """News of a comparison."""

    DIVERGED = "diverged"
    AGREED = "agreed"


@dataclass
class AxisComparison:
    """The comparison of one axis."""

    apart: bool = False
    """The drive and its twin differ."""
    slack: float = 0.0
    """Steps by which the end of the present move is uncertain."""
    lag: float = 0.0
    """Seconds by which an input that started the present move was seen late, at most."""
    took: float = 0.0
    """Seconds that the last reading took: its parts are of different times."""
    pairs: deque[Pair] = field(default_factory=lambda: deque(maxlen=MOST_KEPT_PAIRS))
    """From the last two that agreed well to the present one."""
    doubted: Pair | None = None
    """The first pair that contradicts the state."""
    since: Pair | None = None
    """The first pair of the present state."""
    furthest: Pair | None = None
    """The pair with the largest difference."""
    lost: str = ""
    """The reason for which the twin cannot follow; empty: it can."""
    learned: bool = False
    """The twin was shown where a switch is since it could not follow."""
    _usual: float = 0.0
    """Seconds between two readings; 0: not known."""
    _undisturbed: int = 0
    """The pairs since the last command or input."""
    _still: Pair | None = None
    """The first pair at the present place of the drive."""
    _beyond_at: float = 0.0

    def limit(self, pair: Pair, rest: int) -> int:
        """The limit for a pair, steps. `rest`: the limit at rest."""
        return round(self._limit(pair, rest, self.lag))

    def _limit(self, pair: Pair, rest: int, lag: float) -> float:
        fastest = max(
            [last_pair.fastest for last_pair in [*self.pairs][-1:]], default=0
        )  # a reading may begin while it moves
        return rest + self.slack + max(pair.fastest, fastest) * (SKEW + self.took + lag)

    def take(self, pair: Pair, rest: int) -> Verdict | None:
        """Take a pair; return the news."""
        self._time(pair, rest)
        beyond = abs(pair.difference) > self.limit(pair, rest)
        if self.furthest is None or abs(pair.difference) > abs(self.furthest.difference):
            self.furthest = pair
        if not beyond and not self.apart and 2 * abs(pair.difference) <= rest:
            while len(self.pairs) > 1:
                self.pairs.popleft()
        self.pairs.append(pair)
        self._undisturbed += 1
        if self._still is None or pair.velocity or abs(pair.position - self._still.position) > JITTER:
            self._still = pair
        if beyond:
            self._beyond_at = pair.at
        if beyond == self.apart or self.lost:
            self.doubted = None
            return None
        self.doubted = self.doubted or pair
        return self.settle() if pair.at - self.doubted.at >= (DOUBT_TIME if self.held else LASTING) else None

    def _time(self, pair: Pair, rest: int) -> None:
        """Take the time since the reading before into the limit."""
        if not self.pairs:
            return
        interval = pair.at - self.pairs[-1].at
        if self._usual and interval > GAP_TIMES * self._usual:
            self.lag = max(self.lag, interval - self._usual)
        else:
            self._usual = FADING * self._usual + (1 - FADING) * interval if self._usual else interval
            if self.steady and pair.equally_fast and abs(pair.difference) <= self._limit(pair, rest, -self.took):
                self.lag *= FADING

    @property
    def held(self) -> bool:
        """Whether a difference is in doubt of a drive that stands, and that its twin has moved explains it."""
        standing = self.doubted is not None and not self.apart and not self.pairs[-1].velocity
        return standing and causes(self.pairs)[0] not in (SLIP, UNSEEN)

    def lose(self, why: str, at: float) -> None:
        """Note that the twin cannot follow from here on."""
        self.lost = self.lost or why
        self._still, self._beyond_at, self.doubted = None, at, None

    def over(self, searching: bool) -> bool:
        """Whether what the twin could not follow is over. `searching`: the twin is homing."""
        last, still = self.pairs[-1], self._still
        rested = still is not None and last.at - still.at >= SETTLED
        return bool(self.lost) and (rested or (not searching and last.at - self._beyond_at >= SETTLED))

    def begin_again(self) -> None:
        """Begin anew, once the twin has the position of the drive."""
        self.lost, self.learned, self.apart, self.doubted = "", False, False, None
        self.pairs.clear()
        self.calm()

    def settle(self) -> Verdict | None:
        """Let what was seen last count, however short it lasted."""
        if self.doubted is None:
            return None
        self.apart = not self.apart
        self.since, self.doubted = self.doubted, None
        return Verdict.DIVERGED if self.apart else Verdict.AGREED

    @property
    def steady(self) -> bool:
        """Whether both move, agree, and are equally fast in the last two readings."""
        last = list(self.pairs)[-2:]
        if len(last) < 2 or self.doubted is not None or self.apart:
            return False
        return all(pair.velocity and pair.equally_fast for pair in last) and last[0].predicted != last[1].predicted

    def rests(self, rest: int) -> bool:
        """Whether both are at rest and agree, so that the uncertainty of the last move is over."""
        last = list(self.pairs)[-2:]
        settled = self._undisturbed > 1 and len(last) == 2 and all(pair.at_rest for pair in last)
        settled = settled and last[0].difference == last[1].difference
        return settled and not self.apart and abs(last[1].difference) <= self.limit(last[1], rest)

    def disturbed(self, velocity: float, late: float = 0.0) -> None:
        """Note a command or an input during a move of this velocity, seen up to `late` s after it acted."""
        self.slack += abs(velocity) * (SKEW + late + self.lag)  # it may have begun late, too
        self.lag = max(self.lag, late)
        self._undisturbed = 0

    def calm(self) -> None:
        """Note that the drive and its twin are at rest: the next move is as certain as the first."""
        self.slack = self.lag = 0.0
