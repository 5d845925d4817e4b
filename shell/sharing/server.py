"""A shared port on the network: sockets around an `Exchange`, and the port that comes back after a loss."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any, cast

from multidrop.dialects import StopPiece
from multidrop.shell.connect.opening import OpenedPort
from multidrop.shell.connect.reconnect import FIRST, next_pause
from multidrop.shell.sharing.actions import Action, Close, Purge, Say, Send, Set, Stop, Write
from multidrop.shell.sharing.exchange import NEVER, NOT_REACHED, Exchange
from multidrop.shell.sharing.stop_bytes import StopBytes
from multidrop.transports import PortControl, TransportLost
from multidrop.transports.sockets import host_port, set_socket_options
from multidrop.transports.telnet import Control, Setting

UNREAD = 1 << 18
"""Bytes that a client may leave unread before it is disconnected."""
AHEAD = 1 << 18
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
        self._exchange = Exchange(stops, control.baud if control else port.baud)
        self._connections: dict[int, Connection] = {}
        self._left = asyncio.Event()
        """No client is connected."""
        self._left.set()
        self._number = 0
        self._loss: TransportLost | None = None
        self._purged = 0
        """Bytes that a purge has dropped, until the next ones are written: the drives may hold a half-sent line."""
        self._timer: asyncio.TimerHandle | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._turns = asyncio.Lock()
        """Settings are changed one after the other."""
        self._server: asyncio.Server | None = None

    async def open(self, host: str, port: int) -> str:
        """Listen; return the URL for clients. Raises OSError."""
        self._server = await self._loop.create_server(lambda: Connection(self), host, port)
        self._transport.start(self._received, self._broke)
        return f"rfc2217://{host_port(host, self._server.sockets[0].getsockname()[1])}"

    async def close(self) -> None:
        """End the service, and close the port."""
        for name in self._exchange.owed.names if self._loss is not None else ():
            self._narrate(Say(name, NOT_REACHED, f"sharing ends before the port is back; {NEVER}"))
        if self._server is not None:
            self._server.close()
        for number in tuple(self._exchange.clients):
            self._do(self._exchange.close(number, "closed", "the port is shared no longer"))
        for connection in tuple(self._connections.values()):
            connection.end()
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

    def stop(self) -> None:
        """Write a stop of this side at once, and its repetition in pieces; while the port is lost it is owed."""
        self._write_pieces(self._own, owed=False)

    def _write_pieces(self, pieces: Sequence[StopPiece], owed: bool) -> None:
        first, *others = pieces
        self._do(self._exchange.stop(first.data, self._loop.time(), owed))
        self._begin(self._repeat(others, owed))

    async def _repeat(self, pieces: Sequence[StopPiece], owed: bool) -> None:
        """Write pieces of a stop; those of an owed one end where a client starts something."""
        starts = self._exchange.owed.starts
        for piece in pieces:
            await asyncio.sleep(piece.quiet)
            if self._loss is not None or (owed and self._exchange.owed.starts != starts):
                return
            self._do(self._exchange.stop(piece.data, self._loop.time(), owed))

    # Clients

    def connected(self, connection: Connection, name: str) -> int:
        """Take a client; return its number."""
        self._number += 1
        self._connections[self._number] = connection
        self._left.clear()
        self._do(self._exchange.connect(self._number, name))
        if len(self._exchange.clients) > CLIENTS:
            self._do(self._exchange.close(self._number, "refused", f"{CLIENTS} clients are connected"))
        return self._number

    def disconnected(self, number: int) -> None:
        """Forget a client."""
        self._connections.pop(number, None)
        if not self._connections:
            self._left.set()
        self._do(self._exchange.leave(number))

    def received(self, number: int, data: bytes) -> None:
        """Take bytes that a client has sent."""
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
                self._send(action)
            elif isinstance(action, Close):
                self._connections[action.client].say_goodbye(action.farewell)
            elif isinstance(action, Write):
                self._write(action)
            elif isinstance(action, Stop):
                self._stop(action)
            elif isinstance(action, Purge):
                self._purge()
            else:
                self._begin(self._apply(action))

    def _send(self, action: Send) -> None:
        if (connection := self._connections.get(action.client)) and not connection.send(action.data):
            self._do(self._exchange.close(action.client, "dropped", f"it left {UNREAD} bytes unread"))
            connection.abort()

    def _write(self, action: Write) -> None:
        if self._transport.pending > AHEAD:
            ahead = f"it wrote {AHEAD} bytes more than the line has taken; {len(action.data)} bytes were dropped"
            self._do(self._exchange.close(action.client, "dropped", ahead))
            return
        self._purged = 0
        self._transport.write(action.data)

    def _stop(self, action: Stop) -> None:
        dropped = self._transport.discard(whole=self._exchange.framed)
        self._transport.write(action.mended if dropped or self._purged else action.data)
        self._purged = 0
        self._do(self._exchange.dropped(dropped))

    def _purge(self) -> None:
        dropped = self._transport.discard(whole=self._exchange.framed)
        self._purged += dropped
        self._do(self._exchange.dropped(dropped))

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
        pause = FIRST
        while self._loss is not None:
            await asyncio.sleep(pause)
            try:
                self._transport = await self._port.reopen(self._transport)
            except TransportLost as failure:
                pause = next_pause(pause, failure)
            else:
                self._loss, self._purged = None, 0
        self._transport.start(self._received, self._broke)
        self._exchange.back()
        if owed := self._exchange.owed.pieces:
            self._write_pieces(owed, owed=True)
        self._narrate(Say("", "back", self._transport.name))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _change(control: PortControl, action: Set) -> Callable[[], None]:
    """The call that changes a setting."""
    if action.setting == Setting.BAUD:
        return partial(control.set_baud, action.value)
    lines: dict[int, Callable[[bool], None]] = {
        Control.BREAK_ON: control.set_break,
        Control.DTR_ON: control.set_dtr,
        Control.RTS_ON: control.set_rts,
    }
    on = action.value in lines
    return partial(lines[action.value if on else action.value - 1], on)


class Connection(asyncio.BufferedProtocol):
    """One client's connection."""

    def __init__(self, port: SharedPort) -> None:
        self._buffer = memoryview(bytearray(READ))
        self._port = port
        self._number = 0
        self._transport: asyncio.Transport | None = None
        self._ending: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin with a client."""
        self._transport = cast(asyncio.Transport, transport)
        if (made := transport.get_extra_info("socket")) is not None:
            set_socket_options(made)
        peer = transport.get_extra_info("peername") or ("unknown", 0)
        self._number = self._port.connected(self, host_port(peer[0], peer[1]))

    def get_buffer(self, sizehint: int) -> memoryview:
        """Give the room for one read."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Take bytes that the client has written."""
        self._port.received(self._number, bytes(self._buffer[:nbytes]))

    def connection_lost(self, exc: Exception | None) -> None:
        """End: the client has left."""
        if self._ending is not None:
            self._ending.cancel()
        self._transport = None
        self._port.disconnected(self._number)

    def send(self, data: bytes) -> bool:
        """Send bytes; False where the client leaves too many of them unread."""
        if self._transport is None or self._transport.is_closing():
            return True
        self._transport.write(data)
        return self._transport.get_write_buffer_size() <= UNREAD

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
        """Close the connection at once."""
        if self._transport is not None:
            self._transport.abort()
