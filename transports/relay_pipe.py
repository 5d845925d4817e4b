"""The near side of a relay: a pipe over a connection whose other end speaks the frames of `transports.relay`.

No more than `CREDIT` bytes are on the way or in the far driver. The rest waits here, where a stop drops it. A stop's
drop is followed by the stop whatever the credit, because the far side obeys the drop ahead of its queue.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable

from multidrop.transports import PortControl
from multidrop.transports.pipe import DescriptorPipe, begun
from multidrop.transports.relay import (
    BEAT,
    CREDIT,
    HEAD_BYTES,
    MISSED,
    MOST_FRAME_BYTES,
    FrameSplitter,
    GarbledFrame,
    Kind,
    PortSetting,
    frame,
)

_READ_BYTES = 4096
_WAITED = 64 * 1024
SETTING_TIMEOUT = 5.0
"""Seconds to wait for the outcome of a change of a setting."""


class SocketStream:
    """A stream to the other end over a socket, as a descriptor that never blocks."""

    def __init__(self, name: str, made: socket.socket) -> None:
        """`name`: for a person."""
        made.setblocking(False)
        self.name = name
        self._socket = made

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self, most: int) -> bytes:
        """Read bytes that arrived; empty at the end. Raises BlockingIOError where there are none."""
        return self._socket.recv(most)

    async def read_some(self) -> bytes:
        """Wait for bytes; empty at the end."""
        try:
            return await asyncio.get_running_loop().sock_recv(self._socket, _WAITED)
        except OSError:
            return b""

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write, and return how many bytes were taken. Raises BlockingIOError where none are."""
        return self._socket.send(data)

    def last_words(self) -> str:
        """The reason of its end; empty if unknown."""
        return ""

    def close(self, lost: bool) -> None:
        """End it; may block."""
        self._socket.close()


class RelayEndpoint:
    """The frames and the credit. `read` is called by the loop, all that writes under the lock of the pipe."""

    def __init__(self, connection: SocketStream, early: bytes) -> None:
        """`early`: bytes that arrived after the greeting."""
        self.name = connection.name
        self.answered = 0
        """Number of signs of life that the far side has replied to."""
        self.outcomes: dict[int, str] = {}
        self.news = threading.Condition()
        """Notified at an outcome, and at the end."""
        self._connection = connection
        self._frames = FrameSplitter()
        self._early = early
        self._rest: deque[memoryview] = deque()
        """Frames, and the rest of one, that the system has not taken."""
        self._sent = self._done = self._base = 0
        """Bytes for the port: sent; reported as sent by the port or dropped; sent before the last drop."""
        self._urgent = self._ended = self._lost = False
        self._reason = ""

    def fileno(self) -> int:
        return self._connection.fileno()

    @property
    def blocked(self) -> bool:
        """True while the system does not take what has to leave."""
        return bool(self._rest)

    @property
    def over(self) -> bool:
        """True once the far side has said that its port is lost."""
        return bool(self._reason)

    @property
    def room(self) -> int:
        """The number of bytes that may leave now."""
        return CREDIT - (self._sent - max(self._done, self._base))

    def read(self) -> bytes | None:
        """Bytes from the port; empty: other news; None: the end."""
        data = self._early or self._connection.read(_READ_BYTES)
        self._early = b""
        if not data:
            return None
        arrived = bytearray()
        try:
            for kind, payload in self._frames.take(data):
                self._obey(kind, payload, arrived)
        except GarbledFrame as problem:
            self._reason = f"the other end sends what is not of a relay ({problem})"
            raise OSError(self._reason) from problem
        return bytes(arrived)

    def _obey(self, kind: Kind, payload: bytes, arrived: bytearray) -> None:
        if kind is Kind.DATA:
            arrived += payload
        elif kind is Kind.DONE:
            self._done = int.from_bytes(payload)
        elif kind is Kind.BEAT:
            self.answered += 1
        elif kind is Kind.OUTCOME and payload:
            with self.news:
                self.outcomes[payload[0]] = payload[1:].decode(errors="replace")
                self.news.notify_all()
        elif kind is Kind.LOST:
            self._reason = payload.decode(errors="replace")

    def write(self, data: bytes | memoryview) -> int:
        """Write, and return how many bytes the credit allowed."""
        if not data:
            return 0
        self.flush()
        allowed = len(data) if self._urgent else min(len(data), self.room)
        if self._rest or allowed <= 0:
            raise BlockingIOError
        self._urgent = False
        for at in range(0, allowed, MOST_FRAME_BYTES):
            self._rest.append(memoryview(frame(Kind.DATA, data[at : min(at + MOST_FRAME_BYTES, allowed)])))
        self._sent += allowed
        self.flush()
        return allowed

    def send(self, made: bytes) -> None:
        self._rest.append(memoryview(made))
        self.flush()

    def flush(self) -> None:
        """Write waiting frames until the system takes no more."""
        with contextlib.suppress(BlockingIOError, InterruptedError):
            while self._rest:
                first = self._rest[0]
                taken = self._connection.write(first)
                if taken < len(first):
                    self._rest[0] = first[taken:]
                else:
                    self._rest.popleft()

    def unsent(self) -> int:
        return max(0, self._sent - self._done)

    def drop(self) -> int:
        """Drop what waits here, and have the far side drop what its port has not sent.

        What is written next leaves at once and whole.
        """
        held = self.unsent()
        leaves = deque[memoryview]()
        for piece in self._rest:
            if piece[0] == Kind.DATA and not begun(piece):
                self._sent -= len(piece) - HEAD_BYTES
            else:
                leaves.append(piece)
        self._rest = leaves
        self._base, self._urgent = self._sent, True
        self._rest.append(memoryview(frame(Kind.DROP)))
        return held

    def hurry(self) -> None:
        """Let what is written next leave at once and whole: the rest of a stop waits for no report of the far side."""
        self._urgent = True

    def explain(self, error: OSError | None) -> str:
        """Reason of a break in one line for a person."""
        self._lost = True
        ours = str(error) if error is not None and error.errno is None else ""
        why = error.strerror if error is not None and error.strerror else "the connection has ended"
        return (
            self._reason or ours or self._connection.last_words() or f"{why}; check the network and the other machine"
        )

    def end(self) -> None:
        """End every wait for an outcome."""
        with self.news:
            self._ended = True
            self.news.notify_all()

    def outcome(self, number: int) -> str:
        """Wait for the outcome of a change. Raises OSError where none comes."""
        with self.news:
            self.news.wait_for(lambda: self._ended or number in self.outcomes, SETTING_TIMEOUT)
            if number not in self.outcomes:
                raise OSError("the far side does not reply" if not self._ended else "the connection has ended")
            return self.outcomes.pop(number)

    def close(self) -> None:
        self._connection.close(self._lost)


