"""The far side of `ssh://`: a port here, lent to one multidrop elsewhere through standard input and output.

The frames. A frame is a kind, the length of the payload (2 bytes, the high one first), and the payload. The far side
begins with one line of text, `GREETING`, once its port is open; frames follow it in both directions. Bytes on their way
through ssh cannot be taken back: pipes and windows on the way hold megabytes. So the near side sends no more than
`CREDIT` bytes ahead of the far port, and at `DROP` the far side drops its queue. The far side reads all that has
arrived before it writes to its port. Thus a drop reaches it ahead of its queue.

Theory of operation. One loop waits for three descriptors, and no write blocks. A relay that blocked on its port would
never see the end of its input, and would keep the port. A byte counts as sent when it has left the driver, where the
driver reports that. The relay reports it at once, because the near side's credit and its knowledge of half-sent lines
depend on it. The relay ends with its input, and after a silence of `SILENCE` seconds; of what arrives after that it
passes on only a stop. It then gives the driver a second to send its bytes, because the last may be a stop.
"""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import TYPE_CHECKING

from multidrop.base.errors import TransportLost
from multidrop.transports import PortControl

if TYPE_CHECKING and sys.platform != "win32":
    from multidrop.transports.serial_port import SerialEndpoint

WORD = "multidrop-relay"
VERSION = 1
GREETING = f"{WORD} {VERSION}"
CREDIT = 256
"""The largest number of bytes that were sent and that the far port has not reported as sent."""
MOST_FRAME_BYTES = 4096
"""The longest payload, bytes."""
BEAT = 1.5
"""The pause between two signs of life of this side, s; the far side replies to each."""
MISSED = 3
"""Without a reply to this many signs of life in turn the connection is lost."""
SILENCE = 6.0
"""Without a byte from this side for that long, s, the far side ends: a cut network must not keep the port locked.

By then this side has given up. What it sent before must not be executed later."""
HEAD_BYTES = 3
"""The bytes of a frame before its payload."""


class Kind(IntEnum):
    """The kinds of frames."""

    DATA = ord("D")
    """Bytes for the port, or from it."""
    DROP = ord("X")
    """To the far side: drop all that the port has not sent."""
    DONE = ord("T")
    """To this side: how many bytes for the port are sent or dropped by now, since the beginning (8 bytes)."""
    BEAT = ord("P")
    """A sign of life, and the reply to it."""
    SET = ord("S")
    """To the far side: change a setting of the port (number, `PortSetting`, 4 bytes value)."""
    OUTCOME = ord("O")
    """To this side: the outcome of a change (number, text; no text: it is done)."""
    LOST = ord("L")
    """To this side: the port is lost (text)."""


class PortSetting(IntEnum):
    """The settings of a port that change while it is open."""

    BAUD = 1
    DTR = 2
    RTS = 3
    BREAK = 4


class GarbledFrame(Exception):
    """Bytes that are not a frame."""


def frame(kind: Kind, payload: bytes | memoryview = b"") -> bytes:
    return bytes([kind]) + len(payload).to_bytes(2) + payload


class FrameSplitter:
    """Divides the bytes that arrive into frames."""

    def __init__(self) -> None:
        self._held = bytearray()

    def take(self, data: bytes) -> Iterator[tuple[Kind, bytes]]:
        """Take bytes in, and return the frames that are whole by now. Raises GarbledFrame at the first wrong byte."""
        self._held += data
        while len(self._held) >= HEAD_BYTES:
            kind, size = self._held[0], int.from_bytes(self._held[1:HEAD_BYTES])
            if kind not in _KINDS or size > MOST_FRAME_BYTES:
                raise GarbledFrame(f"{bytes(self._held[:HEAD_BYTES]).hex(' ')} is not the beginning of a frame")
            if len(self._held) < HEAD_BYTES + size:
                return
            payload = bytes(self._held[HEAD_BYTES : HEAD_BYTES + size])
            del self._held[: HEAD_BYTES + size]
            yield Kind(kind), payload


_KINDS = frozenset(map(int, Kind))


assert sys.platform != "win32"

_READ_BYTES = 65536
_FULL = 65536
"""Bytes that wait for a slow reader, from which on the port is not read."""
_LINGER = 1.0
"""Seconds that the end waits for the driver, and for the reader of what was said last."""
_DRIVER_POLL = 0.002
"""Seconds between two looks at what the driver holds."""


