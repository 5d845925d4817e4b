"""A floor in real time: the one place where the simulator meets the event loop's clock; what clients write to it.

It wakes at the floor's next event, at most once a millisecond, and not at all without one. What comes from a client is
carried out at once, so a reply that takes no time is sent in the same turn.

A queue is between a client and a wire. It holds as much as a serial port's buffer, and feeds the wire in short pieces,
so that the clients of a bus take turns. While it is full the client is not read; a timer of some milliseconds looks for
room. When a client has left, its bytes have some seconds to go out, as with a serial port that is closed. Then the rest
is dropped, with a notice.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from math import inf

from multidrop.simulator.family import PortConnection, Shadow
from multidrop.simulator.floor import Floor
from multidrop.simulator.wire import BITS_A_BYTE, Wire
from multidrop.transports.pipe import running_loop

HOLD = 4096
"""Bytes of one client that wait in the queue."""
PIECE = 256
"""Bytes that are read at a time, so that no turn of the event loop takes long; at least as many wait on the wire."""
SECONDS_AHEAD = 0.02
"""Seconds of a fast wire's bytes that wait on it, if those are more."""
POLL = 0.01
"""Seconds between two polls while a client is not read."""
GRACE = 10.0
"""Seconds in which the bytes of a client that has left can go out: 9600 bytes at 9600 baud."""
SHORTEST_SLEEP = 0.001
LATEST = 0.1
"""Seconds that are made up for where this process came too late. The floor's time pauses for the rest, so that a
machine that is too slow for a floor still serves its clients at once."""


LONGEST_HELD = 0.02
"""Seconds for which an endpoint holds a byte at most."""
CHARACTERS = 2
"""Character times of a pause that ends a piece, unless a cell file says otherwise: as a UART's receive timeout."""


class Gathered:
    """The bytes of a wire in the pieces in which a serial port's hardware delivers them.

    UARTs, USB chips and device servers deliver together what arrives without a pause. `pause`, s; None: two character
    times. No timer is needed: the wire knows when its next byte arrives, so the last byte of a reply is never late.
    """

    def __init__(self, wire: Wire, pause: float | None) -> None:
        self._wire, self._pause = wire, pause
        self.held = bytearray()
        self._since = 0.0

    def take(self, data: bytes, now: float) -> bytes:
        """Take what has arrived up to `now`; return the piece that ends here, empty while more follows."""
        if not self.held:
            self._since = now
        self.held += data
        pause = CHARACTERS * BITS_A_BYTE / (self._wire.baud or inf) if self._pause is None else self._pause
        following = self._wire.following
        if following is not None and following <= min(now + pause, self._since + LONGEST_HELD):
            return b""
        piece = bytes(self.held)
        self.held.clear()
        return piece


class Listener:
    """An endpoint of a bus. It leaves as they are the events that mean nothing to its clients."""

    gathers = False
    """It is a serial port or a device server, which gathers the bytes of serial drives."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the wire."""

    def unplugged(self) -> None:
        """Disconnect the client: the bus is unplugged."""

    def plugged(self) -> None:
        """The bus is plugged in again."""

    def disconnected(self) -> None:
        """End all connections: the bus's Ethernet drive has lost power, or boots."""

    def connectable(self) -> None:
        """The Ethernet drive has booted."""

    def commanded(self) -> None:
        """A line of `/sim` was carried out."""


