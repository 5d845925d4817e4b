"""One axis beside its twin: when the two diverge, when they agree again, and the causes, the likeliest first.

Theory of operation. The limit at rest is in steps. A move adds `SKEW` seconds of the faster velocity, because the time
of requests and replies on their way is not measured. A reading in several requests adds the time that it takes. A
command or an input in the middle of a move adds as much once more, until both are at rest (`slack`): the place of the
end depends on the moment then. A difference beyond the limit counts once it has lasted for `LASTING`, and is over in
the same way.

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
    found = list(dict.fromkeys(_likely(pairs, limits)))
    if doubtful:
        found.insert(0, f"it is not known whether '{doubtful}' was executed")
    return tuple(found)


def _likely(pairs: Sequence[Pair], limits: Sequence[str]) -> Iterator[str]:
    if not any(each.expected for each in pairs) and len({each.predicted for each in pairs}) <= 1:
        # The twin was at rest all the time: a drive that reports velocity 0 was pushed.
        yield from (UNSEEN, SETTINGS) if any(each.velocity for each in pairs) else (SLIP, UNSEEN)
    elif _left_behind([(each.position, each.predicted) for each in pairs]):
        yield from _obstacles(pairs, limits)
    elif _fell_short(pairs):
        yield from (STALL, LOAD, SLIP, AT_LIMIT, SETTINGS)
    elif _slipped(pairs):
        yield from (SLIP, LOAD, UNSEEN)
    elif _left_behind([(each.predicted, each.position) for each in pairs]):
        yield from (UNSEEN, SETTINGS)
    elif _lost_speed(pairs):
        yield from (LOAD, SETTINGS, STALL)
    else:
        yield from (SETTINGS, LOAD, SLIP)


def _left_behind(places: Sequence[tuple[int, int]]) -> bool:
    """Whether the first of two is at rest at the end, and most of the difference came since: the other one moved on."""
    stands, there = places[-1]
    first = places[-1]
    for each in reversed(places):
        if each[0] != stands:
            break
        first = each
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
        apart = max(abs(each.velocity - each.expected) for each in (before, after))
        explained = apart * (after.at - before.at) + max(before.fastest, after.fastest) * SKEW
        if abs(after.difference - before.difference) > explained + JITTER:
            return True
    return False


def _obstacles(pairs: Sequence[Pair], limits: Sequence[str]) -> Iterator[str]:
    """The causes of a drive at rest: where it never began to move, its load comes before a stall."""
    if limits:
        yield f"{AT_LIMIT} ({', '.join(limits)})"
    never = len({each.position for each in pairs}) == 1
    yield from (LOAD, STALL) if never else (STALL, LOAD)
    yield AT_LIMIT if not limits else SETTINGS


def _lost_speed(pairs: Sequence[Pair]) -> bool:
    """Whether the drive became slower after it had been as fast as its twin, which went on at a constant velocity."""
    top = max(abs(each.expected) for each in pairs)
    steady = [each for each in pairs if abs(each.expected) >= (1 - EQUAL) * top]
    slower = [each.equally_fast for each in steady]
    return any(slower) and not slower[-1] and abs(steady[-1].velocity) < abs(steady[-1].expected)


LIMIT = 50
"""Default limit at rest, steps."""
LASTING = 0.1
"""Seconds after which a difference, or an agreement, counts."""
KEPT = 400
"""Pairs that are kept to find a cause."""


class Verdict(Enum):
    """News of a comparison."""

    DIVERGED = "diverged"
    AGREED = "agreed"


@dataclass
class Comparison:
    """The comparison of one axis."""

    apart: bool = False
    """The drive and its twin differ."""
    slack: float = 0.0
    """Steps by which the end of the present move is uncertain."""
    lag: float = 0.0
    """Seconds by which an input that started the present move was seen late, at most."""
    took: float = 0.0
    """Seconds that the last reading took: its parts are of different times."""
    pairs: deque[Pair] = field(default_factory=lambda: deque(maxlen=KEPT))
    """From the last two that agreed well to the present one."""
    _doubted: Pair | None = None
    """The first pair that contradicts the state."""
    furthest: Pair | None = None
    """The pair with the largest difference."""

    def limit(self, pair: Pair, rest: int) -> int:
        """The limit for a pair, steps. `rest`: the limit at rest."""
        return round(rest + self.slack + pair.fastest * (SKEW + self.took + self.lag))

    def take(self, pair: Pair, rest: int) -> Verdict | None:
        """Take a pair; return the news."""
        beyond = abs(pair.difference) > self.limit(pair, rest)
        if self.furthest is None or abs(pair.difference) > abs(self.furthest.difference):
            self.furthest = pair
        if not beyond and not self.apart and 2 * abs(pair.difference) <= rest:
            while len(self.pairs) > 1:
                self.pairs.popleft()
        self.pairs.append(pair)
        if beyond == self.apart:
            self._doubted = None
            return None
        self._doubted = self._doubted or pair
        return self.settle() if pair.at - self._doubted.at >= LASTING else None

    def settle(self) -> Verdict | None:
        """Let what was seen last count, however short it lasted."""
        if self._doubted is None:
            return None
        self.apart = not self.apart
        self._doubted = None
        return Verdict.DIVERGED if self.apart else Verdict.AGREED

    @property
    def steady(self) -> bool:
        """Whether both move, agree, and are equally fast in the last two readings."""
        last = list(self.pairs)[-2:]
        if len(last) < 2 or self._doubted is not None or self.apart:
            return False
        return all(each.velocity and each.equally_fast for each in last) and last[0].predicted != last[1].predicted

    def rests(self, rest: int) -> bool:
        """Whether both are at rest and agree, so that the uncertainty of the last move is over."""
        last = list(self.pairs)[-2:]
        settled = len(last) == 2 and all(each.at_rest for each in last) and last[0].difference == last[1].difference
        return settled and not self.apart and abs(last[1].difference) <= self.limit(last[1], rest)

    def disturbed(self, velocity: float, late: float = 0.0) -> None:
        """Note a command or an input during a move of this velocity, seen up to `late` s after it acted."""
        self.slack += abs(velocity) * (SKEW + late)
        self.lag = max(self.lag, late)

    def calm(self) -> None:
        """Note that the drive and its twin are at rest: the next move is as certain as the first."""
        self.slack = self.lag = 0.0
