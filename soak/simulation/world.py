"""The world of one seed: lines of drives with their wires and ports, a person at the prompt, and faults.

A seed draws a machine (which lines, which drives), a climate (the probability of each fault), and a story: what the
person types, and what happens meanwhile. All of it runs on the real session, its real lines and pipes, in one thread.
Here is what the acts of a story work with; `lives` fills it as a session begins and ends.
"""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any

from multidrop.drives.stop_forms import stop_forms
from multidrop.features.sharing.server import SharedPort
from multidrop.shell.configuration import Settings, parse
from multidrop.shell.session import Session
from multidrop.simulator import wire
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.serving.running import RunningFloor
from soak.judge import Witness
from soak.languages import LANGUAGES
from soak.simulation.person import Other, Person
from soak.simulation.records.climate import Climate
from soak.simulation.records.commands import Command
from soak.simulation.records.history import NUMBER, Damage, Held, History, Stop
from soak.simulation.records.phrases import STOP
from soak.simulation.records.places import Place
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.cut_ins import CutIns
from soak.simulation.system.disk import Disk
from soak.simulation.system.kernel import Kernel
from soak.simulation.system.network import Network
from soak.simulation.system.ports import Trace
from soak.simulation.system.process import Process
from soak.simulation.system.terminal import Terminal
from soak.simulation.system.threads import Scheduler
from soak.simulation.system.wall import Wall

HARMLESS: dict[str, Any] = {"flip": 0.0, "drop": 0.0, "double": 0.0, "insert": 0.0}
"""Bytes on a network are not damaged: TCP repairs or ends the connection, and a damaged datagram is dropped."""
HARMED = wire.harmed
LOGGED = 0.2
"""The probability of a session log of every life."""


class WireRandom(Random):
    """The source of chance of the wire of one line."""

    def __init__(self, seed: int, line: str) -> None:
        super().__init__(f"{seed} wire {line}")
        self.line = line


