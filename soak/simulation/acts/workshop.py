"""A workshop: a line of drives of its own, and a person with a session of their own, which no fault of the story meets.

The rules about the machine's lines have to except what noise and kills can do. Here nothing does that, so a job can
compare what a session promises with what the drives did, to the letter. A job notes each comparison as a `Fact`; the
rules of the judge read them.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import json
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from contextlib import AsyncExitStack
from contextvars import copy_context
from functools import partial
from random import Random
from types import MappingProxyType
from typing import Any

from multidrop.dialects.units import scale
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Guarding, SavedConnection, Settings
from multidrop.shell.events import FAILURES, Notified, Output
from multidrop.shell.origin import PERSON
from multidrop.shell.scripts.executor import run_script
from multidrop.shell.scripts.reading import read_script
from multidrop.shell.session import Session
from multidrop.simulator import cells
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from soak.judge import Witness
from soak.languages import LANGUAGES
from soak.simulation.records.told import Fact
from soak.simulation.system.kernel import WHO
from soak.simulation.world import World

PORT = 4001
BAUD = 115200
LINE = "w"
"""The name of the line in the session."""
TRIES = 10
SETTLED = 5.0
"""The time, s, after an early end in which its stops are confirmed."""
LONGEST = 60.0
"""The time, s, in which a job is over."""


NO_MORE: Mapping[str, str] = MappingProxyType({})
SAVES = ("STORE", "STAP")
"""Lines without a value that do more than ask."""
ALSO = frozenset({"S"})
"""Words that the person has guarded."""


class Workshop:
    """A line of drives, and a person at it. `names`: its drives; `more`: further lines of their tables, by name."""

    def __init__(
        self, world: World, rng: Random, language: str, names: Sequence[str], more: Mapping[str, str] = NO_MORE
    ) -> None:
        self.world, self.rng, self.language, self.names = world, rng, language, names
        self.folder = world.folder / f"workshop{world.step}"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.host = f"shop{world.step}.plant"
        world.network.host(self.host).spared = True
        self.answers: list[bool] = []
        """What the person answers to the next questions, in their order; then no."""
        self.asked: list[str] = []
        """The questions that were put to them."""
        self.said: list[tuple[float, str]] = []
        """The notices and the output of the session."""
        self._more = more
        self._served = AsyncExitStack()

    # Making

    async def serve(self) -> None:
        """Put the drives on the line."""
        table = LANGUAGES[self.language].drive
        drives = (self._table(table(each, 1, 1, True), self._more.get(each, "")) for each in self.names)
        serves = f'serve = ["tcp://{self.host}:{PORT}"]\n'
        text = f'seed = {self.world.seed}\n[[bus]]\nname = "{LINE}"\nbaud = {BAUD}\n{serves}' + "".join(drives)
        (self.folder / "cell.toml").write_text(text)
        self.floor = RunningFloor(Floor(cells.load(str(self.folder / "cell.toml"))))
        self.devices = {each.spec.name: each for each in self.floor.floor.drives}
        self.witnesses = {
            name: Witness(each.device, self._asks, LANGUAGES[self.language].refused)
            for name, each in self.devices.items()
        }
        await self.serve_again()

    def _asks(self, line: str) -> bool:
        return line.split()[0] not in SAVES and LANGUAGES[self.language].asks(line)

    async def serve_again(self) -> None:
        """Plug the line in again."""
        for bus in self.floor.floor.cell.buses:
            await serve_bus(self.floor, bus, self._served)

    async def unplug(self) -> None:
        """Take the line away, with its drives as they are."""
        await self._served.aclose()

    @staticmethod
    def _table(text: str, more: str) -> str:
        kept = (each for each in text.splitlines() if not each.startswith("program"))
        return "\n".join(("[[bus.drive]]", *kept, more, ""))

    def sit_down(self, scales: str = "", timeout: float = 2.0) -> None:
        """Begin a session. `scales`: that of each drive. The words of `ALSO` ask first, too."""
        names = ",".join(self.names)
        url = f"tcp://{self.host}:{PORT}?dialect={self.language}&drives={names}&timeout={timeout:g}"
        units = {each: scale(scales, ()) for each in self.names} if scales else {}
        settings = Settings(
            {LINE: SavedConnection(LINE, url, {}, units)},
            self.folder / "config",
            self.folder / "state",
            Guarding(also=ALSO),
            data=self.folder / "data",
        )
        self.session = Session(settings, reconnect=True)
        self.session.front = Front(ask=self._ask)
        self.session.subscribe(self._heard)

    async def open(self) -> None:
        """Open the line, again where a thread that is slow or a loop that is held up kept it from that."""
        for left in reversed(range(TRIES)):
            try:
                await self.session.open(LINE, LINE)
            except FAILURES:
                if not left:
                    raise
                await asyncio.sleep(1.0)
            else:
                return

    async def _ask(self, question: str) -> bool:
        self.asked.append(question)
        await asyncio.sleep(0.5)
        return self.answers.pop(0) if self.answers else False

    def _heard(self, event: object) -> None:
        if isinstance(event, Notified | Output):
            self.said.append((self.world.loop.now, event.text))

    # What the person does

    async def type(self, line: str) -> str:
        """Type a line; return why it failed, empty if it did not."""
        try:
            await self.session.run(line)
        except FAILURES as failure:
            return str(failure) or type(failure).__name__
        return ""

    async def script(self, lines: Sequence[str]) -> str:
        """Run a script; return why it failed."""
        file = self.folder / f"s{len(self.said)}.txt"
        file.write_text("\n".join(lines))
        try:
            await self.session.tasks.run(
                run_script(self.session, PERSON, read_script(str(file), {}, self.session.macros))
            )
        except (*FAILURES, asyncio.CancelledError) as failure:
            return str(failure) or type(failure).__name__
        return ""

    async def macro(self, lines: Sequence[str]) -> str:
        """Play a macro; return why it failed."""
        folder, name = self.session.settings.macros, f"m{len(self.said)}"
        folder.mkdir(parents=True, exist_ok=True)
        steps = (f"[[step]]\nafter = 0.0\nline = {json.dumps(each)}\n" for each in lines)
        (folder / f"{name}.toml").write_text(f'name = "{name}"\n' + "".join(steps))
        try:
            await self.session.tasks.run(self.session.run(f"/play {name}"))
        except (*FAILURES, asyncio.CancelledError) as failure:
            return str(failure) or type(failure).__name__
        return ""

    def start(self, work: Coroutine[Any, Any, str]) -> asyncio.Task[str]:
        """Let something run beside."""
        return self.world.loop.create_task(work)

    def takes(self, nothing: bool) -> None:
        """Let the port of the session take nothing for a while, or every byte."""
        for each in self.world.kernel.descriptors.values():
            if not each.closed and getattr(each, "host", None) is self.world.network.host(self.host):
                if nothing:
                    each.taken = partial(self._full, each.fileno())
                else:
                    vars(each).pop("taken", None)

    def _full(self, descriptor: int, data: object, room: int, busy: bool = True) -> int:
        """In place of `Descriptor.taken`, where there is no room."""
        self.world.loop.call_later(0.002, self.world.loop.writable, descriptor)
        raise BlockingIOError(errno.EAGAIN, "no room")

    # What the drives did

    def device(self, drive: str) -> Any:
        """A simulated drive."""
        return self.devices[drive].device

    def executed(self, drive: str) -> list[str]:
        """The lines that a drive has executed, without questions."""
        return self.witnesses[drive].executed

    def before_execution(self, drive: str, note: Callable[[str], object]) -> None:
        """Call something with each line that a drive is about to execute."""
        device = self.device(drive)
        execute = device.execute

        def noted(text: Any, now: float, **how: Any) -> Any:
            note(str(text).strip())
            return execute(text, now, **how)

        device.execute = noted

    def moves(self, drive: str, axis: str = "") -> bool:
        """Whether a drive moves, or one axis of it."""
        shadow = self.devices[drive].unit.shadow
        assert shadow is not None
        every = shadow.motion(self.floor.now())
        return any(each.velocity for each in every if axis.lower() in ("", each.axis))

    def position(self, drive: str) -> int:
        """Where a drive is."""
        return int(self.device(drive).position(self.floor.now()))

    def fact(self, rule: str, holds: object, words: str) -> None:
        """Note what was compared for a rule of the judge."""
        self.world.history.count("facts of workshops")
        self.world.history.told.facts.append(Fact(rule, f"workshop of step {self.world.step}: {words}", bool(holds)))

    async def close(self) -> None:
        """Take the line away."""
        await self.unplug()
        self.floor.close()


@contextlib.asynccontextmanager
async def workshop(
    world: World,
    rng: Random,
    language: str,
    names: Sequence[str],
    *,
    scales: str = "",
    timeout: float = 2.0,
    more: Mapping[str, str] = NO_MORE,
) -> AsyncIterator[Workshop]:
    """A workshop whose line is open; see `Workshop`, `Workshop.sit_down`."""
    shop = Workshop(world, rng, language, names, more)
    await shop.serve()
    shop.sit_down(scales, timeout)
    try:
        await shop.open()
        yield shop
    finally:
        await shop.session.close()
        await shop.close()


Job = Callable[["World", Random], Coroutine[Any, Any, None]]


def at_work(job: Job) -> Callable[[World, Random], float]:
    """The act of a job, which the story does not wait for longer than it takes."""

    def act(world: World, rng: Random) -> float:
        world.loop.late = 0.0  # nothing but the jobs is left of the story
        context = copy_context()
        context.run(WHO.set, "far")
        world.visits.append(context.run(lambda: world.loop.create_task(job(world, rng))))
        return LONGEST

    return act