class RunningFloor:
    """Runs a floor `speed` times as fast as the clock. Needs a running loop; `close` ends it."""

    def __init__(self, floor: Floor, speed: float = 1.0) -> None:
        self.floor = floor
        self.notify: Callable[[str], None] = lambda text: None
        """Takes a notice about clients, for a person."""
        self.loop = running_loop()
        self._speed = speed
        self._origin = self.loop.time()
        self._now = 0.0
        self._deadline: float | None = None
        """When something happens next, as of the last turn."""
        self._listeners: dict[str, list[Listener]] = {name: [] for name in floor.wires}
        self._gathered = {  # an Ethernet drive sends in pieces of its own
            bus.name: Gathered(floor.wires[bus.name], 0.0 if bus.name in floor.ethernet else bus.gather)
            for bus in floor.cell.buses
        }
        self._down = {name: wire.hung_up for name, wire in floor.wires.items()}
        self._connectable = {name: floor.connectable(name) for name in floor.ethernet}
        self._wake: asyncio.TimerHandle | None = None
        self._closed = False
        self._sources = 0
        self._turn()

    def now(self) -> float:
        """The floor's time: seconds since the start, times the speed; less where it stood still."""
        now = (self.loop.time() - self._origin) * self._speed
        if self._deadline is not None:
            most = max(self._deadline + LATEST * self._speed, self._now)
            self._origin += max(0.0, now - most) / self._speed
            now = min(now, most)
        self._now = now
        return now

    def attach(self, bus: str, listener: Listener) -> Callable[[], None]:
        """Listen on a bus; call what is returned to end that."""
        self._listeners[bus].append(listener)

        def detach() -> None:
            if listener in self._listeners[bus]:
                self._listeners[bus].remove(listener)

        return detach

    def source(self) -> int:
        """A number for a new source of bytes."""
        self._sources += 1
        return self._sources

    def bytes_a_second(self, bus: str) -> float:
        """How many bytes a wire carries in a second of the clock; 0 if they take no time."""
        return self.floor.wires[bus].baud / BITS_A_BYTE * self._speed

    def write(self, bus: str, data: bytes, source: int = 0, baud: int | None = None) -> None:
        if not self._closed:
            wire = self.floor.wires[bus]
            wire.receive(data, self.now(), baud, source)
            if wire.baud:  # the bytes take their time, and are not there yet
                self._set_alarm()
            else:
                self._turn()

    def exchange(self, bus: str, connection: PortConnection, data: bytes) -> bytes:
        """Pass a client's bytes to its connection; give the reply. Nothing passes while the bus is unplugged."""
        if self._closed:
            return b""
        self._turn()
        if self.floor.wires[bus].hung_up:
            return b""
        answer = connection.receive(data, self.now())
        self.floor.wires[bus].look_again()
        self._turn()
        return answer

    def later(self, seconds: float, call: Callable[[], None]) -> None:
        """Call something when so much of the floor's time has passed."""
        self.loop.call_later(seconds / self._speed, call)

    def retract(self, bus: str, source: int) -> int:
        """Drop what a source has written and what has not begun to go out; return the number of bytes."""
        return self.floor.wires[bus].retract(self.now(), source)

    def command(self, text: str) -> None:
        if self._closed:
            return
        self._turn()
        try:
            self.floor.command(text, self.now())
        finally:
            self._turn()
            for listener in [each for listeners in self._listeners.values() for each in listeners]:
                listener.commanded()

    def shadow(self, bus: str, name: str) -> Shadow | None:
        """The reading of a drive without its wire, up to date; None where the cell has no such drive."""
        self._turn()
        drives = [drive for drive in self.floor.drives if drive.bus == bus]
        named = [drive for drive in drives if drive.spec.name == name] or (drives if len(drives) == 1 else [])
        return named[0].unit.shadow if named else None

    def close(self) -> None:
        self._closed = True
        if self._wake is not None:
            self._wake.cancel()

    def _turn(self) -> None:
        """Bring the floor up to date, call the listeners, and see when to come back."""
        now = self.now()
        received = self.floor.advance(now)
        for bus, gathered in self._gathered.items():
            data = received.get(bus, b"")
            if not (data or gathered.held):
                continue
            piece = gathered.take(data, now)
            for listener in tuple(self._listeners[bus]):
                if part := piece if listener.gathers else data:
                    listener.receive(part)
        for bus, wire in self.floor.wires.items():
            if wire.hung_up != self._down[bus]:
                self._down[bus] = wire.hung_up
                for listener in tuple(self._listeners[bus]):
                    (listener.unplugged if wire.hung_up else listener.plugged)()
        for bus, before in self._connectable.items():
            now = self.floor.connectable(bus)
            if now != before:
                self._connectable[bus] = now
                for listener in tuple(self._listeners[bus]):
                    (listener.connectable if now else listener.disconnected)()
        self._set_alarm()

    def _set_alarm(self) -> None:
        deadline = self.floor.deadline
        if self._wake is not None and deadline == self._deadline:
            return  # most replies change nothing of what happens next
        if self._wake is not None:
            self._wake.cancel()
            self._wake = None
        self._deadline = deadline
        if deadline is not None and not self._closed:
            at = max(self._origin + deadline / self._speed, self.loop.time() + SHORTEST_SLEEP)
            self._wake = self.loop.call_at(at, self._wake_up)

    def _wake_up(self) -> None:
        self._wake = None
        self._turn()


