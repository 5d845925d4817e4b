"""The USB interface of a controller as a pipe of lines: commands out, replies in, and the flush request.

Source: the manual of the controllers, 6.1 (64 characters each way, the late reply of 6.1.3); the vendor requests are
those of the maker's driver for Linux. On USB a NUL ends a command and a reply. This pipe takes and delivers CR in its
place, so that the codec of the serial line serves both.  A command leaves whole or not at all. There is one command at
a time: where a reply is missing, the next command waits a little for it, then the pipe flushes both buffers and drops
what comes before the flush is confirmed. A stop waits for nothing: it cancels the transfer that waits and leaves from
the thread that calls. If the controller does not take it within 100 ms, the pipe flushes and sends it once more; if
that is not taken either, the pipe is lost (`Undelivered`).
"""

from __future__ import annotations

import asyncio
import os
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from math import inf
from typing import Protocol

from multidrop.base.errors import TransportLost
from multidrop.features.usb.interface import CANCELLED, GONE, STALLED, TIMEOUT, UsbControl
from multidrop.transports import Undelivered, Unreachable
from multidrop.transports.pipe import Pipe
from multidrop.transports.sockets import explain

TAKEN = 0.1
"""Seconds in which the controller takes a stop."""
REPLY = 0.25
"""Seconds that a command waits for the reply to the one before."""
WRITE_TIMEOUT = 1.0
"""Seconds after which a controller that takes nothing is lost."""
STALE = 0.02
"""Seconds after the first flush in which what comes is of an earlier session."""
_ENDS = {STALLED: "the controller refused a transfer", GONE: "unplugged, or without power", -108: "unplugged"}
Done = Callable[[int, int, bytes], None]
"""Takes the number of a transfer, its status (0, or a negative errno) and what came in."""
Broken = Callable[[OSError | None], None]
"""Takes the reason why the device is gone; None: the other end closed."""


class TransferFailed(OSError):
    """A transfer did not end well. `status`: how, in the numbers of Linux."""

    def __init__(self, status: int, what: str = "") -> None:
        super().__init__(-status, what or _ENDS.get(status, f"a transfer failed ({os.strerror(-status)})"))


class Carrier(Protocol):
    """Transfers to one device. Each begins from any thread, has a number, and ends with one `done` in the loop's
    thread.
    """

    delay: float
    """Seconds that the way to the device and back adds."""

    @property
    def name(self) -> str:
        """The name for a person."""

    def start(self, done: Done, broken: Broken) -> None:
        """Begin to report."""

    def control(self, value: UsbControl) -> int:
        """Begin a vendor request. Raises OSError."""

    def send(self, data: bytes) -> int:
        """Begin a packet to the device. Raises OSError."""

    def receive(self) -> int:
        """Begin to wait for a packet. Raises OSError."""

    def cancel(self, number: int) -> None:
        """Cancel a transfer, if it has not ended."""

    def halt(self) -> None:
        """Report nothing more."""

    def close(self) -> None:
        """Send the request to close, and give the device back. May block."""


