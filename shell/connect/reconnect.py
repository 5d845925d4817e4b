"""The return of lost buses: each is tried again by itself until it is back or closed.

A bus keeps its name, its drives and everything that watches it. An attempt opens the port again, writes the stop that
the loss has left open, and finds the drives and their settings again. Nothing else is sent before that, nothing that
was sent is sent again, and nothing moves.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from multidrop.dialects import DriveError, Hints, Stopped
from multidrop.drives.apart import apart
from multidrop.drives.drive import confirmed_motion
from multidrop.drives.events import Changed
from multidrop.shell.connect.reopening import Absent, Reopen
from multidrop.shell.stops import E_STOP, UNCONFIRMED, last_seen
from multidrop.transports import TransportLost

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive

FIRST = 0.1
"""The pause before the first attempt, s; each further one is twice as long."""
LONGEST = 0.7
"""The longest pause, s: a port that is back is noticed within a second, however long it was away."""
GLANCE = 0.2
"""The pause while the port is known to be absent, s: to look costs nothing."""

Say = Callable[[str, str], None]
"""Publishes a warning: the name of the bus, the text."""


class Reconnections:
    """The buses of a session that are tried again when they are lost."""

    def __init__(self, say: Say, wanted: bool) -> None:
        self._say = say
        self._wanted = wanted
        self._ways: dict[str, tuple[Hints, Reopen]] = {}
        self._ports: dict[str, str] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    @property
    def trying(self) -> Collection[str]:
        """The names of the buses that are being tried again."""
        return self._tasks.keys()

    def add(self, bus: Bus, hints: Hints, reopen: Reopen | None, port: str) -> None:
        """Try this bus again whenever it is lost, where that is wanted and possible."""
        if self._wanted and reopen is not None:
            self._ways[bus.name], self._ports[bus.name] = (hints, reopen), port

    def rename(self, before: str, now: str) -> None:
        """Know a bus by its new name. It must not be lost."""
        if before in self._ways:
            self._ways[now], self._ports[now] = self._ways.pop(before), self._ports.pop(before)

    def waiting_for(self, port: str) -> str:
        """The name of the bus that is being tried again on a port; empty if there is none."""
        return next((name for name in self._tasks if port and self._ports.get(name) == port), "")

    def lost(self, bus: Bus) -> bool:
        """Begin to try a lost bus; whether it is tried."""
        way = self._ways.get(bus.name)
        if way is None:
            return False
        if earlier := self._tasks.get(bus.name):  # which is back, and reads what moves
            earlier.cancel()
        self._tasks[bus.name] = asyncio.get_running_loop().create_task(self._try(bus, *way))
        return True

    async def _try(self, bus: Bus, hints: Hints, reopen: Reopen) -> None:
        trouble: list[str] = []
        try:
            with apart(f"the return of {bus.name}", trouble):
                await _Return(bus, hints, reopen, self._say).run()
        finally:
            if self._tasks.get(bus.name) is asyncio.current_task():
                del self._tasks[bus.name]
        if trouble:
            self._gave_up(bus, trouble[0])

    def _gave_up(self, bus: Bus, trouble: str) -> None:
        """Publish that a defect has ended the attempts."""
        if bus.lost is None:
            self._say(bus.name, f"{bus.name} is back, but whether a drive moves was not read ({trouble})")
        else:
            self._say(bus.name, f"{bus.name} is lost and not tried again ({trouble}); /close it, then open it")
            bus.link.publish(Changed(bus.now()))

    async def remove(self, name: str) -> None:
        """End the attempts for a bus that is being closed."""
        self._ways.pop(name, None)
        self._ports.pop(name, None)
        if task := self._tasks.get(name):
            task.cancel()
            await asyncio.wait([task])


class _Return:
    """The attempts for one loss of one bus."""

    def __init__(self, bus: Bus, hints: Hints, reopen: Reopen, say: Say) -> None:
        self._bus, self._hints, self._reopen = bus, hints, reopen
        self._publish = say
        self._since = bus.now()
        self._unsure = [drive for drive in bus.all_drives if may_move(drive)]
        self._stopped = ""
        """The drives to which a stop was sent first; its confirmation reads what moves."""
        self._reason = ""
        self._said: set[str] = set()

    def _say(self, text: str) -> None:
        self._publish(self._bus.name, text)

    async def run(self) -> None:
        """Try until the bus is back."""
        if self._unsure:
            seen = ", ".join(f"{each.shown} {last_seen(each, self._since)}" for each in self._unsure)
            self._say(f"{self._bus.name}: cannot be stopped from here until the line is back: {seen}{E_STOP}")
        pause = FIRST
        while pause:
            await asyncio.sleep(pause)
            pause = await self._try(pause)
        await self._report()

    async def _try(self, pause: float) -> float:
        """Make one attempt; return the pause before the next one, s: 0 if the bus is back."""
        try:
            await self._attempt()
        except (Absent, Stopped):
            return min(2 * pause, GLANCE)
        except DriveError as failure:  # after a search of some seconds
            self._failed(str(failure))
            return FIRST
        except TransportLost as failure:
            self._failed(str(failure))
            return min(2 * pause, LONGEST)
        return 0.0

    async def _attempt(self) -> None:
        bus = self._bus
        if bus.link.lost is not None:
            cut = bus.link.cut
            halt = bus.resume(await self._reopen(bus.link.transport))
            if halt is not None and not self._stopped:
                self._stopped = ", ".join(drive.shown for drive in halt.affected) or "every drive"
                why = f"'{cut}' was cut off by the loss" if cut else "the loss kept it from the drives"
                self._say(f"{bus.name}: the stop of {self._stopped} was sent first ({why})")
        await bus.find_again(self._hints)

    def _failed(self, reason: str) -> None:
        """Publish a reason once, when it is met a second time in a row: a port may take a moment to be ready."""
        if reason == self._reason and reason not in self._said:
            self._said.add(reason)
            self._say(f"{self._bus.name}: still lost: {reason}")
        self._reason = reason

    async def _report(self) -> None:
        bus = self._bus
        self._say(f"{bus.name} is back after {bus.now() - self._since:.1f} s")
        for drive in self._unsure:
            if drive.address in bus.drives and not drive.programming and not self._stopped:
                self._say(f"{bus.name}: {await _motion(drive)}")


async def _motion(drive: Drive) -> str:
    try:
        axes = await confirmed_motion(drive)
    except (DriveError, TransportLost) as failure:
        return f"whether {drive.shown} moves could not be read: {failure}"
    velocity = max((axis.velocity for axis in axes), key=abs)
    where = ", ".join(str(axis.position) for axis in axes)
    if not velocity and drive.seen is not None and not drive.seen.at_rest():
        return f"{drive.shown} {UNCONFIRMED}; now {where}"
    return f"{drive.shown} moves at {velocity} a second" if velocity else f"{drive.shown} is at rest at {where}"


def may_move(drive: Drive) -> bool:
    """Whether the last that is known of a drive is that it moved, or that something was sent to start it."""
    seen = drive.seen
    if seen is None or drive.started_at > seen.at:
        return drive.started_at > float("-inf")
    return not seen.at_rest()
