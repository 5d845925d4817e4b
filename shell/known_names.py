"""The labels and variables of programs, as far as they were read: for completion, which asks no drive by itself."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from multidrop.dialects import DriveError, Priority
from multidrop.dialects.codec import at_priority
from multidrop.transports import TransportLost

if TYPE_CHECKING:
    from multidrop.dialects.held import Held
    from multidrop.drives.drive import Drive


class KnownNames:
    """The names last read of each drive, with the number of commands sent to it by then."""

    def __init__(self) -> None:
        self._held: WeakKeyDictionary[Drive, tuple[Held, int]] = WeakKeyDictionary()
        self._asking: WeakKeyDictionary[Drive, asyncio.Task[None]] = WeakKeyDictionary()

    def learn(self, drive: Drive, held: Held) -> None:
        """Note what was read of a drive."""
        self._held[drive] = held, drive.commands

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
        if programs is None or programs.names is None or drive.programming or drive.transferring:
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
        assert programs is not None and programs.names is not None
        with contextlib.suppress(DriveError, TransportLost):  # completion goes without
            self.learn(drive, await drive.run(at_priority(programs.names(drive.state), Priority.POLL)))
