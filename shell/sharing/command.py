"""`multidrop share`: lend a port to several clients until a signal."""

from __future__ import annotations

import asyncio
import json
import sys
import time
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.shell.connect import settings
from multidrop.shell.connect.opening import open_port
from multidrop.shell.connect.urls import listening, parse
from multidrop.shell.events import FAILURES
from multidrop.shell.prompt.keyboard import on_signals, on_stop_key
from multidrop.shell.sharing.actions import Say
from multidrop.shell.sharing.server import SharedPort
from multidrop.shell.sharing.stop_bytes import stop_bytes
from multidrop.shell.streams.stdout import exit_code, finish, nonblocking, report, write
from multidrop.transports import TransportLost
from multidrop.transports.sockets import explain, exposed

AGAIN = 10.0
"""Seconds for which a client that tries again and again is refused without another line."""
_SENT_AWAY = ("refused", "lost")
_REPEATED = ("connected", "left", *_SENT_AWAY)
EXPOSED = "other computers can move the drives at {}; they need no password. 127.0.0.1 keeps them out"


def run(url: str, address: str, *, as_json: bool) -> int:
    """Lend the port until a signal, which ends it well; return the exit code."""
    return asyncio.run(_run(url, address, as_json))


async def _run(url: str, address: str, as_json: bool) -> int:
    over = asyncio.Event()
    with nonblocking() as streams, on_signals(over.set):
        try:
            await _share(url, address, as_json, over)
            return 0
        except FAILURES as failure:
            write(sys.stderr, report(failure))
            return exit_code(failure)
        finally:
            await finish(streams, over.is_set)


async def _share(url: str, address: str, as_json: bool, over: asyncio.Event) -> None:
    host, port = listening(address)
    connection = parse(url, settings.load().connections)
    if connection.scheme == "udp":
        raise Diagnostic("datagrams cannot be shared", url, "an Ethernet drive takes several clients itself")
    if connection.hints.family:
        stop_bytes(connection.hints.family)
    narrator = Narrator(as_json)
    opened = await open_port(connection)
    shared = SharedPort(opened, stop_bytes(opened.family, connection.hints.drives), narrator.say)
    try:
        endpoint = await _listen(shared, host, port)
        narrator.ready(opened.name, endpoint)
        if opened.transport.limits:
            narrator.note(f"{opened.transport.name}: {opened.transport.limits}")
        if exposed(host):
            narrator.note(EXPOSED.format(endpoint))
        with on_stop_key(_nothing, shared.stop, over.set):
            await _ended(shared, over)
    finally:
        await shared.close()


def _nothing() -> None:
    """Do nothing in the thread that reads the keys: the event loop, which never blocks here, writes the stop."""


async def _listen(shared: SharedPort, host: str, port: int) -> str:
    try:
        return await shared.open(host, port)
    except OSError as error:
        where = f"--rfc2217 {host}:{port}"
        raise TransportLost(f"{where}: cannot listen there: {explain(error)}; give another port") from None


async def _ended(shared: SharedPort, over: asyncio.Event) -> None:
    """Wait for a signal, or for the loss of a port that cannot be found again. Raises that loss."""
    signalled = asyncio.create_task(over.wait())
    ends: list[asyncio.Future[Any]] = [signalled, shared.lost_for_good]
    await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
    signalled.cancel()
    if shared.lost_for_good.done():
        raise shared.lost_for_good.result().again()


class Narrator:
    """Reports events to a person on standard error, or as JSON lines on standard output."""

    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._refused: dict[str, float] = {}
        """The hosts whose clients were refused, and the time of that line."""

    def ready(self, name: str, endpoint: str) -> None:
        """Print where clients connect, as `multidrop sim` does."""
        if self._as_json:
            self._print(bus=name, endpoint=endpoint)
            self._print(ready=True)
        else:
            write(sys.stdout, f"{name:<12} {endpoint}", "ready: Ctrl+X stops the drives, Ctrl+C ends it")

    def note(self, text: str) -> None:
        """Show a message on standard error."""
        write(sys.stderr, f"multidrop: {text}")

    def say(self, event: Say) -> None:
        if self._as_json:
            self._print(at=round(time.time(), 3), client=event.client, event=event.event, detail=event.detail)
        elif not self._repeated(event, time.monotonic()):
            detail = f": {event.detail}" if event.detail else ""
            write(sys.stderr, f"{time.strftime('%H:%M:%S')} {event.client or 'the port'} {event.event}{detail}")

    def _print(self, **fields: Any) -> None:
        write(sys.stdout, json.dumps(fields))

    def _repeated(self, event: Say, now: float) -> bool:
        """Whether a client of a host was refused a moment ago: one that connects again by itself is said once."""
        host = event.client.rpartition(":")[0]
        again = bool(host) and event.event in _REPEATED and now < self._refused.get(host, -AGAIN) + AGAIN
        if host and event.event in _SENT_AWAY and not again:
            self._refused = {host: now, **{each: at for each, at in self._refused.items() if now < at + AGAIN}}
        return again
