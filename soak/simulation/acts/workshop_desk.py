"""Jobs of the workshop at the desk: questions, downloads, restores, echo modes, scales, and replies that come late."""

from __future__ import annotations

import asyncio
import re
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from multidrop.drives.events import Sample
from multidrop.shell.events import OnBus, Printed
from multidrop.simulator.cell.spec import Faults
from soak.simulation.acts.act import Act
from soak.simulation.acts.workshop import LINE, Workshop, at_work, workshop
from soak.simulation.records.phrases import PHRASES
from soak.simulation.world import World

NAMES = {"mcode": ("a", "b"), "pmx": ("01", "02"), "tmcl": ("1", "2")}
FIRST = 42_000_000
BACKUP = re.compile(r"backup: (\S+)")
YES, NO = ("IP", "CP", "S"), ("FD", 'DN="z"', "LK=1", "AS=3", "UG", "BD=19", "PY=0")
"""Lines that ask first, and leave a drive usable; lines that get no yes here."""


def _spelled(rng: Random, text: str) -> str:
    """A line in capitals, in small letters, or in both."""
    return rng.choice((text, text.lower(), text.lower(), text.capitalize()))


async def questions(world: World, rng: Random) -> None:
    """Type lines that ask first, one after the other, each with another answer than the one before."""
    language = rng.choice(("mcode", "mcode", "mcode", "pmx", "tmcl"))
    phrases, names = PHRASES[language], NAMES[language]
    usable, denied = (YES, NO) if language == "mcode" else (phrases.guarded, phrases.denied)
    async with workshop(world, rng, language, names) as shop:
        agreed = rng.random() < 0.5
        for _ in range(rng.randrange(2, 5)):
            drive, text = rng.choice(names), rng.choice(usable if agreed else (*usable, *denied))
            typed = _spelled(rng, text) if language == "mcode" else text
            asked, before = len(shop.asked), len(shop.executed(drive))
            shop.answers = [agreed]
            why = await shop.type(f"@{drive} {typed}")
            done = text.upper() in (each.upper() for each in shop.executed(drive)[before:])
            answer = "yes" if agreed else "no"
            shop.fact("asked", len(shop.asked) == asked + 1, f"{typed!r} asked {len(shop.asked) - asked} times")
            shop.fact("asked", agreed or not done, f"{typed!r} was executed after a no")
            shop.fact("lost", why or done, f"{typed!r} was not executed after a {answer}, and nothing was said")
            agreed = not agreed
        typed, sofar = _spelled(rng, rng.choice((*usable, *denied))), [*shop.executed(names[0])]
        why = await shop.script([f"@{names[0]} {typed}"])
        shop.fact("asked", why and shop.executed(names[0]) == sofar, f"{typed!r} of a script was executed ({why})")


def _held(shop: Workshop, drive: str) -> list[str]:
    """The program lines that a drive holds."""
    return [each.text.strip() for _, each in sorted(shop.device(drive).program.lines.items())]


async def downloads(world: World, rng: Random) -> None:
    """Send programs to one drive, and perhaps to another, each after a backup of the one before."""
    async with workshop(world, rng, "mcode", NAMES["mcode"]) as shop:
        for number in range(rng.randrange(2, 4)):
            drive, value = rng.choice("aaab"), FIRST + world.step * 10 + number
            file = shop.folder / f"p{number}.mxt"
            file.write_text(PHRASES["mcode"].program.format(value=value, label=number))
            old, begun, option = _held(shop, drive), len(shop.said), rng.choice(("", "", " --save", " --no-verify"))
            why = await shop.type(f"/download {file} {LINE}:{drive}{option}")
            words = f"download {number} to {drive}{option} ({why or 'done'})"
            named = [Path(each) for _, text in shop.said[begun:] for each in BACKUP.findall(text)]
            kept = "\n".join(each.read_text() for each in named)
            shop.fact("programs", named and all(each in kept for each in old), f"{words}: {named} has not {old}")
            new = " ".join(_held(shop, drive))
            shop.fact("programs", why or f"R2={value}" in new, f"{words}: the drive holds {new!r}")


