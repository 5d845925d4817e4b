"""Several hosts' conversations at once on one noisy party line in memory, and a judge of them.

The judge knows what each simulated drive holds and has carried out. Every drive's R1 is another number each time that
it is asked for, so that a value that is told as a drive's can be traced to where it comes from.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from random import Random
from typing import Any

from multidrop.base.errors import DriveError
from multidrop.dialects import DriveState, End, Priority
from multidrop.dialects.families import family_of
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.simulator.cell.spec import Faults
from tests.support.faults import disturb
from tests.support.mcode_drives import Witness
from tests.support.procedure import ProcedureRunner

PROGRAM = ("PG 1", "LB G1", 'PR "tick ",R3', "IC R3", "H 170", "PR R3", "H 190", "BR G1", "E", "PG", "EX G1")
PRINTS = ("PR R1", 'PR "v",R1', 'PR R1," units"', "PR R1 R4", 'PR R4,"/",R1')
PLACES = {"a": 17_345_621, "b": 26_871_034, "c": 39_518_267}
TICKS = 50_000_000
NAMES = "abc"
GROUP = 0.004
"""Seconds for which an adapter holds bytes."""


@dataclass
class Told:
    """What the judge has seen: how often what came of a command, and the misdeeds in words."""

    ends: Counter[str] = field(default_factory=Counter)
    misdeeds: list[str] = field(default_factory=list)
    wrong: Counter[str] = field(default_factory=Counter)


class Crowd:
    """Three drives on a line, a program that prints in c, and somebody at each drive who says something at random."""

    def __init__(
        self, bench: Any, em: int, check: int, seed: int, faults: Faults, program: bool = True, signs: bool = True
    ) -> None:
        tables = [{"name": name, "party": True, "set": {"EM": em, "CK": check, "CE": 0}} for name in NAMES]
        self.bench = bench(tables, baud=9600)
        self.bench.wire.receive(b"\n\n", 0.0)
        self.bench.wait(0.5)
        self.devices = {placed.device.memory.name: placed.device for placed in self.bench.floor.drives}
        self.witnesses = {name: Witness(device) for name, device in self.devices.items()}
        self.rng = Random(f"{em} {check} {seed}")
        self.held: dict[int, str] = {}
        """Every number that a drive's R1 has been, and whose."""
        self.told = Told()
        self.mode = MCode(em=em, party=True, checksum=check, escape=1)
        self.knowns = {name: self.fresh(name, signs) for name in NAMES}
        if program:
            self.devices["c"].memory.values["R3"] = TICKS
            for line in PROGRAM:
                self.devices["c"].execute(line, self.bench.now)
        self.bench.line.events(self.bench.now)
        disturb(self.bench.wire, faults, seed)

    def fresh(self, name: str, signs: bool) -> DriveState:
        return MCodeState(self.mode, name, name, "LMDCM", signs=signs)

    # -- somebody at a drive

    def somebody(self, name: str, commands: int):
        """A generator of things to do: it yields requests or times to wait for, and judges what came of them."""
        state, device, rng = self.knowns[name], self.devices[name], self.rng
        for _ in range(commands):
            held = rng.randrange(60_000_000, 100_000_000)
            self.held[held] = name
            device.memory.values["R1"], device.memory.values["R4"] = held, 7
            choice = rng.random()
            if choice < 0.6:
                yield from self.print_judged(state, rng.choice(PRINTS), name, held)
            elif choice < 0.8:
                yield from self.command_judged(state, f"R2={held}", name)
            else:
                yield from self.poll_judged(state, name)
            yield rng.random() * 0.05

    def talk(self, talk: Any, state: DriveState):
        """Hold it: yields its requests, is sent replies; its result or the DriveError it ended in."""
        try:
            result = yield from talk
        except DriveError as error:
            self.told.ends[type(error).__name__] += 1
            return error
        finally:
            state.notes.clear()
        self.told.ends["done"] += 1
        return result

    def print_judged(self, state: DriveState, text: str, name: str, held: int):
        result = yield from self.talk(family_of(state).perform(text), state)
        if isinstance(result, DriveError):
            return
        shown = {
            "PR R1": f"{held}",
            'PR "v",R1': f"v{held}",
            'PR R1," units"': f"{held} units",
            "PR R1 R4": f"{held}7",
            'PR R4,"/",R1': f"7/{held}",
        }[text]
        if result != (shown,):
            whose = self.whose("".join(result), name, held)
            self.told.wrong[whose or "damaged"] += 1
            if whose:
                self.told.misdeeds.append(f"{self.bench.now:.3f} @{name} {text}: {result}, held {held}: {whose}")

    def whose(self, text: str, name: str, held: int) -> str:
        """Where a value that is not the drive's comes from; empty where it is only damaged."""
        if "tick" in text:
            return "a program's"
        for digits in re.findall(r"\d{8}", text):
            number = int(digits)
            if TICKS <= number < TICKS + 1_000_000:
                return "a program's"
            if number != held and number in self.held:
                return "another drive's" if self.held[number] != name else "an older one of its own"
        return ""

    def command_judged(self, state: DriveState, text: str, name: str):
        result = yield from self.talk(family_of(state).perform(text), state)
        times = len(self.witnesses[name].executed(text))
        if times > 1:
            self.told.misdeeds.append(f"{self.bench.now:.3f} @{name} {text}: executed {times} times")
        if not isinstance(result, DriveError) and not times:
            self.told.wrong["told as done, and was not"] += 1

    def poll_judged(self, state: DriveState, name: str):
        """Each drive stands at a place of its own."""
        result = yield from self.talk(family_of(state).motion(Priority.POLL), state)
        if isinstance(result, DriveError):
            return
        places = {axis.position for axis in result}
        others = {PLACES[other] for other in NAMES if other != name}
        if places & others:
            self.told.misdeeds.append(f"{self.bench.now:.3f} @{name} poll: {result}")

    # -- all of them at once

    def run(self, commands: int) -> Told:
        """Let all of them say so many things; what came of it."""
        for name, device in self.devices.items():
            device.execute(f"P={PLACES[name]}", self.bench.now)
        running: dict[int, tuple[int, ProcedureRunner[Any]]] = {}
        waiting: list[tuple[float, int, Any]] = []
        for n, name in enumerate(NAMES):
            self._go_on(n, ProcedureRunner(self.somebody(name, commands)), running, waiting)
        while running or waiting:
            waiting.sort(key=lambda each: each[:2])
            while waiting and waiting[0][0] <= self.bench.now:
                _, n, procedure = waiting.pop(0)
                procedure.answer(None)  # type: ignore[arg-type]
                self._go_on(n, procedure, running, waiting)
            until = waiting[0][0] if waiting else self.bench.now + 100.0
            for ended in (*self.bench.events(), *self._step(until)):
                if ended.ticket in running:
                    n, procedure = running.pop(ended.ticket)
                    assert ended.reply.end is not End.STOPPED
                    procedure.answer(ended.reply)
                    self._go_on(n, procedure, running, waiting)
        return self.told

    def _step(self, until: float) -> list[Any]:
        """Let time pass to the next thing that happens; bytes come in groups, as an adapter hands them on."""
        bench = self.bench
        if (heard := bench.wire.deadline) is not None:
            until = min(until, heard + GROUP)
        if (due := bench.line.deadline) is not None:
            until = min(until, due)
        bench.now = max(bench.now, until)
        if data := bench.wire.advance(bench.now):
            bench.line.receive(data, bench.now)
        return list(bench.events())

    def _go_on(self, n: int, procedure: Any, running: Any, waiting: Any) -> None:
        asked = procedure.request
        if asked is None:
            return
        if isinstance(asked, float):
            waiting.append((self.bench.now + asked, n, procedure))
        else:
            running[self.bench.line.ask(asked)] = (n, procedure)
