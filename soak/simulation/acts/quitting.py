"""A person ends the session and types on: nothing of that may leave."""

from __future__ import annotations

from random import Random

from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import later
from soak.simulation.records.phrases import STOP
from soak.simulation.records.told import Quit
from soak.simulation.world import World

QUITS = ("/quit", "/exit")
LONG = 12.0
"""Seconds until the end is decided, and another session has begun."""


def _typed_on(world: World, rng: Random, number: int) -> bytes:
    """Commands that are typed after a quit; the quit is noted with them."""
    typed = b"".join(world.command(rng) for _ in range(number))
    lines = typed.decode().split("\r")
    commands = [world.history.commands[line] for line in lines if line in world.history.commands]
    world.history.told.quits.append(Quit(world.loop.now, commands))
    return typed


def type_on(world: World, rng: Random) -> float:
    """Type commands, a quit, and more commands, in reads of any size."""
    before = b"".join(world.command(rng) for _ in range(rng.randrange(0, 2)))
    end = f"{rng.choice(QUITS)}\r".encode()
    world.person.type(before + end + _typed_on(world, rng, rng.randrange(1, 4)), rng.choice((0.0, 0.0, 0.02)))
    if rng.random() < 0.3:
        later(world, rng.random(), STOP + b"/resume\r")
    return LONG


def paste_on(world: World, rng: Random) -> float:
    """Paste commands with a quit among them."""
    before = b"".join(world.command(rng) for _ in range(rng.randrange(1, 3))).decode()
    after = _typed_on(world, rng, rng.randrange(1, 4)).decode()
    world.person.paste(f"{before}{rng.choice(QUITS)}\r{after}".rstrip("\r").replace("\r", rng.choice("\r\n")))
    return LONG


QUITTING = (Act("quit and type on", 1, type_on), Act("paste with a quit", 1, paste_on))
