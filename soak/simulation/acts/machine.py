"""What happens to the machine: power, cables, time of day, kills; and verbs that write files, which a kill leaves."""

from __future__ import annotations

import contextlib
from random import Random

from multidrop.base.errors import Diagnostic
from soak.simulation.acts.act import Act
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


def unplug(world: World, rng: Random) -> None:
    """Pull the cable of a line, for a while."""
    name = rng.choice(world.places).name
    world.floor.command(f"/sim unplug {name}")
    world.loop.call_later(rng.random() * 5, world.floor.command, f"/sim plug {name}")


def power_off(world: World, rng: Random) -> None:
    """Take the power of a drive away, for a while."""
    place = rng.choice(world.places)
    drive = f"{place.name}:{rng.choice(place.names)}"
    with contextlib.suppress(Diagnostic):
        world.floor.command(f"/sim power {drive} off")
        world.loop.call_later(rng.random() * 5, world.floor.command, f"/sim power {drive} on")


def clock_jumps(world: World, rng: Random) -> None:
    """Let the clock of day jump."""
    world.wall.jump(rng.uniform(-4000, 4000))


MACHINE = (
    Act("power off", 4, power_off),
    Act("files", 4, files),
    Act("kill", 2, kill),
    Act("PC power cut", 1, power_cut),
    Act("unplug", 4, unplug, fault=True),
    Act("clock jumps", 2, clock_jumps, fault=True),
)