class ServedClient(Listener):
    """The endpoint of one client, that a queue reads and pauses."""

    def pause(self) -> None:
        """Stop reading the client."""

    def resume(self) -> None:
        """Read the client again."""

    def poll(self) -> None:
        """Look for what cannot wait: the client may take back what it has written."""

    def has_left(self) -> bool:
        """Whether the client has left, as far as the system reports it."""
        return False

    def discard(self) -> None:
        """Drop what the client has left unread."""


class InputQueue:
    """Puts what a client writes on the wire, and pauses its reading while the wire is slower."""

    def __init__(self, floor: RunningFloor, bus: str, client: ServedClient) -> None:
        self._floor, self._bus = floor, bus
        self._client: ServedClient | None = client
        self._source = floor.source()
        self._pending: deque[tuple[bytes, int | None]] = deque()
        self._waiting = 0
        self._paused = False
        self._gone_at: float | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def room(self) -> int:
        """How many bytes may be read now."""
        return min(PIECE, HOLD - self._waiting)

    def write(self, data: bytes, baud: int | None = None) -> None:
        """Queue bytes for the wire. `baud`: the client's baud rate, if known."""
        self._pending.append((data, baud))
        self._waiting += len(data)
        self._feed()
        if self._client is not None and not self._paused and self.room <= 0:
            self._paused = True
            self._client.pause()
        self._come_back()

    def retract(self) -> None:
        """Drop what has not begun to go out: the client takes it back."""
        self._pending.clear()
        self._waiting = 0
        self._floor.retract(self._bus, self._source)

    def close(self) -> None:
        """Take note that the client has left. What it wrote goes out in the time that it has."""
        self._client = None

    def _feed(self) -> None:
        """Hand the wire as much as it has room for."""
        most = max(PIECE, int(SECONDS_AHEAD * self._floor.bytes_a_second(self._bus)))
        wire = self._floor.floor.wires[self._bus]
        while self._pending and (room := most - wire.queued(self._source)) > 0:
            data, baud = self._pending.popleft()
            if data[room:]:
                self._pending.appendleft((data[room:], baud))
            self._waiting -= len(data[:room])
            self._floor.write(self._bus, data[:room], self._source, baud)

    def _come_back(self) -> None:
        if self._timer is None and (self._waiting or self._paused):
            self._timer = self._floor.loop.call_later(POLL, self._look)

    def _look(self) -> None:
        self._timer = None
        if self._client is not None:
            self._client.poll()
        self._feed()
        now = self._floor.loop.time()
        if self._client is not None and not self._client.has_left():
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = now
        elif now - self._gone_at > GRACE:
            self._gone_at = None
            self._paused = self._paused and self._client is not None
            self.retract()
            if self._client is not None:
                self._client.discard()
            self._floor.notify(f"{self._bus}: a client has left; what it wrote faster than the wire is dropped")
        if self._paused and self._client is not None and 2 * self._waiting <= HOLD:
            self._paused = False
            self._client.resume()
        self._come_back()
