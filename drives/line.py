"""One half-duplex wire as a state machine: bytes and times in, events out. It has no clock and no event loop.

Theory of operation. The line is in one of three states: None (nothing in flight), `Flight` (a request in flight), or
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

import re
from bisect import insort
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from multidrop.dialects import Codec, Decoded, End, Kind, Priority, Reply, Request, StopPiece
from multidrop.dialects.codec import copy_with
from multidrop.drives.echoes import LocalEcho
from multidrop.drives.events import Transaction, Unsolicited
from multidrop.drives.inbox import LONGEST_WAIT_FOR_QUIET, TAIL, Doubt, Inbox

DEFAULT_TIMEOUT = 1.0
"""Longest wait for a reply after the last byte, s, unless a URL gives `timeout`."""
CHATTER = 4.0
"""Longest wait for a reply, in timeouts, while a running program keeps the wire busy."""
LONGEST_LIST = 60.0
"""Longest time for a listing, s: 28 kB at 4800 baud."""


class Finished(NamedTuple):
    """The end of a request, and the ticket under which it was queued."""

    ticket: int
    transaction: Transaction

    @property
    def request(self) -> Request:
        return self.transaction.request

    @property
    def reply(self) -> Reply:
        return self.transaction.reply


@dataclass
class Flight:
    """The request that the line waits for. Times are seconds."""

    ticket: int
    request: Request
    sent_at: float
    transmitted_at: float
    received_at: float
    """When the last byte came; before the first, when the request was written."""
    sent: bool = True
    judged_length: int = -1
    """Length of the bytes about which quiet was consulted last."""
    due: tuple[float, float] | None = None
    """What `times` has found with the bytes received so far; None until they are asked for."""

    def times(self, buffer: bytes, default: float) -> tuple[float, float]:
        """Times at which quiet ends a reply without an end of its own, and at which the request times out.

        `default`: the line's timeout, s.
        """
        if self.due is not None:
            return self.due
        patience, own = self.request.codec.quiet_time(self.request, buffer), self.request.timeout
        slow = default - DEFAULT_TIMEOUT
        if slow > 0 and own is not None and self.request.signed:
            # The request has a timeout of its own. On a line with a longer one than usual it gets that much more time.
            # So does its quiet time, until the print that bears its signature has come.
            own += slow
            if not re.search(self.request.expect or "", buffer.decode("latin-1")):
                patience += slow
        since = max(self.received_at, self.transmitted_at)
        quiet = since + patience
        if self.request.kind is Kind.COMMAND:
            # A command prints nothing, so a program that prints without a pause does not delay it.
            quiet = min(quiet, self.transmitted_at + max(2 * patience, LONGEST_WAIT_FOR_QUIET))
        timeout = max(default if own is None else own, patience)
        longest = self.transmitted_at + (LONGEST_LIST if self.request.kind is Kind.LIST else CHATTER * timeout)
        if not buffer.endswith(b"\n"):  # not in the middle of a program's line
            longest = max(longest, min(self.received_at + TAIL, longest + LONGEST_WAIT_FOR_QUIET))
        self.due = quiet, min(since + timeout, longest)
        return self.due


class QueuedRequest(NamedTuple):
    """A queued request and its ticket, by which its end is reported. The least is next; no two tickets are equal."""

    priority: Priority
    ticket: int
    request: Request


RECOVERY_QUIET = 0.1
"""Quiet time after which a recovering line is written to again, s."""
MOST_HELD_UP_QUIETS = 4
"""Longest time for which further stops hold up a piece of the first one, in quiet times of that piece."""


class Write(NamedTuple):
    """Bytes to write now. `request` is what they carry, None for a repeated stop."""

    data: bytes
    request: Request | None


class EchoFound(NamedTuple):
    """The adapter repeats what it sends: our own bytes are removed from now on."""


LineEvent = Write | Finished | Unsolicited | EchoFound


@dataclass(frozen=True)
class Recovering:
    """Trouble at this time: nothing is written until the wire has been quiet."""

    since: float
    held_up_since: float = float("inf")
    """When the wait of the next piece of a stop began, if further stops have interrupted that wait."""


State = Flight | Recovering | None
"""None: nothing is in flight, and the next request may be written."""


class Line:
    """The wire. Call `events` after every other call, and when `deadline` has come."""

    def __init__(
        self, codec: Codec, *, baud: int = 0, local_echo: bool = False, timeout: float = DEFAULT_TIMEOUT
    ) -> None:
        self.timeout = timeout
        self.inbox = Inbox(codec, local_echo, self._publish, lambda: self._events.append(EchoFound()))
        self.transmitted_at = float("-inf")
        """Time at which the last byte written has been sent on the wire, calculated from the baud rate, s."""
        self.baud = baud
        """The baud rate of the port; 0 where it is not known."""
        self.byte_time = 10.0 / baud if baud else 0.0
        """The time of a byte on the wire, s; 0: it takes none."""
        self.unasked = 0
        """Number of times that bytes came which no request asked for."""
        self.printed_at = float("-inf")
        """Time of the last bytes that no request asked for."""
        self._queue: list[QueuedRequest] = []
        """What waits for the wire: by priority, then in order."""
        self._tickets = 0
        self._poll_passed_over = False
        self._nak_of = ""
        """The drive of the last reply, if that was a NAK: it is asked why before another drive's ACK can come."""
        self._state: State = None
        self._doubt = Doubt()
        self._repeats: list[StopPiece] = []
        """Pieces of the last stop that are still to be repeated."""
        self._offered: tuple[StopPiece, int] | None = None
        """The piece that the last Write carries, and the number of stops then, until the transport has accepted it."""
        self._stops = 0
        self.last_write_was_stop = False
        """What was written last is a stop or a piece of one, so nothing else can be on the wire behind it."""
        self.stops_all = False
        """The last stop is for the whole line. One for some drives holds up none that is."""
        self._partial_until = float("-inf")
        """Until then the drives have part of a line that would do harm if it ended there."""
        self.overtaken = False
        """Another thread has written a stop: what comes may be the reply to it. `stop` follows, or `cut_off`."""
        self._events: list[LineEvent] = []

    # Requests

    def ask(self, request: Request) -> int:
        """Queue a request; return the ticket under which its end is reported."""
        self._tickets += 1
        insort(self._queue, QueuedRequest(request.priority, self._tickets, request))
        return self._tickets

    def withdraw(self, ticket: int) -> bool:
        """Remove a request that has not been written; whether it was one."""
        queued, self._queue = len(self._queue), [each for each in self._queue if each.ticket != ticket]
        kept_back = isinstance(self._state, Flight) and self._state.ticket == ticket and not self._state.sent
        return kept_back or len(self._queue) < queued

    @property
    def waiting(self) -> Sequence[Request]:
        return [queued.request for queued in self._queue]

    # Bytes

    def receive(self, data: bytes, now: float) -> None:
        if isinstance(self._state, Flight):
            self._state.received_at, self._state.due = now, None
        else:
            self.printed_at = now
            self.unasked += 1
        self.inbox.receive(data, now)

    def note_written(self, data: bytes, now: float, whole: bool = False, codec: Codec | None = None) -> None:
        """Note bytes that are written. `codec`: that of a request; None: they are a stop, or go past the queue.

        `whole`: a drive that receives only the beginning of them may do harm; see `half_sent`.
        """
        self.transmitted_at = now + len(data) * self.byte_time
        self._partial_until = self.transmitted_at if whole else float("-inf")
        self.inbox.note_written(data, now, codec)

    def not_written(self, now: float) -> None:
        """Note that the transport dropped the last Write: no drive receives any of it."""
        self._partial_until = float("-inf")
        self.inbox.note_written(b"", now)
        if isinstance(self._state, Flight):
            self._state.sent = False
        self.put_back()

    def accepted(self) -> None:
        """Note that the transport has accepted the last Write."""
        self._offered = None

    def put_back(self) -> None:
        """Note that the transport has not accepted the piece of a stop in the last Write: it is the next again."""
        if self._offered is None:
            return
        (piece, stops), self._offered = self._offered, None
        if stops != self._stops and piece in self._repeats:  # a stop that came meanwhile has it at the end
            del self._repeats[len(self._repeats) - 1 - self._repeats[::-1].index(piece)]
        self._repeats.insert(0, piece)

    def put_first(self, piece: StopPiece) -> None:
        """Write a piece of a stop before all others that are still to be repeated."""
        self._repeats.insert(0, piece)

    def owed_pieces(self) -> list[StopPiece]:
        """The pieces of the last stop that no transport has accepted yet, in their order. From any thread."""
        offered = self._offered
        return [*((offered[0],) if offered is not None else ()), *self._repeats]

    def half_sent(self, now: float) -> bool:
        """Whether the drives have part of a line that would do harm if it ended here."""
        return now < self._partial_until

    # Stops

    def stop(
        self, now: float, *repeats: StopPiece, only: Container[str] | None = None, since: float | None = None
    ) -> None:
        """Fail what is queued (for `only` these addresses) and in flight; write each of `repeats` once it is quiet.

        Pieces of the last stop that are not written yet go first, so that each drive has its turn. `since`: another
        thread has begun this stop and wrote its last piece at that time; `repeats` is what is left, as for `went_on`.
        """
        if only is None and not self.stops_all:
            self._repeats = []  # those of some drives: they are in this stop, in its own order
        self.stops_all = only is None or (self.stops_all and self.last_write_was_stop and self.stopping)
        self.overtaken, self.last_write_was_stop = False, True
        self._stops += 1
        flight = self._state if isinstance(self._state, Flight) else None
        if flight is not None:
            self._finish(flight, Decoded(Reply(end=End.STOPPED), 0), now)
        dropped, self._queue = self._queue, []
        if only is not None:
            self._queue = [queued for queued in dropped if queued.request.address not in only]
            dropped = [queued for queued in dropped if queued.request.address in only]
        for queued in dropped:
            ended = Transaction(queued.request, Reply(end=End.STOPPED), now, now, now, sent=False)
            self._events.append(Finished(queued.ticket, ended))
        self.inbox.stop(flight.request if flight is not None else None)
        added = [repeat for repeat in repeats if repeat.data]
        if since is not None:
            return self.went_on(added, since)
        waited, _ = divided(self._repeats)
        self._repeats = merged(self._repeats, added, keep=only is not None)
        held_up = float("inf")
        if waited and self._repeats[0] in waited and isinstance(self._state, Recovering):
            held_up = min(self._state.held_up_since, self._state.since)  # further stops interrupt the wait of the piece
        self._state = Recovering(now, held_up)

    def went_on(self, repeats: Sequence[StopPiece], since: float) -> None:
        """Note that another thread has gone on with the last stop; `repeats` is what it has left to write.

        `since`: the time of its last write.
        """
        self.overtaken = False
        self._repeats, self._state = [*repeats], Recovering(since)

    def cut_off(self, now: float, begun: bool) -> Flight | None:
        """Note that the wire broke: forget what is queued. Return the flight that this ended.

        `begun`: the drives may hold a part of a line that does harm if it ends there. A reply to the flight may still
        come, once the wire is whole again.
        """
        self.overtaken = False
        flight = self._state if isinstance(self._state, Flight) else None
        if flight is not None:
            self._doubt.weigh(flight.request, Reply(end=End.STOPPED), now, self.inbox.buffer)
            self.inbox.forget()
        self.inbox.cut_off(now)
        self._queue = []
        self._repeats = []
        self._offered, self.last_write_was_stop = None, False
        self._partial_until = float("inf") if begun else float("-inf")
        self._state = Recovering(now)
        return flight

    @property
    def stopping(self) -> bool:
        """Whether pieces of a stop are still to be written."""
        return bool(self._repeats)

    def take_repeats(self) -> bytes:
        """Remove and return the stop that is still to be repeated, for a caller that cannot wait for quiet."""
        repeats, self._repeats = b"".join(repeat.data for repeat in self._repeats), []
        return repeats

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
            flight = self._state
            echo = self.inbox.echo
            decoded = self._without_echo(flight, echo, now) if echo and echo.own else self._decoded(flight, now)
            if decoded is not None:
                self._finish(flight, decoded, now)
            return decoded is not None
        self.inbox.sort(now)
        if not (self._queue or self._repeats):
            return False
        if isinstance(self._state, Recovering):
            if now < self._quiet_at(self._state):
                return False
            self.inbox.resume()
            self._state = None
        if self._repeats:  # one piece of the stop
            piece = self._repeats.pop(0)
            self._offered = piece, self._stops
            self._state = Recovering(now)
            self.note_written(piece.data, now, whole=not self.stops_all)
            self._events.append(Write(piece.data, None))
            return False
        if self.inbox.awaits_tail(now):
            return False
        self._launch(now)
        return bool(self.inbox.buffer)

    def _launch(self, now: float) -> None:
        """Write the next request. A poll passed over once goes first, or typing would blind a plot."""
        poll_waits, at = self._queue[-1].priority is Priority.POLL, 0
        if poll_waits and self._poll_passed_over:
            at = next(at for at, queued in enumerate(self._queue) if queued.priority is Priority.POLL)
        if self._nak_of:
            at = next((at for at, queued in enumerate(self._queue) if queued.request.address == self._nak_of), at)
        priority, ticket, request = self._queue.pop(at)
        self._poll_passed_over = poll_waits and priority is not Priority.POLL
        request = copy_with(request, tag=ticket)
        data = request.codec.encode(request)
        self.last_write_was_stop = False
        self.note_written(data, now, whole=True, codec=request.codec)
        self._state = Flight(ticket, request, now, self.transmitted_at, now)
        self._events.append(Write(data, request))

    def _finish(self, flight: Flight, found: Decoded, now: float) -> None:
        if found.strays:  # first: a proof forgets which replies are outstanding
            self._publish(now, found.strays)
        heard = self.inbox.buffer
        if found.reply.end in (End.TIMEOUT, End.DAMAGED):  # what came may be the late reply to a doubtful one
            self._doubt.stray(flight.request.codec.parse_unsolicited(heard)[0])
        weight = self._doubt.weigh(flight.request, found.reply, now, heard)
        took = now - flight.transmitted_at
        reply = copy_with(found.reply, raw=heard[: found.used], doubtful=weight.doubtful, took=took, at=now)
        reply = self._doubt.with_evidence(flight.request, reply)
        ended = Transaction(flight.request, reply, flight.sent_at, now, flight.transmitted_at, flight.sent)
        self._events.append(Finished(flight.ticket, ended))
        self.inbox.consume(found.used, now)
        self.unasked += bool(found.strays or self.inbox.buffer)
        self._nak_of = flight.request.address if reply.end is End.NAK else ""
        # A mark that ends the wait for another reply recovers too: an ACK may follow it. After a NAK others wait.
        troubled = weight.ends_wait or reply.end in (End.TIMEOUT, End.DAMAGED) or bool(self._nak_of and self._queue)
        self._state = Recovering(now) if troubled else None

    # Replies

    def _decoded(self, flight: Flight, now: float) -> Decoded | None:
        """The reply, if it is whole, if quiet ends it, or if time is up."""
        codec, request = flight.request.codec, flight.request
        if now >= min(flight.times(self.inbox.buffer, self.timeout)):
            self.inbox.notice_echo(b"", now, over=True)
        buffer = self.inbox.buffer
        if not self._takes_reply(flight):
            return codec.on_timeout(request, b"") if now >= flight.times(buffer, self.timeout)[1] else None
        decoded = codec.decode(request, buffer) if buffer else None
        if decoded is not None:
            return decoded
        quiet, timeout = flight.times(buffer, self.timeout)
        if flight.judged_length != len(buffer) and now >= quiet:
            flight.judged_length = len(buffer)
            decoded = codec.on_quiet(request, buffer)
        if decoded is None and now >= timeout:
            return codec.on_timeout(request, buffer)
        return decoded

    def _takes_reply(self, flight: Flight) -> bool:
        """Whether what comes is the reply to it: not if a stop of another thread kept it back, or has left since."""
        return flight.sent and not self.overtaken

    def _without_echo(self, flight: Flight, echo: LocalEcho, now: float) -> Decoded | None:
        """The end of a request whose bytes were not repeated unchanged: no reply can be trusted."""
        if now < flight.times(self.inbox.buffer, self.timeout)[1]:
            return None
        held = echo.forget().decode("latin-1")
        self.inbox.doubt_echo()
        if not held:
            return flight.request.codec.on_timeout(flight.request, b"")
        return Decoded(Reply(end=End.DAMAGED, detail=f"echo=local, but our own bytes came back as {held[:48]!r}"), 0)

    def _publish(self, now: float, lines: Iterable[str]) -> None:
        """Publish unsolicited lines. They are evidence against a doubtful reply."""
        if lines := tuple(filter(None, lines)):
            if shown := self._doubt.without_late(lines):
                self._events.append(Unsolicited(now, shown))
                self.printed_at = now
            self._doubt.stray(lines)

    # Times

    @property
    def deadline(self) -> float | None:
        """Time of the next internal event; None if only new input can cause one."""
        if isinstance(self._state, Flight):
            flight, echo = self._state, self.inbox.echo
            quiet, timeout = flight.due or flight.times(self.inbox.buffer, self.timeout)
            if flight.judged_length == len(self.inbox.buffer) or (echo and echo.own):
                return timeout
            return min(timeout, quiet) if self._takes_reply(flight) else timeout
        tail = self.inbox.tail_at()
        if not (isinstance(self._state, Recovering) and (self._queue or self._repeats)):
            return tail
        quiet = self._quiet_at(self._state)
        return quiet if tail is None else min(tail, quiet)

    def _quiet_at(self, trouble: Recovering) -> float:
        """Time at which the wire has been quiet long enough, or is given up on."""
        since = max(self.transmitted_at, trouble.since)
        quiet = self._repeats[0].quiet if self._repeats else RECOVERY_QUIET
        quiet_at = min(max(self.inbox.received_at, since) + quiet, since + LONGEST_WAIT_FOR_QUIET)
        if not self._repeats:
            return max(quiet_at, self.inbox.tail_at() or quiet_at)  # not in the middle of a program's line
        # A stop key that is held down must not keep the stop from the drives that get it piece by piece.
        return min(quiet_at, max(self.transmitted_at, trouble.held_up_since + MOST_HELD_UP_QUIETS * quiet))


