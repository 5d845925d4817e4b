"""What an act draws for its lines: a number that no other line has, and a drive."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from soak.simulation.records.phrases import PHRASES, Phrases
from soak.simulation.records.places import Place
from soak.simulation.world import World


def number(world: World) -> int:
    """A number that no other line of this history has."""
    world.said += 1
    return world.step * 100 + world.said


def target(place: Place, drive: str) -> str:
    """A drive as a verb takes it."""
    return f"{place.name}:{drive if place.drives else ''}"


def drawn(world: World, rng: Random, fits: Callable[[Phrases], object] = bool) -> tuple[Place, str]:
    """Draw a drive, if possible one whose language fits."""
    fitting = [each for each in world.places if fits(PHRASES[each.language])]
    place = rng.choice(fitting or world.places)
    return place, rng.choice(place.names)
