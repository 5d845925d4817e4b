"""An act: something that can happen in a step of a story."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from soak.simulation.world import World


@dataclass(frozen=True)
class Act:
    """Something that can happen in a step. `fault`: never in a calm seed. `weight`: how often, beside the others.

    `do` returns how long the story waits for its end, s; None: not at all. `where`: the machines on which it happens.
    """

    name: str
    weight: float
    do: Callable[[World, Random], float | None]
    fault: bool = False
    where: Callable[[World], bool] = lambda world: True
