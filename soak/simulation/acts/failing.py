"""Motions that fail in the middle of a script: a limit switch closes, or something blocks the rotor.

The last steps of the stories that end with `CREWS`, so no other story is changed by them. The line after the wait is
the one that matters: it may go out only if the drive is at its target.
"""

from __future__ import annotations

import asyncio
import contextlib
from random import Random

from multidrop.shell.events import FAILURES
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.reading import read_script
from soak.simulation.acts.act import Act
from soak.simulation.acts.automation import Lines, tell
from soak.simulation.acts.drawing import number, target
from soak.simulation.records.phrases import PHRASES
from soak.simulation.records.told import Awaited, Run
from soak.simulation.watching.path import watched
from soak.simulation.world import World

LEXIUM = ("mcode", "modbus")
CLOSED = ("LMDCM", "LMDCE")
WAITS = ("/wait stopped 20", "/wait idle 20", "/wait stopped 20", "/wait {at} P={goal} 20")
ENCODER = ("EE=1", "VM=8000", "A=40000", "D=40000", "MT=50")
"""A stall shows with the encoder in use."""
SETTINGS = {"limit": ("IS=1,2,0",), "stall": ENCODER, "nothing": ()}


def failing(world: World, rng: Random) -> float:
    """Move a drive in a script; close its limit switch on the way, block its rotor, or let it be."""
    place = rng.choice([each for each in world.places if each.language in LEXIUM])
    drive = rng.choice(place.names)
    run = Run(f"f{world.step}", f"f{world.step}.txt", automatic=True)
    lines = Lines(world, rng, run, place.name, drive, f"@{target(place, drive)}", PHRASES[place.language])
    device = world.witnesses[place.name, drive].device
    product = device.spec.personality
    kinds = ["nothing"] + ["limit"] * 2 * product.startswith("LMD") + ["stall"] * 2 * (product in CLOSED)
    kind = rng.choice(kinds)
    goal = (20_000 if kind == "stall" else 3_000_000) + number(world)
    before = [f"{lines.at} {each}" for each in ("SL 0", *SETTINGS[kind])]
    wait = rng.choice(WAITS).format(at=lines.at, goal=goal)
    move, value = lines.sends(f"MA {goal}", moves=True), lines.value()
    text = [before[0], "/wait ended 5", *before[1:], f"{lines.at} P=0", move, wait, lines.sets(value)]
    (world.folder / run.typed).write_text("\n".join(text))
    tell(world, run)

    def fail() -> None:
        if kind == "limit":
            world.floor.command(f"/sim input {place.name}:{drive} 1 0")
        elif kind == "stall":
            world.floor.command(f"/sim lock {place.name}:{drive} on")

    async def work() -> None:
        session = world.session
        with contextlib.suppress(*FAILURES, asyncio.CancelledError):
            read = read_script(run.typed, {}, session.macros)
            try:
                await watched(world, run, session.tasks.run(run_script(session, PERSON, read)))
            finally:
                awaited = Awaited(run, (place.name, drive, PHRASES[place.language].value.format(value)), goal)
                awaited.position = device.position(world.floor.now())
                world.history.told.awaited.append(awaited)

    world.beside(work())
    world.loop.call_later(1.5 + rng.random() * 2, fail)
    return 25.0


FAILING = Act("failing motion", 1, failing, where=lambda world: any(each.language in LEXIUM for each in world.places))
