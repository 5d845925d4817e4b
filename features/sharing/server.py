"""`multidrop share`: lend a port to several clients until a signal: sockets around an `PortClients`.

The port comes back after a loss, as a lost bus does.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any, cast

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.base.text import counted
from multidrop.dialects import StopPiece
from multidrop.features.sharing.key_stop import KeyStop, pause
from multidrop.features.sharing.stop_bytes import StopBytes, stop_bytes
from multidrop.features.sharing.writer_turns import (
    NEVER,
    NOT_REACHED,
    Action,
    ClientWrite,
    Close,
    PortClients,
    Purge,
    Say,
    Send,
    Set,
    Stop,
)
from multidrop.shell import configuration
from multidrop.shell.connect import Pauses
from multidrop.shell.connect.opening import OpenedPort, open_port
from multidrop.shell.connect.reconnect import FIRST_RETRY_PAUSE, LONGEST_RETRY_PAUSE, limit_of
from multidrop.shell.connect.urls import listening, parse
from multidrop.shell.events import FAILURES
from multidrop.shell.prompt.keyboard import on_signals, on_stop_key
from multidrop.shell.streams.stdout import fail, finish, nonblocking, write
from multidrop.transports import PortControl
from multidrop.transports.sockets import explain, exposed, host_port, set_socket_options
from multidrop.transports.telnet import Control, Setting

MOST_UNREAD_BYTES = 1 << 18
"""Bytes that a client may leave unread before it is disconnected."""
MOST_BYTES_AHEAD = 1 << 18
"""Bytes that the writer may be ahead of the line. Within them its own stop is read at once."""
CLIENTS = 32
READ = 1 << 12
"""Bytes of one client that are read before the others are."""
LINGER = 2.0
"""Seconds for which stops are still taken from a client that is being disconnected."""
FLUSH = 0.5
"""Seconds for which clients may still read at the end."""

Narrate = Callable[[Say], None]


class SharedPort:
    """An open port and its clients. All in the loop's thread."""

    def __init__(self, port: OpenedPort, stops: StopBytes, narrate: Narrate) -> None:
        self.lost_for_good: asyncio.Future[TransportLost] = asyncio.get_running_loop().create_future()
        """Done once the port is lost and cannot be found again."""
        self._port = port
        self._transport = port.transport
        self._narrate = narrate
        self._loop = asyncio.get_running_loop()
        control = self._transport.control
        self._own = stops.own
        self._exchange = PortClients(stops, control.baud if control else port.baud)
        self._key = KeyStop(stops, lambda: bool(self._purged) or self._exchange.line_begun, lambda: self._only_stop)
        self._key.transport, self._key.baud = self._transport, control.baud if control else 0
        self._taken: int | None = None
        """The bytes that made room for a stop which the key's thread has written already."""
        self._refused = 0
        """Bytes of clients that came while only that thread could write."""
        self._connections: dict[int, ClientConnection] = {}
        self._left = asyncio.Event()
        """No client is connected."""
        self._left.set()
        self._number = 0
        self._loss: TransportLost | None = None
        self._purged = 0
        """Bytes that a purge has dropped, until the next ones are written: the drives may hold a half-sent line."""
        self._only_stop = False
        """What was written last is a stop or a piece of one: whoever stops or purges next does not drop it."""
        self._timer: asyncio.TimerHandle | None = None
        self._tasks: dict[asyncio.Task[None], None] = {}
        self._turns = asyncio.Lock()
        """Settings are changed one after the other."""
        self._server: asyncio.Server | None = None

    async def open(self, host: str, port: int) -> str:
        """Listen; return the URL for clients. Raises OSError."""
        self._server = await self._loop.create_server(lambda: ClientConnection(self), host, port)
        self._transport.start(self._received, self._broke)
        return f"rfc2217://{host_port(host, self._server.sockets[0].getsockname()[1])}"

    async def close(self) -> None:
        for name in self._exchange.owed.names if self._loss is not None else ():
            self._narrate(Say(name, NOT_REACHED, f"sharing ends before the port is back; {NEVER}"))
        if self._server is not None:
            self._server.close()
        for number in tuple(self._exchange.clients):
            self._do(self._exchange.close(number, "closed", "the port is shared no longer"))
        for connection in tuple(self._connections.values()):
            connection.end()
        self._do(self._exchange.over())
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._left.wait(), FLUSH)
        for connection in tuple(self._connections.values()):
            connection.abort()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._timer is not None:
            self._timer.cancel()
        await self._transport.close()

    def stop_ahead(self) -> None:
        """Write a stop of this side from any thread, whatever the loop is doing; `stop` must follow in the loop."""
        if self._loss is None:
            self._key.press()

    def stop(self) -> None:
        """Write a stop of this side at once, and its repetition in pieces; while the port is lost it is owed.

        What `stop_ahead` has written of it is not written again.
        """
        taken = self._key.take()
        if taken is None:
            return self._write_pieces(self._own, owed=False)
        self._taken, self._refused = taken.dropped + self._refused, 0
        self._do(self._exchange.stop(self._own[0].data, self._loop.time()))
        self._taken = None
        if taken.left:
            self._begin(self._repeat(taken.written[-1], taken.left, owed=False))

    def _write_pieces(self, pieces: Sequence[StopPiece], owed: bool) -> None:
        first, *others = pieces
        self._do(self._exchange.stop(first.data, self._loop.time(), owed))
        self._begin(self._repeat(first, others, owed))

    async def _repeat(self, last: StopPiece, pieces: Sequence[StopPiece], owed: bool) -> None:
        """Write pieces of a stop behind the last one; those of an owed one end where a client starts something."""
        starts, baud = self._exchange.owed.starts, self._transport.control.baud if self._transport.control else 0
        for piece in pieces:
            await asyncio.sleep(pause(last, piece, baud))
            last = piece
            if self._loss is not None or (owed and self._exchange.owed.starts != starts):
                return
            self._do(self._exchange.stop(piece.data, self._loop.time(), owed))

    # Clients

    def connected(self, connection: ClientConnection, name: str) -> int:
        self._number += 1
        self._connections[self._number] = connection
        self._left.clear()
        self._do(self._exchange.connect(self._number, name))
        if len(self._exchange.clients) > CLIENTS:
            self._do(self._exchange.close(self._number, "refused", f"{CLIENTS} clients are connected"))
        return self._number

    def disconnected(self, number: int) -> None:
        self._connections.pop(number, None)
        if not self._connections:
            self._left.set()
        self._do(self._exchange.leave(number))

    def received(self, number: int, data: bytes) -> None:
        self._do(self._exchange.receive(number, data, self._loop.time()))
        self._set_timer()

    def _set_timer(self) -> None:
        """Call `_advance` at its time; one that is due follows the next look at the sockets."""
        if (deadline := self._exchange.deadline) is None or (self._timer and self._timer.when() <= deadline):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(deadline, self._advance)

    def _advance(self) -> None:
        self._timer = None
        self._do(self._exchange.advance(self._loop.time()))
        self._set_timer()

    # The port

    def _received(self, data: bytes) -> None:
        self._do(self._exchange.printed(data, self._loop.time()))

    def _do(self, actions: list[Action]) -> None:
        for action in actions:
            if isinstance(action, Say):
                self._narrate(action)
            elif isinstance(action, Send):
                connection = self._connections.get(action.client)
                if connection is not None and not connection.send(action.data):
                    self._do(
                        self._exchange.close(action.client, "dropped", f"it left {MOST_UNREAD_BYTES} bytes unread")
                    )
                    connection.abort()
            elif isinstance(action, Close):
                self._connections[action.client].say_goodbye(action.farewell)
            elif isinstance(action, ClientWrite):
                if self._transport.pending > MOST_BYTES_AHEAD and action.client in self._exchange.clients:
                    lost = counted(len(action.data), "byte")
                    self._exchange.unwritten(self._loop.time())
                    ahead = f"it wrote {MOST_BYTES_AHEAD} bytes more than the line has taken; {lost} dropped"
                    self._do(self._exchange.close(action.client, "dropped", ahead))
                    continue
                self._purged, self._only_stop = 0, False
                if not self._transport.write(action.data):
                    self._refused += len(action.data)
            elif isinstance(action, Stop):
                if (dropped := self._taken) is None:
                    dropped = self._take_back()
                    self._transport.write(action.mended if dropped or self._purged else action.data)
                self._purged, self._only_stop = 0, True
                self._do(self._exchange.dropped(dropped))
            elif isinstance(action, Purge):
                dropped = self._take_back()
                self._purged += dropped
                self._do(self._exchange.dropped(dropped, True, self._loop.time()))
            else:
                self._begin(self._apply(action))

    def _take_back(self) -> int:
        """Drop what the port has not sent, but no stop; return the number of bytes."""
        return 0 if self._only_stop else self._transport.discard(whole=self._exchange.framed)

    async def _apply(self, action: Set) -> None:
        """Change a setting, in a thread, for the call may block. A port without settings takes any."""
        async with self._turns:
            trouble = ""
            if (control := self._transport.control) is not None:
                try:
                    await asyncio.to_thread(_change(control, action))
                except OSError as error:
                    trouble = error.strerror or str(error)
            self._do(self._exchange.applied(action.client, action.setting, action.value, trouble))
            self._set_timer()

    # A lost port

    def _broke(self, loss: TransportLost) -> None:
        self._loss = loss
        self._narrate(Say("", "lost", str(loss)))
        self._do(self._exchange.lose(str(loss), self._loop.time(), self._port.reopen is not None))
        if self._port.reopen is not None:
            self._begin(self._return())
        elif not self.lost_for_good.done():
            self.lost_for_good.set_result(loss)

    async def _return(self) -> None:
        """Open the port again, as a lost bus is."""
        assert self._port.reopen is not None
        pauses = Pauses(FIRST_RETRY_PAUSE, LONGEST_RETRY_PAUSE)
        while self._loss is not None:
            await asyncio.sleep(pauses.now)
            try:
                self._transport = await self._port.reopen(self._transport)
            except TransportLost as failure:
                pauses.lengthen(limit_of(failure))
            else:
                self._loss, self._purged, self._only_stop, self._refused = None, 0, False, 0
                self._key.forget()
                self._key.transport = self._transport
        self._transport.start(self._received, self._broke)
        self._exchange.back()
        if owed := self._exchange.owed.pieces:
            self._write_pieces(owed, owed=True)
        self._narrate(Say("", "back", self._transport.name))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks[task] = None
        task.add_done_callback(self._tasks.pop)


