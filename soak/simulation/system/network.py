"""The network of a seed: hosts, connections and datagrams in memory, and what a network does to them.

The product's own code is at both ends: its sockets (`transports.sockets`) over `Socket`, and the servers of the
simulator and of `multidrop share` over `Served` and `Datagrams`. Bytes of a connection arrive in their order or not at
all. A host may refuse connections, or be dark: what is sent to it or by it waits, as for a system that sends again, and
a connection that is not confirmed for long is given up (`sockets` asks the system for that).
"""

from __future__ import annotations

import asyncio
import errno
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextvars import Context, copy_context
from math import inf
from random import Random
from typing import Any, cast

from soak.simulation.records.climate import Climate
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.connection import CONFIRMED, LATER, PROBED, WINDOW, Address, End, Host, error
from soak.simulation.system.ports import Descriptor, Trace

PROMPT = 0.0005
"""The longest time, s, that a datagram is on its way which is not late."""


class Network:
    """All hosts, what listens on them, and the connections to them."""

    def __init__(self, loop: SimulatedLoop, rng: Random, climate: Climate) -> None:
        self.loop, self.rng, self.climate = loop, rng, climate
        self.doubled: list[tuple[str, bytes]] = []
        """The datagrams that arrived twice, with their hosts."""
        self.astray: list[tuple[float, str]] = []
        """When datagrams arrived twice or late, with their hosts."""
        self.overtaken: list[tuple[float, float, str]] = []
        """When late or lost datagrams left and arrived, with their hosts: one that left later may have come before."""
        self._hosts: dict[str, Host] = {}
        self._listening: dict[Address, tuple[Callable[[], Any], Context]] = {}
        self._datagrams: dict[Address, Datagrams] = {}
        self._ends: list[End] = []
        self._numbers = 40000

    def host(self, name: str) -> Host:
        """A host by its name."""
        return self._hosts.setdefault(name, Host(name))

    def number(self) -> int:
        """A free port number."""
        self._numbers += 1
        return self._numbers

    def drawn(self, kind: str) -> bool:
        """Whether a fault of this kind happens now."""
        return self.climate[kind] > 0 and self.climate.happens(kind, self.rng)

    def delay(self, kind: str = "net late", spared: bool = False) -> float:
        """The time that bytes are on their way, s; to and from a host that is `spared` they are never late."""
        prompt = 0.0002 + 0.0003 * self.rng.random()
        return prompt + (self.rng.random() ** 2 * LATER if not spared and self.drawn(kind) else 0.0)

    # What happens to a host

    def cut(self, name: str) -> None:
        """Reset every connection of a host: what is on its way is lost."""
        for end in self._of(name):
            end.fail(errno.ECONNRESET)

    def refuse(self, name: str, seconds: float) -> None:
        """Let the server of a host end, and begin again after a while."""
        self.host(name).refuses = self.loop.now + seconds
        self.cut(name)

    def darken(self, name: str, seconds: float) -> None:
        """Let nothing pass to and from a host for a while; neither end is told."""
        self.host(name).dark = self.loop.now + seconds
        for end in self._of(name):
            self.loop.call_later(CONFIRMED if end.flying else PROBED, end.give_up)

    def heal(self) -> None:
        """Let everything pass."""
        for host in self._hosts.values():
            host.refuses = host.dark = 0.0

    def _of(self, name: str) -> list[End]:
        self._ends = [each for each in self._ends if not each.gone]
        return [each for each in self._ends if each.host.name == name]

    # What asyncio's loop asks

    async def connect(self, made: Socket, address: Address) -> None:
        """Connect a socket."""
        host = self.host(address[0])
        if made.type == socket.SOCK_DGRAM:
            made.address, made.peer = ("10.0.0.9", self.number()), address
            return made.at(host)
        delay = self.delay(spared=host.spared)
        await asyncio.sleep(delay + (self.rng.random() * 3 if not host.spared and self.drawn("slow connect") else 0.0))
        while host.dark > self.loop.now:
            await asyncio.sleep(host.dark - self.loop.now)
        listens = self._listening.get(address)
        refused = not host.spared and self.drawn("refused")
        if listens is None or host.refuses > self.loop.now or refused:
            raise error(errno.ECONNREFUSED)
        near, far = self._connection(host)
        made.connected(near, host)
        make, server = listens
        server.copy().run(Served, far, make, ("10.0.0.9", self.number()), address)

    def pair(self, near: Socket, far: Socket, name: str) -> Host:
        """Connect two sockets through a host, as `ssh` does."""
        host = self.host(name)
        for made, end in zip((near, far), self._connection(host), strict=True):
            made.connected(end, host)
        return host

    def _connection(self, host: Host) -> tuple[End, End]:
        near, far = End(self, host), End(self, host)
        near.other, far.other = far, near
        self._ends += [near, far]
        return near, far

    def listen(self, make: Callable[[], Any], host: str, port: int) -> Server:
        """Accept connections. Raises OSError."""
        address = host, port or self.number()
        if address in self._listening:
            raise error(errno.EADDRINUSE)
        self._listening[address] = make, copy_context()
        return Server(address, lambda: self._listening.pop(address, None))

    def datagrams(self, make: Callable[[], Any], address: Address) -> tuple[asyncio.BaseTransport, Any]:
        """Take datagrams."""
        protocol = make()
        transport = self._datagrams[address] = Datagrams(self, self.host(address[0]), address)
        transport.receive = protocol.datagram_received
        protocol.connection_made(transport)
        return transport, protocol

    def datagram(self, host: Host, data: bytes, arrive: Callable[[bytes], None]) -> None:
        """Send one: it may be lost, late or doubled."""
        if host.dark > self.loop.now or self.drawn("datagram lost"):
            return self.overtaken.append((self.loop.now, inf, host.name))
        twice = self.drawn("datagram doubled")
        for again in (False, True) if twice else (False,):
            if again:
                self.doubled.append((host.name, data))
            if (delay := self.delay("datagram late")) > PROMPT or twice:
                self.astray.append((self.loop.now + delay, host.name))
                self.overtaken.append((self.loop.now, self.loop.now + delay, host.name))
            self.loop.call_later(delay, arrive, data)

    def at_host(self, host: Host, address: Address, data: bytes, sender: Socket) -> None:
        """A datagram arrives at a host, where nothing may take it."""
        found = self._datagrams.get(address)
        if found is None or host.refuses > self.loop.now:
            self.datagram(host, b"", lambda _: sender.refuse())
        else:
            found.senders[sender.address] = sender
            found.receive(data, sender.address)


