"""What happens to connections, and another person who shares a line."""

from __future__ import annotations

from contextvars import copy_context
from functools import partial
from random import Random
from typing import Any

from soak.simulation.acts.act import Act
from soak.simulation.person import Other, Person
from soak.simulation.records.places import Place
from soak.simulation.system.kernel import WHO
from soak.simulation.watching.hearing import heard, typed
from soak.simulation.watching.session import WatchedSession
from soak.simulation.world import World

LONG = 12.0
"""The longest time that a host is away or dark, s: longer than a system waits for it."""
SECOND = "2"
"""The other person, as `WHO`."""


def _comes(world: World, place: Place) -> Other:
    """Let another person open a line that is shared, in a session of their own."""
    session = WatchedSession(world.settings(world.folder / SECOND), world)
    session.subscribe(lambda event: heard(world, event, SECOND))
    types = partial(typed, world, session=session, who=SECOND)
    person = Person(session, world.loop, Random(f"{world.seed} other"), types, world.cut_ins)
    return Other(place, session, person, world.loop.create_task(session.open_all([place.name], lambda *_: None)))


def _host(world: World, rng: Random) -> str:
    """A line that a network leads to, as its host; empty if there is none."""
    hosts = [place.host for place in world.places if place.networked]
    return rng.choice(hosts) if hosts else ""


def cut(world: World, rng: Random) -> None:
    """Reset the connections of a host, perhaps in the middle of an exchange."""
    world.person.type(world.command(rng), 0.0)
    world.loop.call_later(rng.random() ** 2 * 0.3, world.network.cut, _host(world, rng))


def dark(world: World, rng: Random) -> None:
    """Let a host vanish without a word, and come back."""
    world.network.darken(_host(world, rng), rng.random() ** 4 * LONG)
    world.person.type(world.command(rng), 0.0)


def restart(world: World, rng: Random) -> None:
    """Let a server end and begin again."""
    world.network.refuse(_host(world, rng), rng.random() ** 4 * LONG)


def replug(world: World, rng: Random) -> None:
    """Pull adapters and plug them in again in another order: each may get the number of another.

    Controllers on USB go to each other's sockets, and come back: none may be taken for another.
    """
    for adapter in world.kernel.adapters:
        world.floor.command(f"/sim unplug {adapter.line}")
    for adapter in rng.sample(world.kernel.adapters, len(world.kernel.adapters)):
        world.loop.call_later(rng.random() * 2, world.floor.command, f"/sim plug {adapter.line}")
    sockets = world.kernel.usb
    if len(sockets.plugged) > 1:
        _pull(world)
        sockets.exchange()
        world.loop.call_later(rng.random(), _plug, world)
        world.loop.call_later(1 + rng.random() * 4, _bring_back, world)


def _pull(world: World) -> None:
    for each in world.kernel.usb.plugged:
        world.floor.command(f"/sim unplug {each.bus}")


def _plug(world: World) -> None:
    for each in world.kernel.usb.plugged:
        world.floor.command(f"/sim plug {each.bus}")


def _bring_back(world: World) -> None:
    _pull(world)
    for each in world.kernel.usb.plugged:
        each.place = f"1-{world.place(each.bus).place}"
    _plug(world)


def busy(world: World, rng: Random) -> None:
    """Pull an adapter; another program opens its port before it is back, and closes it after a while."""
    adapters: list[Any] = [*world.kernel.adapters, *world.kernel.usb.plugged]
    if not adapters:
        return
    adapter = rng.choice(adapters)
    world.floor.command(f"/sim unplug {adapter.line}")
    adapter.held = True
    world.loop.call_later(rng.random(), world.floor.command, f"/sim plug {adapter.line}")
    world.loop.call_later(rng.random() * 8, _release, adapter)


def _release(adapter: Any) -> None:
    adapter.held = False


def stop_while_away(world: World, rng: Random) -> None:
    """Type a command, lose a line, and type the stop before the line is back."""
    place = rng.choice(world.places)
    world.person.type(world.command(rng, place), 0.0)
    away = 0.05 + rng.random() ** 2 * 6
    if not place.networked:
        world.loop.call_later(0.03, world.floor.command, f"/sim unplug {place.name}")
        world.loop.call_later(0.03 + away, world.floor.command, f"/sim plug {place.name}")
    else:
        world.loop.call_later(0.03, world.network.refuse, place.host, away)
    world.loop.call_later(0.03 + rng.random() * away, world.stop)


def another(world: World, rng: Random) -> None:
    """Another person types at a line that is shared: a command, or a stop."""
    places = [place for place in world.places if place.kind == "rfc2217"]
    if not places:
        return
    if not world.others:
        context = copy_context()
        context.run(WHO.set, SECOND)
        world.others.append(context.run(_comes, world, places[0]))
    [other] = world.others
    if rng.random() < 0.4:
        other.stops += 1
        other.person.type(b"\x18", 0.0)
    else:
        other.person.type(world.command(rng, other.place, SECOND, other.stops), 0.0)


def stop_at_the_share(world: World, rng: Random) -> None:
    """Type the stop at the computer that lends a line."""
    for shared in world.shares.values():
        shared.stop()


CONNECTIONS = (
    Act("connection cut", 1.5, cut, fault=True),
    Act("half-open", 1.5, dark, fault=True),
    Act("server restarts", 1.5, restart, fault=True),
    Act("adapters replugged", 0.7, replug, fault=True),
    Act("port busy", 0.7, busy, fault=True),
    Act("stop while away", 1, stop_while_away, fault=True),
    Act("another person", 5, another),
    Act("stop at the share", 1, stop_at_the_share),
)