def _change(control: PortControl, action: Set) -> Callable[[], None]:
    if action.setting == Setting.BAUD:
        return partial(control.set_baud, action.value)
    lines: dict[int, Callable[[bool], None]] = {
        Control.BREAK_ON: control.set_break,
        Control.DTR_ON: control.set_dtr,
        Control.RTS_ON: control.set_rts,
    }
    on = action.value in lines
    return partial(lines[action.value if on else action.value - 1], on)


class ClientConnection(asyncio.BufferedProtocol):
    """One client's connection."""

    def __init__(self, port: SharedPort) -> None:
        self._buffer = memoryview(bytearray(READ))
        self._port = port
        self._number = 0
        self._transport: asyncio.Transport | None = None
        self._ending: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        if (made := transport.get_extra_info("socket")) is not None:
            set_socket_options(made)
        peer = transport.get_extra_info("peername") or ("unknown", 0)
        self._number = self._port.connected(self, host_port(peer[0], peer[1]))

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._port.received(self._number, bytes(self._buffer[:nbytes]))

    def connection_lost(self, exc: Exception | None) -> None:
        if self._ending is not None:
            self._ending.cancel()
        self._transport = None
        self._port.disconnected(self._number)

    def send(self, data: bytes) -> bool:
        """Send bytes; False where the client leaves too many of them unread."""
        if self._transport is None or self._transport.is_closing():
            return True
        self._transport.write(data)
        return self._transport.get_write_buffer_size() <= MOST_UNREAD_BYTES

    def say_goodbye(self, farewell: bytes) -> None:
        """Send the reason and the end of the stream. Stops are taken for a while: one may be on its way."""
        if self._transport is None or self._transport.is_closing():
            return
        with contextlib.suppress(OSError):
            self._transport.write(farewell)
            self._transport.write_eof()
        self._ending = asyncio.get_running_loop().call_later(LINGER, self.end)

    def end(self) -> None:
        """Close the connection after what is to be sent; a client that does not read gets a limited time for it."""
        if self._transport is not None:
            self._transport.close()
            self._ending = asyncio.get_running_loop().call_later(LINGER, self.abort)

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()


