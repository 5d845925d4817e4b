"""Shrinking: the fewest steps of a seed's story, and the fewest kinds of faults, with which the same rule breaks."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from soak.simulation.judges.judge import judged
from soak.simulation.living import lived
from soak.simulation.records.climate import Climate
from soak.simulation.world import World

LONGEST = 60.0
"""Real seconds that shrinking takes at most."""


@dataclass(frozen=True)
class Life:
    """What is lived of a seed: these steps of its story, `without` these kinds of faults."""

    seed: int
    steps: tuple[int, ...]
    without: tuple[str, ...] = ()

    def live(self, keep: bool = False) -> World:
        """Live it."""
        return lived(self.seed, self.steps, keep, self.without)

    @property
    def command(self) -> str:
        """The command that lives it again."""
        kinds = f" WITHOUT={shlex.quote(','.join(self.without))}" if self.without else ""
        return f"make simulate SEED={self.seed} ONLY={','.join(map(str, self.steps))}{kinds}"


def shrunk(life: Life, rule: str, seconds: float = LONGEST) -> Life:
    """Leave out what the breach of a rule does not need: first kinds of faults, then steps (delta debugging)."""
    deadline = time.monotonic() + seconds

    def breaks(tried: Life) -> bool:
        return time.monotonic() < deadline and rule in judged(tried.live()).rules

    for kind in Climate.drawn(life.seed, life.without).chances:
        less = replace(life, without=(*life.without, kind))
        life = less if breaks(less) else life
    return replace(life, steps=_fewest(life.steps, lambda steps: breaks(replace(life, steps=steps))))


def _fewest(steps: tuple[int, ...], breaks: Callable[[tuple[int, ...]], bool]) -> tuple[int, ...]:
    """Remove parts, from halves to single steps, as long as what is left breaks."""
    size = len(steps)
    while size > 1 or (size == 1 and steps):
        size = max(1, size // 2)
        at, before = 0, steps
        while at < len(steps):
            less = steps[:at] + steps[at + size :]
            if breaks(less):
                steps = less
            else:
                at += size
        if size == 1 and steps == before:
            return steps
    return steps
