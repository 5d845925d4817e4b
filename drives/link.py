"""A link: a line, its transport and the event loop. The one owner of a port; it knows requests and no drives.

It writes what the line says, hands it what is received, and publishes everything to its watchers.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import inf, nextafter
from typing import Any

from multidrop.base.errors import TransportLost
from multidrop.base.isolation import isolated
from multidrop.dialects import End, Kind, Priority, Request, StopPiece
from multidrop.drives import events
from multidrop.drives.echoes import TERMINATORS, FirstBytes
from multidrop.drives.inbox import Debris, Leftovers
from multidrop.drives.line import EchoFound, Finished, Line, Write, divided
from multidrop.drives.port_journal import GLOBAL, Departure, Keeper
from multidrop.transports import Transport
from multidrop.transports.pipe import running_loop

OnAnswer = Callable[[events.Transaction | TransportLost], None]
"""Called with the end of a request that was queued, in the turn of the event loop in which it ends."""


LATE_TIMER = 0.01
"""A timer that is later than this, s, was held up with the loop: what the wire has delivered meanwhile comes first."""
ECHO = "the adapter repeats what it sends: our own bytes are removed for this session, as with echo=local"
UNASKED = 10.0
"""Time between two notices of what came without a question, s: another host may ask all the time."""
UNLIKE_A_DRIVE = (
    "no drive sends that by itself: another program uses this line, an adapter repeats, or a reply was late"
)
AS_GREETING = "not taken for a drive's output: it may be a gateway's greeting, or another program uses this line"
GREETING = 2.0
"""Time after a connection in which a gateway may greet, s; later, what comes is a drive's."""
LONGEST_HEARD = 60
"""Most characters shown of a reply that was destroyed."""


class LostInFlight(TransportLost):
    """The pipe broke after a request was written and before its reply came."""


class Reserved(TransportLost):
    """A person has the line: the requests of others are refused."""