REFUSAL_PERIOD = 10.0
"""Seconds for which a client that tries again and again is refused without another line."""
_SENT_AWAY = ("refused", "lost")
_REPEATED = ("connected", "left", *_SENT_AWAY)
EXPOSED = "other computers can move the drives at {}; they need no password. 127.0.0.1 keeps them out"


def run(url: str, address: str, *, as_json: bool) -> int:
    return asyncio.run(_run(url, address, as_json))


async def _run(url: str, address: str, as_json: bool) -> int:
    over = asyncio.Event()
    with nonblocking() as streams, on_signals(over.set):
        try:
            await _share(url, address, as_json, over)
            return 0
        except FAILURES as failure:
            return fail(failure)
        finally:
            await finish(streams, over.is_set)


async def _share(url: str, address: str, as_json: bool, over: asyncio.Event) -> None:
    """Lend the port until a signal (`over`). Raises the loss of a port that cannot be found again."""
    host, port = listening(address)
    connection = parse(url, configuration.load().connections)
    if connection.scheme.datagrams:
        raise Diagnostic("datagrams cannot be shared", url, "an Ethernet drive takes several clients itself")
    if connection.hints.family:
        stop_bytes(connection.hints.family)
    narrator = Narrator(as_json)
    opened = await open_port(connection)
    hints = connection.hints
    shared = SharedPort(opened, stop_bytes(opened.family, hints.drives, hints.party), narrator.say)
    try:
        try:
            endpoint = await shared.open(host, port)
        except OSError as error:
            where = f"--rfc2217 {host}:{port}"
            raise TransportLost(f"{where}: cannot listen there: {explain(error)}; give another port") from None
        narrator.ready(opened.name, endpoint)
        if opened.transport.limits:
            narrator.note(f"{opened.transport.name}: {opened.transport.limits}")
        if exposed(host):
            narrator.note(EXPOSED.format(endpoint))
        with on_stop_key(shared.stop_ahead, shared.stop, over.set):
            signalled = asyncio.create_task(over.wait())
            ends: list[asyncio.Future[Any]] = [signalled, shared.lost_for_good]
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            signalled.cancel()
        if shared.lost_for_good.done():
            raise shared.lost_for_good.result().again()
    finally:
        await shared.close()


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
        again = (
            bool(host) and event.event in _REPEATED and now < self._refused.get(host, -REFUSAL_PERIOD) + REFUSAL_PERIOD
        )
        if host and event.event in _SENT_AWAY and not again:
            self._refused = {host: now, **{each: at for each, at in self._refused.items() if now < at + REFUSAL_PERIOD}}
        return again
