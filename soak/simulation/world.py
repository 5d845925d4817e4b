"""The world of one seed: lines of drives with their wires and ports, a person at the prompt, and faults.

A seed draws a machine (which lines, which drives), a climate (the probability of each fault), and a story: what the
person types, and what happens meanwhile. All of it runs on the real session, its real lines and pipes, in one thread.
"""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from contextvars import Context
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

from multidrop.features.sharing.server import SharedPort
from multidrop.features.sharing.writer_turns import Say
from multidrop.shell.automation import settled
from multidrop.shell.configuration import Settings, parse
from multidrop.shell.log import files, writer
from multidrop.shell.session import Session
from multidrop.simulator import cells, wire
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from soak.judge import Witness
from soak.languages import LANGUAGES, PROGRAM
from soak.simulation.acts.watching import wrote
from soak.simulation.climate import Climate
from soak.simulation.clock import SimulatedLoop
from soak.simulation.cut_ins import CutIns
from soak.simulation.disk import Disk
from soak.simulation.far import share
from soak.simulation.files_left import backups, breaches_in_logs, unreadable
from soak.simulation.hearing import heard, typed
from soak.simulation.history import Command, Damage, Executed, Held, History, Stop
from soak.simulation.kernel import WHO, Kernel
from soak.simulation.network import Network
from soak.simulation.person import Person
from soak.simulation.places import SERIAL, Place
from soak.simulation.ports import Trace
from soak.simulation.process import Process
from soak.simulation.story import STOP
from soak.simulation.terminal import Terminal
from soak.simulation.threads import Scheduler
from soak.simulation.wall import Wall
from soak.simulation.watched_session import WatchedSession

if TYPE_CHECKING:
    from soak.simulation.acts_connections import Other

HARMLESS: dict[str, Any] = {"flip": 0.0, "drop": 0.0, "double": 0.0, "insert": 0.0}
"""Bytes on a network are not damaged: TCP repairs or ends the connection, and a damaged datagram is dropped."""
HARMED = wire.harmed
NUMBER = r"\d{7,8}"
"""A unique value."""
LONGEST = 400.0
"""Virtual seconds in which everything that was begun ends, once the faults are over."""
FORGETS = ("IP", "FD")
"""Lines that put values back to the saved ones, as a power-up does."""


class WireRandom(Random):
    """The source of chance of the wire of one line."""

    def __init__(self, seed: int, line: str) -> None:
        super().__init__(f"{seed} wire {line}")
        self.line = line