async def restores(world: World, rng: Random) -> None:
    """Restore a setting, and save it; the drive may hold another value than it was sent."""
    async with workshop(world, rng, "mcode", NAMES["mcode"]) as shop:
        for number in range(rng.randrange(1, 3)):
            value, wrong = FIRST + world.step * 10 + number, rng.random() < 0.6
            file = shop.folder / f"set{number}.toml"
            file.write_text(f'[drive]\nlanguage = "MCode"\n[variables]\nR2 = {value}\n')
            device, shop.answers = shop.device("a"), [True]
            if wrong:
                _rounds(device)
            before = len(shop.executed("a"))
            why = await shop.type(f"/params restore {file} {LINE}:a --save")
            saved = "S" in shop.executed("a")[before:]
            holds = device.memory.values["R2"]
            words = f"{file.name} with {value}: the drive holds {holds}, and {'saved' if saved else 'did not save'} it"
            shop.fact("saved", not saved or holds == value, f"{words} ({why or 'done'})")
            shop.fact("saved", saved or why, words)
            shop.fact("saved", why or holds == value, f"{words}, which was reported as done")


def _rounds(device: Any) -> None:
    """Let a drive hold the next even value of R2, a drive's own rounding."""
    execute = device.execute

    def rounded(text: Any, now: float, **how: Any) -> Any:
        answer = execute(text, now, **how)
        if str(text).strip().startswith("R2="):
            device.memory.values["R2"] -= 1
        return answer

    device.execute = rounded


def _serial(number: int) -> str:
    return f'identity = {{ serial = "{number}" }}'


async def owed(world: World, rng: Random) -> None:
    """Lose a line in a download; then other drives of its kind are on it; then the drive is back."""
    names = NAMES["mcode"]
    shop = Workshop(world, rng, "mcode", names, {"a": _serial(111), "b": _serial(222)})
    await shop.serve()
    shop.sit_down()
    await shop.open()
    device, host = shop.device("a"), world.network.host(shop.host)
    (shop.folder / "p.mxt").write_text(PHRASES["mcode"].program.format(value=FIRST, label=1))
    work = shop.start(shop.type(f"/download {shop.folder / 'p.mxt'} {LINE}:a"))
    while device.memory.values["EM"] != 0 and not work.done():
        await asyncio.sleep(0.001)
    await asyncio.sleep(rng.random() * 0.01)
    world.network.refuse(shop.host, 1e6)
    await asyncio.sleep(0.1)
    await shop.session.close()
    await asyncio.sleep(5.0)
    borrowed = device.memory.values["EM"] == 0
    host.refuses = 0.0
    if borrowed and rng.random() < 0.9:
        other = Workshop(world, rng, "mcode", names, {"a": _serial(333), "b": _serial(444)})
        await shop.unplug()
        await other.serve()
        other.device("a").memory.values["EM"] = 0
        other.sit_down()
        await other.open()
        await asyncio.sleep(1.0)
        await other.session.close()
        modes = [int(other.device(each).memory.values["EM"]) for each in names]
        shop.fact(
            "restored", modes == [0, 1], f"what was owed to a was given to another drive: EM is {modes}, not 0, 1"
        )
        await other.close()
        await shop.serve_again()
    shop.sit_down()
    await shop.open()
    await asyncio.sleep(1.0)
    await shop.session.close()
    modes = [int(shop.device(each).memory.values["EM"]) for each in names]
    shop.fact("restored", modes == [1, 1], f"EM is {modes} at the end, not 1, 1")
    await shop.close()


