"""One half-duplex wire as a state machine: bytes and times in, events out. No clock, no event loop.

Theory of operation. One request is in flight at a time; the rest wait by priority, then in order, but a poll is passed
over only once. An answer ends when the request's dialect finds it whole; answers without an end of their own end when
the wire has been quiet for the dialect's patience; a request that is not answered in time ends as such and is never
sent again from here. ASCII has no sequence numbers, so after a timeout, a damaged answer or a stop nothing is written
until the wire has been quiet for a while, and the stop is repeated then. Quiet proves nothing about a slow drive: until
it has printed a mark, an answer that may be the one that is outstanding is handed on as doubtful, and every line that
comes after it stands in front of the mark that its asker has printed then. Every request is given a number, its tag,
for the languages whose answers carry one. Where messages have a length (`framed`), a stop forgets no half of one; where
they are not `numbered` besides, what is left over after a pause is dropped.

Times are seconds of one clock; the wire's own time (ten bits a byte) is added where the baud rate is known, because the
operating system takes a line at once and sends it slowly.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

from dialects import Codec, Decoded, End, Kind, Priority, Reply, Request
from drives.doubt import Doubt
from drives.echo import LocalEcho
from drives.events import Unsolicited

QUIET = 0.1
"""Seconds without a byte after which the wire is written to again after trouble."""
NEVER_QUIET = 1.0
"""Seconds for which that is waited for at most: a program may print without a pause, and a stop must be repeated."""
TAIL = 0.05
"""Seconds after which a line without an end is handed on as it is."""
CHATTER = 4.0
"""How many timeouts a request may take while a running program keeps the wire busy."""
LONGEST_LIST = 60.0
"""Seconds that a list may take: 28 kB at 4800 baud."""
LONGEST_TAIL = 4096
"""Characters of a line that nobody asked for before it is handed on without its end."""


@dataclass(frozen=True)
class Write:
    """Bytes to be written now; `request` is what they carry, None for a repeated stop."""

    data: bytes
    request: Request | None


@dataclass(frozen=True)
class Finished:
    """A request ended, `sent` or not. `carried_at` is when its last byte had left, as far as the baud rate tells."""

    ticket: int
    request: Request
    reply: Reply
    sent_at: float
    transmitted_at: float
    ended_at: float
    sent: bool = True


LineEvent = Write | Finished | Unsolicited


@dataclass
class _Flight:
    ticket: int
    request: Request
    sent_at: float
    transmitted_at: float
    heard_at: float
    settled_at_length: int = -1


class Line:
    """The wire. Call `events` after everything that was told to it, and when `deadline` has come."""

    def __init__(self, idle: Codec, *, baud: int = 0, local_echo: bool = False, timeout: float = 1.0) -> None:
        self.idle = idle
        self.timeout = timeout
        self._byte_time = 10.0 / baud if baud else 0.0
        self._echo = LocalEcho() if local_echo else None
        self._buffer = b""
        self._queue: list[tuple[int, int, Request]] = []
        self._flight: _Flight | None = None
        self._tickets = 0
        self._passed_over = False
        self._heard_at = self._begun_at = self._busy_until = self._trouble_at = self._cut_until = float("-inf")
        self._doubt = Doubt()
        self._quiet_needed = False
        self._again: list[bytes] = []
        self._ended: list[LineEvent] = []
        self._stopped: tuple[Request, int] | None = None

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
        self._heard_at = now
        if not self._buffer:
            self._begun_at = now
        if self._flight is not None:
            self._flight.heard_at = now
        if self._echo:
            before, data = self._echo.sift(data)
            self._show(before, now)
        self._buffer += data

    def _show(self, data: bytes, now: float) -> None:
        """Hand on what was not asked for, the unfinished rest too."""
        lines, used = self.idle.parse_unsolicited(data)
        rest = data[used:].hex(" ") if self.idle.framed else data[used:].decode("latin-1").strip("\r\n>?")
        self._stray(now, *lines, rest)

    def _stray(self, now: float, *lines: str) -> None:
        """Hand on lines that answer nothing."""
        self._ended += [Unsolicited(now, text) for text in lines if text]
        self._doubt.stray(lines)

    @property
    def transmitted(self) -> float:
        """When the last byte that was written has left, as far as the baud rate tells, s."""
        return self._busy_until

    def half_sent(self, now: float) -> bool:
        """Whether the drives have the head of a line of which a half would do harm."""
        return now < self._cut_until

    def stop(self, now: float, *again: bytes, only: Container[str] | None = None) -> bool:
        """Fail what is queued (for `only` these addresses) and in flight; write each of `again` when it is quiet.

        Whether a line was half sent.
        """
        cut_off = self._cut_off() or self._stopped
        if self._flight is not None:
            self._finish(Decoded(Reply(end=End.STOPPED), 0), now)
        for _, ticket, request in [each for each in self._queue if only is None or each[2].address in only]:
            self.withdraw(ticket)
            self._ended.append(Finished(ticket, request, Reply(end=End.STOPPED), now, now, now, sent=False))
        if cut_off is None:
            self._drop()
        self._stopped = cut_off
        before = [] if only is None else self._again
        self._quiet_needed, self._trouble_at = True, now
        self._again = [*before, *(each for each in again if each)]
        return self.half_sent(now)

    def _cut_off(self) -> tuple[Request, int] | None:
        """The print that a stop cuts off, and how many bytes of its answer came: the rest is no line of a program's."""
        if self._flight is None or self._echo or self.idle.framed:
            return None
        request = self._flight.request
        return (request, len(self._buffer)) if request.kind is Kind.PRINT and request.expect else None

    def take_again(self) -> bytes:
        """The stop that is still to be repeated, for somebody who cannot wait until it is quiet."""
        again, self._again = b"".join(self._again), []
        return again

    def wrote(self, data: bytes, now: float, whole: bool = False) -> None:
        """Bytes were written (a stop's around the queue). `whole`: a half of them would do harm in a drive's buffer."""
        self._busy_until = now + len(data) * self._byte_time
        self._cut_until = self._busy_until if whole else float("-inf")
        if self._echo:
            self._show(self._echo.wrote(data), now)

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
        codec, request = flight.request.codec, flight.request
        if self._echo and self._echo.awaited:
            found = self._without_echo(flight, now)
        else:
            found = codec.decode(request, self._buffer) if self._buffer else None
            if found is None and self._settles(flight) and now >= self._settle_time(flight):
                flight.settled_at_length = len(self._buffer)
                found = codec.on_quiet(request, self._buffer)
            if found is None and now >= self._overdue_time(flight):
                found = codec.on_timeout(request, self._buffer)
        if found is None:
            return False
        self._finish(found, now)
        return True

    def _without_echo(self, flight: _Flight, now: float) -> Decoded | None:
        """Our own bytes did not come back as they were sent: whatever came cannot be trusted to be an answer."""
        if self._echo is None or now < self._overdue_time(flight):
            return None
        held = self._echo.forget().decode("latin-1")
        if not held:
            return flight.request.codec.on_timeout(flight.request, b"")
        return Decoded(Reply(end=End.DAMAGED, detail=f"echo=local, but our own bytes came back as {held[:48]!r}"), 0)

    def _settles(self, flight: _Flight) -> bool:
        """Whether quiet has something to say: not twice of the same bytes, not while our own are outstanding."""
        return flight.settled_at_length != len(self._buffer) and not (self._echo and self._echo.awaited)

    def _settle_time(self, flight: _Flight) -> float:
        patience = flight.request.codec.quiet_time(flight.request, self._buffer)
        quiet = max(flight.heard_at, flight.transmitted_at) + patience
        if flight.request.kind is not Kind.COMMAND:
            return quiet
        # Nothing is to be printed: a program that prints without a pause is not waited for in vain.
        return min(quiet, flight.transmitted_at + max(2 * patience, NEVER_QUIET))

    def _overdue_time(self, flight: _Flight) -> float:
        timeout = self.timeout if flight.request.timeout is None else flight.request.timeout
        timeout = max(timeout, flight.request.codec.quiet_time(flight.request, self._buffer))
        latest = max(flight.heard_at, flight.transmitted_at) + timeout
        if flight.request.kind is Kind.LIST:
            return min(latest, flight.transmitted_at + LONGEST_LIST)
        return min(latest, flight.transmitted_at + CHATTER * timeout)

    def _finish(self, found: Decoded, now: float) -> None:
        flight = self._flight
        assert flight is not None
        reply = found.reply
        raw = self._buffer[: found.used]
        doubtful, marked = self._doubt.weigh(flight.request, reply, now)
        reply = reply.heard(raw, doubtful)
        self._stray(now, *found.strays)
        reply = self._doubt.with_evidence(flight.request, reply)
        self._ended.append(Finished(flight.ticket, flight.request, reply, flight.sent_at, flight.transmitted_at, now))
        self._buffer, self._begun_at = self._buffer[found.used :], now
        if marked or reply.end in (End.TIMEOUT, End.DAMAGED):  # an ACK of its own may stand behind a mark
            self._quiet_needed, self._trouble_at = True, now
        self._flight = None

    def _drop(self) -> None:
        """Forget what has come so far, except where a message must not be cut."""
        if not self.idle.framed:
            self._buffer = b""
        self._stopped = None

    def _resynchronise(self) -> None:
        """After a pause: what has come is over. Only where messages are numbered a rest that comes yet does no harm."""
        if not self.idle.numbered:
            self._buffer = b""
        self._stopped = None

    def _after_stop(self, now: float) -> bool:
        """Take away the answer to what a stop cut off. Whether it is still to be waited for."""
        assert self._stopped is not None
        request, came = self._stopped
        tail = self._tail_time()
        found = request.codec.decode(request, self._buffer)
        if found is None and tail is not None and now < tail:
            return True
        self._stopped = None
        if found is not None:
            self._stray(now, *found.strays)
        self._buffer = self._buffer[found.used if found is not None else came :]
        return False

    def _unasked(self, now: float) -> None:
        if not (self._buffer or self._echo) or (self._stopped is not None and self._after_stop(now)):
            return
        lines, used = self.idle.parse_unsolicited(self._buffer)
        self._stray(now, *lines)
        if used:
            self._buffer, self._begun_at = self._buffer[used:], now
        if self.idle.numbered:
            return
        tail = self._tail_time()
        if self._buffer and ((tail is not None and now >= tail) or len(self._buffer) > LONGEST_TAIL):
            self._show(self._buffer, now)
            self._buffer = b""
        if self._echo and self._echo.held and now >= self._heard_at + TAIL:
            self._show(self._echo.forget(), now)

    def _quiet_time(self) -> float:
        """When the wire will have been quiet for long enough, or was given up on."""
        since = max(self._busy_until, self._trouble_at)
        quiet = (self.idle.stop_gap or QUIET) if self._again else QUIET
        return min(max(self._heard_at, since) + quiet, since + NEVER_QUIET)

    def _tail_time(self) -> float | None:
        """When the unfinished line that nobody asked for is handed on; until then it may be going on.

        A program that prints without ever ending a line does not keep the wire to itself.
        """
        held = self._echo is not None and self._echo.held
        if self.idle.numbered or not (self._buffer or held):
            return None
        quiet = self._heard_at + TAIL
        return quiet if held else min(quiet, self._begun_at + NEVER_QUIET)

    def _written(self, now: float) -> bool:
        if self._flight is not None or not (self._queue or self._again):
            return False
        if self._quiet_needed:
            if now < self._quiet_time():
                return False
            self._quiet_needed = False
            self._resynchronise()
        if self._again:
            data = self._again.pop(0)
            self._quiet_needed, self._trouble_at = True, now
            self.wrote(data, now)
            self._ended.append(Write(data, None))
            return False
        if (tail := self._tail_time()) is not None and now < tail:
            return False
        ticket, request = self._next()
        request = request.numbered(ticket)
        data = request.codec.encode(request)
        self.wrote(data, now, whole=True)
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
            if self._settles(self._flight):
                times.append(self._settle_time(self._flight))
            return min(times)
        tail = self._tail_time()
        times = [tail] if tail is not None else []
        if (self._queue or self._again) and self._quiet_needed:
            times.append(self._quiet_time())
        return min(times) if times else None

    @property
    def waiting(self) -> Sequence[Request]:
        """What is queued, first what goes first."""
        return [request for _, _, request in self._queue]
