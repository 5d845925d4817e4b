"""Acts that end a process, and those that write files: what it leaves is what the next one finds."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from soak.simulation.world import World

MOST = 80
"""The largest number of operations until a kill."""
MOMENTS = ("before", "within", "after")


def kill(world: World, rng: Random) -> None:
    """Kill the session at an operation on a disk or a wire, in the middle of some lines."""
    _kill(world, rng, power=False)


def power_cut(world: World, rng: Random) -> None:
    """Let the PC lose its power there."""
    _kill(world, rng, power=True)


def _kill(world: World, rng: Random, power: bool) -> None:
    world.kill(1 + int(rng.random() ** 2 * MOST), rng.choice(MOMENTS), power)
    world.person.type(b"".join(world.command(rng) for _ in range(rng.randrange(0, 4))), rng.choice((0.0, 0.02)))


def files(world: World, rng: Random) -> None:
    """Type a verb that writes a file."""
    name = f"m{rng.randrange(3)}"
    verbs = (
        "/log session.log",
        f"/record {name} --replace",
        "/record stop",
        f"/key F{rng.randrange(2, 5)} {name}",
    )
    world.person.type(f"{rng.choice(verbs)}\r".encode(), 0.0)