class Socket(Descriptor):
    """A socket as `socket.socket` makes it. A stream has an end of a connection, a datagram socket an address."""

    def __init__(self, network: Network, rng: Random, trace: Trace, kind: Any) -> None:
        super().__init__(network.loop, rng, network.climate, trace)
        self.type = kind
        self.address: Address = ("", 0)
        self.peer: Address = ("", 0)
        self.host = Host("")
        self.traced: Callable[[str], Trace] = lambda host: self.trace
        """Makes the notebook of a host."""
        self._network = network
        self._end: End | None = None
        self._arrived: deque[bytes] = deque()
        self._refused = False

    def setblocking(self, flag: bool) -> None:
        """Never block."""

    def setsockopt(self, level: int, option: int, value: int) -> None:
        """Take note of nothing: the network knows the product's options."""

    def connected(self, end: End, host: Host) -> None:
        """Use this end of a connection."""
        self._end = end
        end.woken = self._woken
        self.at(host)

    def at(self, host: Host) -> None:
        """Take note of the host at the other end."""
        self.host, self.trace = host, self.traced(host.name)

    @property
    def readable(self) -> bool:
        """Whether a read does not wait."""
        end = self._end
        return end is None or bool(end.received or end.failed or end.ended)

    @property
    def writable(self) -> bool:
        """Whether a write does not wait."""
        return self._end is None or self._end.gone or self._end.room > 0

    def refuse(self) -> None:
        """Nothing takes the datagrams that it sends."""
        self._refused = True
        self.wake()

    def recv(self, most: int) -> bytes:
        """Read what has arrived: bytes, or one datagram."""
        if (end := self._end) is None:
            self._raise_refused()
            if not self._arrived:
                raise BlockingIOError(errno.EAGAIN, "no datagram")
            data = self._arrived.popleft()
            self.trace("<", data)
            if self._arrived:
                self.wake()
            return data[:most]
        if end.received:
            data = self.piece(end.received, most)
            if end.received or end.ended or end.failed:
                self.wake()
            return data
        if end.failed:
            raise error(end.failed)
        if end.ended:
            return b""
        raise BlockingIOError(errno.EAGAIN, "no bytes")

    def send(self, data: bytes | memoryview) -> int:
        """Take bytes, as many as there is room for, or a datagram."""
        if (end := self._end) is None:
            self._raise_refused()
            whole = bytes(data)
            self.trace(">", whole)
            self._network.datagram(
                self.host, whole, lambda sent: self._network.at_host(self.host, self.peer, sent, self)
            )
            return len(whole)
        if end.failed or end.closed:
            raise error(end.failed or errno.EPIPE)
        size = self.taken(data, end.room, end.flying > 0)
        end.send(bytes(data[:size]))
        return size

    def unsent(self) -> int:
        """Bytes that are not confirmed."""
        return self._end.flying if self._end is not None else 0

    def close(self) -> None:
        """Close it."""
        self.closed = True
        if self._end is not None:
            if not self._end.gone:
                self._end.close()
            self._end.closed = True

    def datagram(self, data: bytes) -> None:
        """One has come."""
        if not self.closed:
            self._arrived.append(data)
            self.wake()

    def _raise_refused(self) -> None:
        if self._refused:
            self._refused = False
            raise error(errno.ECONNREFUSED)

    def _woken(self) -> None:
        self.wake()
        self.loop.writable(self.fileno())