async def expected(world: World, rng: Random) -> None:
    """Let a script expect a text that only another person's line prints, and then one that its own line prints."""
    async with workshop(world, rng, "mcode", NAMES["mcode"]) as shop:
        for number, own in enumerate((False, False, True)):
            value = FIRST + world.step + number
            shop.device("b").memory.values["R1"] = value
            mark = f"R2={value}"
            ask = ["/sleep 0.5", "@b PR R1"] if own else ["@a PR R2", f"/sleep {1 + rng.random():.2f}"]
            work = shop.start(shop.script([*ask, f'/expect "{value}" 2', f"@a {mark}"]))
            for _ in range(8):
                await asyncio.sleep(rng.random() * 0.4)
                await shop.type("@b PR R1")
            why, whose = await work, "its own line" if own else "another's line"
            done = mark in shop.executed("a")
            shop.fact("credited", done == own, f"/expect of what {whose} prints: the script went on: {done} ({why})")


SCALES = {"mcode": "5 mm/turn", "pmx": "0.4 um/step", "tmcl": "5 mm/turn"}
WORDS = {
    "mcode": (("MS=128", "MS=256"), ("EE=1", "EE=0"), ("ee=1", "ee=0"), ("ms=64", "ms=256"), ("MS 128", "MS 256")),
    "tmcl": (("SAP 140, 0, 5", "SAP 140, 0, 8"), ("sap 140, 0, 4", "sap 140, 0, 8")),
    "pmx": (("SLX=1", "SLX=0"),),
}
"""Lines that give a count another length, each with the one that takes it back."""


class _Truth:
    """Whether a drive is set as its scale was accepted with."""

    def __init__(self, shop: Workshop, drive: str) -> None:
        self._device = shop.device(drive)
        self._language = shop.language
        self.accepted = self.now

    @property
    def now(self) -> object:
        """The settings that the scale rests on, as the drive has them."""
        if self._language == "mcode":
            return [int(self._device.memory.values[word]) for word in ("MS", "EE")]
        if self._language == "tmcl":
            return self._device.motors[0].parameters.get(140)
        return self._device.controller.axes[0].snl

    @property
    def holds(self) -> bool:
        """Whether they are what was accepted."""
        return self.now == self.accepted


async def units(world: World, rng: Random) -> None:
    """Show a drive in units, and change what its scale rests on."""
    language = rng.choice(("mcode", "mcode", "tmcl"))
    names = NAMES[language]
    async with workshop(world, rng, language, names, scales=SCALES[language]) as shop:
        drive, session = names[0], shop.session
        truth = _Truth(shop, drive)
        own = session.bus(LINE).drives[drive]
        poll = session.bus(LINE).telemetry.subscribe([drive], 0.02) if rng.random() < 0.7 else None
        _watch_scale(shop, own, truth)
        for _ in range(rng.randrange(2, 5)):
            change, back = rng.choice(WORDS[language])
            for line in (change, rng.choice((back, f"/units {drive}", change))):
                if line[0] != "/":
                    where = rng.choice((f"@{drive}", f"@{drive}", f"@{LINE}:*")) if language == "mcode" else f"@{drive}"
                    await (shop.script([f"{where} {line}"]) if rng.random() < 0.3 else shop.type(f"{where} {line}"))
                else:
                    why = await shop.type(line)
                    truth.accepted = truth.accepted if why else truth.now
                await _looked_at(shop, own, drive, truth, line)
        if poll is not None:
            poll.close()


def _watch_scale(shop: Workshop, own: Any, truth: _Truth) -> None:
    """Look with each sample of the drive how it would be shown: nothing else is on the line meanwhile."""

    def sampled(event: object) -> None:
        if isinstance(event, OnBus) and isinstance(event.event, Sample) and not truth.holds:
            given = shop.session.units.given(own, event.event.axis, event.event.position)
            shop.fact("units", given is None, f"{own.address} is at {event.event.position}, and is shown as {given}")

    shop.session.subscribe(sampled)