LOGGED = 0.2
"""The probability of a session log of every life."""
AWAY = 20.0
"""The longest time until a killed session is started again, s; a PC without power takes at least as long."""


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
    kept: Callable[[], None] | None = None
    """Called where a session writes down what it owes a drive."""
    beside_it: list[asyncio.Task[None]] = field(default_factory=list)
    """What runs beside the prompt."""
    visits: list[asyncio.Task[None]] = field(default_factory=list)
    """People at devices that are none of the machine's."""

    def place(self, line: str) -> Place:
        """A line of the machine."""
        return next(each for each in self.places if each.name == line)

    # Making

    def __post_init__(self) -> None:
        self.network = self.loop.network = Network(self.loop, Random(f"{self.seed} network"), Climate(self.seed))
        self.kernel = Kernel(self.loop, self.seed, self.climate, self.network, self._notebook)

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
                    wrote(self, line, data)
            elif way == "=":
                self.history.full.append((self.loop.now, name))
            else:
                self.history.received.setdefault(line, []).append((self.loop.now, data))

        return trace

    async def begin(self) -> None:
        """Build the floor, open the session, and let the faults begin."""
        (self.folder / "tick.mxt").write_text(PROGRAM)
        cell = self.folder / "cell.toml"
        cell.write_text(f"seed = {self.seed}\n" + "".join(place.cell() for place in self.places))
        self.floor = RunningFloor(Floor(cells.load(str(cell))))
        for placed in self.floor.floor.drives:
            self._watch(placed.bus, placed.spec.name, placed.device)
        for place in self.places:
            if place.kind in SERIAL:
                self.kernel.adapter(self.floor, place.name, place.link)
            if place.kind == "rfc2217":
                await self.lend(place)
            if place.kind == "usb":
                self.kernel.usb.add(self.floor, place.name, f"1-{place.place}")
        for bus in self.floor.floor.cell.buses:
            await serve_bus(self.floor, bus, self.stack)
        await self._live()
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
                if each in FORGETS:
                    self.cut.setdefault((line, drive), []).append(self.loop.now)
                self.history.note(self.loop.now, f"! {line}:{drive}", each)
            return answer

        switched = device.power

        def power(on: bool, now: float) -> None:
            self.cut.setdefault((line, drive), []).append(self.loop.now)
            switched(on, now)

        device.execute, device.power = execute, power

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

    async def lend(self, place: Place) -> None:
        """Lend the port of a line, as a computer beside it does."""
        token = WHO.set("far")
        url = f"serial:{place.link}?baud={place.baud}&dialect={place.language}"
        try:
            self.shares[place.name] = await share(url, place.language, place.host, 2217, partial(self._lent, place))
        finally:
            WHO.reset(token)

    def _lent(self, place: Place, said: Say) -> None:
        if said.event == "stop":
            self.history.passed.append((self.loop.now, place.name))
        self.history.note(self.loop.now, "share", f"{said.client} {said.event} {said.detail}")

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

    def another(self, place: Place, who: str) -> Session:
        """A session of another person, which opens a line that is shared."""
        made = WatchedSession(self.settings(self.folder / who), self)
        made.subscribe(lambda event: heard(self, event, who))
        return made

    # Lives of the session

    async def _live(self) -> None:
        """Start a process with a session on what the disk holds, and open the lines."""
        self.history.began.append(self.loop.now)
        lives = self.history.lives
        self.history.unreadable += unreadable(self.folder, f"life {lives}", self.history)
        self.process = process = Process(4000 + lives, self.loop)
        process.at_death += (self._died, partial(self.disk.close_all, process), partial(self.scheduler.forget, process))
        process.run(self._open_session, process)
        session = self.session
        process.routines = lambda: [
            each._procedure for bus in session.buses.values() for each in bus._conversations.under_way
        ]
        opening = process.start(session.open_all([place.name for place in self.places], lambda number, failure: None))
        await asyncio.wait((opening, process.death), return_when=asyncio.FIRST_COMPLETED)
        if not process.dead:
            self.ready.set()

    def _open_session(self, process: Process) -> None:
        files.PROCESS = process.number
        self.history.told.latches.append((self.loop.now, False))
        self.session = WatchedSession(self.settings(self.folder), self, process)
        self.session.subscribe(partial(heard, self))
        self.terminal = Terminal(self.loop)
        self.session.subscribe(self.terminal.show)
        writer.begin(self.session)
        rng = Random(f"{self.seed} person {self.history.lives}")
        self.person = Person(self.session, self.loop, rng, self._typed, self.cut_ins, process)
        self.person.quits = self.quit

    def kill(self, operations: int, moment: str, power: bool = False, of: str = "") -> None:
        """Kill the session at an operation from now; `power`: the PC loses its power there. `of`: see `Process.arm`."""
        self.history.power = power
        self.process.arm(operations, moment, of)

    def _died(self) -> None:
        """The kernel closes its ports; what it had to say of a line is not known."""
        self.ready.clear()
        power = self.history.power
        self.history.note(self.loop.now, "killed", "power" * power)
        self.history.count("power cuts" if power else "kills")
        self.history.killed(self.loop.now)
        self.stops = sum(not stop.who for stop in self.history.stops)
        self.beside_it.clear()
        self.cut_ins.kill()
        self.kernel.close_all(self.process, power)
        rng = Random(f"{self.seed} life {self.history.lives}")
        if power:
            self.loop.call_soon(self.disk.cut_power, rng, context=Context())
        away = rng.random() ** 2 * AWAY + power * AWAY
        self._start(self._again(away))

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        """Begin work that no process does."""
        self.loop.create_task(work, context=Context())

    async def _again(self, away: float) -> None:
        await asyncio.sleep(away)
        await self._live()

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

    # What happens

    def _typed(self, data: bytes) -> None:
        typed(self, data, self.session)

    # The story

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
    def _beside(self) -> list[asyncio.Task[None]]:
        return [each for each in self.beside_it if not each.done()]

    def beside(self, work: Coroutine[Any, Any, None]) -> None:
        """Let work of the session's process run beside the prompt; nobody does it while that is dead."""
        if self.process.dead:
            return work.close()
        self.beside_it.append(self.process.start(work))

    async def end(self) -> None:
        """End the faults, wait until nothing runs, and close; after kills once more, as the next session does."""
        await self.ready.wait()
        self.ending = True
        self.process.arm(0, "")
        self.cut_ins.hurry()
        self.cut_ins.end()
        self.faults(False)
        self.person.type(b"/plot off\r/twin off\r")
        await asyncio.sleep(10.0)
        deadline = self.loop.now + LONGEST
        while still := self.person.lines.running or self.session._background or self._beside:
            if self.loop.now > deadline:
                self.history.defects.append(f"still runs: {still!r}")
                break
            self.person.type(b"n")  # the answer to a question, if there is one
            await asyncio.sleep(1.0)
        await self._close()
        for visit in self.visits:
            await visit
        for other in self.others:  # while he writes to a line, the next session is refused there
            await other.leave()
        if self.history.lives > 1 or self._owing():
            await self._live()
            await self._close()
        self.history.unreadable += unreadable(self.folder, "the end", self.history)
        self.history.owing += self._owing()
        self.history.told.backups = backups(self.folder)
        self.history.logged += breaches_in_logs(self.folder, self.history)
        for shared in self.shares.values():
            await shared.close()
        await self.stack.aclose()
        self.floor.close()
        await asyncio.sleep(30.0)
        left = [each for each in asyncio.all_tasks() if each is not asyncio.current_task()]
        self.history.defects += [f"task left: {each.get_coro()}" for each in left]
        self.history.defects += [f"open: {each!r}" for each in self.kernel.descriptors.values() if not each.closed]
        self.history.defects += [f"thread left: {each.name}" for each in self.scheduler.running]

    def _owing(self) -> list[str]:
        """The MCode drives in another echo mode than at the beginning, which only FD sets, or in program mode."""
        found = []
        cleared = {(each.line, each.drive) for each in self.history.executed if each.text == "FD"}
        for (line, drive), witness in self.witnesses.items():
            place = self.place(line)
            if place.language == "mcode":
                mode, stores = int(witness.device.memory.values["EM"]), witness.device.programming is not None
                factory = mode == 0 and (line, drive) in cleared
                if stores or (mode != place.em and not factory):
                    found.append(f"{line}:{drive} has EM={mode}, not {place.em}" + ", and stores lines" * stores)
        return found

    async def _close(self) -> None:
        """Close the session in an orderly way."""
        await self.process.start(self._leave())
        self.history.defects += [f"file left: {each.path}" for each in self.disk.open.values()]

    async def _leave(self) -> None:
        await self.person.leave()
        await self.session.close()
        self.history.unshown += await self.terminal.finish()

    # A terminal that hangs up

    def hang_up(self) -> None:
        """Hang up the terminal: the session ends in an orderly way, and after a while another one begins."""
        if self.ready.is_set() and not (self.process.dead or self.ending):
            self.ready.clear()
            self.cut_ins.hurry()
            self.cut_ins.end()
            self.history.deaths.append(self.loop.now)
            self.history.note(self.loop.now, "hang-up", "")
            self.person.hang_up(lambda: self._start(self._hung_up()))

    def quit(self) -> None:
        """End the session by a quit: as a hang-up, but the terminal stays, and what is typed still arrives."""
        if self.ready.is_set() and not (self.process.dead or self.ending):
            self.ready.clear()
            self.cut_ins.hurry()
            self.cut_ins.end()
            self.history.deaths.append(self.loop.now)
            self.history.note(self.loop.now, "quit", "")
            for each in self.history.told.quits[-1:]:
                each.accepted = min(each.accepted, self.loop.now)
            self._start(self._hung_up())

    async def _hung_up(self) -> None:
        process, rng = self.process, Random(f"{self.seed} hang-up {self.history.lives}")
        ending = process.start(self._end_of_prompt())
        await asyncio.wait((ending, process.death), return_when=asyncio.FIRST_COMPLETED)
        if process.dead:
            return  # killed meanwhile, which begins the next life
        process.arm(0, "")
        ending.result()
        await asyncio.sleep(0.1)  # a look-up of a name that nobody waits for any more ends
        self.stops = sum(not stop.who for stop in self.history.stops)
        self.beside_it.clear()
        opened = [each for each in self.kernel.descriptors.values() if each.owner is process and not each.closed]
        self.history.defects += [f"left by a hang-up: {each!r}" for each in (*self.loop.tasks_of(process), *opened)]
        await self._again(rng.random() ** 2 * AWAY)

    async def _end_of_prompt(self) -> None:
        """End as the prompt does: what was set in motion is stopped."""
        for work in self._beside:
            work.cancel()
        self.person.lines.drop("the prompt has ended")
        self.session.interrupt()
        await self.session.automations.over()
        await settled(self.session)
        await self._leave()
