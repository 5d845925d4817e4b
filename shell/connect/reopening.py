"""Opening the port of a lost bus again: the same adapter by its stable name, the same host, the same simulated bus.

Nothing is written here. A serial port is opened only under a name that follows the adapter: another adapter may have
taken the number of the old one. The number of a pseudo-terminal does not qualify; a link to it does, once a server has
renewed it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from multidrop.transports import Controllable, Transport, Unreachable

if TYPE_CHECKING:
    from multidrop.simulator.serving.in_process import SimBus

Reopen = Callable[[Transport], Awaitable[Transport]]
"""Opens the port again in place of a broken transport, which it closes. Raises Unreachable, or Absent."""
SLOWEST = 5.0
"""The longest attempt to connect, s."""
SHORTEST = 0.9
"""The shortest attempt to connect, s: each attempt asks once, so a host that is back is asked within that time."""
PATIENCE = 4.0
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
        from multidrop.transports.listing import stable_name

        self._name = stable_name(port)
        self._open = open_
        self._before = _terminal(self._name)

    @property
    def possible(self) -> bool:
        """Whether the name follows the port: the number of a pseudo-terminal does not."""
        return not self._name.startswith(TERMINALS)

    async def __call__(self, old: Transport) -> Transport:
        """Open it, once it is there."""
        await old.close()
        if not os.path.exists(self._name) or (self._before and _terminal(self._name) == self._before):
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


class HostAgain:
    """A host's port. `took` is how long the first connection took, s: a slow network stays reachable."""

    def __init__(self, open_: Callable[[float], Awaitable[Transport]], took: float) -> None:
        self._open = open_
        self._within = min(max(SHORTEST, PATIENCE * took), SLOWEST)

    async def __call__(self, old: Transport) -> Transport:
        """Connect to it."""
        await old.close()
        return await _at_the_same_baud(await self._open(self._within), old)


class LoginAgain:
    """A port that is reached by a login, opened at its last baud rate. `took` is how long the first login took, s.

    Logins that fail are tried ever less often: a server may shut out a machine that tries too often.
    """

    def __init__(self, open_: Callable[[float, int | None], Awaitable[Transport]], took: float) -> None:
        self._open = open_
        self._within = min(max(LOGIN, PATIENCE * took), SLOWEST_LOGIN)
        self._pause = 0.0

    async def __call__(self, old: Transport) -> Transport:
        """Log in, and open it."""
        await old.close()
        await asyncio.sleep(self._pause)
        self._pause = min(2 * self._pause + FIRST_PAUSE, LONGEST_PAUSE)
        control = old.control if isinstance(old, Controllable) else None
        opened = await self._open(self._within, control.baud if control else None)
        self._pause = 0.0
        return opened


async def _at_the_same_baud(opened: Transport, old: Transport) -> Transport:
    """Set the baud rate that a person had changed on the old transport of a serial port."""
    before, now = (each.control if isinstance(each, Controllable) else None for each in (old, opened))
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


async def timed(opening: Awaitable[Transport]) -> tuple[Transport, float]:
    """Await a transport; return how long that took, s."""
    begun = asyncio.get_running_loop().time()
    return await opening, asyncio.get_running_loop().time() - begun