LONG_QUIET = 0.5
"""A piece of a stop with a longer quiet time begins its repetition: every drive has been sent a stop before it, s."""


def merged(pending: Sequence[StopPiece], added: Sequence[StopPiece], keep: bool = False) -> list[StopPiece]:
    """The pieces of a stop behind those of the one before that are not written yet, each once.

    So stops in quick succession go round, and do not begin with the first drive each time. `keep`: the new stop is for
    some drives alone, and the pieces for others stay.
    """
    if not pending:
        return [*added]
    before, again = divided(pending)
    soon, late = divided(added)
    first = [piece for piece in before if _taken_from(soon, piece) or keep]
    rest = [piece for piece in again if piece not in late] if keep else []
    return [*first, *soon, *rest, *late]


def divided(pieces: Sequence[StopPiece]) -> tuple[list[StopPiece], list[StopPiece]]:
    """Pieces before and behind the pause of a stop."""
    for at, piece in enumerate(pieces):
        if piece.quiet > LONG_QUIET:
            return [*pieces[:at]], [*pieces[at:]]
    return [*pieces], []


def _taken_from(added: list[StopPiece], piece: StopPiece) -> bool:
    """Remove a piece from a new stop; return whether it was in it."""
    if piece not in added:
        return False
    added.remove(piece)
    return True
