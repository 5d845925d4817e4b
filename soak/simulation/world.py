"""The world of one seed: lines of drives with their wires and ports, a person at the prompt, and faults.

A seed draws a machine (which lines, which drives), a climate (the probability of each fault), and a story: what the
person types, and what happens meanwhile. All of it runs on the real session, its real lines and pipes, in one thread.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import shutil
import tempfile
import threading
from collections.abc import Collection, Coroutine, Iterable, Iterator
from contextlib import AsyncExitStack, ExitStack
from contextvars import Context, ContextVar
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic, DriveError
from multidrop.drives.bus import Bus
from multidrop.drives.events import LOG, Ended
from multidrop.drives.stopping import stop_forms
from multidrop.shell.automation import settled
from multidrop.shell.configuration import Settings, parse
from multidrop.shell.events import Failed, Notified, OnBus, Output, Printed
from multidrop.shell.line_syntax import TypedLine
from multidrop.shell.log import files, writer
from multidrop.shell.session import Session
from multidrop.shell.sharing.server import SharedPort
from multidrop.shell.sharing.writer_turns import Say
from multidrop.shell.workspace import LATCHED
from multidrop.simulator import cells, wire
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import TransportLost, pipe, telnet, usb
from multidrop.transports.relay import Kind, frame
from soak.judge import Witness, Word, word
from soak.languages import LANGUAGES, PROGRAM
from soak.simulation.acts.seams import SEAMS
from soak.simulation.acts.watching import WatchedPath, examine_before_a_stop, wrote
from soak.simulation.climate import Climate
from soak.simulation.clock import Deadlock, SimulatedLoop
from soak.simulation.cut_ins import UP, CutIns
from soak.simulation.disk import Disk
from soak.simulation.far import share
from soak.simulation.files_left import backups, breaches_in_logs, unreadable
from soak.simulation.history import Command, Damage, Executed, Held, History, Outcome, Shown, Stop
from soak.simulation.kernel import WHO, Kernel
from soak.simulation.network import Network
from soak.simulation.person import Person
from soak.simulation.places import SERIAL, Place, drawn_places
from soak.simulation.ports import Trace
from soak.simulation.process import Process
from soak.simulation.story import STOP, tell
from soak.simulation.terminal import Terminal
from soak.simulation.threads import Scheduler
from soak.simulation.wall import Wall

if TYPE_CHECKING:
    from soak.simulation.acts_connections import Other

STOPPED = re.compile(r"(?:(\w+): )(?:(\w+): )?stopped, velocity 0 ")
WORDS = {
    Word.DONE: Outcome.OK,
    Word.UNCONFIRMED: Outcome.UNKNOWN,
    Word.REFUSED: Outcome.REFUSED,
    Word.NOT_EXECUTED: Outcome.NOT_SENT,
    Word.UNKNOWN: Outcome.UNKNOWN,
}
HARMLESS = {"flip": 0.0, "drop": 0.0, "double": 0.0, "insert": 0.0}
"""Bytes on a network are not damaged: TCP repairs or ends the connection, and a damaged datagram is dropped."""
HARMED = wire.harmed
NUMBER = r"\d{7,8}"
"""A unique value."""
LONGEST = 400.0
"""Virtual seconds in which everything that was begun ends, once the faults are over."""
FORGETS = ("IP", "FD")
"""Lines that put values back to the saved ones, as a power-up does."""
ASKED: ContextVar[tuple[str, float] | None] = ContextVar("asked", default=None)
"""The question that runs in this task, and when it began; None: none that the judge knows."""


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
    beside_it: list[asyncio.Task[None]] = field(default_factory=list)
    """What runs beside the prompt."""

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
            if way == ">":
                if (stop := self.stopping.get(threading.get_ident())) is not None:
                    stop.own.setdefault(name, (len(self.history.written), self.kernel.rest(name)))
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
        return len(self.cut.get((line, drive), ())) + int(getattr(self.witnesses[line, drive].device, "boots", 0))

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
        return replace(parse(text, "world"), folder=folder / "config", state=folder / "state")

    def _url(self, place: Place) -> str:
        """How a person names a line: a serial port by the link that follows it, or by the node that it has now."""
        node = self.kernel.realpath(place.link)
        by_node = place.kind == "serial" and Random(f"{self.seed} {place.name} by node").random() < 0.5
        return place.url.replace(place.link, node) if by_node else place.url

    def another(self, place: Place, who: str) -> Session:
        """A session of another person, which opens a line that is shared."""
        made = WatchedSession(self.settings(self.folder / who), self)
        made.subscribe(lambda event: self.heard(event, who))
        return made

    # Lives of the session

    async def _live(self) -> None:
        """Start a process with a session on what the disk holds, and open the lines."""
        lives = self.history.lives = self.history.lives + 1
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
        self.session = WatchedSession(self.settings(self.folder), self, process)
        self.session.subscribe(self.heard)
        self.terminal = Terminal(self.loop)
        self.session.subscribe(self.terminal.show)
        writer.begin(self.session)
        rng = Random(f"{self.seed} person {self.history.lives}")
        self.person = Person(self.session, self.loop, rng, self._typed, self.cut_ins, process)

    def kill(self, operations: int, moment: str, power: bool = False) -> None:
        """Kill the session at an operation from now; `power`: the PC loses its power there."""
        self.history.power = power
        self.process.arm(operations, moment)

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
        self.loop.create_task(self._again(away), context=Context())

    async def _again(self, away: float) -> None:
        await asyncio.sleep(away)
        await self._live()

    def faults(self, on: bool) -> None:
        """Let the faults begin or end."""
        for name, each in self.floor.floor.wires.items():
            faults = self.climate.wire if self.place(name).noisy else replace(self.climate.wire, **HARMLESS)
            each.disturb(faults if on else Faults(), WireRandom(self.seed, name))
        self.loop.late = self.climate["late timer"] if on else 0.0
        self.kernel.quiet(self.climate if on else Climate(self.seed))
        if not on:
            self.network.heal()
            self.terminal.reader()
            for held in (*self.kernel.adapters, *self.kernel.usb.plugged):
                held.held = False

    # What happens

    def heard(self, event: object, who: str = "") -> None:
        """Take what a session says."""
        if not who and self.process.dead:
            return
        if isinstance(event, OnBus):
            self.history.exchanges += isinstance(event.event, Ended)
            return
        if isinstance(event, Notified | Failed | Printed | Output):
            self.history.note(self.loop.now, type(event).__name__, event.text)
            self.history.notices.append((self.loop.now, event.text))
        if isinstance(event, Notified):
            self.history.unsent(event.text)
            if (found := STOPPED.match(event.text)) is not None:
                self._judge_stopped(found[1], found[2] or "", who)
        if isinstance(event, Printed) and (asked := ASKED.get()) is not None:
            names = self.place(event.bus).names
            drive = event.address if event.address in names else names[0]
            form, began, restarts = self.history.questions[asked[0]], asked[1], self.restarts(event.bus, drive)
            self.history.shown.append(Shown(event.bus, drive, event.text, form, began, self.loop.now, restarts))

    def _judge_stopped(self, line: str, drive: str, who: str) -> None:
        """Note a drive that is said to stand and moves, unless a line has started it since the stop."""
        now = self.floor.now()
        for placed in self.floor.floor.drives:
            if placed.bus != line or (drive and placed.spec.name != drive):
                continue
            since = max((each.at for each in self.history.stops if each.who == who), default=0.0)
            name = placed.spec.name
            started = any(
                each.at >= since and (each.line, each.drive) == (line, name) for each in self.history.executed
            )
            if not started and any(each.velocity for each in placed.unit.shadow.motion(now)):
                self.history.untrue.append(f"{self.loop.now:.3f} {line}:{name} is said to be stopped, and moves")

    def _typed(self, data: bytes) -> None:
        self.typed(data, self.session)

    def typed(self, data: bytes, session: Session, who: str = "") -> None:
        """Take what somebody types; at a stop, note what has to leave next on each line."""
        self.history.note(self.loop.now, f"key{who}", data.replace(bytes(self.folder), b"~").hex())
        if data[:1] in (b"y", b"Y"):
            self.history.told.yes.append(self.loop.now)
        if STOP in data:
            buses = {name: bus for name, bus in session.buses.items() if not bus.link.lost}
            forms = {f"{name}{who}": self._forms(bus) for name, bus in buses.items()}
            trying = session.reconnections.trying
            lost = tuple(name + who for name, bus in session.buses.items() if bus.link.lost and name in trying)
            self.history.stops.append(Stop(self.loop.now, forms, who, len(self.history.written), lost))

    @contextlib.contextmanager
    def ahead(self) -> Iterator[None]:
        """Note what the stop's thread writes meanwhile: the one that runs this."""
        stop, me = self.history.stops[-1], threading.get_ident()
        self.stopping[me] = stop
        try:
            yield
        finally:
            del self.stopping[me]
            stop.done = len(self.history.written)
            for name in stop.forms:
                stop.own.setdefault(name, (stop.done, self.kernel.rest(name)))

    def _forms(self, bus: Bus) -> tuple[bytes, ...]:
        """What a stop of a line may begin with."""
        forms, kind = stop_forms(bus.roster), self.place(bus.name).kind
        found = (forms.immediate,) if forms.framed else (forms.immediate, forms.unterminated)
        if kind == "rfc2217":
            purge = b"" if forms.framed else telnet.message(telnet.Setting.PURGE, telnet.PURGE_UNSENT)
            return tuple(purge + telnet.escaped(each) for each in found)
        if kind == "ssh":
            drop = b"" if forms.framed else frame(Kind.DROP)
            return tuple(beat + drop + bytes((Kind.DATA,)) for each in found for beat in (b"", frame(Kind.BEAT)))
        return found

    # The story

    def command(self, rng: Random, place: Place | None = None, who: str = "", stops: int | None = None) -> bytes:
        """Draw a line for a drive, and its Enter. `who` types it, after so many stops of his own."""
        place = place or rng.choice(self.places)
        drive = rng.choice(place.names)
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
        """Let work of the session's process run beside the prompt."""
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
        if self.history.lives > 1 or self._owing():
            await self._live()
            await self._close()
        self.history.unreadable += unreadable(self.folder, "the end", self.history)
        self.history.owing += self._owing()
        self.history.told.backups = backups(self.folder)
        self.history.logged += breaches_in_logs(self.folder, self.history)
        for other in self.others:
            await other.leave()
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
        """The MCode drives in another echo mode than at the beginning, which no act sets, or in program mode."""
        found = []
        for (line, drive), witness in self.witnesses.items():
            place = self.place(line)
            if place.language == "mcode":
                mode, stores = int(witness.device.memory.values["EM"]), witness.device.programming is not None
                if mode != place.em or stores:
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
            self.person.hang_up(lambda: self.loop.create_task(self._hung_up(), context=Context()) and None)

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


