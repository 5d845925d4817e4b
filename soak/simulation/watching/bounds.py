"""What waits in a session, against the bounds that docs/safety.md names: the most of each that a history has seen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from multidrop.dialects import StopPiece
from multidrop.drives.echoes import LONGEST_TAIL
from multidrop.drives.line import Flight
from soak.simulation.records.history import Peak
from soak.simulation.system.terminal import LIMIT
from soak.simulation.world import World

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus


@dataclass(frozen=True)
class Bound:
    """The largest number of something that waits. `waits` gives the number now, for each place where it may wait."""

    name: str
    most: int
    waits: Callable[[World], Iterator[int]]


def _lines(waits: Callable[[Bus], int]) -> Callable[[World], Iterator[int]]:
    return lambda world: (waits(bus) for bus in world.session.buses.values())


def _unended(bus: Bus) -> int:
    """The bytes of a print without an end. A reply that is awaited ends by its time."""
    line = bus.link.line
    return 0 if isinstance(line._state, Flight) or line.inbox.codec.numbered else len(line.inbox.buffer)


ALIKE = 6
"""The most pieces of one stop that are alike: a form has up to three, and a stop has one for each kind of settings."""


def _most_alike(pieces: list[StopPiece]) -> int:
    return max(Counter(pieces).values(), default=0)


BOUNDS = (
    Bound("bytes before a terminal", LIMIT, lambda world: iter((world.terminal.most,))),
    Bound("bytes of a print without an end", LONGEST_TAIL, _lines(_unended)),
    Bound("bytes before a port", 4096, _lines(lambda bus: bus.link.transport.pending)),
    Bound("times that one piece of a stop waits", ALIKE, _lines(lambda bus: _most_alike(bus.link.line._repeats))),
)


def sample(world: World) -> None:
    """Note how much waits now."""
    peaks = world.history.peaks
    for bound in BOUNDS:
        before = peaks[bound.name].seen if bound.name in peaks else 0
        peaks[bound.name] = Peak(max((*bound.waits(world), before)), bound.most)
