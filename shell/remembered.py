"""The memory of a session: names in their programs, lines that they printed, actions while it records."""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from weakref import WeakKeyDictionary

from multidrop.base.errors import DriveError, TransportLost
from multidrop.dialects import Priority
from multidrop.dialects.codec import at_priority
from multidrop.dialects.program_files import Held
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import Conditioned, Sample, Unsolicited
from multidrop.macros import Recorder
from multidrop.shell.events import OnBus, Printed, SessionEvent
from multidrop.shell.line_syntax import join_target
from multidrop.shell.origin import Origin


class KnownNames:
    """The names last read of each drive, with the number of commands sent to it by then."""

    def __init__(self) -> None:
        self._held: WeakKeyDictionary[Drive, tuple[Held, int]] = WeakKeyDictionary()
        self._asking: WeakKeyDictionary[Drive, asyncio.Task[None]] = WeakKeyDictionary()

    def learn(self, drive: Drive, held: Held) -> None:
        self._held[drive] = held, drive.commands

    def forget(self, drive: Drive) -> None:
        """Offer no name of a drive until its names are read again."""
        self._held.pop(drive, None)

    def offered(self, drive: Drive, line: str) -> Sequence[tuple[str, str]]:
        """The names that may end a line being typed, each with its meaning."""
        known = self._held.get(drive)
        programs = drive.family.programs
        return programs.offered(known[0], line) if known is not None and programs is not None else ()

    def ask(self, drive: Drive, done: Callable[[], None] = lambda: None) -> asyncio.Task[None] | None:
        """Read the names of a drive at the priority of polls, where they are not known as they are now.

        `done` is called once they are read. A drive that stores lines, or takes a file, is not asked.
        """
        programs = drive.family.programs
        if programs is None or not programs.offers("names") or drive.programming or drive.transferring:
            return None
        known = self._held.get(drive)
        if known is not None and known[1] == drive.commands:
            return None
        task = self._asking.get(drive)
        if task is None or task.done():
            task = self._asking[drive] = asyncio.get_running_loop().create_task(self._read(drive))
        task.add_done_callback(lambda ended: None if ended.cancelled() else done())
        return task

    async def _read(self, drive: Drive) -> None:
        programs = drive.family.programs
        assert programs is not None
        with contextlib.suppress(DriveError, TransportLost):  # completion goes without
            self.learn(drive, await drive.run(at_priority(programs.names(), Priority.POLL)))


MOST_REMEMBERED_LINES = 1000
"""The number of lines kept."""


class Lately:
    """The last lines that drives printed, replies and others, each with its number."""

    def __init__(self) -> None:
        self._lines: deque[tuple[int, str]] = deque(maxlen=MOST_REMEMBERED_LINES)
        self._count = 0
        self._typed = 0
        """The number of lines before the last line that was sent to a drive."""
        self._changed = asyncio.Event()

    def take(self, event: SessionEvent) -> None:
        if isinstance(event, Printed):
            self._add(event.text)
        elif isinstance(event, OnBus) and isinstance(event.event, Unsolicited):
            for line in event.event.lines:
                self._add(line)

    def begin(self, origin: Origin) -> None:
        """Note that a line is sent to a drive: the next wait of its sender looks from here on."""
        self._typed = self._count
        if origin.last is not None:
            origin.last.printed = self._count

    async def finds(self, origin: Origin, text: str, seconds: float) -> bool:
        """True if a line contains the text: since the sender's last line, or within a time, s."""
        begun = origin.last.printed if origin.last is not None else None
        since = self._typed if begun is None else begun
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self._has(text, since):
                    self._changed.clear()
                    await self._changed.wait()
        return self._has(text, since)

    def last(self, most: int) -> list[str]:
        return [line for _, line in self._lines][-most:]

    def _has(self, text: str, since: int) -> bool:
        return any(text in line for number, line in self._lines if number >= since)

    def _add(self, line: str) -> None:
        self._lines.append((self._count, line))
        self._count += 1
        self._changed.set()


class Observing:
    """Notes the texts, motions and changes of inputs while a recorder records."""

    def __init__(self, recorder: Recorder, buses: Callable[[], Mapping[str, Bus]]) -> None:
        self._recorder, self._buses = recorder, buses
        self._inputs: dict[tuple[str, str, str], bool] = {}
        """The last state of each input, by bus, address and word."""

    def take(self, event: SessionEvent) -> None:
        if not isinstance(event, OnBus):
            return
        happened, observed = event.event, self._recorder.observed
        if isinstance(happened, Conditioned):
            # Note each input that has changed and that can be asked for.
            for conditions in happened.conditions:
                for lamp in conditions.lamps:
                    key = (event.bus, happened.address, f"I{lamp.name}")
                    if lamp.output or lamp.on is None:
                        continue
                    before, self._inputs[key] = self._inputs.get(key), lamp.on
                    if self._recorder.name and before not in (None, lamp.on) and self._has(*key):
                        target = join_target(event.bus if len(self._buses()) > 1 else "", happened.address)
                        condition = f"{key[2]}={int(lamp.on)}"
                        text = f"@{target} {condition}" if target else condition
                        self._recorder.observed.inputs.append((happened.at, text))
        elif not self._recorder.name:
            return
        elif isinstance(happened, Unsolicited):
            observed.texts.extend((happened.at, line) for line in happened.lines)
        elif isinstance(happened, Sample):
            observed.moving.append((happened.at, happened.velocity != 0))

    def _has(self, bus: str, address: str, word: str) -> bool:
        """True if a drive can be asked for a word."""
        open_bus = self._buses().get(bus)
        drive = open_bus.drives.get(address) if open_bus is not None else None
        return drive is not None and drive.family.question(word) is not None