@dataclass
class World:
    """A machine, its person, and the history so far: what acts work with, and what is noted."""

    seed: int
    loop: SimulatedLoop
    history: History
    climate: Climate
    places: list[Place]
    folder: Path
    wall: Wall
    scheduler: Scheduler
    disk: Disk
    cut_ins: CutIns
    floor: RunningFloor = field(init=False)
    process: Process = field(init=False)
    session: Session = field(init=False)
    person: Person = field(init=False)
    terminal: Terminal = field(init=False)
    ending: bool = False
    """The story is told: this life is the last but one."""
    ready: asyncio.Event = field(default_factory=asyncio.Event)
    """A session is open, and somebody types at it."""
    witnesses: dict[tuple[str, str], Witness] = field(default_factory=dict)
    network: Network = field(init=False)
    kernel: Kernel = field(init=False)
    stopping: dict[int, Stop] = field(default_factory=dict)
    """The stops that threads write now, by thread."""
    others: list[Other] = field(default_factory=list)
    """Other people, who share lines."""
    shares: dict[str, SharedPort] = field(default_factory=dict)
    """What lends the ports of lines to several people."""
    stack: AsyncExitStack = field(default_factory=AsyncExitStack)
    step: int = 0
    said: int = 0
    """The number of commands that this step has typed."""
    stops: int = 0
    """The number of stops that were typed, arrived or on their way."""
    cut: dict[tuple[str, str], list[float]] = field(default_factory=dict)
    """When the power of each drive was switched, or its values were put back."""
    hang_up: Callable[[], None] = field(init=False)
    """Hangs up the terminal: see `lives`."""
    kept: Callable[[], None] | None = None
    """Called where a session writes down what it owes a drive."""
    beside_it: list[asyncio.Task[None]] = field(default_factory=list)
    """What runs beside the prompt."""
    visits: list[asyncio.Task[None]] = field(default_factory=list)
    """People at devices that are none of the machine's."""

    def __post_init__(self) -> None:
        self.network = self.loop.network = Network(self.loop, Random(f"{self.seed} network"), Climate(self.seed))
        self.kernel = Kernel(self.loop, self.seed, self.climate, self.network, self._notebook)

    def place(self, line: str) -> Place:
        """A line of the machine."""
        return next(each for each in self.places if each.name == line)

    def _notebook(self, who: str, line: str) -> Trace:
        """Note what is written to a line, and read; what a computer that lends it does is seen on its wire."""
        if who == "far":
            return lambda way, data: self.history.note(self.loop.now, f"{way} {line} far", data.hex())
        name = f"{line}{who}"
        self.history.opened.append((self.loop.now, name, len(self.history.written)))

        def trace(way: str, data: bytes) -> None:
            self.history.note(self.loop.now, f"{way} {name}", data.hex())
            if way in ">=" and (stop := self.stopping.get(threading.get_ident())) is not None:
                stop.own.setdefault(name, (len(self.history.written), self.kernel.rest(name)))
            if way == ">":
                self.history.written.append((self.loop.now, name, data))
                if not who:
                    self._wrote(line, data)
            elif way == "=":
                self.history.full.append((self.loop.now, name))
            else:
                self.history.received.setdefault(line, []).append((self.loop.now, data))

        return trace

    def _wrote(self, line: str, data: bytes) -> None:
        """Take what left on a line: in raw mode it is what was typed, or a stop."""
        told = self.history.told
        if line in self.session.raw:
            forms = stop_forms(self.session.buses[line].roster)
            parts = (forms.immediate, forms.unterminated, forms.invalidate, *(each.data for each in forms.repeats))
            told.raw_stops.setdefault(line, {}).update(dict.fromkeys(filter(None, parts)))
            told.raw_written.setdefault(line, bytearray()).extend(data)

    def restarts(self, line: str, drive: str) -> int:
        """How often a drive has lost what it held."""
        return len(self.cut.get((line, drive), ())) + self.witnesses[line, drive].boots

    def harmed(self, data: bytes, faults: Faults, rng: Random) -> bytes:
        """In place of the noise of a wire: the same noise, and a note of what it changed."""
        after = HARMED(data, faults, rng)
        if after != data and isinstance(rng, WireRandom):
            self.history.damage.setdefault(rng.line, []).append(Damage(self.loop.now, data, after))
            self.history.count("bytes damaged")
        return after

    def settings(self, folder: Path) -> Settings:
        """The settings of a person, who has the connections of all lines."""
        text = "".join(f'[connections.{each.name}]\nurl = "{self._url(each)}"\n' for each in self.places)
        text += "[log]\nalways = true\nmegabytes = 0.02\nfiles = 3\n" * (Random(f"{self.seed} log").random() < LOGGED)
        return replace(parse(text, "world"), folder=folder / "config", state=folder / "state", data=folder / "data")

    def _url(self, place: Place) -> str:
        """How a person names a line: a serial port by the link that follows it, or by the node that it has now."""
        node = self.kernel.realpath(place.link)
        by_node = place.kind == "serial" and Random(f"{self.seed} {place.name} by node").random() < 0.5
        return place.url.replace(place.link, node) if by_node else place.url

    def kill(self, operations: int, moment: str, power: bool = False, of: str = "") -> None:
        """Kill the session at an operation from now; `power`: the PC loses its power there. `of`: see `Process.arm`."""
        self.history.power = power
        self.process.arm(operations, moment, of)

    def _faults(self, place: Place) -> Faults:
        """The faults of a wire in this climate."""
        return self.climate.wire if place.noisy else replace(self.climate.wire, **HARMLESS)

    def weather(self, place: Place, **worse: Any) -> None:
        """Change some faults of a wire for a while; without any: put them back."""
        if not self.ending:
            self.floor.floor.wires[place.name].disturb(replace(self._faults(place), **worse))

    def faults(self, on: bool) -> None:
        """Let the faults begin or end."""
        for name, disturbed in self.floor.floor.wires.items():
            disturbed.disturb(self._faults(self.place(name)) if on else Faults(), WireRandom(self.seed, name))
        self.loop.late = self.climate["late timer"] if on else 0.0
        self.kernel.quiet(self.climate if on else Climate(self.seed))
        if not on:
            self.network.heal()
            self.terminal.reader()
            holders: list[Any] = [*self.kernel.adapters, *self.kernel.usb.plugged]
            for each in holders:
                each.held = False

    def command(
        self, rng: Random, place: Place | None = None, who: str = "", stops: int | None = None, drive: str = ""
    ) -> bytes:
        """Draw a line for a drive, and its Enter. `who` types it, after so many stops of his own."""
        place = place or rng.choice(self.places)
        drive = drive or rng.choice(place.names)
        self.said += 1
        serial = self.step * 100 + self.said
        said = LANGUAGES[place.language].say(rng, serial, self.witnesses[place.name, drive], self.floor.now())
        typed = f"@{place.name}:{drive if place.drives else ''} {said.text}"
        if said.prints:
            number = re.findall(NUMBER, said.prints)[0]
            self.history.questions[typed] = said.prints.replace(number, "{}")
            self.history.asked += 1
            restarts = self.restarts(place.name, drive)
            self.history.holds(Held(place.name, drive, number, self.loop.now, restarts))
        else:
            self.history.commands[typed] = Command(
                said.text, place.name, drive, self.loop.now, self.stops if stops is None else stops, who=who
            )
        return typed.encode() + b"\r"

    def stop(self) -> None:
        """Type the stop key."""
        self.stops += 1
        self.person.type(STOP, 0.0)
        self.person.type(b"/resume\r", 0.0)

    @property
    def running(self) -> list[asyncio.Task[None]]:
        """What runs beside the prompt."""
        return [each for each in self.beside_it if not each.done()]

    def beside(self, work: Coroutine[Any, Any, None]) -> None:
        """Let work of the session's process run beside the prompt; nobody does it while that is dead."""
        if self.process.dead:
            return work.close()
        self.beside_it.append(self.process.start(work))
