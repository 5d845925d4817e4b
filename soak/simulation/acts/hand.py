"""What a person does with single lines beside commands: questions, broadcasts, program mode, raw mode, and verbs."""

from __future__ import annotations

from random import Random

from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import later
from soak.simulation.acts.drawing import drawn, number, target
from soak.simulation.acts.files import answered
from soak.simulation.records.commands import Command
from soak.simulation.records.phrases import PHRASES, STOP
from soak.simulation.records.told import Line
from soak.simulation.world import World

VERBS = (
    "/drives",
    "/status {at}",
    "/hex on",
    "/hex off",
    "/log session.log",
    "/log on",
    "/log off",
    "/macros",
    "/sleep 0.3",
    "/help /stop",
    "/wait idle 1",
    "/referenced {at}",
    "/play nothing",
    "/key F3 nothing",
    "/use {at}",
    "/check tick.mxt",
)
RAW = ("/bytes 0D", "/bytes ESC", "/bytes ^C", "/bytes 15", "/raw end lf", "/raw end cr", "/raw show hex")


def guard(world: World, rng: Random) -> None:
    """Type a line that asks first."""
    place, drive = drawn(world, rng)
    phrases = PHRASES[place.language]
    usable = rng.random() < 0.6
    text = rng.choice(phrases.guarded if usable else phrases.denied)
    line: Line = (place.name, drive, text)
    answered(world, rng, f"@{target(place, drive)} {text}\r".encode(), line, yes=usable)


def broadcast(world: World, rng: Random) -> None:
    """Type a line to all drives of a line; one that moves them asks first."""
    place, _ = drawn(world, rng)
    phrases, count, moves = PHRASES[place.language], number(world), rng.random() < 0.5
    text = phrases.motion.format(phrases.first_motion + count) if moves else phrases.value.format(phrases.first + count)
    lines: list[Line] = [(place.name, drive, text) for drive in place.names]
    world.history.told.repeated |= dict.fromkeys(lines, 1)
    typed = f"@{place.name}:* {text}\r".encode()
    if moves and place.drives:  # a drive that is alone is the only one that starts
        answered(world, rng, typed, *lines)
    else:
        world.person.type(typed)


def by_hand(world: World, rng: Random) -> None:
    """Store a program line by line, as far as the end or not."""
    place, drive = drawn(world, rng, lambda each: each.by_hand)
    phrases = PHRASES[place.language]
    for form in phrases.by_hand:
        count = number(world)
        text = form.format(label=count % 9, value=phrases.first + count)
        typed = f"@{target(place, drive)} {text}"
        if "{value}" in form:
            world.history.commands[typed] = Command(text, place.name, drive, world.loop.now, world.stops)
        world.person.type(f"{typed}\r".encode(), rng.choice((0.0, 0.05)))
        if rng.random() < 0.03:
            world.stops += 1
            world.person.type(STOP + b"/resume\r")


def raw(world: World, rng: Random) -> None:
    """Type texts and bytes to a line in raw mode, and leave it after a while."""
    place = rng.choice(world.places)
    lines = [f"/use {place.name}", "/raw on"]
    for _ in range(rng.randrange(1, 5)):
        lines.append(rng.choice(RAW) if rng.random() < 0.3 else f"raw {number(world)} text")
    for line in lines:
        world.person.type(f"{line}\r".encode(), rng.choice((0.0, 0.03)))
    if rng.random() < 0.2:
        later(world, rng.random(), STOP + b"/resume\r")
    for again in (1.0, 4.0):
        later(world, again + rng.random(), f"/use {place.name}\r/raw off\r".encode())


def verb(world: World, rng: Random) -> None:
    """Type a verb that moves nothing."""
    place, drive = drawn(world, rng)
    world.person.type(f"{rng.choice(VERBS).format(at=target(place, drive))}\r".encode())


def scan(world: World, rng: Random) -> None:
    """Search a line for more drives."""
    world.person.type(f"/scan {rng.choice(world.places).name}\r".encode())
    if rng.random() < 0.3:
        later(world, rng.random(), STOP + b"/resume\r")


def plot(world: World, rng: Random) -> None:
    """Plot drives into a file for a while."""
    place, drive = drawn(world, rng)
    world.person.type(f"/plot {target(place, drive)} --to plot{world.step}.rrd\r".encode())
    later(world, 0.5 + rng.random(), b"/plot off\r")


def twin(world: World, rng: Random) -> None:
    """Run a twin beside a drive for a while."""
    place, drive = drawn(world, rng)
    world.person.type(f"/use {place.name}\r/twin on {target(place, drive)}\r".encode())
    later(world, 2 + rng.random(), b"/twin off\r")


HAND = (
    Act("question", 2, guard),
    Act("broadcast", 2, broadcast),
    Act("program mode", 1, by_hand),
    Act("raw mode", 1, raw),
    Act("other verb", 3, verb),
    Act("scan", 0.3, scan),
    Act("plot", 0.5, plot),
    Act("twin", 0.3, twin),
)
