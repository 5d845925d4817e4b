"""Acts of several callers at once: an operator at each drive of a line, several tabs, and stops between their lines.

They are the last steps of one story in four, after all others, so no other story is changed by them: see `story.whole`.
Beside them are stops, kills and losses that are aimed: at a write, at a file, at a port that takes little.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from contextvars import copy_context
from dataclasses import replace
from random import Random
from typing import Any

from multidrop.shell.events import FAILURES
from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import Lines, later, motion, pause, refused, setting, tell
from soak.simulation.acts.connections import another
from soak.simulation.acts.drawing import number, target
from soak.simulation.acts.files import download
from soak.simulation.acts.guests import half_line
from soak.simulation.records.commands import Command
from soak.simulation.records.phrases import PHRASES, STOP
from soak.simulation.records.places import Place
from soak.simulation.records.told import Run
from soak.simulation.system.cut_ins import OWN_WORK, WRITING, Aim, points
from soak.simulation.system.process import Killed
from soak.simulation.world import World

AT_ONCE = 0.002
"""The time in which a session writes down what it owes, s."""
WAIT = 8.0
"""The longest time until it does, s."""
QUESTIONS = 0.4
"""The part of the commands that are questions: see `soak.languages`."""
INTO_THE_PIPE = "pipe DescriptorPipe.write: with"
"""The point at which a line is about to be passed to a port."""


def _arrived(world: World) -> int:
    """The number of stops that have arrived."""
    return sum(not stop.who for stop in world.history.stops)


def _spell(world: World, seconds: float, worse: Mapping[str, float]) -> None:
    """Let faults of the kernel, the network and USB be more probable for a while."""

    def back() -> None:
        if not world.ending:
            world.kernel.quiet(world.climate)

    world.kernel.quiet(replace(world.climate, chances={**world.climate.chances, **worse}))
    world.loop.call_later(seconds, back)


# Several callers


async def _operator(world: World, place: Place, drive: str, rng: Random) -> None:
    """Send lines to one drive, each as soon as the one before has ended; some callers give up before that."""
    session = world.session
    for _ in range(rng.randrange(2, 7)):
        await asyncio.sleep(rng.choice((0.0, 0.0, 0.01, 0.3)))
        typed = world.command(rng, place, stops=_arrived(world), drive=drive).decode().strip()
        if rng.random() < 0.3:  # a tab
            session.start(typed)
            continue
        with contextlib.suppress(*FAILURES, TimeoutError):
            async with asyncio.timeout(rng.random() ** 2 * 0.3 if rng.random() < 0.25 else None):
                await session.run(typed)


def _operators(world: World, rng: Random, places: list[Place], callers: int = 1) -> None:
    """Let so many callers work at each drive of some lines."""
    for place in places:
        for drive in place.names * callers:
            world.beside(_operator(world, place, drive, Random(rng.random())))


def _some(world: World, rng: Random) -> list[Place]:
    """One line, the one with the most drives or any, or all."""
    most = max(world.places, key=lambda place: len(place.names))
    return rng.choice(([most], [most], [rng.choice(world.places)], world.places))


def at_each_drive(world: World, rng: Random) -> float:
    """Let an operator send lines to each drive at once, and stop now and then."""
    _operators(world, rng, _some(world, rng))
    took = 1 + rng.random() * 3
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        later(world, rng.random() ** 2 * took, STOP + b"/resume\r")
    return took


def at_each_drive_late(world: World, rng: Random) -> float:
    """The same with replies that are late, some of them later than the time-out."""
    for place in (places := _some(world, rng)):
        world.weather(place, delay=(0.0, 0.4 + rng.random()))
        world.loop.call_later(6.0, world.weather, place)
    _operators(world, rng, places)
    if rng.random() < 0.3:
        later(world, rng.random() * 3, STOP + b"/resume\r")
    return 6.0


def at_each_drive_in_noise(world: World, rng: Random) -> float:
    """The same with noise."""
    for place in (places := _some(world, rng)):
        kinds = [each for each in ("flip", "drop", "double", "insert") if rng.random() < 0.6]
        world.weather(place, **{kind: rng.random() * 0.01 for kind in kinds if place.noisy})
        world.loop.call_later(4.0, world.weather, place)
    _operators(world, rng, places)
    return 4.0


def two_at_a_share(world: World, rng: Random) -> float:
    """Let two people work at a line that is shared, each with stops."""
    places = [each for each in world.places if each.kind == "rfc2217"]
    if not places:
        return at_each_drive(world, rng)
    at, lines = 0.0, Random(f"{world.seed} lines {world.step}")

    def own() -> None:
        if world.ready.is_set():
            world.person.type(world.command(lines, places[0]))

    for _ in range(rng.randrange(6, 16)):
        if (choice := rng.random()) < 0.5:
            world.loop.call_later(at, another, world, lines)
        elif choice < 0.8:
            world.loop.call_later(at, own)
        else:
            later(world, at, STOP + b"/resume\r")
        at += rng.choice((0.0, 0.001, 0.02, 0.3))
    return at


# Stops that are aimed


def stop_at_a_write(world: World, rng: Random) -> float:
    """Let operators work, and stop in the instruction in which a line is about to leave."""
    _operators(world, rng, _some(world, rng))
    form = INTO_THE_PIPE if rng.random() < 0.5 else WRITING
    names = [each for each in points() if each.startswith(form) and not each.startswith("usb")]
    if any(each.kind == "usb" for each in world.places) and rng.random() < 0.7:
        names = [each for each in points() if each.startswith("usb")]
    held = (1 + int(rng.random() * OWN_WORK), 1 + int(rng.random() * 3000)) if rng.random() < 0.3 else (0, 0)
    aim = Aim(rng.choice(names), 1 + int(rng.random() ** 2 * 4), rng.choice((0, 0, 1, 3, 6)), *held)

    def typed() -> None:
        if not world.ready.is_set():
            return
        world.stops += 1
        world.person.type_stop(aim)
        world.person.type(b"/resume\r")

    world.loop.call_later(rng.random() * 0.2, typed)
    return 2.0


def two_stops(world: World, rng: Random) -> float:
    """Stop twice; the thread of the second stop is held up as it has written, while the loop takes over the first."""
    person = world.person
    if person._coming:
        return stop_at_a_write(world, rng)
    world.stops += 1
    between = world.command(rng) + world.command(rng) * (rng.random() < 0.5)
    with contextlib.suppress(Killed):  # a kill ends the program, and not its story
        world.process.run(person.read, STOP + between)
        world.stops += 1
        if not world.process.dead:
            world.process.run(person.read, STOP, 0.1 + rng.random() * 0.5)
            person.type(b"/resume\r")
    return 1.0


def stop_at_a_full_port(world: World, rng: Random) -> float:
    """Stop while the ports take few bytes at a time, mostly none."""
    _spell(world, 0.2 + rng.random(), {"full": 0.5 + rng.random() * 0.45, "part": 0.9})
    _operators(world, rng, [rng.choice(world.places)], rng.randrange(1, 4))
    for _ in range(rng.randrange(1, 3)):
        later(world, rng.random() ** 2 * 0.3, STOP + b"/resume\r")
    return 2.0


def stop_while_owed(world: World, rng: Random) -> float:
    """Send a program, and stop as the session writes down what it owes the drive."""
    download(world, rng)
    until, context = world.loop.now + WAIT, copy_context()

    def press() -> None:
        if not world.ending and world.ready.is_set():
            world.stops += 1
            world.person.type(STOP + b"/resume\r")

    def kept() -> None:
        world.kept = None
        if world.loop.now <= until:
            world.loop.call_later(rng.random() * AT_ONCE, press, context=context)

    world.kept = kept
    return 3.0


def stop_at_usb(world: World, rng: Random) -> float:
    """Stop while controllers on USB take their packets late."""
    if not world.kernel.usb.plugged:
        return stop_at_a_full_port(world, rng)
    _spell(world, 2.0, {"usb held": 0.3 + rng.random() * 0.5, "usb missing": rng.random() * 0.5, "usb late": 0.3})
    places = [each for each in world.places if each.kind == "usb"]
    _operators(world, rng, places, rng.randrange(1, 4))
    for _ in range(rng.randrange(1, 4)):
        later(world, rng.random() * 1.5, STOP + b"/resume\r")
    return 3.0


def second_host(world: World, rng: Random) -> float:
    """Let a second host empty the buffers of controllers on USB at any time, while operators work at them."""
    sockets = world.kernel.usb.plugged
    places = [each for each in world.places if each.kind == "usb"]
    took = 2 + rng.random() * 4
    _spell(world, took, {f"usb {kind}": rng.random() * 0.1 for kind in ("late", "held", "stalled", "empty")})
    _operators(world, rng, places, rng.randrange(1, 4))
    at = rng.random() ** 2
    while at < took:
        world.loop.call_later(at, rng.choice(sockets).controller.replies.clear)
        at += rng.choice((0.001, 0.02, 0.3, 1.0)) * rng.random()
    if rng.random() < 0.3:
        name = rng.choice(places).name
        world.loop.call_later(rng.random() * took, world.floor.command, f"/sim unplug {name}")
        world.loop.call_later(took, world.floor.command, f"/sim plug {name}")
    if rng.random() < 0.3:
        later(world, rng.random() * took, STOP + b"/resume\r")
    return took + 1


class Asking(Random):
    """Draws questions in place of commands, each of the first form."""

    def random(self) -> float:
        """Draw less than `QUESTIONS`."""
        return super().random() * QUESTIONS

    def choice(self, seq: Any) -> Any:
        """Take the first."""
        return seq[0]


async def _asker(world: World, place: Place, drive: str, rng: Random) -> None:
    """Ask one drive the same question again and again."""
    questions = Asking(rng.random())
    for _ in range(rng.randrange(4, 12)):
        await asyncio.sleep(rng.choice((0.0, 0.0, 0.01, 0.3)))
        with contextlib.suppress(*FAILURES):
            await world.session.run(world.command(questions, place, drive=drive).decode().strip())


def same_question(world: World, rng: Random) -> float:
    """Ask all drives of a line the same at once, with replies that come late, some of them later than the time-out."""
    place = rng.choice([each for each in world.places if len(each.names) > 1])
    world.weather(place, delay=(0.0, 0.4 + rng.random() * 0.8))
    world.loop.call_later(8.0, world.weather, place)
    for drive in place.names:
        world.beside(_asker(world, place, drive, Random(rng.random())))
    return 8.0


# Losses, kills, automation


def other_transactions(world: World, rng: Random) -> float:
    """Let replies over Modbus come late, twice, or with the number of another transaction."""
    places = [each for each in world.places if each.kind == "modbus"]
    if not places:
        return at_each_drive_late(world, rng)
    _spell(world, 4.0, {"reply again": 0.3, "reply of another": 0.2, "reply late": 0.3})
    _operators(world, rng, places, 3)
    return 4.0


def kill_at_a_file(world: World, rng: Random) -> float:
    """Kill the session, or the PC, at an operation on the disk."""
    name = f"m{rng.randrange(3)}"
    line, another_one = world.command(rng), world.command(rng)
    verbs = (
        b"/record %s --replace\r" % name.encode() + line + b"/record stop\r",
        b"/key F2 %s\r" % name.encode() + b"/key F3 %s\r" % name.encode(),
        line + another_one,
    )
    world.kill(1 + int(rng.random() ** 2 * 16), rng.choice(("before", "within", "within", "after")), False, "disk")
    world.person.type(rng.choice(verbs))
    if rng.random() < 0.4:
        download(world, rng)
    return 3.0


def nodes_exchanged(world: World, rng: Random) -> float:
    """Pull all adapters, and plug them in so that each has the node of another."""
    adapters = world.kernel.adapters
    if len(adapters) < 2:
        return at_each_drive(world, rng)
    nodes = [each.node for each in adapters]
    for adapter in adapters:
        world.floor.command(f"/sim unplug {adapter.line}")

    def plug() -> None:
        for adapter in adapters:
            world.floor.command(f"/sim plug {adapter.line}")
        for adapter, node in zip(adapters, nodes[1:] + nodes[:1], strict=True):
            adapter.node = node or adapter.node
        _operators(world, rng, world.places)

    world.loop.call_later(0.1 + rng.random(), plug)
    return 4.0


def beside_a_mover(world: World, rng: Random) -> float:
    """Start a drive by hand, and run a script on another drive of its line that ends early."""
    places = [each for each in world.places if len(each.drives) > 1 and PHRASES[each.language].endless]
    if not places or world.climate.wire.harmful:
        return at_each_drive(world, rng)
    place = rng.choice(places)
    first, second = rng.sample(place.names, 2)
    _starts_by_hand(world, place, first)
    run = Run(f"m{world.step}", f"/play m{world.step}", automatic=True)
    lines = Lines(world, rng, run, place.name, second, f"@{target(place, second)}", PHRASES[place.language])
    steps = [*motion(lines), *pause(lines), *(refused(lines) if rng.random() < 0.7 else ["/sleep 2"])]
    _plays(world, run, steps)
    later(world, 1.5 + rng.random(), b"/play stop\r")
    return 9.0


def refused_beside_a_mover(world: World, rng: Random) -> float:
    """Start a drive by hand, and run a macro on any drive of its line that only sets values, and is refused."""
    place = rng.choice([each for each in world.places if PHRASES[each.language].endless])
    _starts_by_hand(world, place, rng.choice(place.names))
    run = Run(f"m{world.step}", f"/play m{world.step}", automatic=True)
    drive = rng.choice(place.names)
    lines = Lines(world, rng, run, place.name, drive, f"@{target(place, drive)}", PHRASES[place.language])
    wrong = rng.choice((refused(lines), [f"{lines.at} STATUS"], [f"{lines.at} PR STATUS"], [f"{lines.at} MA 1,2,3,4"]))
    _plays(world, run, [*setting(lines) * (rng.random() < 0.5), *wrong])
    return 9.0


def _starts_by_hand(world: World, place: Place, drive: str) -> None:
    phrases = PHRASES[place.language]
    text = phrases.motion.format(phrases.first_motion + number(world))
    typed = f"@{target(place, drive)} {text}"
    world.history.commands[typed] = Command(text, place.name, drive, world.loop.now, world.stops)
    world.person.type(f"{typed}\r".encode())


def _plays(world: World, run: Run, steps: list[str]) -> None:
    """Play a macro a little later."""
    folder = world.session.settings.macros
    folder.mkdir(parents=True, exist_ok=True)
    text = f'name = "{run.name}"\n' + "".join(f"[[step]]\nafter = 0.1\nline = '{step}'\n" for step in steps)
    (folder / f"{run.name}.toml").write_text(text)
    tell(world, run)
    later(world, 0.5, f"{run.typed}\r".encode())


def _endless(world: World) -> bool:
    """Whether a drive can move until something ends it, on a line where noise changes no command."""
    return any(PHRASES[each.language].endless for each in world.places) and not world.climate.wire.harmful


MARKS = {
    "mcode": "\\200 \\far #_far ^M",
    "modbus": "\\200 \\far #_far",
    "pmx": ";far ;200 #_far ^M",
    "tmcl": ";200 //far #_far",
}
"""What begins a comment in some language, as it follows a number; `_` is a blank. No drive executes a line with it."""


def marks_in_lines(world: World, rng: Random) -> float:
    """Type lines of which a part would be taken for a comment: none of them is sent, nor a part of one."""
    for place in world.places:
        phrases = PHRASES[place.language]
        for mark in MARKS[place.language].split():
            form = rng.choice((phrases.value, phrases.motion))
            first = phrases.first if form == phrases.value else phrases.first_motion
            tail = f" {mark}".replace("_", " ") if mark.startswith("#") else mark
            drive, text = rng.choice(place.names), f"{form.format(first + number(world))}{tail}"
            world.history.told.repeated[(place.name, drive, text)] = 1
            world.person.type(f"@{target(place, drive)} {text}\r".encode(), rng.choice((0.0, 0.05)))
    return 4.0


CREWS = (
    Act("operators at once", 4, at_each_drive),
    Act("operators at once, late replies", 3, at_each_drive_late, fault=True),
    Act("operators at once, noise", 2, at_each_drive_in_noise, fault=True),
    Act("two at a share", 2, two_at_a_share),
    Act("stop at a write", 4, stop_at_a_write),
    Act("two stops", 2, two_stops),
    Act("stop at a full port", 3, stop_at_a_full_port, fault=True),
    Act("stop while owed", 2, stop_while_owed),
    Act("stop at USB", 2, stop_at_usb, fault=True),
    Act("other transactions", 2, other_transactions, fault=True),
    Act("kill at a file", 2, kill_at_a_file),
    Act("nodes exchanged", 1, nodes_exchanged, fault=True),
    Act("beside a mover", 2, beside_a_mover),
)
AFTER_CREWS = (
    Act("second host at USB", 1, second_host, fault=True, where=lambda world: bool(world.kernel.usb.plugged)),
    Act(
        "same question", 1, same_question, fault=True, where=lambda world: any(each.names[1:] for each in world.places)
    ),
    Act("marks in lines", 1, marks_in_lines),
    Act("half line at a share", 1, half_line, where=lambda world: bool(world.shares)),
    Act("refused beside a mover", 1, refused_beside_a_mover, where=_endless),
)
"""The last of all, each once."""
