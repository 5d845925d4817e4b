"""The world of one seed: lines of drives with their wires and ports, a person at the prompt, and faults.

A seed draws a machine (which lines, which drives), a climate (the probability of each fault), and a story: what the
person types, and what happens meanwhile. All of it runs on the real session, its real lines and pipes, in one thread.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import shutil
import tempfile
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from random import Random
from typing import Any

from multidrop.dialects import Diagnostic, DriveError
from multidrop.drives.bus import Bus
from multidrop.drives.stopping import stop_forms
from multidrop.shell.configuration import Settings, parse
from multidrop.shell.connect import opening
from multidrop.shell.connect.urls import Connection
from multidrop.shell.events import Failed, Notified, Output, Printed
from multidrop.shell.line_syntax import TypedLine
from multidrop.shell.session import Session
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Transport, TransportLost, Unreachable
from multidrop.transports.pipe import DescriptorPipe
from soak.judge import Witness, Word, word
from soak.languages import LANGUAGES, PROGRAM
from soak.simulation.climate import Climate
from soak.simulation.clock import SimulatedLoop
from soak.simulation.history import Command, Executed, History, Outcome, Stop
from soak.simulation.person import Person
from soak.simulation.places import Place, drawn_places
from soak.simulation.ports import Port
from soak.simulation.story import STOP, tell
from soak.simulation.threads import Scheduler
from soak.simulation.wall import Wall

STOPPED = re.compile(r"(?:(\w+): )(?:(\w+): )?stopped, velocity 0 ")
WORDS = {
    Word.DONE: Outcome.OK,
    Word.UNCONFIRMED: Outcome.UNKNOWN,
    Word.REFUSED: Outcome.REFUSED,
    Word.NOT_EXECUTED: Outcome.NOT_SENT,
    Word.UNKNOWN: Outcome.UNKNOWN,
}
LONGEST = 400.0
"""Virtual seconds in which everything that was begun ends, once the faults are over."""


@dataclass
class World:
    """A machine, its person, and the history so far."""

    seed: int
    loop: SimulatedLoop
    history: History
    climate: Climate
    places: list[Place]
    folder: Path
    wall: Wall
    scheduler: Scheduler
    floor: RunningFloor = field(init=False)
    session: Session = field(init=False)
    person: Person = field(init=False)
    witnesses: dict[tuple[str, str], Witness] = field(default_factory=dict)
    ports: dict[str, Port] = field(default_factory=dict)
    step: int = 0
    said: int = 0
    """The number of commands that this step has typed."""
    stops: int = 0
    """The number of stops that were typed, arrived or on their way."""

    def place(self, line: str) -> Place:
        """A line of the machine."""
        return next(each for each in self.places if each.name == line)

    # Making

    @cached_property
    def _opening(self) -> Random:
        return Random(f"{self.seed} opening")

    async def begin(self) -> None:
        """Build the floor, open the session, and let the faults begin."""
        (self.folder / "tick.mxt").write_text(PROGRAM)
        cell = self.folder / "cell.toml"
        cell.write_text(f"seed = {self.seed}\n" + "".join(place.cell() for place in self.places))
        self.floor = RunningFloor(Floor(cells.load(str(cell))))
        for placed in self.floor.floor.drives:
            self._watch(placed.bus, placed.spec.name, placed.device)
        self._open_session()
        await self.session.open_all([place.name for place in self.places], lambda number, failure: None)
        self.faults(True)

    def _watch(self, line: str, drive: str, device: Any) -> None:
        language = LANGUAGES[self.place(line).language]
        witness = self.witnesses[line, drive] = Witness(device, language.asks, language.refused)
        seen = device.execute

        def execute(text: Any, now: float, **how: Any) -> Any:
            before = len(witness.executed)
            answer = seen(text, now, **how)
            for each in witness.executed[before:]:
                self.history.executed.append(Executed(self.loop.now, line, drive, each))
                self.history.note(self.loop.now, f"! {line}:{drive}", each)
            return answer

        device.execute = execute

    def _open_session(self) -> None:
        found = parse("".join(f'[connections.{each.name}]\nurl = "{each.url}"\n' for each in self.places), "world")
        settings = replace(found, folder=self.folder / "config", state=self.folder / "state")
        self.session = WatchedSession(settings, self)
        self.session.subscribe(self._event)
        self.person = Person(self.session, self.loop, Random(f"{self.seed} person"), self._typed)

    async def transport(
        self, connection: Connection, port: str = "", within: float | None = None, baud: int | None = None
    ) -> Transport:
        """In place of the ports of this machine: a descriptor of the simulated kernel."""
        name = (
            connection.target.rpartition("-")[2] if connection.scheme == "serial" else connection.host.partition(".")[0]
        )
        await asyncio.sleep(self._opening.random() * 0.05)
        if self.floor.floor.wires[name].hung_up or not self.floor.floor.connectable(name):
            raise Unreachable(f"{connection.short}: not there")

        def trace(way: str, data: bytes) -> None:
            self.history.note(self.loop.now, f"{way} {name}", data.hex())
            if way == ">":
                self.history.written.append((self.loop.now, name, data))

        made = self.ports[name] = Port(
            connection.short,
            self.loop,
            self.floor,
            name,
            Random(f"{self.seed} port {name} {len(self.history.written)}"),
            self.climate,
            trace,
            connection.scheme == "serial",
        )
        return DescriptorPipe(made)

    def faults(self, on: bool) -> None:
        """Let the faults begin or end."""
        for name, wire in self.floor.floor.wires.items():
            wire.disturb(self.climate.wire if on else Faults(), Random(f"{self.seed} wire {name}"))
        self.loop.late = self.climate["late timer"] if on else 0.0
        if not on:
            for port in self.ports.values():
                port.climate = Climate(self.seed)

    # What happens

    def _event(self, event: object) -> None:
        if isinstance(event, Notified | Failed | Printed | Output):
            self.history.note(self.loop.now, type(event).__name__, event.text)
            self.history.notices.append((self.loop.now, event.text))
        if isinstance(event, Notified):
            self.history.unsent(event.text)
            if (found := STOPPED.match(event.text)) is not None:
                self._judge_stopped(found[1], found[2] or "")

    def _judge_stopped(self, line: str, drive: str) -> None:
        """Note a drive that is said to stand and moves, unless a line has started it since the stop."""
        now = self.floor.now()
        for placed in self.floor.floor.drives:
            if placed.bus != line or (drive and placed.spec.name != drive):
                continue
            since = self.history.stops[-1].at if self.history.stops else 0.0
            name = placed.spec.name
            started = any(
                each.at >= since and (each.line, each.drive) == (line, name) for each in self.history.executed
            )
            if not started and any(each.velocity for each in placed.unit.shadow.motion(now)):
                self.history.untrue.append(f"{self.loop.now:.3f} {line}:{name} is said to be stopped, and moves")

    def _typed(self, data: bytes) -> None:
        self.history.note(self.loop.now, "key", data.hex())
        if STOP in data:
            forms = {name: self._forms(bus) for name, bus in self.session.buses.items() if not bus.link.lost}
            self.history.stops.append(Stop(self.loop.now, {name: each for name, each in forms.items() if each}))

    def _forms(self, bus: Bus) -> tuple[bytes, ...]:
        """What a stop of a line may begin with; empty where a frame that has begun leaves whole before it."""
        forms = stop_forms(bus.roster)
        return () if forms.framed else (forms.immediate, forms.unterminated)

    # The story

    def command(self, rng: Random) -> bytes:
        """Draw a line for a drive, and its Enter."""
        place = rng.choice(self.places)
        drive = rng.choice(place.names)
        self.said += 1
        serial = self.step * 100 + self.said
        said = LANGUAGES[place.language].say(rng, serial, self.witnesses[place.name, drive], self.floor.now())
        typed = f"@{place.name}:{drive if place.drives else ''} {said.text}"
        if not said.prints:
            self.history.commands[typed] = Command(said.text, place.name, drive, self.loop.now, self.stops)
        return typed.encode() + b"\r"

    async def end(self) -> None:
        """End the faults, wait until nothing runs, and close."""
        self.faults(False)
        await asyncio.sleep(10.0)
        deadline = self.loop.now + LONGEST
        while self.person.lines.running or self.session._background:
            if self.loop.now > deadline:
                self.history.defects.append(f"still runs: {self.person.lines.running!r} {self.session._background}")
                break
            await asyncio.sleep(1.0)
        await self.person.leave()
        await self.session.close()
        self.floor.close()
        await asyncio.sleep(30.0)
        left = [each for each in asyncio.all_tasks() if each is not asyncio.current_task()]
        self.history.defects += [f"task left: {each.get_coro()}" for each in left]
        self.history.defects += [f"thread left: {each.name}" for each in self.scheduler.running]


class WatchedSession(Session):
    """A session that notes what the caller of each line got."""

    def __init__(self, settings: Settings, world: World) -> None:
        super().__init__(settings, reconnect=True)
        self._world = world

    async def run(self, line: str | TypedLine, *arguments: Any, **named: Any) -> None:
        """Run a line, and note its outcome."""
        text = (line if isinstance(line, str) else line.typed).strip()
        command = self._world.history.commands.get(text)
        if command is None:
            return await super().run(line, *arguments, **named)
        command.began = self.now()
        try:
            await super().run(line, *arguments, **named)
        except (DriveError, Diagnostic, TransportLost) as failure:
            self._ended(command, failure)
            raise
        except asyncio.CancelledError:
            command.outcome, command.said = Outcome.UNKNOWN, "cancelled"
            raise
        else:
            self._ended(command, ())

    def _ended(self, command: Command, result: tuple[str, ...] | BaseException) -> None:
        command.ended, command.said = self.now(), str(result)
        notices = [text for at, text in self._world.history.notices if at >= command.began]
        command.outcome = WORDS[word(result, notices)]


@contextlib.contextmanager
def place_of_state() -> Iterator[Path]:
    """A folder for the files of one world."""
    folder = Path(tempfile.mkdtemp(prefix="simulate-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def lived(seed: int, steps: Iterable[int], keep: bool = False, without: Collection[str] = ()) -> World:
    """Live one seed: these steps of its story, `without` these kinds of faults."""
    climate, places = Climate.drawn(seed, without), drawn_places(Random(f"{seed} places"))
    history = History(keep=keep)
    loops: list[SimulatedLoop] = []

    def factory() -> SimulatedLoop:
        loops.append(SimulatedLoop(Random(f"{seed} loop")))
        return loops[0]

    with place_of_state() as folder, asyncio.Runner(loop_factory=factory) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, SimulatedLoop)
        wall, scheduler = Wall(loop), Scheduler(loop, Random(f"{seed} threads"), climate["slow thread"])
        world = World(seed, loop, history, climate, places, folder, wall, scheduler)

        async def life() -> None:
            await world.begin()
            for step in steps:
                await tell(world, step)
            await world.end()

        with ExitStack() as stack:
            stack.enter_context(wall.installed())
            stack.enter_context(scheduler.installed())
            stack.enter_context(_replaced(opening, "_transport", world.transport))
            runner.run(life())
        history.defects += [str(each.get("exception") or each.get("message")) for each in loop.defects]
    return world


@contextlib.contextmanager
def _replaced(module: Any, name: str, value: Callable[..., Awaitable[Any]]) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)