class Server:
    """What `create_server` returns."""

    def __init__(self, address: Address, close: Callable[[], object]) -> None:
        self.address, self._close = address, close
        self.sockets = [self]

    def getsockname(self) -> Address:
        """Where it listens."""
        return self.address

    def close(self) -> None:
        """Accept no more."""
        self._close()

    async def wait_closed(self) -> None:
        """Wait for nothing."""


class Served(asyncio.Transport):
    """The server's end of a connection, for an `asyncio` protocol, which works in the context of the server."""

    def __init__(self, end: End, make: Callable[[], Any], peer: Address, address: Address) -> None:
        super().__init__({"peername": peer})
        self._end, self._protocol, self._context = end, make(), copy_context()
        self._paused = self._closing = self._lost = False
        self._modbus = address[1] == 502
        self._before = b""
        end.woken = lambda: self._context.copy().run(self._woken)
        self._protocol.connection_made(self)

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send bytes; a reply over Modbus may be late, doubled, or have the number of another transaction."""
        for late, each in self._replies(bytes(data)) if self._modbus else ((0.0, bytes(data)),):
            if late:
                self._end.network.loop.call_later(late, self._send, each)
            else:
                self._send(each)

    def _replies(self, data: bytes) -> Iterator[tuple[float, bytes]]:
        network = self._end.network
        if self._before and network.drawn("reply again"):
            yield 0.0, self._before
        self._before = data
        if network.drawn("reply of another"):
            number = (int.from_bytes(data[:2]) + network.rng.choice((-0x200, -0x100, 0x100, 0x200))) % 0x10000
            yield 0.0, number.to_bytes(2) + data[2:]
        else:
            yield network.rng.random() * LATER if network.drawn("reply late") else 0.0, data

    def _send(self, data: bytes) -> None:
        if not self._end.gone:
            self._end.send(data)

    def write_eof(self) -> None:
        """Send the end of the stream."""
        self._end.finish()

    def get_write_buffer_size(self) -> int:
        """Bytes that the other end leaves unread."""
        return max(0, self._end.flying + len(self._end.other.received) - WINDOW)

    def is_closing(self) -> bool:
        """Whether it is closed, or will be."""
        return self._closing

    def close(self) -> None:
        """Close it after what was written."""
        if not self._closing:
            self._end.close()
            self._ends(None)

    def abort(self) -> None:
        """Close it now."""
        if not self._closing:
            other = self._end.other
            self._end.closed = True
            self._end.network.loop.call_later(self._end.network.delay(), other.fail, errno.ECONNRESET)
        self._ends(None)

    def pause_reading(self) -> None:
        """Leave unread what comes."""
        self._paused = True

    def resume_reading(self) -> None:
        """Read on."""
        self._paused = False
        self._end.network.loop.call_soon(self._woken)

    def _woken(self) -> None:
        end, protocol = self._end, self._protocol
        while end.received and not self._paused and not self._closing:
            if isinstance(protocol, asyncio.BufferedProtocol):
                buffer = cast(Any, protocol.get_buffer(-1))
                size = min(len(buffer), len(end.received))
                buffer[:size] = end.received[:size]
                del end.received[:size]
                protocol.buffer_updated(size)
            else:
                data = bytes(end.received)
                end.received.clear()
                cast(asyncio.Protocol, protocol).data_received(data)
            end.other.woken()
        if end.failed:
            self._ends(error(end.failed))
        elif end.ended and not end.received:
            self.close()

    def _ends(self, problem: OSError | None) -> None:
        self._closing = True
        if not self._lost:
            self._lost = True
            self._end.network.loop.call_soon(self._protocol.connection_lost, problem)


class Datagrams(asyncio.DatagramTransport):
    """The server's datagram socket."""

    receive: Callable[[bytes, Address], None]

    def __init__(self, network: Network, host: Host, address: Address) -> None:
        super().__init__({"sockname": address})
        self._network, self._host = network, host
        self.senders: dict[Address, Socket] = {}

    def sendto(self, data: Any, addr: Any = None) -> None:
        """Send one."""
        self._network.datagram(self._host, bytes(data), self.senders[addr].datagram)

    def get_write_buffer_size(self) -> int:
        """All have left."""
        return 0

    def close(self) -> None:
        """Close it."""
