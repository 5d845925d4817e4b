"""Acts in which meets what seldom does: a stop key that is held down, a drive that babbles or replies late, a burst of
noise, prints of a program between replies, a macro that is played before `/resume`.

One seed in three has them beside the others: see `story.tell`. One in five has a stop in a loop that is held up.
"""

from __future__ import annotations

from random import Random

from soak.languages import LANGUAGES
from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import later, macro, script
from soak.simulation.acts.files import download
from soak.simulation.records.history import Damage
from soak.simulation.records.phrases import STOP
from soak.simulation.records.places import Place
from soak.simulation.system.ports import Port
from soak.simulation.watching.bounds import sample
from soak.simulation.world import World

REPEAT = 1 / 30
"""The time between two keys of one that is held down, s."""
BABBLE = (b"U" * 64, 0.007)
"""What a drive babbles at a time, and how often, s: what a drive at another baud rate looks like."""


def _several(world: World, rng: Random, place: Place | None = None) -> None:
    """Type some commands for one line."""
    for _ in range(rng.randrange(2, 7)):
        world.person.type(world.command(rng, place), rng.choice((0.0, 0.0, 0.3)))


def held_down(world: World, rng: Random) -> None:
    """Hold the stop key down."""
    _several(world, rng)
    keys = rng.randrange(5, 40)
    for number in range(keys):
        later(world, 0.2 + number * REPEAT, STOP)
    later(world, 0.4 + keys * REPEAT, b"/resume\r")


def within_a_line(world: World, rng: Random) -> None:
    """Type the stop while a line is on the wire."""
    place = rng.choice([each for each in world.places if each.baud] or world.places)
    world.person.type(world.command(rng, place))
    later(world, 0.0005 + rng.random() * 0.02, STOP + b"/resume\r")


def babbles(world: World, rng: Random) -> None:
    """Let a drive print without an end."""
    if not world.kernel.adapters:
        return
    adapter = rng.choice(world.kernel.adapters)
    for number in range(int(rng.random() ** 2 * 160)):
        world.loop.call_later(number * BABBLE[1], _babble, world, adapter.line, adapter.opened)
    _several(world, rng, world.place(adapter.line))


def _babble(world: World, line: str, port: Port | None) -> None:
    if port is not None and not (port.closed or world.ending):
        world.history.damage.setdefault(line, []).append(Damage(world.loop.now, b"", BABBLE[0]))
        port.receive(BABBLE[0])
        world.loop.call_later(0.001, sample, world)


def late_replies(world: World, rng: Random) -> None:
    """Let the drives of a line reply late for a while, mostly later than the time-out."""
    place = rng.choice(world.places)
    world.weather(place, delay=(0.1, 0.3 + rng.random() * 2.5))
    world.loop.call_later(rng.random() * 6, world.weather, place)
    _several(world, rng, place)


def noise(world: World, rng: Random) -> None:
    """Let there be much noise on a line for a while."""
    place = rng.choice([each for each in world.places if each.noisy] or world.places)
    kinds = ("flip", "drop", "double", "insert")
    world.weather(place, **{kind: rng.random() ** 2 * 0.05 for kind in kinds if place.noisy and rng.random() < 0.6})
    world.loop.call_later(rng.random() * 4, world.weather, place)
    _several(world, rng, place)


def prints(world: World, rng: Random) -> None:
    """Let the program of a drive run that prints, as an input starts it."""
    places = [each for each in world.places if each.language == "mcode"]
    if not places:
        return
    place = rng.choice(places)
    drive = rng.choice(place.names)
    witness = world.witnesses[place.name, drive]
    if witness.device.programming is None:
        if not witness.device.running:
            world.history.told.started.append((world.loop.now, place.name, drive))
        LANGUAGES[place.language].print_on(witness, world.floor.now())
        world.floor.floor.wires[place.name].look_again()
        world.history.told.programs.setdefault(place.name, world.loop.now)
    _several(world, rng, place)


def latched(world: World, rng: Random) -> None:
    """Type the stop, and start a macro or a script before `/resume`."""
    world.stops += 1
    world.person.type(STOP)
    rng.choice((macro, script))(world, rng)
    later(world, 1 + rng.random() * 2, b"/resume\r")


def stopped_download(world: World, rng: Random) -> None:
    """Send a program to a drive, and stop in the middle of that."""
    download(world, rng)
    later(world, rng.random() * 5, rng.choice((STOP, b"\x03")) + b"/resume\r")


def in_a_held_up_loop(world: World, rng: Random) -> None:
    """Press the stop key, once or held down, while the loop is held up, or has just taken over the first of them."""
    place = rng.choice([each for each in world.places if len(each.drives) > 1] or world.places)
    _several(world, rng, place)
    at, keys = 0.2 + rng.random(), rng.choice((1, 1, 2, rng.randrange(5, 40)))
    for number in range(keys):
        later(world, at + number * REPEAT, STOP)
    later(world, at + keys * REPEAT, b"/resume\r")
    begins = at + rng.choice((-0.01, rng.random() * 0.15, rng.random() * 0.6))
    world.loop.call_later(begins, world.loop.starve, 1.0 + rng.random() ** 2 * 4)


HELD_UP = (Act("stop in a held-up loop", 1, in_a_held_up_loop, fault=True),)
MEETINGS = (
    Act("stop held down", 1, held_down),
    Act("stop within a line", 3, within_a_line),
    Act("babble", 1, babbles, fault=True),
    Act("late replies", 3, late_replies, fault=True),
    Act("noise", 3, noise, fault=True),
    Act("program prints", 2, prints),
    Act("macro before resume", 1, latched),
    Act("download stopped", 1, stopped_download),
)