async def _looked_at(shop: Workshop, own: Any, drive: str, truth: _Truth, line: str) -> None:
    """Compare what is shown with what the drive counts, at once and after `/status`."""
    given, holds = shop.session.units.given(own, "", 51200), truth.holds
    shop.fact("units", holds or given is None, f"{line!r}: {drive} is shown as {given}, and its scale does not hold")
    begun = len(shop.said)
    await shop.type(f"/status {drive}")
    shown = [text for _, text in shop.said[begun:] if " mm" in text]
    shop.fact("units", truth.holds or not shown, f"{line!r}, /status: {shown}, and the scale does not hold")
    shop.fact("units", shown or not truth.holds, f"{line!r}, /status: no units, and the scale holds")


QUESTION = {"mcode": ("PR R1", "R1"), "pmx": ("V1", ""), "tmcl": ("GAP 195, 0", "")}
LATE = Faults(delay=(0.0, 0.9))
"""Replies come in time or later than the time-out."""


async def late(world: World, rng: Random) -> None:
    """Ask drives in turn, with replies that come later than the time-out."""
    language = rng.choice(("mcode", "pmx", "pmx", "tmcl", "tmcl"))
    names = NAMES[language]
    async with workshop(world, rng, language, names, timeout=0.4) as shop:
        wire = shop.floor.floor.wires[LINE]
        prints: list[str] = []
        shop.session.subscribe(lambda event: prints.append(event.text) if isinstance(event, Printed) else None)
        for number in range(rng.randrange(6, 12)):
            drive, value = rng.choice(names), 6_000_000 + world.step * 100 + number
            _sets(shop, drive, value)
            wire.disturb(rng.choice((LATE, LATE, Faults())))
            prints.clear()
            why = await shop.type(f"@{drive} {QUESTION[language][0]}")
            right = prints == [str(value)] or (why and not prints)
            shop.fact("credited", right, f"{drive} holds {value}; shown: {prints} ({why})")
            await asyncio.sleep(rng.choice((0.0, 0.0, 0.2, 0.6)))


def _sets(shop: Workshop, drive: str, value: int) -> None:
    """Give a drive the value that it is asked for."""
    from multidrop.families.tmcl.manual.commands import TmclCall

    witness = shop.witnesses[drive]
    if shop.language == "mcode":
        witness.device.memory.values["R1"] = value
    else:
        witness.unwatched(f"V1={value}" if shop.language == "pmx" else TmclCall(5, 195, 0, value), shop.floor.now())


NAK = b"\x15"


async def noisy(world: World, rng: Random) -> None:
    """Let noise make a NAK before the drive's own ACK has come, which is late."""
    names = NAMES["mcode"]
    async with workshop(world, rng, "mcode", names) as shop:
        wire = shop.floor.floor.wires[LINE]
        for number in range(rng.randrange(3, 6)):
            drive, text = rng.choice(names), f"R2={FIRST + world.step * 10 + number}"
            if rng.random() < 0.9:
                wire.disturb(Faults(delay=(0.16, 0.4)))
                shop.before_execution(drive, partial(_nak, shop, text, 0.001 + rng.random() * 0.01))
            why = await shop.type(f"@{drive} {text}")
            wire.disturb(Faults())
            await asyncio.sleep(0.5)
            times = shop.executed(drive).count(text)
            shop.fact("twice", times < 2, f"{text!r} was executed {times} times after a NAK and a late ACK ({why})")
            shop.fact("lost", why or times, f"{text!r} was reported as done, and was not executed")


def _nak(shop: Workshop, text: str, delay: float, executed: str) -> None:
    """Let a NAK come, where a drive is about to execute a line."""
    if executed == text:
        for each in [*shop.floor._listeners[LINE]]:
            shop.world.loop.call_later(delay, each.receive, NAK)


DESK = (
    Act("workshop, questions", 3, at_work(questions)),
    Act("workshop, downloads", 1, at_work(downloads)),
    Act("workshop, restores", 1, at_work(restores)),
    Act("workshop, owed echo mode", 1, at_work(owed)),
    Act("workshop, /expect", 1, at_work(expected)),
    Act("workshop, units", 3, at_work(units)),
    Act("workshop, a NAK of noise", 1, at_work(noisy)),
    Act("workshop, late replies", 1, at_work(late)),
)
