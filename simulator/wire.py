"""One wire with drives on it: pacing, collisions and faults between the endpoints and the drives' ports.

Theory of operation. Bytes from the host queue up and arrive one by one, each `10 / baud` seconds after the previous one
(8N1; at 0 baud all at once, and in one piece if there is only one drive). Every port receives a byte at its arrival.
The merger takes what the ports send, with the times at which they begin, and gives the bytes that every endpoint
receives. All this happens inside `advance(now)`, in the order of the times, so a late caller sees the same bytes as a
prompt one.

The two directions do not disturb each other (four-wire). Drives do not receive the replies of drives: a line could
begin with any character of them, that is, with any drive's name. What a drive's program prints is given to the other
ports when its last byte has gone out, so that one drive can command another (`PR "bEX G1"`). The hazard of real lines
remains: a program that prints `7186` on a line with a drive called 7 gives that drive a command.

A port is asked only when it can have something to send: after it has received, and at its deadline. `_ports_due` is
never later than the earliest deadline. `look_again` follows a change of a drive by another way than this wire.

Faults draw from one seeded source in the order of the bytes: an equal conversation has equal faults.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from math import ceil, inf
from random import Random
from typing import NamedTuple, Protocol

from multidrop.simulator.cell.spec import Faults

# Collisions: the transmissions of several drives merged on one wire.
#
# A drive's transmitter sends one byte after another, whatever the others do. On the wire, bytes that overlap become
# one. Equal bytes give that byte, so a global ESC, to which all drives reply with the same characters, looks like one
# reply. Different bytes give their AND, since a 0 wins over a 1. A byte that begins in the middle of another one is
# lost in it: the receiver is busy with the first.
#
# On a paced wire, transmissions overlap in time. On an unpaced one bytes take no time, so two drives collide only if
# the same byte from the host, or the same moment, made them send.


class Paced:
    """Merges what transmitters send on a wire on which each byte takes `byte_time` seconds.

    `send` takes bytes at a time, or after what the transmitter sends already, and returns the time of their end;
    `take` gives those that have arrived in full, `deadline` is when the next one will have. `backlog` counts bytes.
    """

    def __init__(self, byte_time: float) -> None:
        self._time = byte_time
        self._free: dict[int, float] = {}
        self._pending: list[tuple[float, int, int]] = []

    def send(self, who: int, at: float, data: bytes) -> float:
        start = max(at, self._free.get(who, at))
        for n, byte in enumerate(data):
            heappush(self._pending, (start + n * self._time, who, byte))
        self._free[who] = start + len(data) * self._time
        return self._free[who]

    def busy(self, who: int, at: float) -> bool:
        return at < self._free.get(who, at)

    def new_cause(self) -> None:
        """Do nothing: where bytes take time, causes do not matter."""

    def take(self, now: float) -> bytes:
        pending, slack = self._pending, self._time / 16
        out = bytearray()
        while pending and pending[0][0] + self._time <= now:
            start, _, value = heappop(pending)
            while pending and pending[0][0] < start + self._time - slack:
                value &= heappop(pending)[2]
            out.append(value)
        return bytes(out)

    @property
    def backlog(self) -> int:
        return len(self._pending)

    @property
    def deadline(self) -> float | None:
        return self._pending[0][0] + self._time if self._pending else None

    def clear(self) -> None:
        self._pending.clear()
        self._free.clear()


class Unpaced:
    """The same for a wire on which bytes take no time. After `new_cause` what is sent has another cause."""

    def __init__(self) -> None:
        self._cause = 0
        self._last: dict[int, tuple[float, int, int]] = {}
        self._pending: list[tuple[float, int, int, bytes]] = []
        self._waiting = 0

    def send(self, who: int, at: float, data: bytes) -> float:
        before, cause, n = self._last.get(who, (at, self._cause, 0))
        at = max(at, before)
        if (at, self._cause) != (before, cause):
            n = 0
        heappush(self._pending, (at, self._cause, n, data))
        self._waiting += len(data)
        self._last[who] = (at, self._cause, n + len(data))
        return at

    def busy(self, who: int, at: float) -> bool:
        return who in self._last and at <= self._last[who][0]

    def new_cause(self) -> None:
        self._cause += 1

    def take(self, now: float) -> bytes:
        heard, moment = bytearray(), (0.0, -1)
        begun = 0
        while self._pending and self._pending[0][0] <= now:
            at, cause, n, data = heappop(self._pending)
            self._waiting -= len(data)
            if moment != (at, cause):
                moment, begun = (at, cause), len(heard) - n
            start = begun + n
            both = max(0, min(len(heard) - start, len(data)))
            for k in range(both):
                heard[start + k] &= data[k]
            heard += data[both:]
        return bytes(heard)

    @property
    def backlog(self) -> int:
        return self._waiting

    @property
    def deadline(self) -> float | None:
        return self._pending[0][0] if self._pending else None

    def clear(self) -> None:
        self._waiting = 0
        self._pending.clear()
        self._last.clear()


# The bytes that a receiver samples from a signal of another baud rate.


BITS_A_BYTE = 10
"""A byte on the wire: a start bit, eight bits of data, a stop bit (8N1)."""


def resample(data: bytes, sent: float, received: float) -> bytes:
    """Sample bytes that are sent back to back at `sent` baud (8N1) with a receiver set to `received` baud.

    The receiver starts at a falling edge and samples the middle of each of its own bit times. It delivers the byte even
    if the stop bit is not one.
    """
    if sent == received:
        return data
    levels = [1]
    for byte in data:
        levels += [0, *((byte >> bit) & 1 for bit in range(8)), 1]
    ratio = sent / received
    out = bytearray()
    at = 1
    while at < len(levels):
        if levels[at] or not levels[at - 1]:
            at += 1
            continue
        middles = (int(at + (bit + 1.5) * ratio) for bit in range(8))
        bits = [levels[middle] if middle < len(levels) else 1 for middle in middles]  # idle after the last byte
        out.append(sum(level << bit for bit, level in enumerate(bits)))
        at = max(at + 1, ceil(at + 9.5 * ratio))
    return bytes(out)


# The faults of a wire: what they do to bytes, drawn from one seeded source in the order of the bytes.


def harmed(data: bytes, faults: Faults, rng: Random) -> bytes:
    """Return the bytes with some of them lost, doubled and with a bit flipped, and with others inserted.

    To be called for harmful faults only: it draws from the source for every byte.
    """
    out = bytearray()
    for byte in data:
        if faults.insert and rng.random() < faults.insert:
            out.append(rng.randrange(256))
        if rng.random() < faults.drop:
            continue
        out.append(byte ^ (1 << rng.randrange(8)) if rng.random() < faults.flip else byte)
        if faults.double and rng.random() < faults.double:
            out.append(out[-1])
    return bytes(out)


def lateness(faults: Faults, rng: Random) -> float:
    """Draw the seconds by which a byte, and all that follow it, are late."""
    return rng.uniform(*faults.late_by) if faults.late and rng.random() < faults.late else 0.0


def pieces(data: bytes, faults: Faults, rng: Random) -> Iterator[tuple[float, bytes]]:
    """Divide bytes before each that is late; yield the seconds before each piece, and the piece."""
    begin, late = 0, 0.0
    for n in range(len(data)) if faults.late else ():
        if more := lateness(faults, rng):
            if data[begin:n]:
                yield late, data[begin:n]
                late = 0.0
            begin, late = n, late + more
    yield late, data[begin:]


MOST_UNSENT = 4096
"""Bytes that the drives have to send still when the host's next message waits.

