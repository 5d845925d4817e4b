"""Computers that lend a serial port: by `multidrop share`, and by `multidrop relay` at the far end of `ssh`.

The relay is the product's, one turn of its loop at a time. It is woken where something has arrived or can be written,
and after the time for which it would have waited.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from random import Random
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Protocol

from multidrop.base.errors import TransportLost
from multidrop.features.sharing.server import SharedPort
from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.shell.connect.opening import open_port
from multidrop.shell.connect.urls import parse
from multidrop.transports import relay, serial_port
from soak.simulation.system.clock import SimulatedLoop
from soak.simulation.system.network import Network, Socket
from soak.simulation.system.process import Process

if TYPE_CHECKING:
    from multidrop.features.sharing.writer_turns import Say
    from multidrop.transports.ssh import FarPort

LOGIN = 0.3
"""The longest time of a login, s."""
LINGER = 1.0
"""Seconds that a far side which ends gives its port."""


class Kernel(Protocol):
    """What the program `ssh` and its far side ask of the kernel: see `kernel.Kernel`."""

    loop: SimulatedLoop
    network: Network
    rng: Random
    descriptors: dict[int, Any]

    def socket(self, family: Any, kind: Any, protocol: int = 0) -> Socket:
        """Make a socket."""

    def as_far(self, work: Callable[[], Any]) -> Any:
        """Do something as a computer that lends a port."""


async def share(url: str, family: str, host: str, port: int, say: Callable[[Say], None]) -> SharedPort:
    """Lend a port as `multidrop share` does."""
    shared = SharedPort(await open_port(parse(url)), stop_bytes(family), say)
    await shared.open(host, port)
    return shared


class SshProgram:
    """The program `ssh`, as `SshSession` starts it, and the relay at its far end once it has logged in."""

    def __init__(self, kernel: Kernel, far: FarPort, baud: int) -> None:
        self.name = far.name
        self._kernel, self._far, self._baud = kernel, far, baud
        self._words, self._status = "", -1
        self._near = kernel.socket(None, None)
        self._theirs = kernel.socket(None, None)
        self._theirs.traced = lambda host: lambda way, data: None  # what it does is noted at the near end
        host = kernel.network.pair(self._near, self._theirs, far.host)
        wait = max(0.0, host.dark - kernel.loop.now) + kernel.rng.random() * LOGIN
        kernel.loop.call_later(min(wait, 5.0), self._log_in)

    def own(self, process: Process | None) -> None:
        """End with a process: its end of the pipe is closed then."""
        self._near.owner = process

    def _log_in(self) -> None:
        host, now = self._kernel.network.host(self._far.host), self._kernel.loop.now
        if host.dark > now or host.refuses > now:
            why = "timed out" if host.dark > now else "refused"
            return self.end(255, f"ssh: connect to host {self._far.host} port 22: Connection {why}")
        try:
            port = self._kernel.as_far(
                lambda: serial_port.opened(serial_port.SerialEndpoint, self._far.path, self._baud)
            )
        except TransportLost as problem:
            return self.end(3, f"multidrop: {problem}")
        FarSide(self._kernel, self, self._theirs.fileno(), port)

    def end(self, status: int, words: str) -> None:
        """The far side has ended."""
        self._status, self._words = status, words
        self._theirs.close()

    # What `SshSession` is for the product

    async def read_some(self) -> bytes:
        """Wait for bytes; empty at the end."""
        while True:
            try:
                return self.read(4096)
            except BlockingIOError:
                await asyncio.sleep(0.005)

    def fileno(self) -> int:
        """The descriptor."""
        return self._near.fileno()

    def read(self, most: int) -> bytes:
        """Read bytes that have come; empty at the end."""
        try:
            return self._near.recv(most)
        except BlockingIOError:
            raise
        except OSError as problem:  # which ssh meets, and ends
            self._status, self._words = 255, f"client_loop: send disconnect: {problem.strerror}"
            return b""

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write bytes."""
        return self._near.send(bytes(data))

    def unsent(self) -> int:
        """Bytes that ssh has not taken."""
        return self._near.unsent()

    def last_words(self) -> str:
        """The last line that was printed."""
        return self._words

    def mark(self) -> None:
        """Forget what was printed."""
        self._words = ""

    def status(self, within: float) -> int | None:
        """The exit status; None: it runs on."""
        return self._status if self._status >= 0 else None

    def close(self, lost: bool) -> None:
        """End it."""
        self._near.close()


class FarSide:
    """A running relay: a turn of its loop, the time of its wait, the next turn."""

    def __init__(self, kernel: Kernel, ssh: SshProgram, stream: int, port: serial_port.SerialEndpoint) -> None:
        self._kernel, self._ssh, self._port, self._stream = kernel, ssh, port, stream
        self._relay = relay.Relay(port)
        self._loop = relay._Loop(self._relay, stream, stream, relay.SILENCE)
        self._timer: asyncio.TimerHandle | None = None
        self._over = False
        for number in (stream, port.fileno()):
            kernel.loop.add_reader(number, self._come_back, 0.0002)
            kernel.loop.add_writer(number, self._come_back, 0.0002)

    def _come_back(self, after: float) -> None:
        if not self._over and (self._timer is None or self._timer.when() > self._kernel.loop.now + after):
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._kernel.loop.call_later(after, self._turn)

    def _turn(self) -> None:
        self._timer = None
        seam: Any = relay
        before, words = seam.select, "the relay has ended"
        waits = [0.0]
        seam.select = SimpleNamespace(select=lambda *given: self._ready(waits, *given))
        try:
            alive = self._loop._turn()
        except (TransportLost, relay.GarbledFrame) as problem:
            alive, words = False, f"multidrop: {problem}"
        finally:
            seam.select = before
        if alive:
            self._come_back(waits[0])
        else:
            self._over = True
            self._linger(words, self._kernel.loop.now + LINGER)

    def _ready(self, waits: list[float], reads: list[int], writes: list[int], _: Any, patience: float) -> Any:
        at = self._kernel.descriptors
        readable = [each for each in reads if at[each].readable]
        writable = [each for each in writes if at[each].writable]
        waits[0] = 0.0002 if readable or writable else patience
        return readable, writable, []

    def _linger(self, words: str, until: float) -> None:
        """Give the driver and the reader a moment for what they hold, and end."""
        loop = self._kernel.loop
        if loop.now < until and (self._port.unsent() or (self._relay.out and self._loop._write())):
            loop.call_later(0.01, self._linger, words, until)
            return
        for number in (self._stream, self._port.fileno()):
            loop.remove_reader(number)
            loop.remove_writer(number)
        self._port.close()
        self._ssh.end(3, words)
