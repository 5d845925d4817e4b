"""One axis beside its twin: when the two diverge, and when they agree again.

Theory of operation. The limit at rest is in steps. A move adds `SKEW` seconds of the faster velocity, because the time
of requests and replies on their way is not measured. A reading in several requests adds the time that it takes. A
command or an input in the middle of a move adds as much once more, until both are at rest (`slack`): the place of the
end depends on the moment then. A difference beyond the limit counts once it has lasted for `LASTING`, and is over in
the same way.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from enum import Enum

from multidrop.shell.twins.causes import SKEW, Pair

LIMIT = 50
"""Default limit at rest, steps."""
LASTING = 0.1
"""Seconds after which a difference, or an agreement, counts."""
KEPT = 400
"""Pairs that are kept to find a cause."""


class State(Enum):
    """The relation of a drive and its twin."""

    AGREE = "agree"
    APART = "apart"


class Verdict(Enum):
    """News of a comparison."""

    DIVERGED = "diverged"
    AGREED = "agreed"


@dataclass
class Comparison:
    """The comparison of one axis."""

    state: State = State.AGREE
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
        if not beyond and self.state is State.AGREE and 2 * abs(pair.difference) <= rest:
            while len(self.pairs) > 1:
                self.pairs.popleft()
        self.pairs.append(pair)
        if beyond == (self.state is State.APART):
            self._doubted = None
            return None
        self._doubted = self._doubted or pair
        return self.settle() if pair.at - self._doubted.at >= LASTING else None

    def settle(self) -> Verdict | None:
        """Let what was seen last count, however short it lasted."""
        if self._doubted is None:
            return None
        self.state = State.APART if self.state is State.AGREE else State.AGREE
        self._doubted = None
        return Verdict.DIVERGED if self.state is State.APART else Verdict.AGREED

    @property
    def steady(self) -> bool:
        """Whether both move, agree, and are equally fast in the last two readings."""
        last = list(self.pairs)[-2:]
        if len(last) < 2 or self._doubted is not None or self.state is State.APART:
            return False
        return all(each.velocity and each.equally_fast for each in last) and last[0].predicted != last[1].predicted

    def rests(self, rest: int) -> bool:
        """Whether both are at rest and agree, so that the uncertainty of the last move is over."""
        last = list(self.pairs)[-2:]
        settled = len(last) == 2 and all(each.at_rest for each in last) and last[0].difference == last[1].difference
        return settled and self.state is State.AGREE and abs(last[1].difference) <= self.limit(last[1], rest)

    def disturbed(self, velocity: float, late: float = 0.0) -> None:
        """Note a command or an input during a move of this velocity, seen up to `late` s after it acted."""
        self.slack += abs(velocity) * (SKEW + late)
        self.lag = max(self.lag, late)

    def calm(self) -> None:
        """Note that the drive and its twin are at rest: the next move is as certain as the first."""
        self.slack = self.lag = 0.0
