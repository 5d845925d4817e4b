"""The lives of a session: each is a process that begins on what the disk holds.

It ends by a kill, a hang-up or a quit, and another one follows; or with the story.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextvars import Context
from functools import partial
from random import Random
from typing import Any

from multidrop.features.sharing.writer_turns import Say
from multidrop.shell.automation import settled
from multidrop.shell.log import files, writer
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from soak.judge import Witness
from soak.languages import LANGUAGES, PROGRAM
from soak.simulation.person import Person
from soak.simulation.records.history import Executed
from soak.simulation.records.places import SERIAL, Place
from soak.simulation.system.far import share
from soak.simulation.system.kernel import WHO
from soak.simulation.system.process import Process
from soak.simulation.system.terminal import Terminal
from soak.simulation.watching.files_left import backups, breaches_in_logs, unreadable
from soak.simulation.watching.hearing import heard, typed
from soak.simulation.watching.session import WatchedSession
from soak.simulation.world import World

LONGEST = 400.0
"""Virtual seconds in which everything that was begun ends, once the faults are over."""
FORGETS = ("IP", "FD")
"""Lines that put values back to the saved ones, as a power-up does."""
AWAY = 20.0
"""The longest time until a killed session is started again, s; a PC without power takes at least as long."""


class Lives:
    """Begins a world, the lives of its session, and its end."""

    def __init__(self, world: World) -> None:
        self._world = world
        world.hang_up = self.hang_up

    async def begin(self) -> None:
        """Build the floor, open the session, and let the faults begin."""
        world = self._world
        (world.folder / "tick.mxt").write_text(PROGRAM)
        cell = world.folder / "cell.toml"
        cell.write_text(f"seed = {world.seed}\n" + "".join(place.cell() for place in world.places))
        world.floor = RunningFloor(Floor(cells.load(str(cell))))
        for placed in world.floor.floor.drives:
            self._watch(placed.bus, placed.spec.name, placed.device)
        for place in world.places:
            if place.kind in SERIAL:
                world.kernel.adapter(world.floor, place.name, place.link)
            if place.kind == "rfc2217":
                await self._lend(place)
            if place.kind == "usb":
                world.kernel.usb.add(world.floor, place.name, f"1-{place.place}")
        for bus in world.floor.floor.cell.buses:
            await serve_bus(world.floor, bus, world.stack)
        await self._live()
        world.faults(True)

    def _watch(self, line: str, drive: str, device: Any) -> None:
        world = self._world
        language = LANGUAGES[world.place(line).language]
        witness = world.witnesses[line, drive] = Witness(device, language.asks, language.refused)
        seen = device.execute

        def execute(text: Any, now: float, **how: Any) -> Any:
            before = len(witness.executed)
            answer = seen(text, now, **how)
            for each in witness.executed[before:]:
                world.history.executed.append(Executed(world.loop.now, line, drive, each))
                if each in FORGETS:
                    world.cut.setdefault((line, drive), []).append(world.loop.now)
                world.history.note(world.loop.now, f"! {line}:{drive}", each)
            return answer

        switched = device.power

        def power(on: bool, now: float) -> None:
            world.cut.setdefault((line, drive), []).append(world.loop.now)
            switched(on, now)

        device.execute, device.power = execute, power

    async def _lend(self, place: Place) -> None:
        """Lend the port of a line, as a computer beside it does."""
        token = WHO.set("far")
        url = f"serial:{place.link}?baud={place.baud}&dialect={place.language}"
        try:
            self._world.shares[place.name] = await share(
                url, place.language, place.host, 2217, partial(self._lent, place)
            )
        finally:
            WHO.reset(token)

    def _lent(self, place: Place, said: Say) -> None:
        world = self._world
        if said.event == "stop":
            world.history.passed.append((world.loop.now, place.name))
        world.history.note(world.loop.now, "share", f"{said.client} {said.event} {said.detail}")

    async def _live(self) -> None:
        """Start a process with a session on what the disk holds, and open the lines."""
        world = self._world
        world.history.began.append(world.loop.now)
        lives = world.history.lives
        world.history.unreadable += unreadable(world.folder, f"life {lives}", world.history)
        world.process = process = Process(4000 + lives, world.loop)
        process.at_death += (
            self._died,
            partial(world.disk.close_all, process),
            partial(world.scheduler.forget, process),
        )
        process.run(self._open_session, process)
        session = world.session
        process.routines = lambda: [
            each._procedure for bus in session.buses.values() for each in bus._conversations.under_way
        ]
        opening = process.start(session.open_all([place.name for place in world.places], lambda number, failure: None))
        await asyncio.wait((opening, process.death), return_when=asyncio.FIRST_COMPLETED)
        if not process.dead:
            world.ready.set()

    def _open_session(self, process: Process) -> None:
        world = self._world
        files.PROCESS = process.number
        world.history.told.latches.append((world.loop.now, False))
        world.session = WatchedSession(world.settings(world.folder), world, process)
        world.session.subscribe(partial(heard, world))
        world.terminal = Terminal(world.loop)
        world.session.subscribe(world.terminal.show)
        writer.begin(world.session)
        rng = Random(f"{world.seed} person {world.history.lives}")
        world.person = Person(world.session, world.loop, rng, self._typed, world.cut_ins, process)
        world.person.quits = self.quit

    def _died(self) -> None:
        """The kernel closes its ports; what it had to say of a line is not known."""
        world = self._world
        world.ready.clear()
        power = world.history.power
        world.history.note(world.loop.now, "killed", "power" * power)
        world.history.count("power cuts" if power else "kills")
        world.history.killed(world.loop.now)
        world.stops = sum(not stop.who for stop in world.history.stops)
        world.beside_it.clear()
        world.cut_ins.kill()
        world.kernel.close_all(world.process, power)
        rng = Random(f"{world.seed} life {world.history.lives}")
        if power:
            world.loop.call_soon(world.disk.cut_power, rng, context=Context())
        away = rng.random() ** 2 * AWAY + power * AWAY
        self._start(self._again(away))

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        """Begin work that no process does."""
        self._world.loop.create_task(work, context=Context())

    async def _again(self, away: float) -> None:
        await asyncio.sleep(away)
        await self._live()

    def _typed(self, data: bytes) -> None:
        typed(self._world, data, self._world.session)

    async def end(self) -> None:
        """End the faults, wait until nothing runs, and close; after kills once more, as the next session does."""
        world = self._world
        await world.ready.wait()
        world.ending = True
        world.process.arm(0, "")
        world.cut_ins.hurry()
        world.cut_ins.end()
        world.faults(False)
        world.person.type(b"/plot off\r/twin off\r")
        await asyncio.sleep(10.0)
        deadline = world.loop.now + LONGEST
        while still := world.person.lines.running or world.session._background or world.running:
            if world.loop.now > deadline:
                world.history.defects.append(f"still runs: {still!r}")
                break
            world.person.type(b"n")  # the answer to a question, if there is one
            await asyncio.sleep(1.0)
        await self._close()
        for visit in world.visits:
            await visit
        for other in world.others:  # while they write to a line, the next session is refused there
            await other.leave()
        if world.history.lives > 1 or self._owing():
            await self._live()
            await self._close()
        world.history.unreadable += unreadable(world.folder, "the end", world.history)
        world.history.owing += self._owing()
        world.history.told.backups = backups(world.folder)
        world.history.logged += breaches_in_logs(world.folder, world.history)
        for shared in world.shares.values():
            await shared.close()
        await world.stack.aclose()
        world.floor.close()
        await asyncio.sleep(30.0)
        left = [each for each in asyncio.all_tasks() if each is not asyncio.current_task()]
        world.history.defects += [f"task left: {each.get_coro()}" for each in left]
        world.history.defects += [f"open: {each!r}" for each in world.kernel.descriptors.values() if not each.closed]
        world.history.defects += [f"thread left: {each.name}" for each in world.scheduler.running]

    def _owing(self) -> list[str]:
        """The MCode drives in another echo mode than at the beginning, which only FD sets, or in program mode."""
        world = self._world
        found = []
        cleared = {(each.line, each.drive) for each in world.history.executed if each.text == "FD"}
        for (line, drive), witness in world.witnesses.items():
            place = world.place(line)
            if place.language == "mcode":
                mode, stores = int(witness.device.memory.values["EM"]), witness.device.programming is not None
                factory = mode == 0 and (line, drive) in cleared
                if stores or (mode != place.em and not factory):
                    found.append(f"{line}:{drive} has EM={mode}, not {place.em}" + ", and stores lines" * stores)
        return found

    async def _close(self) -> None:
        """Close the session in an orderly way."""
        world = self._world
        await world.process.start(self._leave())
        world.history.defects += [f"file left: {each.path}" for each in world.disk.open.values()]

    async def _leave(self) -> None:
        world = self._world
        await world.person.leave()
        await world.session.close()
        world.history.unshown += await world.terminal.finish()

    def hang_up(self) -> None:
        """Hang up the terminal: the session ends in an orderly way, and after a while another one begins."""
        world = self._world
        if world.ready.is_set() and not (world.process.dead or world.ending):
            world.ready.clear()
            world.cut_ins.hurry()
            world.cut_ins.end()
            world.history.deaths.append(world.loop.now)
            world.history.note(world.loop.now, "hang-up", "")
            world.person.hang_up(lambda: self._start(self._hung_up()))

    def quit(self) -> None:
        """End the session by a quit: as a hang-up, but the terminal stays, and what is typed still arrives."""
        world = self._world
        if world.ready.is_set() and not (world.process.dead or world.ending):
            world.ready.clear()
            world.cut_ins.hurry()
            world.cut_ins.end()
            world.history.deaths.append(world.loop.now)
            world.history.note(world.loop.now, "quit", "")
            for each in world.history.told.quits[-1:]:
                each.accepted = min(each.accepted, world.loop.now)
            self._start(self._hung_up())

    async def _hung_up(self) -> None:
        world = self._world
        process, rng = world.process, Random(f"{world.seed} hang-up {world.history.lives}")
        ending = process.start(self._end_of_prompt())
        await asyncio.wait((ending, process.death), return_when=asyncio.FIRST_COMPLETED)
        if process.dead:
            return  # killed meanwhile, which begins the next life
        process.arm(0, "")
        ending.result()
        await asyncio.sleep(0.1)  # a look-up of a name that nobody waits for any more ends
        world.stops = sum(not stop.who for stop in world.history.stops)
        world.beside_it.clear()
        opened = [each for each in world.kernel.descriptors.values() if each.owner is process and not each.closed]
        world.history.defects += [f"left by a hang-up: {each!r}" for each in (*world.loop.tasks_of(process), *opened)]
        await self._again(rng.random() ** 2 * AWAY)

    async def _end_of_prompt(self) -> None:
        """End as the prompt does: what was set in motion is stopped."""
        world = self._world
        for work in world.running:
            work.cancel()
        world.person.lines.drop("the prompt has ended")
        world.session.interrupt()
        await world.session.automations.over()
        await settled(world.session)
        await self._leave()
