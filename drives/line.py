"""One half-duplex wire as a state machine: bytes and times in, events out. No clock, no event loop.

Theory of operation. One request is in flight at a time; the rest wait by priority, then in order, but a poll is passed
over only once. An answer ends when the request's dialect finds it whole; answers without an end of their own end when
the wire has been quiet for the dialect's patience; a request that is not answered in time ends as such and is never
sent again from here. ASCII has no sequence numbers, so after a timeout, a damaged answer or a stop nothing is written
until the wire has been quiet for a while, and the stop is repeated then. Every request is given a number, its tag, for
the languages whose answers carry one. Times are seconds of one clock; the wire's own time (ten bits a byte) is added
where the baud rate is known, because the operating system takes a line at once and sends it slowly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dialects import Decoded, Dialect, End, Kind, Priority, Reply, Request

QUIET = 0.1
"""Seconds without a byte after which a late answer is no longer expected."""
TAIL = 0.05
"""Seconds after which a line without an end is handed on as it is."""
CHATTER = 4.0
"""How many timeouts a request may take while a running program keeps the wire busy."""


@dataclass(frozen=True)
class Write:
    """Bytes to be written now; `request` is what they carry, None for a repeated stop."""

    data: bytes
    request: Request | None


@dataclass(frozen=True)
class Finished:
    """A request ended. `carried_at` is when its last byte had left, as far as the baud rate tells."""

    ticket: int
    request: Request
    reply: Reply
    sent_at: float
    carried_at: float
    ended_at: float


@dataclass(frozen=True)
class Stray:
    """A line that answers nothing."""

    text: str


LineEvent = Write | Finished | Stray


@dataclass
class _Flight:
    ticket: int
    request: Request
    sent_at: float
    carried_at: float
    heard_at: float
    settled_at_length: int = -1


class Line:
    """The wire. Call `events` after everything that was told to it, and when `deadline` has come."""

    def __init__(self, idle: Dialect, *, baud: int = 0, local_echo: bool = False, timeout: float = 1.0) -> None:
        self.idle = idle
        self.timeout = timeout
        self._byte_time = 10.0 / baud if baud else 0.0
        self._local_echo = local_echo
        self._own = b""
        self._buffer = b""
        self._queue: list[tuple[int, int, Request]] = []
        self._flight: _Flight | None = None
        self._tickets = 0
        self._passed_over = False
        self._heard_at = self._busy_until = self._trouble_at = float("-inf")
        self._quiet_needed = False
        self._again: list[bytes] = []
        self._ended: list[LineEvent] = []

    def ask(self, request: Request) -> int:
        """Queue a request; the ticket by which its end is told."""
        self._tickets += 1
        self._queue.append((request.priority, self._tickets, request))
        self._queue.sort(key=lambda waiting: waiting[:2])
        return self._tickets

    def withdraw(self, ticket: int) -> None:
        """Take back a request that has not been written."""
        self._queue = [waiting for waiting in self._queue if waiting[1] != ticket]

    def receive(self, data: bytes, now: float) -> None:
        """Bytes came."""
        if self._local_echo and self._own:
            data = self._swallow(data)
        if data:
            self._heard_at = now
            self._buffer += data
            if self._flight is not None:
                self._flight.heard_at = now

    def _swallow(self, data: bytes) -> bytes:
        """Take off what a two-wire adapter repeats of our own bytes, up to the first that differs."""
        same = 0
        while same < min(len(data), len(self._own)) and data[same] == self._own[same]:
            same += 1
        self._own = self._own[same:] if same == len(data) else b""
        return data[same:]

    def stop(self, now: float, *again: bytes) -> bool:
        """Fail what is queued and in flight; write each of `again` when it is quiet. Whether a line was half sent."""
        half_sent = now < self._busy_until
        if self._flight is not None:
            self._finish(Decoded(Reply(end=End.STOPPED), 0), now)
        for _, ticket, request in self._queue:
            self._ended.append(Finished(ticket, request, Reply(end=End.STOPPED), now, now, now))
        self._queue.clear()
        self._own = b""
        self._drop()
        self._quiet_needed, self._trouble_at, self._again = True, now, [each for each in again if each]
        return half_sent

    def wrote(self, data: bytes, now: float) -> None:
        """Bytes were written around the queue (a stop)."""
        self._busy_until = now + len(data) * self._byte_time
        if self._local_echo:
            self._own += data

    def events(self, now: float) -> list[LineEvent]:
        """Everything that follows from what was told, up to now."""
        while self._answered(now) or self._written(now):
            pass
        ended, self._ended = self._ended, []
        return ended

    def _answered(self, now: float) -> bool:
        flight = self._flight
        if flight is None:
            self._unasked(now)
            return False
        dialect, request = flight.request.dialect, flight.request
        found = dialect.decode(request, self._buffer) if self._buffer else None
        if found is None and now >= self._settle_time(flight) and flight.settled_at_length != len(self._buffer):
            flight.settled_at_length = len(self._buffer)
            found = dialect.settled(request, self._buffer)
        if found is None and now >= self._overdue_time(flight):
            found = dialect.overdue(request, self._buffer)
        if found is None:
            return False
        self._finish(found, now)
        return True

    def _settle_time(self, flight: _Flight) -> float:
        since = max(flight.heard_at, flight.carried_at)
        return since + flight.request.dialect.patience(flight.request, self._buffer)

    def _overdue_time(self, flight: _Flight) -> float:
        timeout = self.timeout if flight.request.timeout is None else flight.request.timeout
        timeout = max(timeout, flight.request.dialect.patience(flight.request, self._buffer))
        latest = max(flight.heard_at, flight.carried_at) + timeout
        if flight.request.kind is Kind.LIST:
            return latest
        return min(latest, flight.carried_at + CHATTER * timeout)

    def _finish(self, found: Decoded, now: float) -> None:
        flight = self._flight
        assert flight is not None
        reply = found.reply
        raw = self._buffer[: found.used]
        reply = replace(reply, raw=raw)
        self._ended += [Stray(text) for text in found.strays]
        self._ended.append(Finished(flight.ticket, flight.request, reply, flight.sent_at, flight.carried_at, now))
        self._buffer = self._buffer[found.used :]
        if reply.end in (End.TIMEOUT, End.DAMAGED):
            self._quiet_needed, self._trouble_at = True, now
        self._flight = None

    def _drop(self) -> None:
        """Forget what has come so far, except where a message must not be cut: its number tells that it is late."""
        if not self.idle.framed:
            self._buffer = b""

    def _unasked(self, now: float) -> None:
        lines, used = self.idle.idle(self._buffer)
        self._ended += [Stray(text) for text in lines]
        self._buffer = self._buffer[used:]
        if self._buffer and now >= self._heard_at + TAIL and not self.idle.framed:
            text = self._buffer.decode("latin-1").strip("\r\n>?")
            if text:
                self._ended.append(Stray(text))
            self._buffer = b""

    def _quiet_time(self) -> float:
        """When the wire will have been quiet for long enough, if nothing more comes."""
        return max(self._heard_at, self._busy_until, self._trouble_at) + QUIET

    def _written(self, now: float) -> bool:
        if self._flight is not None or not (self._queue or self._again):
            return False
        if self._quiet_needed:
            if now < self._quiet_time():
                return False
            self._quiet_needed = False
            self._drop()
        if self._again:
            data = self._again.pop(0)
            self._quiet_needed = True
            self.wrote(data, now)
            self._ended.append(Write(data, None))
            return False
        ticket, request = self._next()
        request = replace(request, tag=ticket)
        data = request.dialect.encode(request)
        self.wrote(data, now)
        self._flight = _Flight(ticket, request, now, self._busy_until, now)
        self._ended.append(Write(data, request))
        return True

    def _next(self) -> tuple[int, Request]:
        """What goes first; a poll that was passed over goes next, or an operator's typing would blind a plot."""
        polls = [waiting for waiting in self._queue if waiting[0] == Priority.POLL]
        chosen = polls[0] if polls and self._passed_over else self._queue[0]
        self._queue.remove(chosen)
        self._passed_over = bool(polls) and chosen not in polls
        return chosen[1], chosen[2]

    @property
    def deadline(self) -> float | None:
        """When `events` has something to say by itself; None: not before something is told."""
        if self._flight is not None:
            times = [self._overdue_time(self._flight)]
            if self._flight.settled_at_length != len(self._buffer):
                times.append(self._settle_time(self._flight))
            return min(times)
        times = [self._heard_at + TAIL] if self._buffer and not self.idle.framed else []
        if (self._queue or self._again) and self._quiet_needed:
            times.append(self._quiet_time())
        return min(times) if times else None

    @property
    def waiting(self) -> Sequence[Request]:
        """What is queued, first what goes first."""
        return [request for _, _, request in self._queue]
