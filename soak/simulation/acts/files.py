"""Programs and settings between files and drives: downloads, uploads, listings, backups, restores."""

from __future__ import annotations

from random import Random

from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import end, later, tell
from soak.simulation.acts.drawing import drawn, number, target
from soak.simulation.records.phrases import PHRASES, STOP
from soak.simulation.records.told import Download, Guarded, Line, Run
from soak.simulation.world import World

ANSWERS = (b"y", b"y", b"y", b"n", b"\r", b"\x1b", b"\x03", STOP, b"")
EARLY = 0.1
"""A key that comes so soon after the question, s, answers nothing."""


def answered(world: World, rng: Random, data: bytes, *texts: Line, yes: bool = True) -> None:
    """Type a line that asks before it sends texts, and answer. `yes` False: never with a yes."""
    answer = rng.choice(ANSWERS if yes else ANSWERS[3:])
    world.history.told.guarded.append(Guarded(world.loop.now, texts))
    world.person.type(data)
    if answer:
        later(world, EARLY if rng.random() < 0.1 else 0.6 + rng.random(), answer + b"\r/resume\r" * (answer == STOP))


def download(world: World, rng: Random) -> None:
    """Send a program to a drive that may have one; some act at once, and ask."""
    place, drive = drawn(world, rng, lambda each: each.program)
    phrases = PHRASES[place.language]
    count = number(world)
    file, value = f"p{count}{phrases.ending or '.mxt'}", phrases.first + count
    acting = phrases.acting.format(phrases.first_motion + count) if rng.random() < 0.2 else ""
    line: Line = (place.name, drive, phrases.value.format(value))
    outside = f"{line[2]}\n" * (place.language == "mcode" and rng.random() < 0.5)
    text = acting + outside + (phrases.program or PHRASES["mcode"].program).format(value=value, label=count % 9)
    (world.folder / file).write_text(text)
    option = rng.choice(("", "", " --save", " --only-changed", " --no-verify"))
    run = Run(file, f"/download {file} {target(place, drive)}{option}")
    run.download = Download(place.name, drive, file, text)
    if acting:
        run.moves[place.name, drive, acting.strip()] = None
    run.texts = run.moves | ({line: None} if outside else {})
    tell(world, run)
    if acting:
        answered(world, rng, f"{run.typed}\r".encode(), *run.texts)
    else:
        world.person.type(f"{run.typed}\r".encode())
        end(world, rng)


def read(world: World, rng: Random) -> None:
    """List or save the program of a drive, or save its settings."""
    place, drive = drawn(world, rng)
    where, count = target(place, drive), number(world)
    line = rng.choice(
        (
            f"/list {where}",
            f"/upload u{count}{PHRASES[place.language].ending} {where}",
            f"/params backup b{count}.toml {where}",
        )
    )
    world.person.type(f"{line}\r".encode())
    if rng.random() < 0.3:
        end(world, rng)


def restore(world: World, rng: Random) -> None:
    """Restore a setting from a file, after a question."""
    place, drive = drawn(world, rng)
    phrases, file, count = PHRASES[place.language], f"set{world.step}.toml", number(world)
    text = phrases.settings.format(phrases.first + count)
    (world.folder / file).write_text(text)
    sent = phrases.restored.format(phrases.first + count)
    run = Run(file, f"/params restore {file} {target(place, drive)}", {(place.name, drive, sent): None})
    tell(world, run, 1)
    answered(world, rng, f"{run.typed}\r".encode(), *run.texts)


FILES = (Act("download", 2, download), Act("read a file", 1, read), Act("restore", 1, restore))
