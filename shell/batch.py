"""Runs something over connections without a screen: opens them, does it, closes them, and gives the exit code.

A signal stops every drive if anything was sent to one, and is exit 130; the stop key does so always, and is exit 4.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable, Sequence
from contextlib import nullcontext

from shell import settings
from shell.interrupts import on_signals, on_stop_key
from shell.output import INTERRUPTED, Printer, exit_code, finish, nonblocking, report, write
from shell.session import FAILURES, Session
from shell.settings import Settings

LINGER = 1.0
"""Seconds at most that the bytes of a stop are given to leave before the connections are closed."""
Body = Callable[[Session], Awaitable[None]]


def run(urls: Sequence[str], body: Body, *, watch_keys: bool = True, interrupted: int = INTERRUPTED) -> int:
    """Open the URLs, await the body, close; the exit code (`interrupted` after a signal).

    Failures are one line on standard error.
    """
    try:
        found = settings.load()
    except FAILURES as failure:
        write(sys.stderr, report(failure))
        return exit_code(failure)
    try:
        return asyncio.run(_run(found, urls, body, watch_keys, interrupted))
    except KeyboardInterrupt:
        return interrupted


async def _run(found: Settings, urls: Sequence[str], body: Body, watch_keys: bool, interrupted: int) -> int:
    with nonblocking() as streams:
        session = Session(found)
        session.ready = streams.ready
        printer = Printer()
        session.subscribe(printer.show)
        host = _Host(session, printer, interrupted)
        keys = on_stop_key(lambda: session.stop("Ctrl+X"), host.interrupt) if watch_keys else nullcontext()
        with on_signals(host.interrupt), keys:
            try:
                code = await host.result(urls, body)
            finally:
                await session.close()
            await finish(streams, lambda: host.interrupted or session.latched)
            return code


class _Host:
    def __init__(self, session: Session, printer: Printer, code: int) -> None:
        self._session = session
        self._printer = printer
        self._code = code
        self._work: asyncio.Task[None] | None = None
        self.interrupted = False

    def interrupt(self) -> None:
        """A signal came."""
        self.interrupted = True
        if self._session.moved:
            self._session.stop("interrupted")
        elif self._work is not None:
            self._work.cancel()

    async def result(self, urls: Sequence[str], body: Body) -> int:
        self._work = asyncio.create_task(self._session.stoppable(self._whole(urls, body)))
        code, told = 0, ""
        try:
            await self._work
        except FAILURES as failure:
            code, told = exit_code(failure), report(failure)
        except asyncio.CancelledError:
            if not self.interrupted:
                raise
        if self._session.latched:
            await linger(self._session)
        if self.interrupted:
            stopped = "; every drive was told to stop" if self._session.latched else ""
            code, told = self._code, f"interrupted{stopped}" if self._code else ""
        if told:
            self._printer.tell(told)
        return code

    async def _whole(self, urls: Sequence[str], body: Body) -> None:
        for url in urls:
            await self._session.open(url)
        await body(self._session)


async def linger(session: Session) -> None:
    """Give the bytes of a stop the time to leave."""
    waits = [asyncio.create_task(bus.stopped()) for bus in session.buses.values()]
    if waits:
        await asyncio.wait(waits, timeout=LINGER)
