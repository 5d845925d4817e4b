"""Lines that run without a person at each of them, and what becomes of the drives when they end early.

A script, a macro, piped lines and a `send` each are one automation; one within another belongs to it. It keeps which
drives it has sent something that can start motion or a program. Ends it before its last line, whatever the reason,
those are stopped, and those alone, on every bus that is still there; nothing is latched.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterable
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drives.apart import apart
from drives.drive import GLOBAL
from drives.stopping import Halt
from shell import stops

if TYPE_CHECKING:
    from drives.bus import Bus
    from drives.drive import Drive
    from shell.session import Session

LINGER = 3.0
"""Seconds at most for which a stop is given time to leave, and to be seen to work."""
_current: ContextVar[Automation | None] = ContextVar("automation", default=None)


@dataclass(eq=False)
class Automation:
    """`started` are the drives that it sent something that can start motion; the address `*` is all of a bus."""

    stops: int
    """The stops of everything before what it has started."""
    started: dict[Drive, None] = field(default_factory=dict)
    halts: list[Halt] = field(default_factory=list)
    """What stopped them, once that was written."""


class Automations:
    """Those of one session that are running."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._running: list[Automation] = []
        self.interrupted: list[Halt] = []
        """What interruptions have stopped."""

    @contextlib.asynccontextmanager
    async def run(self) -> AsyncIterator[None]:
        """One automation, or a part of the one that this runs in. Its early end stops what it started."""
        if _current.get() is not None:
            yield
            return
        made = Automation(self._session.stops)
        self._running.append(made)
        token = _current.set(made)
        try:
            yield
        except (asyncio.CancelledError, GeneratorExit):
            self._stop(made)  # whoever cancels it goes on, and sees what became of the stop
            raise
        except BaseException:
            self._stop(made)
            await settled(self._session)
            self._tell(made)
            raise
        finally:
            _current.reset(token)
            self._running.remove(made)

    def starts(self, drive: Drive) -> bool:
        """Something goes to a drive that can start it. Whether the automation that runs had not started it before."""
        made = _current.get()
        if made is None:
            return False
        if made.stops != self._session.stops:  # what it had started was stopped, and `/resume` let it go on
            made.stops = self._session.stops
            made.started.clear()
            made.halts.clear()
        if drive in made.started:
            return False
        made.started[drive] = None
        return True

    def spares(self, drive: Drive) -> None:
        """It was not sent after all."""
        made = _current.get()
        if made is not None:
            made.started.pop(drive, None)

    def interrupt(self) -> None:
        """Stop at once what all of them have started, and keep what that was."""
        for made in self._running:
            self._stop(made)
            self.interrupted += [halt for halt in made.halts if halt not in self.interrupted]

    def _stop(self, made: Automation) -> None:
        """The bytes onto every wire first, each by itself; once for each automation."""
        if made.halts or made.stops != self._session.stops:
            return  # or everything was stopped meanwhile
        for bus, only in _by_bus(made.started).items():
            with apart(f"the stop of {bus.name}"):
                made.halts.append(self._halt(bus, only))
        for halt in made.halts:
            with apart(f"the stop of {halt.bus.name}"):
                halt.bus.halted(halt)

    def _halt(self, bus: Bus, only: list[Drive]) -> Halt:
        if self._session.buses.get(bus.name) is not bus:
            return Halt(bus, bus.now(), 0, False, tuple(only), trouble=["closed"])
        return bus.halt(None if any(drive.address in GLOBAL for drive in only) else only)

    def _tell(self, made: Automation) -> None:
        for text in told(self._session, made.halts):
            self._session.notify(text, warning=True)


def _by_bus(started: Iterable[Drive]) -> dict[Bus, list[Drive]]:
    found: dict[Bus, list[Drive]] = {}
    for drive in started:
        found.setdefault(drive.bus, []).append(drive)
    return found


async def settled(session: Session) -> None:
    """Wait until stops have left and were seen to work, and clean-ups are over; LINGER at most."""
    waits = [asyncio.create_task(bus.settled()) for bus in session.buses.values()]
    if waits:
        _, late = await asyncio.wait(waits, timeout=LINGER)
        for each in late:
            each.cancel()


def told(session: Session, halts: list[Halt]) -> list[str]:
    """What became of what automation had started, in lines for a person."""
    sent = [halt for halt in halts if halt.data]
    lines = []
    if sent:
        tally = stops.of_halts(sent, session.wall(sent[0].at), len(session.buses) > 1)
        names = [halt.bus.name if halt.whole else ", ".join(map(session.display_name, halt.drives)) for halt in sent]
        lines.append(f"{'stopped' if tally.stand else 'stop sent to'} {', '.join(names)}: {stops.words(tally)}")
    if others := [session.display_name(drive) for halt in sent for drive in halt.others]:
        lines.append(f"stopped as well, as the stop of their line bears no name: {', '.join(others)}")
    return lines + stops.unreached(halts, session.now())