A drive's own buffers are smaller; this keeps short commands with long replies from filling the memory. Bytes that
complete no message are received all the same, and so is everything up to a key that acts at once.
"""
BYTES = tuple(bytes([value]) for value in range(256))


class Transmission(NamedTuple):
    """Bytes that a drive sends, and when it begins. `overheard`: other drives take them for a host's."""

    at: float
    data: bytes
    overheard: bool = False


class Port(Protocol):
    """The drive's side of the wire. A port without keys and without a line for others inherits the answers to that."""

    @property
    def deadline(self) -> float | None:
        """Time of the drive's next event; None if only new input can cause one."""

    @property
    def baud(self) -> int:
        """The baud rate that the port is set to; 0 if it understands any, as on a wire whose bytes take no time."""

    def quiet(self, now: float) -> bool:
        """Whether nothing waits to be sent, and nothing happens up to `now`: it need not be asked."""
        due = self.deadline
        return due is None or due > now

    def hears(self, byte: int) -> bool:
        """Whether a byte means anything to it now. It takes note of a byte that does not, which is not received."""
        return True

    def completes(self, data: bytes) -> bool:
        """Whether these bytes can complete a message that it replies to with more bytes than the message has."""
        return False

    def urgent(self, data: bytes) -> bool:
        """Whether these bytes contain a key that acts at once, such as a stop."""
        return False

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes whose last bit arrived at `now`."""

    def sent(self, now: float) -> list[Transmission]:
        """Give what it has begun to send up to `now`, since it was last asked."""

    def overhear(self, data: bytes, now: float) -> None:
        """Take bytes that another drive has sent, of those that drives overhear."""
        return


class Wire:
    """A wire. `hung_up`: nothing passes, and the endpoints should disconnect their clients. Times in seconds."""

    def __init__(
        self, ports: Sequence[Port], baud: int = 0, faults: Faults | None = None, rng: Random | None = None
    ) -> None:
        self.baud = baud
        self.hung_up = False
        self._ports = tuple(ports)
        self._faults = faults or Faults()
        self._rng = rng or Random(0)
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._coming: deque[tuple[float, bytes, int]] = deque()
        self._queued: dict[int, int] = {}
        self._held_until = 0.0
        self._merger: Paced | Unpaced = Paced(self._byte_time) if baud else Unpaced()
        self._overheard: list[tuple[float, int, bytes]] = []
        self._hang_up_at = self._faults.hangup_after
        self._ports_due = inf
        self._outdated = True

    def disturb(self, faults: Faults, rng: Random | None = None) -> None:
        """Have these faults from now on; `rng`: drawn from another source of chance."""
        self._faults = faults
        self._rng = rng or self._rng

    @property
    def following(self) -> float | None:
        """Time at which the next byte of a drive arrives at the host; None: no drive sends."""
        return self._merger.deadline

    @property
    def deadline(self) -> float | None:
        """Time of the next event: a byte arrives at the drives or at the host, or a drive does something by itself."""
        if self._outdated:
            self._ports_due = self._earliest()
        first = self._ports_due
        if (received := self._merger.deadline) is not None:
            first = min(first, received)
        if self._hang_up_at is not None:
            first = min(first, self._hang_up_at)
        if self._coming and not self._held:
            first = min(first, self._coming[0][0])
        if self._overheard:
            first = min(first, self._overheard[0][0])
        return None if first == inf else first

    def receive(self, data: bytes, now: float, baud: int | None = None, source: int = 0) -> None:
        """Take bytes that an endpoint's client has written. `baud`: the client's baud rate, if known."""
        if self.hung_up:
            return
        if baud and self.baud:
            data = resample(data, baud, self.baud)
        self._count(source, len(data))
        at = max(now, self._coming[-1][0]) if self._coming else now
        if not self.baud and len(self._ports) == 1 and not self._faults.late:
            self._coming.append((at, data, source))
            return
        for byte in data:
            at += self._byte_time + lateness(self._faults, self._rng)
            self._coming.append((at, BYTES[byte], source))

    def queued(self, source: int = 0) -> int:
        """How many bytes of this source have not arrived yet."""
        return self._queued.get(source, 0)

    def _count(self, source: int, more: int) -> None:
        count = self._queued.get(source, 0) + more
        if count:
            self._queued[source] = count
        else:
            self._queued.pop(source, None)

    def retract(self, now: float, source: int = 0) -> int:
        """Drop what a source has written and what has not begun to go out by `now`; return the number of bytes."""
        kept = [byte for byte in self._coming if byte[2] != source or byte[0] - self._byte_time < now]
        dropped = sum(len(byte[1]) for byte in self._coming) - sum(len(byte[1]) for byte in kept)
        self._coming = deque(kept)
        self._count(source, -dropped)
        return dropped

    def advance(self, now: float) -> bytes:
        """Give the bytes that every endpoint has received by now, since it was last asked."""
        if self._hang_up_at is not None and now >= self._hang_up_at:
            after, lasts = self._faults.hangup_after, self._faults.hangup_for
            if self.hung_up:
                self.plug()
                self._hang_up_at = None if after is None else now + after
            else:
                self.unplug()
                self._hang_up_at = None if lasts is None else now + lasts
        received = self._carry(now)
        if not self._asleep(now):
            for who, port in enumerate(self._ports):
                if not port.quiet(now):
                    self._collect(who, now)
            self._ports_due, self._outdated = self._earliest(), False
        while self._overheard and self._overheard[0][0] <= now:
            _, source, data = heappop(self._overheard)
            self._merger.new_cause()
            for who, port in enumerate(self._ports):
                if who != source:
                    port.overhear(data, now)
                    self._collect(who, now)
        received += self._merger.take(now)
        if self.hung_up:
            return b""
        return harmed(received, self._faults, self._rng) if self._faults.harmful else received

    def _carry(self, now: float) -> bytes:
        """Bring the host's due bytes to the drives; give what endpoints receive meanwhile.

        While the drives have too much to send already, a message that makes them send more is held back.
        """
        received = b""
        while self._coming and self._coming[0][0] <= now:
            at = max(self._coming[0][0], self._held_until)
            if self._held:
                received += self._merger.take(at)
            if self._held:
                self._held_until = now
                break
            _, data, source = self._coming.popleft()
            self._count(source, -len(data))
            self._arrive(harmed(data, self._faults, self._rng) if self._faults.harmful else data, at)
        return received

    @property
    def _held(self) -> bool:
        """Whether the next bytes of the host have to wait."""
        if self._merger.backlog < MOST_UNSENT:
            return False
        completes = any(port.completes(self._coming[0][1]) for port in self._ports)
        return completes and not any(port.urgent(data) for _, data, _ in self._coming for port in self._ports)

    def _arrive(self, received: bytes, at: float) -> None:
        self._merger.new_cause()
        for who, port in enumerate(self._ports):
            if len(received) == 1 and not port.hears(received[0]):
                if self.baud or self._asleep(at):  # paced, what it sends by itself has its own time: collected later
                    continue
            elif received:
                port.receive(resample(received, self.baud, port.baud) if port.baud else received, at)
            if port.quiet(at):
                self._note_due(port)
            else:
                self._collect(who, at)

    def _asleep(self, now: float) -> bool:
        """Whether no port has had an event up to `now`."""
        return now < self._ports_due and not self._outdated

    def _earliest(self) -> float:
        return min((at for port in self._ports if (at := port.deadline) is not None), default=inf)

    def _note_due(self, port: Port) -> None:
        due = port.deadline
        if due is not None and due < self._ports_due:
            self._ports_due = due

    def look_again(self) -> None:
        """Ask all ports at the next occasion: a drive was changed by another way than this wire."""
        self._outdated = True

    def unplug(self) -> None:
        """Unplug: what is on the wire is lost, and nothing passes until `plug`."""
        self.hung_up = True
        self._coming.clear()
        self._queued.clear()
        self._overheard.clear()
        self._merger.clear()

    def plug(self) -> None:
        self.hung_up = False

    def retune(self, baud: int) -> None:
        """Continue at another baud rate; what is on the wire is lost."""
        self.baud = baud
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._coming.clear()
        self._queued.clear()
        self._overheard.clear()
        self._merger = Paced(self._byte_time) if baud else Unpaced()

    def _collect(self, who: int, now: float) -> None:
        low, high = self._faults.delay
        port = self._ports[who]
        sent = port.sent(now)
        self._note_due(port)
        if self.hung_up:
            return
        for at, data, overheard in sent:
            if high and not self._merger.busy(who, at):
                at += self._rng.uniform(low, high)
            for late, piece in pieces(data, self._faults, self._rng) if self._faults.late else ((0.0, data),):
                sent_as = resample(piece, port.baud, self.baud) if port.baud else piece
                at = end = self._merger.send(who, at + late, sent_as)
            if overheard and len(self._ports) > 1:
                heappush(self._overheard, (end, who, data))
