"""Macros and scripts: played from a line or recorded, and ended by stops, Ctrl+C, a failure, or a loss."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random

from multidrop.shell.events import FAILURES
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.reading import read_script
from soak.simulation.acts.act import Act
from soak.simulation.acts.drawing import drawn, number, target
from soak.simulation.records.commands import Command
from soak.simulation.records.phrases import PHRASES, STOP, Phrases
from soak.simulation.records.told import Guarded, Line, Run
from soak.simulation.watching.path import watched
from soak.simulation.world import World

CTRL_C = b"\x03"
ENDS: Sequence[tuple[float, bytes]] = ((5, b""), (2, STOP), (2, CTRL_C), (1, b"/play stop\r"), (1, b"/stop\r"))
"""What ends a run early, and how often."""


@dataclass
class Lines:
    """Writes the lines of one run. Each sends what no other line sends."""

    world: World
    rng: Random
    run: Run
    line: str = ""
    drive: str = ""
    at: str = ""
    phrases: Phrases = PHRASES["mcode"]

    def turn(self) -> None:
        """Go on with any drive."""
        place, self.drive = drawn(self.world, self.rng)
        self.line, self.at, self.phrases = place.name, f"@{target(place, self.drive)}", PHRASES[place.language]

    def value(self) -> int:
        """A value for a setting."""
        return self.phrases.first + number(self.world)

    def sends(self, text: str, moves: bool = False) -> str:
        """A line for the drive."""
        line: Line = (self.line, self.drive, text)
        self.run.texts[line] = None
        if moves:
            self.run.moves[line] = None
        return f"{self.at} {text}"

    def sets(self, value: int) -> str:
        """A line that sets the value."""
        return self.sends(self.phrases.value.format(value))


def setting(lines: Lines) -> list[str]:
    """Set a value."""
    return [lines.sets(lines.value())]


def motion(lines: Lines) -> list[str]:
    """Start a long motion."""
    return [lines.sends(lines.phrases.motion.format(lines.phrases.first_motion + number(lines.world)), moves=True)]


def pause(lines: Lines) -> list[str]:
    """Wait."""
    return [lines.rng.choice(("/sleep 0.3", "/sleep 1", "/wait stopped 1", "/wait idle 1"))]


def asked(lines: Lines) -> list[str]:
    """Print a value, and expect it."""
    value = lines.value()
    return [lines.sets(value), f"{lines.at} {lines.phrases.print}", f'/expect "{value}" 1']


def checked(lines: Lines) -> list[str]:
    """Set a value, and check it."""
    value = lines.value()
    return [lines.sets(value), f"/assert {lines.at} {lines.phrases.question} == {value}"]


def awaited(lines: Lines) -> list[str]:
    """Set a value, and wait for it."""
    value, word = lines.value(), lines.phrases.question
    return [lines.sets(value)] + [f"/wait {lines.at} {word}={value} 1"] * word.isalnum()


def loop(lines: Lines) -> list[str]:
    """Set values in a loop."""
    values = [lines.value() for _ in range(3)]
    for value in values:
        lines.sets(value)
    body = [f"{lines.at} {lines.phrases.value.format('{n}')}", "/set n n + 1"]
    return [f"/set n {values[0]}", "/repeat 3", *body, "/end"]


def branch(lines: Lines) -> list[str]:
    """Set one value or another."""
    first, *others = (lines.value() for _ in range(3))
    then, otherwise = map(lines.sets, others)
    return [
        lines.sets(first),
        f"/if {lines.at} {lines.phrases.question} == {first}",
        then,
        "/else",
        otherwise,
        "/end",
        f"/print {first}",
    ]


def refused(lines: Lines) -> list[str]:
    """Send what the drive refuses."""
    return [f"{lines.at} {lines.phrases.wrong}"]


def guarded(lines: Lines) -> list[str]:
    """Send what only a person may agree to."""
    text = lines.rng.choice(lines.phrases.denied)
    lines.world.history.told.guarded.append(
        Guarded(lines.world.loop.now, ((lines.line, lines.drive, text),), asks=False)
    )
    return [f"{lines.at} {text}"]


def called(lines: Lines) -> list[str]:
    """Call a script."""
    file = f"called-{lines.world.step}-{number(lines.world)}.txt"
    (lines.world.folder / file).write_text("\n".join((*setting(lines), *pause(lines))))
    return [f"/call {file}"]


Part = Callable[[Lines], list[str]]
PARTS: Sequence[tuple[float, Part]] = (
    (4, setting),
    (6, motion),
    (3, pause),
    (1, asked),
    (1, checked),
    (1, awaited),
    (2, loop),
    (1, branch),
    (1, refused),
    (0.3, guarded),
    (0.5, called),
)


def body(lines: Lines) -> list[str]:
    """The lines of a macro or a script."""
    parts = lines.rng.choices([part for _, part in PARTS], [weight for weight, _ in PARTS], k=lines.rng.randrange(2, 6))
    found = []
    for part in parts:
        lines.turn()
        found += part(lines)
    return found


def tell(world: World, run: Run, times: int = 1) -> None:
    """Note what a run is about to send."""
    history = world.history
    history.told.runs[run.typed] = run
    for line, drive, text in run.texts:
        if times == 1:
            typed = f"@{target(world.place(line), drive)} {text}"
            history.commands[typed] = Command(text, line, drive, world.loop.now, world.stops)
        else:
            history.told.repeated[line, drive, text] = times


def later(world: World, delay: float, data: bytes) -> None:
    """Let a person type something after a while."""

    def typed() -> None:
        world.stops += data.count(STOP)
        world.person.type(data)

    world.loop.call_later(delay, typed)


def end(world: World, rng: Random) -> None:
    """Perhaps end what runs."""
    data = rng.choices([each for _, each in ENDS], [weight for weight, _ in ENDS])[0]
    if data:
        later(world, rng.random() ** 2 * 2, data + b"/resume\r" * (data != b"/play stop\r"))


def macro(world: World, rng: Random) -> None:
    """Play a macro of a file."""
    name = f"m{world.step}"
    times, fast = rng.choice((1, 1, 1, 2)), rng.random() < 0.3
    run = Run(name, f"/play {name}" + f" --times {times}" * (times > 1) + " --fast" * fast, automatic=True)
    lines = Lines(world, rng, run)
    steps = body(lines)
    text = f'name = "{name}"\n'
    if rng.random() < 0.3:
        lines.run = after = Run(name, "")
        lines.turn()
        text += f"on_early_end = {json.dumps(setting(lines))}\n"
        run.on_early_end = after.texts
        world.history.told.repeated |= dict.fromkeys(after.texts, 1)
    for step in steps:
        text += f"[[step]]\nafter = {rng.choice((0.0, 0.0, 0.2)):.1f}\nline = {json.dumps(step)}\n"
    folder = world.session.settings.macros
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.toml").write_text(text)
    bystander(world)
    tell(world, run, times)
    world.person.type(f"{run.typed}\r".encode(), rng.choice((0.0, 0.02)))
    end(world, rng)


def recorded(world: World, rng: Random) -> None:
    """Record typed lines as a macro, and play it."""
    name = f"r{world.step}"
    run = Run(name, f"/play {name}")
    lines = Lines(world, rng, run)
    typed = []
    for _ in range(rng.randrange(1, 4)):
        lines.turn()
        typed += rng.choice((setting, motion))(lines)
    tell(world, run, 2)
    for line in (f"/record {name}", *typed, "/record stop", run.typed):
        world.person.type(f"{line}\r".encode(), rng.choice((0.0, 0.02)))
    end(world, rng)


def script(world: World, rng: Random) -> None:
    """Run a script beside the prompt, as `multidrop run` does in a session of its own."""
    run = Run(f"s{world.step}", f"s{world.step}.txt", automatic=True)
    lines = Lines(world, rng, run)
    (world.folder / run.typed).write_text("\n".join(body(lines)))
    bystander(world)
    tell(world, run)

    async def work() -> None:
        session = world.session
        with contextlib.suppress(*FAILURES, asyncio.CancelledError):
            read = read_script(run.typed, {}, session.macros)
            await watched(world, run, session.tasks.run(run_script(session, PERSON, read)))

    world.beside(work())
    end(world, rng)


def long_move(world: World, rng: Random) -> None:
    """Start a long motion, and end it, or not."""
    place, drive = drawn(world, rng, lambda each: each.endless)
    phrases = PHRASES[place.language]
    text = phrases.motion.format(phrases.first_motion + number(world))
    typed = f"@{target(place, drive)} {text}"
    world.history.commands[typed] = Command(text, place.name, drive, world.loop.now, world.stops)
    world.person.type(f"{typed}\r".encode())
    if rng.random() < 0.4:
        end(world, rng)


def bystander(world: World) -> None:
    """Perhaps start a drive by hand first: the early end of what follows leaves it alone."""
    rng = Random(f"{world.seed} bystander {world.step}")
    if rng.random() < 0.4:
        long_move(world, rng)


AUTOMATION = (
    Act("macro", 3, macro),
    Act("recorded macro", 1, recorded),
    Act("script", 2, script),
    Act("long move", 3, long_move),
)