class Link:
    """An open line. Its methods are called from the event loop's thread.

    A link whose transport broke is `lost`. `resume` gives it another transport; from then until `resumed` it passes
    the requests of those who look for its drives, and no others.
    """

    def __init__(self, name: str, transport: Transport, line: Line, keeper: Keeper) -> None:
        self.name = name
        self.transport = transport
        self.line = line
        self.lost: TransportLost | None = None
        """The loss of the transport, while nothing can be written; None while it works."""
        self._held: TransportLost | None = None
        """The loss after which the drives are not found again yet."""
        self.reserved: Reserved | None = None
        """A person writes bytes of his own (`write_raw`), and requests are refused; None: they pass."""
        self.unheard = True
        """Nothing was ever received."""
        self.stops = 0
        """Number of stops written so far, of any kind."""
        self.on_unsolicited: Callable[[Sequence[str]], None] = lambda lines: None
        """Called with unsolicited lines, debris included, before they are published."""
        self.on_unasked: Callable[[], None] = lambda: None
        """Called when bytes came that no request asked for."""
        self.on_echo: Callable[[], None] = lambda: self.notify(ECHO)
        """Called once it is found that the adapter repeats what it sends."""
        self.departure = Departure(keeper)
        """The note on the command that is on its way."""
        self._keeper = keeper
        self.debris, self.heard = Debris(), FirstBytes()
        self.leftovers = Leftovers()
        self._counted = 0
        self._came_unasked, self._unasked_said, self._opened_at = 0, -inf, -inf
        self._orderly = False
        """The port was still open when it was shut."""
        self._rest: list[StopPiece] = []
        """What was still to be written of a stop then."""
        self._loop = running_loop()
        self._stamped = -inf
        self._waiting: dict[int, OnAnswer] = {}
        self._advancing = self._further = False
        self._news = events.EventQueue(name)
        self._timer: asyncio.TimerHandle | None = None
        self._answering = isolated(f"a conversation on {name}")

    def now(self) -> float:
        """The time on the event loop's clock, s."""
        return self._loop.time()

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Have the event loop call back; from any thread."""
        self._loop.call_soon_threadsafe(callback)

    def watch(self, callback: Callable[[Any], None], *kinds: type) -> Callable[[], None]:
        """Call back with every event of these kinds; see `Publisher.subscribe`."""
        return self._news.subscribe(callback, *kinds)

    def publish(self, event: events.BusEvent) -> None:
        self._news.publish(event)

    def start(self) -> None:
        self._opened_at = self.now()
        self.leftovers.opened(self._opened_at)
        self.transport.start(self._received, self._broke)

    @property
    def away(self) -> TransportLost | None:
        """The reason why requests are refused; None while they pass."""
        return self._held or self.lost or self.reserved

    @property
    def loss(self) -> TransportLost | None:
        """The loss of the transport, until the drives are found again; None otherwise."""
        return None if isinstance(self.away, Reserved) else self.away

    @property
    def cut(self) -> str:
        """The command that was on its way as the transport broke; the drives may hold a part of it."""
        return self.departure.under_way

    def stamp(self) -> float:
        """The time now, s; always later than the stamp before, so that stops and starts have an order."""
        self._stamped = max(self.now(), nextafter(self._stamped, inf))
        return self._stamped

    def resume(self, transport: Transport) -> None:
        self.line.overtaken = False  # a stop that met the loss went to the old transport
        self.transport, self.lost = transport, None
        self.start()

    def resumed(self) -> None:
        """Pass all requests again: the drives are found again. Raises TransportLost if it broke meanwhile."""
        if self.lost:
            raise self.lost.again()
        self._held = None

    # Events

    def notify(self, text: str, address: str = "", warning: bool = False, rested: events.Rested | None = None) -> None:
        self.publish(events.Notice(self.now(), text, address, warning, rested))

    # Requests

    def submit(self, request: Request, on_answer: OnAnswer, searching: bool = False) -> int:
        """Queue a request; return its ticket. `advance` must follow. Raises TransportLost.

        `searching`: it is part of the search for the drives of a link that was lost.
        """
        if refusal := self.lost if searching else self.away:
            raise refusal.again()
        ticket = self.line.ask(request)
        self._waiting[ticket] = on_answer
        return ticket

    def withdraw(self, ticket: int) -> bool:
        """Call back no more, and remove the request if it has not been written; whether it was not."""
        return self._waiting.pop(ticket, None) is not None and self.line.withdraw(ticket)

    def write_raw(self, data: bytes) -> bool:
        """Write a person's own bytes past the queue, once; False where a stop went first. Raises TransportLost.

        Until their end has left, they are on record as a command that may be cut off; without a terminator until more
        come.
        """
        if loss := self.loss:
            raise loss
        now, self.line.last_write_was_stop = self.now(), False
        if not self.transport.write(data):
            return False
        text = data.decode("latin-1")

        def left() -> None:  # unless others were written since or the port broke
            if self.departure.under_way == text and not self.lost:
                self.departure.arrived()

        self.departure.begins(text)
        self.line.note_written(data, now, whole=True)
        if data.endswith(TERMINATORS):
            self._loop.call_at(self.line.transmitted_at, left)
        self.publish(events.Traffic(now, True, data))
        self.advance()
        return True

    # The wire

    def advance(self) -> None:
        """Do what the line says, and return when it has more to say.

        A stop and the next poll are written before the last reply is published, so the wire is not idle meanwhile.
        Any other request is written after that, because a watcher may stop it.
        Called from within, by a watcher or by the next step of a conversation, it leaves that to the call under way.
        """
        self._further = True
        if self._advancing:
            return
        self._advancing = self._news.held = True
        try:
            while self._further:
                self._further, stops, now = False, self.stops, self.now()
                news = self.line.events(now)
                self._note_unasked(now)
                for event in news:
                    if isinstance(event, Write):
                        if event.request is not None and event.request.priority is not Priority.POLL:
                            self._news.tell()
                        if stops == self.stops:
                            self._write(event, now)
                        else:  # a watcher has stopped it meanwhile
                            self.line.put_back()
                    elif isinstance(event, Finished):
                        self._finished(event)
                    elif isinstance(event, EchoFound):
                        self.on_echo()
                    else:
                        self._unsolicited(event, now)
        finally:
            self._advancing = self._news.held = False
        if (deadline := self.line.deadline) is not None and not self.lost:
            if self._timer is not None and self._timer.when() > deadline:
                self._sleep()
            if self._timer is None:  # one that fires too early costs less than many timers
                self._timer = self._loop.call_at(deadline, self._wake, deadline)
        self._news.tell()

    def _note_unasked(self, now: float) -> None:
        """Tell of bytes that no request asked for, before the end of a request that may be blamed for them."""
        before, self._counted = self._counted, self.line.unasked
        if self._counted != before and not self.debris.may_come(now):
            self.on_unasked()

    @contextmanager
    def received(self) -> Iterator[bytearray]:
        """Gather what is received meanwhile."""
        heard = bytearray()

        def take(event: events.BusEvent) -> None:
            if isinstance(event, events.Traffic) and not event.outgoing:
                heard.extend(event.data)

        leave = self.watch(take)
        try:
            yield heard
        finally:
            leave()

    def _wake(self, due: float) -> None:
        self._timer = None
        if self.now() - due > LATE_TIMER:  # a pipe delivers in the next turn
            self._loop.call_soon(self.advance)
        else:
            self.advance()

    def _sleep(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _received(self, data: bytes) -> None:
        now, self.unheard = self.now(), False
        self._news.collect(events.Traffic(now, False, data))
        self.heard.received(data)
        self.line.receive(data, now)
        self.advance()

    def _write(self, event: Write, now: float) -> None:
        data, request = event
        if not self.transport.write(data):  # broken, or a stop of another thread has gone first
            self.line.not_written(now)
            return
        self.line.accepted()
        self.heard.note_written(data)
        if request is None:
            self.debris.stop_written(b"", self.line.transmitted_at)
            self.publish(events.Traffic(now, True, data, stop=True))
            return
        # A program's lines are stored and do nothing; a part of a setting or of a question moves nothing.
        if request.kind is Kind.COMMAND or request.address in GLOBAL:
            self.departure.begins(f"{request.address}{request.text}")
        self.debris.request_written(data, request, now)
        # The trace of a lone drive repeats lines that were sent to be stored, but no question of multidrop's.
        if request.address or request.signed:
            self.leftovers.request_written(data, now)
        self.publish(events.Sent(now, request))
        self.publish(events.Traffic(now, True, data))

    def _finished(self, event: Finished) -> None:
        transaction = event.transaction
        if transaction.reply.raw:
            self.leftovers.recovering = False
        if transaction.sent and transaction.reply.end is not End.STOPPED:
            self.departure.arrived()
        if transaction.reply.end is End.DAMAGED:  # by a sign-on, perhaps
            self.on_unsolicited(transaction.reply.raw.decode("latin-1").splitlines())
        self.publish(events.Ended(transaction.ended_at, transaction))
        if transaction.reply.collided:
            self.notify(_destroyed(transaction), transaction.request.address, warning=True)
        if (on_answer := self._waiting.pop(event.ticket, None)) is not None:
            with self._answering:
                on_answer(transaction)

    def _unsolicited(self, event: events.Unsolicited, now: float) -> None:
        self.on_unsolicited(event.lines)
        if lines := self.debris.removed(event.lines, self.line.inbox.codec.stop_debris, now):
            codec = self.line.inbox.codec
            if damaged := [line for line in lines if codec.damaged(line)]:
                self.notify(f"a printed line was damaged on the line (received {_short(damaged)})", warning=True)
                lines = tuple(line for line in lines if line not in damaged)
        if unasked := [line for line in lines if not self.line.inbox.codec.printed(line)]:
            lines = tuple(line for line in lines if line not in unasked)
            self._unasked(unasked, now, "without a question", UNLIKE_A_DRIVE)
        lines, left = self.leftovers.divided(lines, self.line.inbox.codec.answers_host, now)
        if left:
            self.notify(f"left by a session before, not printed by a program: {_short(left)}", warning=True)
        if lines:
            unproved = not self.heard.answered or self._held is not None
            greeting = self.transport.network and unproved and now < self._opened_at + GREETING
            if greeting:
                self._unasked(lines, now, "before a drive replied", AS_GREETING)
            self.publish(events.Unsolicited(event.at, lines, greeting))

    def _unasked(self, lines: Sequence[str], now: float, how: str, why: str) -> None:
        """Say, not too often, what came and is not taken for a drive's output."""
        self._came_unasked += len(lines)
        if now < self._unasked_said + UNASKED:
            return
        more = f" ({self._came_unasked} in all)" if self._came_unasked > len(lines) else ""
        self._unasked_said = now
        self.notify(f"received {how}{more}: {_short(lines)}; {why}", warning=True)

    # The end

    async def detach(self, why: TransportLost) -> None:
        """Close the port for a while, as a loss that nobody is told of; `resume` gives the link another transport."""
        self._held = self._held or why
        self._lose(why)
        self.advance()
        self.publish(events.Changed(self.now()))
        await self.transport.close()

    def _broke(self, error: TransportLost) -> None:
        if self.lost:
            return
        known, self._held = self._held, self._held or error
        self._lose(error)
        self.advance()
        if known is None:
            self.publish(events.Lost(self.now(), error))
            self.publish(events.Changed(self.now()))

    def _lose(self, error: TransportLost) -> None:
        """Fail what waits; who waits for a reply learns that its request was written."""
        self.lost = error
        self._sleep()
        flight = self.line.cut_off(self.now(), begun=bool(self.cut))
        in_flight = flight.ticket if flight is not None and flight.sent else None
        waiting, self._waiting = self._waiting, {}
        for ticket, on_answer in waiting.items():
            with self._answering:
                on_answer(LostInFlight(str(error)) if ticket == in_flight else error.again())

    def shut(self) -> None:
        """Write the stop that is still to be repeated, and fail what waits, so that every conversation ends.

        Where drives reply to a stop, `close` writes it, piece by piece.
        """
        self._orderly = not self.lost
        if self._orderly and self.line.inbox.codec.stop_replies:
            self._rest = self.line.owed_pieces()
        elif self._orderly and (repeats := self.line.take_repeats()):
            with isolated(f"the stop of {self.name}"):
                self.transport.write(repeats)
        self._lose(self.lost or TransportLost(f"{self.transport.name} is closed"))

    async def close(self) -> None:
        """Write the rest of a stop, up to its repetition after a pause, and close the port. Call `shut` first."""
        self._sleep()
        for piece in divided(self._rest)[0]:
            due = self.line.transmitted_at + piece.quiet + len(piece.data) * self.line.byte_time
            await asyncio.sleep(max(0.0, due - self.now()))
            with isolated(f"the stop of {self.name}"):
                self.transport.write(piece.data)
                self.line.note_written(piece.data, self.now())
        await self.transport.close()
        if self._orderly:
            self.departure.arrived()
        self._keeper.close()


def _destroyed(transaction: events.Transaction) -> str:
    """Say what was damaged in the time of a request, and may have been a print."""
    request, reply = transaction.request, transaction.reply
    asked = "a poll" if request.is_poll else f"'{request.text}'"
    whose = f" of {request.address}" if request.address else ""
    text = f"beside {asked}{whose} something was damaged on the line: printed lines may be lost"
    return f"{text} (received {_short(reply.collided)})"


def _short(lines: Sequence[str]) -> str:
    text = " ".join(lines)
    return repr(text if len(text) <= LONGEST_HEARD else text[:LONGEST_HEARD] + "...")