class Relay:
    """The relay as bytes in and out; `serve` is the loop that waits."""

    def __init__(self, port: SerialEndpoint) -> None:
        self.port = port
        self.out = bytearray(f"{GREETING}\n".encode())
        """What the reader has not taken yet."""
        self.queue = bytearray()
        """What the port has not taken yet."""
        self._frames = FrameSplitter()
        self._settled = self._reported = 0
        """Bytes for the port since the beginning: dropped or taken by the driver; reported as sent."""

    def receive(self, data: bytes) -> None:
        """Take in what arrived, and pass it on. Raises GarbledFrame; OSError where the port is lost."""
        for kind, payload in self._frames.take(data):
            if kind is Kind.DATA:
                self.queue += payload
            elif kind is Kind.DROP:
                self._drop()
            elif kind is Kind.BEAT:
                self.out += frame(Kind.BEAT)
            elif kind is Kind.SET:
                if len(payload) != 6:
                    raise GarbledFrame("a change of a setting that is not 6 bytes long")
                self.out += frame(
                    Kind.OUTCOME, payload[:1] + _changed(self.port.control, payload[1], payload[2:]).encode()
                )
            else:
                raise GarbledFrame(f"a frame {kind.name}, which only the far side sends")
        self.push()

    def late(self, data: bytes) -> None:
        """Take in what arrived after too long a silence, and pass on only a stop. May raise as `receive`.

        The other end has given up: a motion that began now would surprise the person who read of the loss.
        """
        stop: bytes | None = None
        for kind, payload in self._frames.take(data):
            if kind is Kind.DROP:
                stop = b""
            elif kind is Kind.DATA and stop == b"":
                stop = payload
        if stop:
            self._drop()
            self.queue += stop
            self.push()

    def push(self) -> None:
        """Write to the port, and report what it has sent. Raises OSError where it is lost."""
        while self.queue:
            try:
                taken = self.port.write(bytes(self.queue))
            except (BlockingIOError, InterruptedError):
                break
            if not taken:
                break
            self._settled += taken
            del self.queue[:taken]
        sent = self._settled - self.port.unsent()
        if sent > self._reported:
            self._reported = sent
            self.out += frame(Kind.DONE, sent.to_bytes(8))

    @property
    def held(self) -> bool:
        """True while the driver holds bytes that it has not sent."""
        return self._reported < self._settled

    def read(self) -> bool:
        """Pass on what the port has received; False where it was hung up. Raises OSError where it is lost."""
        try:
            data = self.port.read()
        except (BlockingIOError, InterruptedError):
            return True
        if data is None:
            return False
        self.out += b"".join(
            frame(Kind.DATA, data[at : at + MOST_FRAME_BYTES]) for at in range(0, len(data), MOST_FRAME_BYTES)
        )
        return True

    def lost(self, error: OSError | None) -> str:
        """Report the loss of the port; return the reason."""
        reason = self.port.explain(error)
        self.out += frame(Kind.LOST, reason.encode()[:1000])
        return reason

    def _drop(self) -> None:
        self._settled += len(self.queue)
        self.queue.clear()
        self.port.drop()


def _changed(control: PortControl, setting: int, value: bytes) -> str:
    """Change a setting; return the reason why it is refused, or an empty text."""
    number = int.from_bytes(value)
    changes: dict[int, Callable[[], None]] = {
        PortSetting.BAUD: lambda: control.set_baud(number),
        PortSetting.DTR: lambda: control.set_dtr(bool(number)),
        PortSetting.RTS: lambda: control.set_rts(bool(number)),
        PortSetting.BREAK: lambda: control.set_break(bool(number)),
    }
    if setting not in changes:
        return f"no setting {setting}"
    try:
        changes[setting]()
    except OSError as problem:
        return problem.strerror or str(problem) or "refused"
    return ""


def serve(port: SerialEndpoint, source: int = 0, sink: int = 1, silence: float = SILENCE) -> None:
    """Lend an open port to the other end of these descriptors; return when that end is gone.

    Raises TransportLost where the port is lost, or where the input is not that of multidrop. Closes the port.
    """
    for descriptor in (source, sink):
        os.set_blocking(descriptor, False)
    try:
        _Loop(Relay(port), source, sink, silence).run()
    finally:
        port.close()


def _now() -> float:
    """The time, s; on Linux it goes on while the machine is suspended."""
    if sys.platform == "linux":
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


class _Loop:
    """The loop that waits for the input, the port and the reader."""

    def __init__(self, relay: Relay, source: int, sink: int, silence: float) -> None:
        self._relay, self._source, self._sink, self._silence = relay, source, sink, silence
        self._port = relay.port.fileno()
        self._last = _now()
        """When something arrived from the other end."""

    def run(self) -> None:
        """Pass bytes on, until the other end is gone. Raises TransportLost."""
        try:
            while self._turn():
                pass
        except GarbledFrame as problem:
            raise TransportLost(f"standard input is not from multidrop: {problem}") from None
        finally:
            self._linger()

    def _turn(self) -> bool:
        """Wait, and do what can be done; False at the end."""
        readable, writable = self._wait()
        late = _now() - self._last > self._silence
        if self._source in readable and not self._take(late):
            return False
        if late:
            raise TransportLost(f"the relay has ended: it got no sign of life for {self._silence:g} s")
        try:
            hung_up = self._port in readable and not self._relay.read()
            self._relay.push()
        except OSError as error:
            raise TransportLost(self._relay.lost(error)) from error
        if hung_up:
            raise TransportLost(self._relay.lost(None))
        return self._sink not in writable or self._write()

    def _wait(self) -> tuple[list[int], list[int]]:
        relay = self._relay
        reads = [self._source] + ([self._port] if len(relay.out) < _FULL else [])
        writes = ([self._sink] if relay.out else []) + ([self._port] if relay.queue else [])
        patience = _DRIVER_POLL if relay.held else max(_DRIVER_POLL, self._last + self._silence - _now())
        readable, writable, _ = select.select(reads, writes, [], patience)
        return readable, writable

    def _take(self, late: bool) -> bool:
        """Take in what arrived from the other end; False where that is gone."""
        self._last = _now()
        try:
            data = os.read(self._source, _READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False
        try:
            (self._relay.late if late else self._relay.receive)(data)
        except OSError as error:
            raise TransportLost(self._relay.lost(error)) from error
        return bool(data)

    def _write(self) -> bool:
        """Pass on what the reader takes; False where that is gone."""
        try:
            del self._relay.out[: os.write(self._sink, self._relay.out)]
        except (BlockingIOError, InterruptedError):
            return True
        except OSError:
            return False
        return True

    def _linger(self) -> None:
        """Give the driver and the reader a moment for what they hold."""
        deadline, reads = time.monotonic() + _LINGER, True
        while time.monotonic() < deadline:
            waits = reads and bool(self._relay.out)
            if not (waits or self._relay.port.unsent()):
                break
            reads = reads and self._write()
            time.sleep(_DRIVER_POLL)