class RelayPipe(DescriptorPipe):
    """A transport over a relay. Room comes with a report of the far side, not with the descriptor."""

    def __init__(self, connection: SocketStream, baud: int, early: bytes = b"", round_trip: float = 0.0) -> None:
        """`early`: bytes that arrived after the greeting."""
        self.round_trip = round_trip
        self._relay = RelayEndpoint(connection, early)
        super().__init__(self._relay, RelayControl(self._relay, self._send_frame, baud))
        self._answered = self._missed = 0
        """Replies to signs of life by the last one, and signs of life in turn that had none."""
        self._show_life()

    def _show_life(self) -> None:
        """Send a sign of life, or break the pipe where the far side has stopped to reply."""
        if not self._usable:
            return
        replied = self._relay.answered > self._answered or not self._reading
        self._answered, self._missed = self._relay.answered, 0 if replied else self._missed + 1
        if self._missed >= MISSED:
            self._break(OSError(f"the far side has not replied for {MISSED * BEAT:g} s; check the network"))
            return
        self._loop.call_later(BEAT, self._show_life)
        self._send_frame(frame(Kind.BEAT))

    def _send_frame(self, made: bytes) -> None:
        """Send a frame that needs no credit; any thread."""
        with self._guard:
            if not self._usable:
                return
            try:
                self._relay.send(made)
                problem = None
            except OSError as error:
                problem = error
        self._loop.call_soon_threadsafe(self._after_push, problem)

    def discard(self, whole: bool = False) -> int:
        """Drop what waits here and, unless `whole`, what the far port has not sent."""
        dropped = super().discard(whole)
        if self._usable:
            self._send()
        return dropped

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        def urgent(waiting: int) -> bytes | None:
            if data := make(waiting):
                self._relay.hurry()
            return data

        return super().follow(urgent, key)

    def _begin(self) -> None:
        super()._begin()
        self._loop.call_soon(self._read_early)

    def _read_early(self) -> None:
        """Read the bytes that came with the greeting: no event of the descriptor announces them."""
        if self._usable:
            self._read()

    def _read(self) -> bool:
        more = super()._read()
        if self._relay.over and self._usable:
            self._break(None)
        if self._pending:  # also while it closes, which waits for what has not left
            self._send()
        return more

    def _push(self) -> OSError | None:
        try:
            self._relay.flush()
        except OSError as error:
            return error
        return super()._push()

    def _wants_room(self) -> bool:
        return self._relay.blocked

    def _idle(self) -> bool:
        return super()._idle() and not self._relay.blocked

    def _halt(self) -> None:
        super()._halt()
        self._relay.end()


class RelayControl(PortControl):
    """The settings of the far port. Each call waits for the far side, so it is made in a thread."""

    def __init__(self, relay: RelayEndpoint, send: Callable[[bytes], None], baud: int) -> None:
        self._relay, self._send = relay, send
        self.baud = baud
        self._turn = threading.Lock()
        self._number = 0

    def set_baud(self, baud: int) -> None:
        self._set(PortSetting.BAUD, baud)
        self.baud = baud

    def _switch(self, line: str, on: bool) -> None:
        self._set(PortSetting[line.upper()], on)

    def _set(self, setting: PortSetting, value: int) -> None:
        with self._turn:
            self._number = (self._number + 1) % 256
            self._relay.outcomes.pop(self._number, None)
            self._send(frame(Kind.SET, bytes([self._number, setting]) + value.to_bytes(4)))
            if refusal := self._relay.outcome(self._number):
                raise OSError(refusal)
