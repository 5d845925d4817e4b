"""The return of lost buses: each is tried again by itself until it is back or closed.

A bus keeps its name, its drives and everything that watches it. An attempt opens the port again, writes the stop that
the loss has left open, and finds the drives and their settings again. Nothing else is sent before that, nothing that
was sent is sent again, and nothing moves.

A serial port is opened only under a name that follows the adapter: another adapter may have taken the number of the old
one. The number of a pseudo-terminal does not qualify; a link to it does, once a server has renewed it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable, Collection
from typing import TYPE_CHECKING, NamedTuple

from multidrop.base.errors import DriveError, Stopped, TransportLost
from multidrop.base.isolation import isolated
from multidrop.dialects import Hints
from multidrop.drives.drive import confirmed_motion
from multidrop.drives.events import Changed
from multidrop.shell.connect import Pauses
from multidrop.shell.stop_report import E_STOP, UNCONFIRMED, last_seen
from multidrop.transports import Transport, Unreachable

if TYPE_CHECKING:
    from multidrop.drives.bus import Bus
    from multidrop.drives.drive import Drive
    from multidrop.simulator.serving.in_process import SimBus


Reopen = Callable[[Transport], Awaitable[Transport]]
"""Opens the port again in place of a broken transport, which it closes. Raises Unreachable, or Absent."""
LONGEST_OPENING = 5.0
"""The longest attempt to connect, s."""
SHORTEST_OPENING = 0.9
"""The shortest attempt to connect, s: each attempt asks once, so a host that is back is asked within that time."""
TIMES_AS_LONG = 4.0
"""An attempt to connect may take this many times as long as the first one took."""
LOGIN = 4.0
"""The shortest attempt to log in, s: after a connection that others shared, a new one takes longer."""
SLOWEST_LOGIN = 20.0
"""The longest attempt to log in, s."""
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 5.0
"""The shortest and the longest pause after a login that failed, s."""
TERMINALS = "/dev/pts/"


class Absent(Unreachable):
    """The port is not there; nothing has to be said about it."""


class SerialAgain:
    """A serial port, by a name that follows its adapter."""

    def __init__(self, port: str, open_: Callable[[str], Awaitable[Transport]]) -> None:
        from multidrop.transports.serial_ports import stable_name

        self._name = stable_name(port)
        self._open = open_
        self._before = _terminal(self._name)

        self.possible = not self._name.startswith(TERMINALS)
        """The name follows the port: the number of a pseudo-terminal does not."""

    async def __call__(self, old: Transport) -> Transport:
        from multidrop.transports.serial_ports import present

        await old.close()
        there = await asyncio.to_thread(present, self._name) if sys.platform == "win32" else present(self._name)
        if not there or (self._before and _terminal(self._name) == self._before):
            raise Absent(f"{self._name} is not there")
        opened = await self._open(self._name)
        self._before = _terminal(self._name)
        return await _at_the_same_baud(opened, old)


def _terminal(name: str) -> tuple[int, int] | None:
    """The identity of a link to a pseudo-terminal, which outlives a killed server; None for other ports."""
    try:
        if not os.path.realpath(name).startswith(TERMINALS):
            return None
        link = os.lstat(name)
    except OSError:
        return None
    return link.st_ino, link.st_mtime_ns


def host_again(open_: Callable[[float], Awaitable[Transport]], took: float) -> Reopen:
    """Connect to a host again. `took` is how long the first connection took, s: a slow network stays reachable."""

    async def again(old: Transport) -> Transport:
        await old.close()
        opened = await open_(min(max(SHORTEST_OPENING, TIMES_AS_LONG * took), LONGEST_OPENING))
        if opened.identity != old.identity:
            await opened.close()
            another = f"another controller, {opened.identity}," if opened.identity else "a controller without a number"
            raise Unreachable(f"{opened.name}: {another} is in the place of {old.identity or 'one without a number'}")
        return await _at_the_same_baud(opened, old)

    return again


class LoginAgain:
    """A port that is reached by a login, opened at its last baud rate. `took` is how long the first login took, s.

    Logins that fail are tried ever less often: a server may shut out a machine that tries too often.
    """

    def __init__(self, open_: Callable[[float, int | None], Awaitable[Transport]], took: float) -> None:
        self._open = open_
        self._within = min(max(LOGIN, TIMES_AS_LONG * took), SLOWEST_LOGIN)
        self._pauses = Pauses(0.0, LONGEST_PAUSE, FIRST_PAUSE)

    async def __call__(self, old: Transport) -> Transport:
        await old.close()
        await asyncio.sleep(self._pauses.now)
        self._pauses.lengthen()
        opened = await self._open(self._within, old.control.baud if old.control else None)
        self._pauses.begin(0.0)
        return opened


async def _at_the_same_baud(opened: Transport, old: Transport) -> Transport:
    """Set the baud rate that a person had changed on the old transport of a serial port."""
    before, now = old.control, opened.control
    if before is not None and now is not None and before.baud != now.baud:
        with contextlib.suppress(OSError):  # then drives are searched for at the rate of the URL
            await asyncio.to_thread(now.set_baud, before.baud)
    return opened


def simulated(bus: SimBus) -> Reopen:
    """Plug in to a simulated bus again. The broken pipe is closed last: the last pipe of a cell ends it."""

    async def again(old: Transport) -> Transport:
        if not bus.present:
            raise Absent(f"{bus.name} is not there")
        opened = bus.again()
        await old.close()
        return opened

    return again


FIRST_RETRY_PAUSE = 0.1
"""The pause before the first attempt, s; each further one is twice as long."""
LONGEST_RETRY_PAUSE = 0.7
"""The longest pause, s: a port that is back is noticed within a second, however long it was away."""
GLANCE = 0.2
"""The pause while the port is known to be absent, s: to look costs nothing."""

Say = Callable[[str, str], None]
"""Publishes a warning: the name of the bus, the text."""


def limit_of(failure: TransportLost) -> float:
    """The longest pause after an attempt that failed, s."""
    return GLANCE if isinstance(failure, Absent) else LONGEST_RETRY_PAUSE


SILENT_PAUSE = 5.0
"""The pause before a line is asked again on which no drive has replied yet, s."""


class Newcomer(NamedTuple):
    """A bus whose drives were never found in this session."""

    found: Callable[[], Awaitable[None]]
    """Awaited once they are."""
    silent: Callable[[DriveError], bool]
    """Called where none replies; whether they are asked again by themselves."""


class ReconnectWay(NamedTuple):
    """How a lost bus comes back."""

    hints: Hints
    reopen: Reopen
    port: str
    newcomer: Newcomer | None = None


class Reconnections:
    """The buses of a session that are tried again when they are lost."""

    def __init__(self, say: Say, wanted: bool) -> None:
        self._say = say
        self.wanted = wanted
        self._ways: dict[str, ReconnectWay] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    @property
    def trying(self) -> Collection[str]:
        return self._tasks.keys()

    def add(self, bus: Bus, hints: Hints, reopen: Reopen | None, port: str, newcomer: Newcomer | None = None) -> None:
        """Try this bus again whenever it is lost, where that is wanted and possible."""
        if self.wanted and reopen is not None:
            self._ways[bus.name] = ReconnectWay(hints, reopen, port, newcomer)

    def rename(self, before: str, now: str) -> None:
        """Know a bus by its new name. It must not be lost."""
        if before in self._ways:
            self._ways[now] = self._ways.pop(before)

    def tries(self, name: str) -> bool:
        """Whether a bus is tried again when it is lost."""
        return name in self._ways

    def waiting_for(self, port: str) -> str:
        """The name of the bus that is being tried again on a port; empty if there is none."""
        return next((name for name, way in self._ways.items() if port and way.port == port and name in self._tasks), "")

    def lost(self, bus: Bus) -> bool:
        """Begin to try a lost bus; whether it is tried."""
        if not self.tries(bus.name):
            return False
        if earlier := self._tasks.get(bus.name):  # which is back, and reads what moves
            earlier.cancel()
        self._tasks[bus.name] = asyncio.get_running_loop().create_task(self._try(bus, self._ways[bus.name]))
        return True

    async def _try(self, bus: Bus, way: ReconnectWay) -> None:
        trouble: list[str] = []
        try:
            with isolated(f"the return of {bus.name}", trouble):
                await _Return(bus, way, self._say).run()
                if bus.drives and self._ways.get(bus.name) is way:
                    self._ways[bus.name] = way._replace(newcomer=None)
        finally:
            if self._tasks.get(bus.name) is asyncio.current_task():
                del self._tasks[bus.name]
        if trouble and bus.lost is None:  # a defect has ended the attempts
            self._say(bus.name, f"{bus.name} is back, but whether a drive moves was not read ({trouble[0]})")
        elif trouble:
            self._say(bus.name, f"{bus.name} is lost and not tried again ({trouble[0]}); /close it, then open it")
            bus.link.publish(Changed(bus.now()))

    async def remove(self, name: str) -> None:
        """End the attempts for a bus that is being closed."""
        self._ways.pop(name, None)
        if task := self._tasks.get(name):
            task.cancel()
            await asyncio.wait([task])


class _Return:
    """The attempts for one loss of one bus."""

    def __init__(self, bus: Bus, way: ReconnectWay, say: Say) -> None:
        self._bus, self._way = bus, way
        self._publish = say
        self._since = bus.now()
        self._unsure = [drive for drive in bus.all_drives if may_move(drive)]
        self._unread = [drive for drive in bus.all_drives if drive not in self._unsure and _unread(drive)]
        self._stopped = ""
        """The drives to which a stop was sent first; its confirmation reads what moves."""
        self._reason = ""
        self._said = {str(bus.lost)} if way.newcomer is not None else set()
        """The reasons that were published: that of a port that was never open was, as it was tried first."""

    def _say(self, text: str) -> None:
        self._publish(self._bus.name, text)

    async def run(self) -> None:
        """Try until the bus is back, and say what its drives do."""
        bus, newcomer = self._bus, self._way.newcomer
        if self._unsure:
            seen = ", ".join(f"{each.shown} {last_seen(each, self._since)}" for each in self._unsure)
            self._say(f"{bus.name}: cannot be stopped from here until the line is back: {seen}{E_STOP}")
        if self._unread:
            names = ", ".join(each.shown for each in self._unread)
            self._say(f"{bus.name}: not known whether these move, as they were not read yet: {names}")
        pauses = Pauses(FIRST_RETRY_PAUSE, LONGEST_RETRY_PAUSE)
        while True:
            await asyncio.sleep(pauses.now)
            if newcomer is not None and bus.drives and bus.lost is None:
                return  # a person's search has found them
            try:
                await self._attempt()
                break
            except Stopped:
                pauses.lengthen(GLANCE)
            except DriveError as failure:  # after a search of some seconds
                pauses.begin(FIRST_RETRY_PAUSE)
                if newcomer is None:
                    self._failed(str(failure))
                elif newcomer.silent(failure):
                    pauses.begin(SILENT_PAUSE)
                else:
                    return
            except TransportLost as failure:
                if not isinstance(failure, Absent):
                    self._failed(str(failure))
                pauses.lengthen(limit_of(failure))
        if newcomer is not None and bus.drives:
            return await newcomer.found()
        self._say(f"{bus.name} is back after {bus.now() - self._since:.1f} s")
        for drive in (*self._unsure, *self._unread):
            if drive.address in bus.drives and not drive.programming and not self._stopped:
                self._say(f"{bus.name}: {await _motion(drive)}")

    async def _attempt(self) -> None:
        bus = self._bus
        if bus.link.lost is not None:
            cut = bus.link.cut
            halt = bus.resume(await self._way.reopen(bus.link.transport))
            if halt is not None and not self._stopped:
                self._stopped = ", ".join(drive.shown for drive in halt.affected) or "every drive"
                why = f"'{cut}' was cut off by the loss" if cut else "the loss kept it from the drives"
                self._say(f"{bus.name}: the stop of {self._stopped} was sent first ({why})")
            if (limits := bus.link.transport.limits) and limits not in self._said:
                self._said.add(limits)
                self._say(f"{bus.name}: {limits}")
        await bus.find_again(self._way.hints)

    def _failed(self, reason: str) -> None:
        """Publish a reason once, when it is met a second time in a row: a port may take a moment to be ready."""
        if reason == self._reason and reason not in self._said:
            self._said.add(reason)
            self._say(f"{self._bus.name}: still lost: {reason}")
        self._reason = reason


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


def _unread(drive: Drive) -> bool:
    """True if a drive was identified, and its velocity was not read yet: it may have been moving all the time."""
    return drive.seen is None and bool(drive.product) and not drive.state.stranger


def may_move(drive: Drive) -> bool:
    """True if a drive moved when it was last seen, or if something was sent since to start it."""
    seen = drive.seen
    if seen is None or drive.started_at > seen.at:
        return drive.started_at > float("-inf")
    return not seen.at_rest()