class UsbPipe(Pipe):
    """One controller on USB; `open_usb` makes it ready."""

    preemptible = True

    def __init__(self, carrier: Carrier) -> None:
        super().__init__(carrier.name)
        self._carrier = carrier
        self._guard = threading.Lock()
        """Held for all that follows, and as transfers begin; never during a callback."""
        self._queue: deque[bytes] = deque()
        self._partial = b""
        """The begin of a command whose CR has not been written."""
        self._sending: set[int] = set()
        """Packets that the controller has not taken yet."""
        self._receiving = self._flushing = 0
        """The packet that is waited for, and the flush that commands wait for; 0: none."""
        self._owed = 0
        """Replies that have not come."""
        self._sent_at = -inf
        """When the last command began to leave; long ago after a stop."""
        self._requests: dict[int, asyncio.Future[int]] = {}
        """Requests that `open` waits for."""
        self._preempted = 0
        """Stops that have gone first, of which the loop has not taken note."""
        self._urgent = False
        """A stop is written next."""
        self._problem: OSError | None = None
        """A transfer could not begin: the device is gone."""

    # Opening

    async def open(self) -> None:
        """Open the interface, flush it, and drop what comes until `start`. Raises OSError, TransportLost."""
        self._carrier.start(self._done, self._break)
        for value in (UsbControl.OPEN, UsbControl.FLUSH):
            number = self._carrier.control(value)
            self._requests[number] = done = self._loop.create_future()
            try:
                async with asyncio.timeout(WRITE_TIMEOUT + self._carrier.delay):
                    status = await done
            except TimeoutError:
                raise TransferFailed(TIMEOUT, "the controller does not take requests") from None
            if status and self._broken is None:
                raise TransferFailed(status)
        self._receiving = self._carrier.receive()
        await asyncio.sleep(STALE + self._carrier.delay)
        if self._broken is not None:
            raise self._broken

    # Writing

    def write(self, data: bytes) -> bool:
        """Queue commands, each up to its CR; False where they were dropped."""
        if not data or not self._usable:
            return not data
        with self._guard:
            if self._preempted:
                return False
            *commands, self._partial = (self._partial + data).split(b"\r")
            urgent = self._urgent
            if urgent:
                numbers = self._send(commands)
            else:
                self._queue += commands
        if urgent:
            self._watch(commands, numbers)
        else:
            self._go_on()
        return True

    @property
    def pending(self) -> int:
        with self._guard:
            return sum(len(frame) + 1 for frame in self._queue) + len(self._partial)

    def discard(self, whole: bool = False) -> int:
        """Drop what waits; what is written in the same turn of the loop is a stop. Returns 0: no command is cut."""
        with self._guard:
            self._drop()
            self._urgent = True
        self._loop.call_soon(self._calm)
        return 0

    def _calm(self) -> None:
        self._urgent = False

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        with self._guard:
            if not self._usable:
                return False
            self._preempted += 1
            self._drop()
            commands = make(0).split(b"\r")
            numbers = self._send(commands)
        self._loop.call_soon_threadsafe(self._watch, commands, numbers)
        return True

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        with self._guard:
            if not self._usable or not (key or self._preempted) or (data := make(0)) is None:
                return False
            self._preempted += key
            commands = data.split(b"\r")
            numbers = self._send(commands)
        self._loop.call_soon_threadsafe(self._watch, commands, numbers)
        return True

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        with self._guard:
            self._preempted = max(0, self._preempted - 1)
            note(not self._preempted)
            return not self._preempted

    def _drop(self) -> None:
        self._queue.clear()
        self._partial, self._sent_at = b"", -inf
        self._cancel(self._sending)

    def _cancel(self, numbers: Collection[int]) -> None:
        for number in [*numbers]:
            self._carrier.cancel(number)
            self._sending.discard(number)

    def _begin_transfer(self, begin: Callable[..., int], *arguments: object) -> int:
        """Begin a transfer; return 0 where the device is gone."""
        try:
            return begin(*arguments)
        except OSError as error:
            self._problem = error
            return 0

    def _send(self, commands: Iterable[bytes]) -> list[int]:
        """Begin to send each command; return the numbers."""
        numbers = [self._begin_transfer(self._carrier.send, command + b"\0") for command in commands if command]
        self._sending.update(filter(None, numbers))
        self._owed += len(numbers)
        return numbers

    def _next(self) -> None:
        """Begin the next command, after a flush where a reply is missing."""
        if not self._queue or self._sending or self._flushing:
            return
        now = self._loop.time()
        if self._owed and now < (until := self._sent_at + REPLY + self._carrier.delay):
            self._loop.call_at(until, self._go_on)
            return
        number = self._flush() if self._owed else sum(self._send([self._queue.popleft()]))
        self._sent_at = now
        self._loop.call_later(WRITE_TIMEOUT + self._carrier.delay, self._late, number)

    def _go_on(self) -> None:
        with self._guard:
            self._next()
        if self._problem is not None:
            self._break(self._problem)

    def _flush(self) -> int:
        """Begin to empty the buffers; what comes until that is confirmed is dropped."""
        self._owed = 0
        self._flushing = self._begin_transfer(self._carrier.control, UsbControl.FLUSH)
        return self._flushing

    def _late(self, number: int) -> None:
        """End the pipe if a packet or a flush is not taken."""
        if number and (number in self._sending or number == self._flushing):
            self._break(TransferFailed(TIMEOUT, "the controller takes nothing"))

    def _watch(self, stop: Sequence[bytes], numbers: Sequence[int], again: bool = False) -> None:
        """Look after a stop."""
        if self._problem is not None:
            self._break(self._problem, Undelivered)
        elif numbers:
            self._loop.call_later(TAKEN + self._carrier.delay, self._look, stop, numbers, again)

    def _look(self, stop: Sequence[bytes], numbers: Sequence[int], again: bool) -> None:
        """Flush and send a stop once more if it is not taken; give up after the second time."""
        with self._guard:
            late = self._sending.intersection(numbers)
            if not late or not self._usable:
                return
            self._cancel(late)
            if not again:
                self._flush()
                numbers = self._send(stop)
        if again:
            self._break(TransferFailed(TIMEOUT, "the controller does not take the stop"), Undelivered)
        else:
            self._watch(stop, numbers, again=True)

    # What ends

    def _done(self, number: int, status: int, data: bytes) -> None:
        if (request := self._requests.pop(number, None)) is not None:
            if not request.done():
                request.set_result(status)
            return
        if status not in (0, CANCELLED):
            self._break(TransferFailed(status))
            return
        reply = b""
        with self._guard:
            self._sending.discard(number)
            if number == self._flushing:
                self._flushing = 0
            elif number == self._receiving:
                if not self._flushing:
                    reply = data.partition(b"\0")[0]
                    self._owed = max(0, self._owed - bool(reply))
                self._receiving = self._begin_transfer(self._carrier.receive)
        self._go_on()
        if reply:
            self._deliver(reply + b"\r")

    def _begin(self) -> None:
        """Nothing to do: `open` has begun to read."""

    def _drain(self) -> None:
        """Nothing to do: what ended was delivered as it came."""

    def _halt(self) -> None:
        with self._guard:
            self._queue.clear()
        for request in self._requests.values():
            if not request.done():
                request.set_result(GONE)
        self._carrier.halt()

    def _idle(self) -> bool:
        return not (self._queue or self._sending)

    def _release(self) -> None:
        self._carrier.close()

    def _explain(self, error: OSError | None) -> str:
        return explain_usb(error)


def explain_usb(error: OSError | None) -> str:
    return str(error.strerror) if isinstance(error, TransferFailed) else explain(error)


async def open_usb(carrier: Carrier) -> UsbPipe:
    """Open the pipe of a controller, or give the carrier back. Raises Unreachable."""
    pipe = UsbPipe(carrier)
    try:
        await pipe.open()
    except BaseException as error:
        await pipe.close()
        if isinstance(error, TransportLost):
            raise Unreachable(str(error)) from error
        if isinstance(error, OSError):
            raise Unreachable(f"{carrier.name}: {explain_usb(error)}") from error
        raise
    return pipe
