"""A serial port of another machine, through the user's own `ssh` program: its keys, configuration, and jump hosts."""

from __future__ import annotations

import asyncio
import sys

from multidrop.transports.base import Transport, Unreachable
from multidrop.transports.far_port import SOCAT, FarPort, NotInstalled
from multidrop.transports.pipe import in_thread

OPENING = 20.0
"""Seconds until the greeting: several hosts on the way, a slow machine."""


async def open_ssh(far: FarPort, baud: int = 9600, within: float | None = None, way: str = "") -> Transport:
    """Open a port of another machine within a time, s; `way`: see `far_port.WAYS`. Raises Unreachable."""
    if sys.platform == "win32":
        raise Unreachable(f"{far.name}: ssh:// needs multidrop on Linux or macOS here")
    else:
        try:
            return await _opened(far, baud, within or OPENING, way)
        except NotInstalled as neither:
            if way:
                raise
            try:  # a server that allows a few commands only may refuse the first one as a whole
                return await _opened(far, baud, within or OPENING, SOCAT)
            except NotInstalled:
                raise neither from None


if sys.platform != "win32":

    async def _opened(far: FarPort, baud: int, within: float, way: str) -> Transport:
        from multidrop.transports.ssh_session import SshSession, greeted

        session = await in_thread(lambda: SshSession(far, baud, way), lambda late: late.close(True))
        try:
            async with asyncio.timeout(within):
                return await greeted(session, far, baud, way)
        except TimeoutError:
            why = session.last_words() or "no reply"
            await asyncio.to_thread(session.close, True)
            raise Unreachable(f"{far.name}: not reached within {within:g} s: {why}; try `ssh {far.login}`") from None
        except BaseException:
            await asyncio.shield(asyncio.to_thread(session.close, True))
            raise
