"""Jobs of the workshop that end early: programs and motions of automation, stops of watchers, motions that fail."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from multidrop.simulator.cell.spec import Faults
from soak.simulation.acts.act import Act
from soak.simulation.acts.workshop import LINE, SETTLED, Workshop, at_work, workshop
from soak.simulation.records.told import NEAR, SHORT
from soak.simulation.watching.path import STOPPED_TOO
from soak.simulation.world import World

PARTY = ("a", "b", "c")
BY_HAND = "SL 5000"
"""What a person has started on a drive beside the automation."""
STARTS = ("EX G1", "EX G1", "SL 40000", "MR 90000000", "MA 90000000")
WRONG = ("VM=-1", "STATUS", "PR STATUS", "MA 1,2,3,4", "EX Z9")
"""Lines that a drive refuses."""
PROGRAM = "PG 1\nLB G1\nMR {steps}\nH\nH {pause}\nBR G1\nE\nPG\n"
"""A program that moves its drive again and again, with pauses."""
CANCEL, INTERRUPT = "cancel", "interrupt"
CLAMP = 41_000_000


def _with_program(rng: Random, world: World) -> str:
    """The table of a drive with such a program."""
    folder = world.folder / f"workshop{world.step}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "g1.mxt").write_text(PROGRAM.format(steps=rng.choice((2000, 90000)), pause=rng.choice((20, 2000))))
    return 'program = "g1.mxt"'


def _automation(shop: Workshop) -> Callable[[list[str]], Any]:
    return shop.rng.choice((shop.script, shop.macro))


AGAIN = "stop sent again"
ENDINGS = (INTERRUPT, "@a VM=-1", "@c VM=-1", "/assert 1 == 2", '/wait "nothing" 0.5')
"""What ends automation early, besides the end of its task."""


async def early_end(world: World, rng: Random) -> None:
    """Let automation start programs and motions, and end early, beside a drive that a person has started."""
    async with workshop(world, rng, "mcode", PARTY, more={"a": _with_program(rng, world)}) as shop:
        if beside := rng.random() < 0.7:
            await shop.type(f"@b {BY_HAND}")
        for ending in (*rng.sample(ENDINGS, 2), CANCEL):
            start = rng.choice(STARTS)
            lines = [f"@a {start}", f"/sleep {rng.random() * 2:.2f}", ending if ending[0] in "@/" else "/sleep 30"]
            work = shop.start(_automation(shop)(lines))
            if ending in (CANCEL, INTERRUPT):
                await asyncio.sleep(0.3 + rng.random() * 2)
                work.cancel() if ending == CANCEL else shop.session.interrupt()
            why = await work
            await asyncio.sleep(SETTLED)
            words = f"{start!r} of an automation that ended early ({ending}: {why})"
            shop.fact("automation", not (shop.moves("a") or shop.device("a").running), f"{words}: a goes on")
            beside = beside and ending != INTERRUPT
            # who only cancels a task hears nothing of its stops
            too = any(STOPPED_TOO in text or (ending == CANCEL and AGAIN in text) for _, text in shop.said)
            shop.fact("automation", shop.moves("b") or too or not beside, f"{words}: b was stopped")
            beside = beside and shop.moves("b")


SHUTTLES = "".join(
    f"PRG {number}\nWHILE 1=1\n{axis}900\nWAIT{axis}\nDELAY=300\n{axis}0\nWAIT{axis}\nENDWHILE\nEND\n"
    for number, axis in enumerate("XY")
)
"""Two programs of a controller, each of which moves an axis."""


async def controller(world: World, rng: Random) -> None:
    """Let automation start a program of a controller, and end early, beside another that a person has started."""
    more = {"01": f"program_text = {json.dumps(SHUTTLES)}"}
    async with workshop(world, rng, "pmx", ("01", "02"), more=more) as shop:

        def runs(number: int) -> bool:
            return str(shop.witnesses["01"].unwatched(f"SASTAT{number}", shop.floor.now())) != "0"

        await shop.type("@02 JX+")
        for ending in rng.sample(("@01 JOYENA=1", "@02 JOYENA=1", "/assert 1 == 2", CANCEL), 4):
            start = rng.choice(("SR0=1", "SR1=1", "SR1=1", "JX+"))
            lines = [f"@01 {start}", f"/sleep {rng.random():.2f}", ending if ending[0] in "@/" else "/sleep 30"]
            work = shop.start(_automation(shop)(lines))
            if ending == CANCEL:
                await asyncio.sleep(0.3 + rng.random())
                work.cancel()
            why = await work
            await asyncio.sleep(SETTLED)
            words = f"{start!r} of an automation that ended early ({ending}: {why})"
            shop.fact("automation", not (runs(0) or runs(1) or shop.moves("01")), f"{words}: 01 goes on")
            shop.fact("automation", shop.moves("02"), f"{words}: 02, started by a person, was stopped")


async def spared(world: World, rng: Random) -> None:
    """Start a drive by hand; then automation on its line reads, sets values, is refused, and ends early."""
    async with workshop(world, rng, "mcode", PARTY) as shop:
        await shop.type(f"@b {BY_HAND}")
        drive = rng.choice(("b", "b", "a"))
        lines = rng.sample((f"@{drive} R2=7", f"@{drive} PR P", f"@{drive} R3=8"), rng.randrange(0, 3))
        wrong = rng.choice(WRONG)
        lines.append(rng.choice((f"@{drive} {wrong}", f"@{drive} {wrong}", "/assert 1 == 2")))
        why = await _automation(shop)(lines)
        await asyncio.sleep(SETTLED)
        shop.fact("spared", shop.moves("b"), f"{lines} ended early ({why}), and b, started by hand, was stopped")
        turn = world.seed // TURNS % (len(SPARED) + 1)
        if turn < len(SPARED):
            await SPARED[turn](shop)
    if turn == len(SPARED):
        await _axis(world, rng)


async def _routine(shop: Workshop) -> None:
    """Let a drive refuse a line that has a routine for errors, which moves it."""
    for line in ("PG 1", "LB Z1", "SL 30000", "RT", "E", "PG", "OE Z1"):
        await shop.type(f"@c {line}")
    lines = [*["@c PR P"] * shop.rng.randrange(2), f"@c {shop.rng.choice(WRONG)}"]
    why = await _automation(shop)(lines)
    await asyncio.sleep(SETTLED)
    words = f"{lines} ended early ({why}), and c has a routine for errors"
    shop.fact("automation", not shop.moves("c"), f"{words}: it goes on")
    shop.fact("spared", shop.moves("b"), f"{words}: b, started by hand, was stopped")


async def _program(shop: Workshop) -> None:
    """Let a drive refuse a line while a program of the same automation runs in it."""
    for line in ("PG 1", "LB Z2", "H 60000", "E", "PG"):
        await shop.type(f"@c {line}")
    lines = ["@c EX Z2", "/sleep 0.4", f"@c {shop.rng.choice(WRONG)}"]
    why = await _automation(shop)(lines)
    await asyncio.sleep(SETTLED)
    words = f"{lines} ended early ({why})"
    shop.fact("automation", not shop.device("c").running, f"{words}: the program of c runs on")
    shop.fact("spared", shop.moves("b"), f"{words}: b, started by hand, was stopped")


async def _rest(shop: Workshop) -> None:
    """Move a drive to its target, wait for that, and let another one refuse a line."""
    await shop.type("@b SL 0")
    await asyncio.sleep(SETTLED)
    before, lines = len(shop.executed("c")), ["@c MR 500", "/wait stopped 20", f"@a {shop.rng.choice(WRONG)}"]
    why = await _automation(shop)(lines)
    await asyncio.sleep(SETTLED)
    stops = [each for each in shop.executed("c")[before:] if each in ("E", "SL 0")]
    shop.fact("spared", not stops, f"{lines} ended early ({why}), and c, which was read at rest, got {stops}")


SPARED = (_routine, _program, _rest)
TURNS = 10
"""The seeds in which every job has its turn."""


async def _axis(world: World, rng: Random) -> None:
    """Let automation start one axis of a controller, and end early, beside another axis that a person has started."""
    async with workshop(world, rng, "pmx", ("01", "02")) as shop:
        by_hand, own = rng.sample("XY", 2)
        await shop.type(f"@01 J{by_hand}+")
        lines = [f"@01 J{own}-", "/sleep 0.5", rng.choice(("@01 JOYENA=1", "@02 JOYENA=1", "/assert 1 == 2"))]
        why = await _automation(shop)(lines)
        await asyncio.sleep(SETTLED)
        words = f"{lines} ended early ({why})"
        shop.fact("automation", not shop.moves("01", own), f"{words}: {own} goes on")
        shop.fact("spared", shop.moves("01", by_hand), f"{words}: {by_hand}, started by hand, was stopped")


class _Gate:
    """In place of the socket to which watchers connect: keeps what it would call."""

    made: Any = None

    def __init__(self, folder: object, loop: object, calls: Any) -> None:
        self.calls, self.path = calls, folder
        self.watchers: list[Any] = []
        _Gate.made = self

    def close(self) -> None:
        """Do nothing."""


async def watched(world: World, rng: Random) -> None:
    """Share the screen; a watcher presses the stop key while automation moves a drive; then more of it begins."""
    from multidrop.features.shared_screen import feed

    async with workshop(world, rng, "mcode", PARTY[:2]) as shop:
        session = shop.session
        app: Any = SimpleNamespace(
            session=session, stop_ahead=session.stop_ahead, presenter=SimpleNamespace(notes=[], on_records={})
        )
        with mock.patch.object(feed, "Gate", _Gate):
            fed = feed.ScreenFeed(app, shop.folder)
        calls = _Gate.made.calls
        running = shop.start(_automation(shop)(["@a SL 40000", "/sleep 30"])) if rng.random() < 0.7 else None
        await asyncio.sleep(0.5 + rng.random() * 2)
        calls.stop_ahead()
        calls.stop("eve")
        await asyncio.sleep(SETTLED)
        shop.fact("automation", running is None or running.done(), "a watcher's stop: automation goes on")
        shop.fact("stopped", not shop.moves("a"), "a watcher's stop: a moves")
        value = CLAMP + world.step
        why = await _automation(shop)([f"@b R2={value}"])
        done = f"R2={value}" in shop.executed("b")
        shop.fact("latched", why and not done, f"automation that began after a watcher's stop was executed ({why})")
        await shop.type("/resume")
        why = await _automation(shop)([f"@b R2={value + 1}"])
        shop.fact("lost", why or f"R2={value + 1}" in shop.executed("b"), "automation after /resume was not executed")
        fed.close()


KINDS = ("limit", "stall", "other")
SETTINGS = {
    "silent": ("VM=200000",),
    "limit": ("EE=0", "VM=400000", "IS=1,2,0"),
    "other": ("EE=0", "IS=1,0,0", "VM=2560000", "A=1000000", "D=1000000"),
    "stall": ("EE=1", "IS=1,0,0", "VM=8000", "A=40000", "D=40000", "MT=50"),
}
WAITS = ("/wait stopped 40", "/wait stopped 40", "/wait idle 40", "/wait @a P={goal} 40", "/wait ended 40")
RESTS = ("/wait stopped 40", "/wait idle 40", "/wait ended 40")
SILENT = Faults(delay=(0.5, 1.5))
"""Replies come later than the time-out."""


async def failing(world: World, rng: Random) -> None:
    """Move a drive in automation, and let the motion fail, or its replies be late; then comes the clamp."""
    async with workshop(world, rng, "mcode", PARTY[:2], timeout=0.4) as shop:
        moved: dict[str, bool] = {}
        for name in PARTY[:2]:
            shop.before_execution(name, lambda text: moved.setdefault(text, shop.moves("a")))
        for number, kind in enumerate(("silent", *rng.sample(KINDS, 2))):
            goal = (20_000 if kind == "stall" else 2_000_000) + world.step
            clamp = f"R2={CLAMP + world.step * 10 + number}"
            wait = rng.choice(WAITS if kind != "silent" else RESTS).format(goal=goal)
            settings = [f"@a {each}" for each in SETTINGS[kind]]
            pause = ["/sleep 4"] if kind == "silent" else []  # until the drives reply again, and before the target
            lines = [*settings, "@a P=0", f"@a MA {goal}", wait, *pause, f"@{rng.choice('ab')} {clamp}"]
            shop.floor.command(f"/sim input {LINE}:a 1 1")
            shop.floor.command(f"/sim lock {LINE}:a off")
            failure = shop.start(_fail(shop, kind))
            why = await _automation(shop)(lines)
            await failure
            await asyncio.sleep(SETTLED)
            at = shop.position("a")
            done, there = clamp in (*shop.executed("a"), *shop.executed("b")), abs(at - goal) <= NEAR
            words = f"{kind}, {wait!r}: a is at {at} of {goal}; {clamp!r} was {'' if done else 'not '}executed ({why})"
            shop.fact("outcome", there or not done or "ended" in wait, words)
            unknown = any("outcome: unknown" in text for _, text in shop.said)  # which a script can ask for
            shop.fact("outcome", unknown or not moved.get(clamp), f"{words}, as a moved")
            shop.fact("outcome", done or not there or not SHORT.search(why), words)


async def _fail(shop: Workshop, kind: str) -> str:
    """Let a motion fail, or replies be late, once it has begun."""
    for _ in range(2000):
        if shop.moves("a"):
            break
        await asyncio.sleep(0.01)
    await asyncio.sleep(0.2 + shop.rng.random())
    wire = shop.floor.floor.wires[LINE]
    if kind == "limit":
        shop.floor.command(f"/sim input {LINE}:a 1 0")
    elif kind == "stall":
        shop.floor.command(f"/sim lock {LINE}:a on")
    elif kind == "other":
        shop.witnesses["a"].unwatched("SL 0", shop.floor.now())
        wire.look_again()
    elif kind == "silent":
        wire.disturb(SILENT)
        await asyncio.sleep(1 + shop.rng.random() * 3)
        wire.disturb(Faults())
    return kind


ON_ITS_WAY = 0.05
"""The longest time, s, in which a frame that has left is executed."""


async def blocked(world: World, rng: Random) -> None:
    """Type commands as the port takes nothing, and stop: what has not left by then never does."""
    async with workshop(world, rng, "tmcl", ("1", "2")) as shop:
        executed: dict[str, float] = {}
        for name in shop.names:
            shop.before_execution(name, lambda text: executed.setdefault(text, world.loop.now))
        for _ in range(rng.randrange(2, 4)):
            shop.takes(nothing=True)
            value = 4_000_000 + world.step * 1000 + len(shop.said)
            typed = {rng.choice(shop.names): f"SAP 194, 0, {value + number}" for number in range(3)}
            work = [shop.start(shop.type(f"@{drive} {text}")) for drive, text in typed.items()]
            await asyncio.sleep(rng.random() * 0.1)
            stopped = world.loop.now
            shop.session.stop_ahead()
            shop.session.stop("Ctrl+X")
            await asyncio.sleep(0.1 + rng.random() * 0.3)
            shop.takes(nothing=False)
            await asyncio.gather(*work)
            await asyncio.sleep(2.0)
            await shop.type("/resume")
            for text in typed.values():
                at = executed.get(text, 0.0)
                words = f"{text!r}, typed before a stop at {stopped:.3f}, was executed at {at:.3f}"
                shop.fact("after a stop", at < stopped + ON_ITS_WAY, words)


ENDS = (
    Act("workshop, early end", 2, at_work(early_end)),
    Act("workshop, early end of a controller", 1, at_work(controller)),
    Act("workshop, spared", 1, at_work(spared)),
    Act("workshop, stop of a watcher", 1, at_work(watched)),
    Act("workshop, failing motion", 2, at_work(failing)),
)
PORT = Act("workshop, a port that takes nothing", 1, at_work(blocked))