class WatchedSession(Session):
    """A session that notes what the caller of each line got."""

    def __init__(self, settings: Settings, world: World, process: Process | None = None) -> None:
        super().__init__(settings, reconnect=True)
        self._world, self._process = world, process
        self.path = WatchedPath(self, world)

    @property
    def _dead(self) -> bool:
        return self._process is not None and self._process.dead

    def stop_ahead(self) -> None:
        """Write the stop, and note it."""
        with self._world.ahead():
            super().stop_ahead()

    def stop(self, why: str = "stop", follows: bool = True) -> None:
        """Stop everything, and note it."""
        examine_before_a_stop(self._world)
        self._world.history.told.halts.append(self.now())
        super().stop(why, follows)

    async def run(self, line: str | TypedLine, *arguments: Any, **named: Any) -> None:
        """Run a line, and note its outcome."""
        text = (line if isinstance(line, str) else line.typed).strip()
        history = self._world.history
        command = history.commands.get(text)
        ASKED.set((text, self.now()) if text in history.questions else None)
        if command is None:
            return await super().run(line, *arguments, **named)
        command.began = self.now()
        command.times += self.recording.startswith("r")
        try:
            await super().run(line, *arguments, **named)
        except (DriveError, Diagnostic, TransportLost) as failure:
            self._ended(command, failure)
            raise
        except asyncio.CancelledError:
            if not self._dead:
                command.outcome, command.said, command.ended = Outcome.UNKNOWN, "cancelled", self.now()
            raise
        else:
            self._ended(command, ())

    def _ended(self, command: Command, result: tuple[str, ...] | BaseException) -> None:
        if self._dead:
            return
        command.ended, command.said = self.now(), str(result)
        notices = [
            text for at, text in self._world.history.notices if at >= command.began and f"'{command.text}'" in text
        ]
        command.outcome = WORDS[word(result, notices)]
        if isinstance(result, Diagnostic) or str(result) == LATCHED:  # before anything is sent
            command.outcome = Outcome.NOT_SENT
        where = f"{command.line}:{command.drive} {command.text!r}"
        self._world.history.note(command.ended, "host", f"{where}: {command.outcome.value} ({command.said})")


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
    climate = Climate.drawn(seed, without)
    places = drawn_places(Random(f"{seed} places"), Random(f"{seed} usb machine"))
    history = History(keep=keep)
    loops: list[SimulatedLoop] = []

    def factory() -> SimulatedLoop:
        loops.append(SimulatedLoop(Random(f"{seed} loop")))
        return loops[0]

    with place_of_state() as folder, asyncio.Runner(loop_factory=factory) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, SimulatedLoop)
        wall, scheduler = Wall(loop), Scheduler(loop, Random(f"{seed} threads"), climate["slow thread"])
        history.folder = str(folder)
        disk = Disk(f"{folder}/", loop, wall, climate, Random(f"{seed} disk"), partial(_noted, history, loop))
        cut_ins = CutIns(lambda name: history.count("stops held up" if name == UP else "cut-ins"), loop)
        world = World(seed, loop, history, climate, places, folder, wall, scheduler, disk, cut_ins)

        async def life() -> None:
            await world.begin()
            for step in steps:
                await tell(world, step)
            await world.end()

        with ExitStack() as stack:
            stack.enter_context(wall.installed())
            stack.enter_context(scheduler.installed())
            stack.enter_context(disk.installed())
            stack.enter_context(world.kernel.installed())
            stack.enter_context(contextlib.chdir(folder))
            for seam in ((wire, "harmed", world.harmed), *SEAMS):
                stack.enter_context(_replaced(*seam))
            locks = SimpleNamespace(**{**vars(threading), "Lock": cut_ins.lock})
            for shared in (pipe, usb):
                stack.enter_context(_replaced(shared, "threading", locks))
            stack.callback(cut_ins.kill)
            stack.enter_context(_logged(history))
            try:
                runner.run(life())
            except Deadlock as defect:
                history.defects.append(str(defect))
        history.defects += [str(each.get("exception") or each.get("message")) for each in loop.defects]
    return world


def _noted(history: History, loop: SimulatedLoop, what: str, path: str) -> None:
    history.note(loop.now, f"disk {what}", path)


@contextlib.contextmanager
def _replaced(module: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


@contextlib.contextmanager
def _logged(history: History) -> Iterator[None]:
    """Take what the product writes to its log of defects."""

    class Defects(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            cause = record.exc_info[1] if record.exc_info else ""
            history.defects.append(f"{record.getMessage()}: {cause!r}")

    handler, propagated = Defects(logging.ERROR), LOG.propagate
    LOG.addHandler(handler)
    LOG.propagate = False
    try:
        yield
    finally:
        LOG.propagate = propagated
        LOG.removeHandler(handler)
