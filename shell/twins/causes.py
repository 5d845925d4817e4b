"""Cause candidates of a difference between a drive and its twin, the likeliest first.

Theory of operation. Only what was measured and predicted since the two last agreed counts. A drive at rest while its
twin moves is held up: by a limit, a stall or its load. Equal velocities with positions apart are a slip. Other
velocities are other settings, or a load. A drive that moves beside a twin that never did got a command from elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

STALL = "stall"
SLIP = "slip"
LOAD = "load"
LIMIT = "a limit"
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
        """Measured minus predicted, steps."""
        return self.position - self.predicted

    @property
    def fastest(self) -> int:
        """The larger of both speeds."""
        return max(abs(self.velocity), abs(self.expected))

    @property
    def at_rest(self) -> bool:
        """Whether both report velocity 0."""
        return not (self.velocity or self.expected)

    @property
    def equally_fast(self) -> bool:
        """Whether both velocities are equal."""
        return abs(abs(self.velocity) - abs(self.expected)) <= EQUAL * self.fastest


class Known(NamedTuple):
    """Other facts about the drive."""

    doubtful: str = ""
    """The last line of which it is not known whether it was executed."""
    limits: tuple[str, ...] = ()
    """The active limits, by the function of their lamps."""


def causes(pairs: Sequence[Pair], known: Known) -> tuple[str, ...]:
    """Name the causes. `pairs`: from the last that agreed to the present one."""
    found = list(dict.fromkeys(_likely(pairs, known.limits)))
    if known.doubtful:
        found.insert(0, f"it is not known whether '{known.doubtful}' was executed")
    return tuple(found)


def _likely(pairs: Sequence[Pair], limits: Sequence[str]) -> Iterator[str]:
    if not _moved(pairs, [each.predicted for each in pairs], [each.expected for each in pairs]):
        yield from _alone(pairs)
    elif _held_up(pairs):
        yield from _obstacles(pairs, limits)
    elif _fell_short(pairs):
        yield from (STALL, LOAD, SLIP, LIMIT, SETTINGS)
    elif _slipped(pairs):
        yield from (SLIP, LOAD, UNSEEN)
    elif _outrun(pairs):
        yield from (UNSEEN, SETTINGS)
    elif _lost_speed(pairs):
        yield from (LOAD, SETTINGS, STALL)
    else:
        yield from (SETTINGS, LOAD, SLIP)


def _moved(pairs: Sequence[Pair], positions: Sequence[int], velocities: Sequence[int]) -> bool:
    return any(velocities) or len(set(positions)) > 1


def _alone(pairs: Sequence[Pair]) -> Iterator[str]:
    """The causes where the twin was at rest all the time: a drive that reports velocity 0 was pushed."""
    yield from (UNSEEN, SETTINGS) if any(each.velocity for each in pairs) else (SLIP, UNSEEN)


def _held_up(pairs: Sequence[Pair]) -> bool:
    """Whether the drive is at rest at the end, and most of the difference came since: its twin moved on."""
    return _left_behind([(each.position, each.predicted) for each in pairs])


def _outrun(pairs: Sequence[Pair]) -> bool:
    """Whether the twin is at rest at the end, and most of the difference came since: the drive moved on."""
    return _left_behind([(each.predicted, each.position) for each in pairs])


def _left_behind(places: Sequence[tuple[int, int]]) -> bool:
    """Whether the first of two is at rest at the end, and the other one moved away from it meanwhile."""
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
        yield f"{LIMIT} ({', '.join(limits)})"
    never = len({each.position for each in pairs}) == 1
    yield from (LOAD, STALL) if never else (STALL, LOAD)
    yield LIMIT if not limits else SETTINGS


def _lost_speed(pairs: Sequence[Pair]) -> bool:
    """Whether the drive became slower after it had been as fast as its twin, which went on at a constant velocity."""
    top = max(abs(each.expected) for each in pairs)
    steady = [each for each in pairs if abs(each.expected) >= (1 - EQUAL) * top]
    slower = [each.equally_fast for each in steady]
    return any(slower) and not slower[-1] and abs(steady[-1].velocity) < abs(steady[-1].expected)
