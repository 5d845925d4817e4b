"""One half-duplex wire as a state machine: bytes and times in, events out. It has no clock and no event loop.

Theory of operation. The line is in one of three states: `Free` (nothing in flight), `Flight` (a request in flight), or
`Recovering` (after a timeout, a damaged reply or a stop). One request is in flight at a time; the rest wait in a queue.
A reply ends when the codec of the request finds it whole. A reply without an end of its own ends when the wire has been
quiet long enough. A request that is not answered in time ends as a timeout; the line never sends it again.

ASCII has no sequence numbers. So a recovering line writes nothing until the wire has been quiet, and repeats the stop
then. Quiet proves nothing about a slow drive: `Doubt` marks replies that may belong to an earlier request. Each request
gets a number, its tag, for languages whose replies carry one. Where messages have a length (`framed`), a stop discards
no half of one; where they are not `numbered` either, the line discards what is left after a pause.

Times are seconds of one clock. Where the baud rate is known, the line adds the time on the wire (ten bits a byte):
the operating system accepts a line at once and sends it slowly.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

from dialects import Codec, Decoded, End, Kind, Reply, Request, StopPiece
from drives.doubt import Doubt
from drives.echo import LocalEcho
from drives.events import Unsolicited
from drives.flight import NEVER_QUIET, Finished, Flight
from drives.request_queue import RequestQueue

QUIET = 0.1
"""Quiet time after which a recovering line is written to again, s."""
TAIL = 0.05
"""Quiet time after which an unterminated line is published as it is, s."""
LONGEST_TAIL = 4096
"""Longest unsolicited line without an end, in characters; a longer one is published in pieces."""


@dataclass(frozen=True)
class Write:
    """Bytes to write now. `request` is what they carry, None for a repeated stop."""

    data: bytes
    request: Request | None


LineEvent = Write | Finished | Unsolicited


@dataclass(frozen=True)
class Free:
    """Nothing is in flight; the next request may be written."""


@dataclass(frozen=True)
class Recovering:
    """Trouble at this time: nothing is written until the wire has been quiet."""

    since: float


State = Free | Flight | Recovering


@dataclass(frozen=True)
class CutOff:
    """A PR that a stop interrupted. Of its reply, `received` bytes came before; the rest is no program output."""

    request: Request
    received: int


class Line:
    """The wire. Call `events` after every other call, and when `deadline` has come."""

    def __init__(self, idle: Codec, *, baud: int = 0, local_echo: bool = False, timeout: float = 1.0) -> None:
        self.idle = idle
        """The codec that parses unsolicited lines."""
        self.timeout = timeout
        self._byte_time = 10.0 / baud if baud else 0.0
        self._echo = LocalEcho() if local_echo else None
        self._queue = RequestQueue()
        self._state: State = Free()
        self._doubt = Doubt()
        self._repeats: list[StopPiece] = []
        """Pieces of the last stop that are still to be repeated."""
        self._cut_off: CutOff | None = None
        self._buffer = b""
        self._received_at = self._begun_at = self._busy_until = self._partial_until = float("-inf")
        self._events: list[LineEvent] = []

    # Requests

    def ask(self, request: Request) -> int:
        """Queue a request; return the ticket under which its end is reported."""
        return self._queue.add(request)

    def withdraw(self, ticket: int) -> None:
        """Remove a request that has not been written."""
        self._queue.withdraw(ticket)

    @property
    def waiting(self) -> Sequence[Request]:
        """The queued requests, next first."""
        return self._queue.requests

    # Bytes

    def receive(self, data: bytes, now: float) -> None:
        """Take received bytes."""
        self._received_at = now
        if not self._buffer:
            self._begun_at = now
        if isinstance(self._state, Flight):
            self._state.received_at = now
        if self._echo:
            before, data = self._echo.sift(data)
            self._publish_rest(before, now)
        self._buffer += data

    def wrote(self, data: bytes, now: float, whole: bool = False) -> None:
        """Note bytes that were written past the queue: a stop. `whole`: a part of them would do harm in a drive."""
        self._busy_until = now + len(data) * self._byte_time
        self._partial_until = self._busy_until if whole else float("-inf")
        if self._echo:
            self._publish_rest(self._echo.wrote(data), now)

    def not_written(self, now: float) -> None:
        """Note that the transport dropped the last Write: no drive receives any of it."""
        self._partial_until = float("-inf")
        if self._echo:
            self._publish_rest(self._echo.forget(), now)
        if isinstance(self._state, Flight):
            self._state.sent = False

    @property
    def transmitted(self) -> float:
        """Time at which the last byte written has left, calculated from the baud rate, s."""
        return self._busy_until

    def half_sent(self, now: float) -> bool:
        """Whether the drives have part of a line that would do harm if it ended here."""
        return now < self._partial_until

    # Stops

    def stop(self, now: float, *repeats: StopPiece, only: Container[str] | None = None) -> bool:
        """Fail what is queued (for `only` these addresses) and in flight; write each of `repeats` once it is quiet.

        Return whether a line was half sent.
        """
        cut_off = self._interrupted() or self._cut_off
        if isinstance(self._state, Flight):
            self._finish(self._state, Decoded(Reply(end=End.STOPPED), 0), now)
        for each in self._queue.drop(only):
            reply = Reply(end=End.STOPPED)
            self._events.append(Finished(each.ticket, each.request, reply, now, now, now, sent=False))
        if cut_off is None and not self.idle.framed:
            self._buffer = b""
        self._cut_off = cut_off
        pending = [] if only is None else self._repeats
        self._repeats = [*pending, *(each for each in repeats if each.data)]
        self._state = Recovering(now)
        return self.half_sent(now)

    def take_repeats(self) -> bytes:
        """Remove and return the stop that is still to be repeated, for a caller that cannot wait for quiet."""
        repeats, self._repeats = b"".join(each.data for each in self._repeats), []
        return repeats

    def _interrupted(self) -> CutOff | None:
        """The PR that a stop interrupts now, if its reply can be told from program output."""
        if not isinstance(self._state, Flight) or self._echo or self.idle.framed:
            return None
        request = self._state.request
        printed = request.kind is Kind.PRINT and request.expect
        return CutOff(request, len(self._buffer)) if printed else None

    # Transitions

    def events(self, now: float) -> list[LineEvent]:
        """Advance to `now`; return everything that follows."""
        while self._advance(now):
            pass
        events, self._events = self._events, []
        return events

    def _advance(self, now: float) -> bool:
        """Make one transition; return whether another may follow."""
        if isinstance(self._state, Flight):
            return self._answer(self._state, now)
        self._sort_unsolicited(now)
        if not self._has_output:
            return False
        if isinstance(self._state, Recovering):
            if now < self._quiet_at(self._state):
                return False
            self._resume()
        if self._repeats:
            self._repeat_stop(now)
            return False
        if self._awaits_tail(now):
            return False
        self._launch(now)
        return True

    def _launch(self, now: float) -> None:
        """Free to Flight: write the next request."""
        chosen = self._queue.take()
        request = chosen.request.numbered(chosen.ticket)
        data = request.codec.encode(request)
        self.wrote(data, now, whole=True)
        self._state = Flight(chosen.ticket, request, now, self._busy_until, now)
        self._events.append(Write(data, request))

    def _answer(self, flight: Flight, now: float) -> bool:
        """Flight to Free or Recovering, if the reply is whole or time is up."""
        found = self._without_echo(flight, now) if self._awaits_echo else self._decoded(flight, now)
        if found is None:
            return False
        self._finish(flight, found, now)
        return True

    def _finish(self, flight: Flight, found: Decoded, now: float) -> None:
        """End the flight with a reply."""
        weight = self._doubt.weigh(flight.request, found.reply, now)
        reply = found.reply.heard(self._buffer[: found.used], weight.doubtful)
        self._publish(now, *found.strays)
        reply = self._doubt.with_evidence(flight.request, reply)
        self._events.append(flight.finished(reply, now))
        self._buffer, self._begun_at = self._buffer[found.used :], now
        # A mark that ends the wait for another reply recovers too: an ACK may follow it.
        troubled = weight.ends_wait or reply.end in (End.TIMEOUT, End.DAMAGED)
        self._state = Recovering(now) if troubled else Free()

    def _resume(self) -> None:
        """Recovering to Free. After the pause, only numbered messages can still be told apart."""
        if not self.idle.numbered:
            self._buffer = b""
        self._cut_off = None
        self._state = Free()

    def _repeat_stop(self, now: float) -> None:
        """Free to Recovering: write one piece of the stop again."""
        data = self._repeats.pop(0).data
        self._state = Recovering(now)
        self.wrote(data, now)
        self._events.append(Write(data, None))

    # Replies

    def _decoded(self, flight: Flight, now: float) -> Decoded | None:
        """The reply, if it is whole, if quiet ends it, or if time is up."""
        codec, request = flight.request.codec, flight.request
        found = codec.decode(request, self._buffer) if self._buffer else None
        if found is None and flight.may_end_by_quiet(self._buffer) and now >= flight.quiet_at(self._buffer):
            flight.judged_quiet(self._buffer)
            found = codec.on_quiet(request, self._buffer)
        if found is None and now >= flight.timeout_at(self._buffer, self.timeout):
            found = codec.on_timeout(request, self._buffer)
        return found

    def _without_echo(self, flight: Flight, now: float) -> Decoded | None:
        """The end of a request whose bytes were not repeated unchanged: no reply can be trusted."""
        if self._echo is None or now < flight.timeout_at(self._buffer, self.timeout):
            return None
        held = self._echo.forget().decode("latin-1")
        if not held:
            return flight.request.codec.on_timeout(flight.request, b"")
        return Decoded(Reply(end=End.DAMAGED, detail=f"echo=local, but our own bytes came back as {held[:48]!r}"), 0)

    # Unsolicited lines

    def _sort_unsolicited(self, now: float) -> None:
        """Publish what came without a request."""
        if self._awaits_cut_off(now):
            return
        if self._buffer:
            self._publish_lines(now)
        if self._echo and self._echo.held and not self.idle.numbered and now >= self._received_at + TAIL:
            self._publish_rest(self._echo.forget(), now)

    def _publish_lines(self, now: float) -> None:
        """Publish whole lines, and the unterminated rest once it is overdue or too long."""
        lines, used = self.idle.parse_unsolicited(self._buffer)
        self._publish(now, *lines)
        if used:
            self._buffer, self._begun_at = self._buffer[used:], now
        if self.idle.numbered:
            return
        if self._buffer and (not self._awaits_tail(now) or len(self._buffer) > LONGEST_TAIL):
            self._publish_rest(self._buffer, now)
            self._buffer = b""

    def _publish_rest(self, data: bytes, now: float) -> None:
        """Publish unsolicited bytes, the unterminated rest included."""
        lines, used = self.idle.parse_unsolicited(data)
        rest = data[used:].hex(" ") if self.idle.framed else data[used:].decode("latin-1").strip("\r\n>?")
        self._publish(now, *lines, rest)

    def _publish(self, now: float, *lines: str) -> None:
        self._events += [Unsolicited(now, text) for text in lines if text]
        self._doubt.stray(lines)

    def _awaits_cut_off(self, now: float) -> bool:
        """Whether the rest of an interrupted reply is still awaited; remove it once it is whole or overdue."""
        if self._cut_off is None or not (self._buffer or self._echo):
            return False
        request, received = self._cut_off.request, self._cut_off.received
        found = request.codec.decode(request, self._buffer)
        if found is None and self._awaits_tail(now):
            return True
        self._cut_off = None
        if found is not None:
            self._publish(now, *found.strays)
        self._buffer = self._buffer[found.used if found is not None else received :]
        return False

    # Times

    @property
    def deadline(self) -> float | None:
        """Time of the next internal event; None if only new input can cause one."""
        times: list[float] = []
        if isinstance(self._state, Flight):
            times.append(self._state.timeout_at(self._buffer, self.timeout))
            if not self._awaits_echo and self._state.may_end_by_quiet(self._buffer):
                times.append(self._state.quiet_at(self._buffer))
            return min(times)
        if (tail := self._tail_at()) is not None:
            times.append(tail)
        if isinstance(self._state, Recovering) and self._has_output:
            times.append(self._quiet_at(self._state))
        return min(times, default=None)

    @property
    def _has_output(self) -> bool:
        return bool(self._queue or self._repeats)

    @property
    def _awaits_echo(self) -> bool:
        return self._echo is not None and self._echo.awaited

    def _quiet_at(self, trouble: Recovering) -> float:
        """Time at which the wire has been quiet long enough, or is given up on."""
        since = max(self._busy_until, trouble.since)
        quiet = self._repeats[0].quiet if self._repeats else QUIET
        return min(max(self._received_at, since) + quiet, since + NEVER_QUIET)

    def _awaits_tail(self, now: float) -> bool:
        """Whether an unsolicited line may still be arriving."""
        tail = self._tail_at()
        return tail is not None and now < tail

    def _tail_at(self) -> float | None:
        """Time at which an unterminated line is published; None if there is none.

        A program that prints without ever ending a line does not keep the wire to itself.
        """
        held = self._echo is not None and self._echo.held
        if self.idle.numbered or not (self._buffer or held):
            return None
        quiet = self._received_at + TAIL
        return quiet if held else min(quiet, self._begun_at + NEVER_QUIET)
