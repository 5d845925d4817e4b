"""Acts in which a person works at one line for a while, and nothing but its weather disturbs that.

In the other acts a failure or a stop drops what was typed ahead, so that under noise few values are shown at all. Here
most lines are typed once the one before is over. Each question has a value of its own, as every command has.

One seed in five has them: see `story.tell`.
"""

from __future__ import annotations

from random import Random
from typing import Any

from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import later
from soak.simulation.acts.drawing import target
from soak.simulation.acts.meetings import prints
from soak.simulation.records.commands import Command
from soak.simulation.records.phrases import STOP
from soak.simulation.records.places import Place
from soak.simulation.world import World

GAPS = (0.02, 0.3, 0.6, 1.0)
"""The time between two lines, s: most exchanges that fail take less than the longest."""
REFUSED = 70_000_000
"""From here on no velocity is in the range of VM."""
STALL = 86
"""An error that a drive sets by itself, and that every product knows."""


def _works(world: World, rng: Random, place: Place) -> float:
    """Let a person type lines for a line of drives; return how long that takes."""
    at, lines = 0.0, Random(f"{world.seed} lines {world.step}")

    def line() -> None:
        if world.ready.is_set():
            world.person.type(world.command(lines, place))

    for _ in range(rng.randrange(10, 30)):
        world.loop.call_later(at, line)
        at += rng.choice(GAPS)
    return at


def in_noise(world: World, rng: Random) -> float:
    """Work at a line with noise."""
    place = rng.choice([each for each in world.places if each.noisy] or world.places)
    kinds = [each for each in ("flip", "drop", "double", "insert") if rng.random() < 0.6]
    world.weather(place, **{kind: rng.random() * 0.01 for kind in kinds if place.noisy})
    took = _works(world, rng, place)
    world.loop.call_later(took, world.weather, place)
    return took


def with_late_replies(world: World, rng: Random) -> float:
    """Work at a line whose drives reply late, some of them later than the time-out."""
    place = rng.choice(world.places)
    world.weather(place, delay=(0.0, 0.5 + rng.random() * 1.5))
    took = _works(world, rng, place)
    world.loop.call_later(took, world.weather, place)
    return took


def beside_a_program(world: World, rng: Random) -> float:
    """Work at a line while a program prints, as an input starts it."""
    prints(world, rng)
    return _works(world, rng, rng.choice([each for each in world.places if each.language == "mcode"] or world.places))


def with_errors(world: World, rng: Random) -> float:
    """Work at a line while its drives set an error by themselves; some replies are damaged, too."""
    place = rng.choice([each for each in world.places if each.language == "mcode"] or world.places)
    took = _works(world, rng, place)
    if place.noisy and rng.random() < 0.6:
        world.weather(place, flip=rng.random() * 0.02)
        world.loop.call_later(took, world.weather, place)

    def stall(device: Any) -> None:
        if device.programming is None:
            device.fail(STALL, world.floor.now())

    if place.language == "mcode":
        for _ in range(rng.randrange(3, 12)):
            device = world.witnesses[place.name, rng.choice(place.names)].device
            world.loop.call_later(rng.random() * took, stall, device)
    return took


def with_stops(world: World, rng: Random) -> float:
    """Stop again and again in the time of a line, which the drive may refuse, and type another line then."""
    place = rng.choice([each for each in world.places if each.language == "mcode"] or world.places)
    at, lines = 0.0, Random(f"{world.seed} lines {world.step}")

    def line(refused: bool) -> None:
        if not world.ready.is_set():
            return
        if not refused or place.language != "mcode":
            return world.person.type(world.command(lines, place))
        drive = lines.choice(place.names)
        world.said += 1
        text = f"VM={REFUSED + world.step * 100 + world.said}"
        typed = f"@{target(place, drive)} {text}"
        world.history.commands[typed] = Command(text, place.name, drive, world.loop.now, world.stops)
        world.person.type(typed.encode() + b"\r")

    for _ in range(rng.randrange(4, 12)):
        world.loop.call_later(at, line, rng.random() < 0.7)
        later(world, at + rng.random() * 0.06, STOP + b"/resume\r")
        at += rng.choice((0.3, 0.8))
        world.loop.call_later(at, line, False)
        at += 0.8
    return at


OPERATORS = (
    Act("work in noise", 3, in_noise, fault=True),
    Act("work with late replies", 3, with_late_replies, fault=True),
    Act("work beside a program", 1.5, beside_a_program),
    Act("work with errors", 1, with_errors, fault=True),
    Act("work with stops", 1.5, with_stops),
)
