"""Conversations with drives on a link: one at a time with each drive; those with several drives take turns.

A conversation (`Procedure`) is a generator that a dialect writes: it yields requests and is sent replies or errors. A
reply steps its conversation at once, in the turn of the event loop that read it: the next request follows without a
task or a future in between. A stop or a cancellation is thrown into the conversation, which may then clean up; nothing
interrupts that.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Generic, TypeVar
from weakref import WeakKeyDictionary

from multidrop.base.errors import Inexpressible, NoAnswer, Refused, Stopped, TransportLost
from multidrop.dialects import DriveState, End, Kind, Owed, Procedure, Request
from multidrop.drives.events import Concluded, ConversationOutcome, Transaction, Witnesses
from multidrop.drives.link import Link, LostInFlight
from multidrop.drives.port_journal import GLOBAL, Keeper
from multidrop.drives.silence import explained

T = TypeVar("T")
A = TypeVar("A")
OnEnded = Callable[[Transaction], None]
"""Called with each transaction of a conversation once it has ended."""
ASKING = {Kind.PRINT, Kind.LIST, Kind.QUIET}
"""Requests that only ask and move nothing."""


OnOver = Callable[[ConversationOutcome[T]], None]
"""Called once with the outcome of a conversation, in the turn of the event loop in which it ends."""


class Conversations:
    """The conversations of one link, and the stops that ended them."""

    def __init__(self, link: Link, keeper: Keeper) -> None:
        self.link = link
        self._keeper = keeper
        self._kept: WeakKeyDictionary[DriveState, Owed | None] = WeakKeyDictionary()
        self._turns: WeakKeyDictionary[DriveState, deque[Conversation[Any]]] = WeakKeyDictionary()
        """The conversations with each drive: the one under way, and those that wait for it."""
        self._passing_on: set[DriveState] = set()
        self.witnesses = Witnesses(link.name)
        self._stops = 0
        self._stops_by_drive: WeakKeyDictionary[DriveState, int] = WeakKeyDictionary()

    @property
    def under_way(self) -> list[Conversation[Any]]:
        """All conversations that are not over, clean-ups included."""
        return [turn for turns in self._turns.values() for turn in turns]

    def engaged(self, state: DriveState) -> bool:
        return bool(self._turns.get(state))

    async def run(self, procedure: Procedure[T], state: DriveState, searching: bool = False) -> T:
        """Run a conversation with one drive to its end. Cancelling the caller stops it, with its clean-up.

        `searching`: it looks for the drives of a link that was lost.
        """
        return await awaited(lambda over: self.start(procedure, state, over, searching=searching))

    def start(
        self,
        procedure: Procedure[T],
        state: DriveState,
        on_over: OnOver[T],
        on_ended: OnEnded | None = None,
        searching: bool = False,
        typed: bool = False,
    ) -> Conversation[T]:
        """Begin a conversation with one drive, at once or after those that wait for it.

        A stranger gets only what a person named (`typed`), and the search for what is there; any other conversation
        with it ends at once with Inexpressible, and sends nothing.
        """
        conversation = Conversation(self, procedure, state, on_over, on_ended, searching, typed or searching)
        turns = self._turns.setdefault(state, deque())
        turns.append(conversation)
        if turns[0] is conversation:
            conversation.begin()
        return conversation

    def leave(self, conversation: Conversation[Any], state: DriveState) -> None:
        """Give the turn to the next conversation with this drive. Those that end at once leave from within."""
        turns = self._turns[state]
        turns.remove(conversation)
        if state in self._passing_on:
            return
        self._passing_on.add(state)
        while turns and not turns[0].begun:
            turns[0].begin()
        self._passing_on.remove(state)

    # Stops

    def stops(self, state: DriveState) -> int:
        """Number of stops of this drive so far; a conversation from before one must not go on after it."""
        return self._stops + self._stops_by_drive.get(state, 0)

    def stop(self, states: Iterable[DriveState] | None) -> None:
        """Count a stop of some drives, or of all (None)."""
        if states is None:
            self._stops += 1
        for state in states or ():
            self._stops_by_drive[state] = self._stops_by_drive.get(state, 0) + 1

    # What a conversation leaves

    def owes(self, state: DriveState) -> bool:
        """Whether what is owed to a drive has changed since it was written down."""
        return state.restore is not self._kept.get(state)

    async def keep(self, state: DriveState) -> None:
        """Have the keeper write down what is owed to a drive before that changes; once begun, to its end."""
        self._kept[state] = state.restore
        await asyncio.shield(self._keeper.owes(state))

    def publish_notes(self, state: DriveState) -> None:
        """Publish what conversations have noted about a drive."""
        if state.errors.at == math.inf:
            state.errors.date(self.link.now())
        if not (state.notes or state.remarks):
            return
        notes, remarks = state.take_messages()
        for note in notes:
            self.link.notify(note, state.address, warning=True)
        for remark in remarks:
            self.link.notify(remark, state.address)


class Conversation(Generic[T]):
    """One conversation with a drive. Its first failure starts its clean-up, which runs to its end."""

    def __init__(
        self,
        conversations: Conversations,
        procedure: Procedure[T],
        state: DriveState,
        on_over: OnOver[T],
        on_ended: OnEnded | None,
        searching: bool,
        wanted: bool,
    ) -> None:
        self.begun = False
        self._all = conversations
        self._link = conversations.link
        self._procedure = procedure
        self._state = state
        self._on_over = on_over
        self._on_ended = on_ended
        self._searching = searching
        self._wanted = wanted
        """It is for whatever device is there, a stranger, too."""
        self._stops = conversations.stops(state)
        self._unproven: Request | None = None
        """The last command, until a reply shows that it was executed; from the first failure on it stays."""
        self._executed = ""
        """The last command, once a reply has shown that it was executed; from the first failure on it stays."""
        self._request: Request | None = None
        """The request that it sends now."""
        self._ticket = 0
        """The ticket of the request that is queued or in flight; 0: none is."""
        self._keeping: asyncio.Task[None] | None = None
        self._outcome: ConversationOutcome[T] | None = None
        self._first: Transaction | None = None
        self._last: Transaction | None = None
        self._taken: list[Transaction] = []
        """Its transactions, where they are witnessed."""
        self._cleaning_up = self._interrupted = False
        self.over: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def begin(self) -> None:
        """Send its first request."""
        self.begun = True
        if self._stops != self._all.stops(self._state):
            self._procedure.close()
            return self._end(error=Stopped(f"{self._name}: stopped before it was sent"))
        try:
            if not self._wanted:
                refuse_stranger(self._state, self._name)
            self._request = next(self._procedure)
        except StopIteration as done:
            return self._end((done.value,))
        except BaseException as error:  # raised again by the outcome
            return self._end(error=error)
        self._send()

    def interrupt(self) -> None:
        """Stop it, with its clean-up."""
        if self._cleaning_up or self._outcome is not None:
            return
        if not self.begun:
            self.begun = True
            self._procedure.close()
            self._end(error=Stopped(f"{self._name}: interrupted"))
        elif self._ticket:
            ticket, self._ticket = self._ticket, 0
            if not self._link.withdraw(ticket):
                self._doubts()
                self._state.reply_outstanding()
            self._fail(Stopped(f"{self._name}: interrupted"))
        else:
            self._interrupted = True

    def abandon(self) -> None:
        """Interrupt it, because its caller has gone and hears no outcome; say what is not known of its command."""
        self.interrupt()
        command, outcome = self._unproven, self._outcome
        known = outcome is not None and (outcome.error is None or isinstance(outcome.error, Refused | Inexpressible))
        if command is None or known:
            return
        text = f"'{command.text}' was interrupted; it is not known whether it was {_done(command)}"
        self._link.notify(f"{self._name}: {text}", self._state.address, warning=True)

    # Steps

    def _send(self) -> None:
        """Queue the request, once what is owed to the drive is written down."""
        if self._all.owes(self._state):
            return self._keep(self._send)
        request = self._request
        assert request is not None
        if not self._cleaning_up:
            if self._interrupted:
                return self._fail(Stopped(f"{self._name}: interrupted"))
            if self._stops != self._all.stops(self._state):  # between a reply and the next request
                return self._fail(Stopped(f"{self._name}: stopped; '{request.text}' was not sent"))
        elif request.kind is Kind.COMMAND and request.codec.starts_motion(request.text):
            # A procedure that went on after a stop: no clean-up moves a drive.
            return self._step(self._procedure.throw, Stopped(f"{self._name}: stopped; '{request.text}' was not sent"))
        try:
            self._ticket = self._link.submit(request, self._answered, self._searching)
        except TransportLost as error:
            return self._lost(error)
        self._link.advance()

    def _answered(self, answer: Transaction | TransportLost) -> None:
        self._ticket = 0
        if isinstance(answer, TransportLost):
            self._lost(answer)
        else:
            self._step(self._take, answer)

    def _step(self, step: Callable[[A], Request | None], given: A) -> None:
        """Step the procedure. Send the request that it yields, or end with what it returns or raises."""
        ended: tuple[T, ...] | None = None
        try:
            self._request = step(given)
        except StopIteration as done:
            ended = (done.value,)
        except BaseException as error:  # raised again by the outcome
            return self._end(error=error)
        if ended is not None:
            return self._end(ended)
        self._all.publish_notes(self._state)
        self._send()

    def _fail(self, error: Exception) -> None:
        self._cleaning_up = True
        self._step(self._procedure.throw, error)

    def _doubts(self) -> None:
        """Note that the command that is queued or in flight may be executed."""
        if self._request is not None and _acts(self._request) and not self._cleaning_up:
            self._unproven = self._request

    def _lost(self, error: TransportLost) -> None:
        """Fail with what the loss leaves open: whether the last command was executed."""
        if isinstance(error, LostInFlight):
            self._state.reply_outstanding()
            self._doubts()
        error = (self._link.away or error).again()
        if (doubtful := self._unproven) is not None:
            error = TransportLost(f"{error}; it is not known whether '{doubtful.text}' was {_done(doubtful)}")
            error.unproven = doubtful.text
        elif self._executed:
            error = type(error)(f"{error}; '{self._executed}' was executed before that")
            error.executed = self._executed
        self._fail(error)

    def _take(self, transaction: Transaction) -> Request | None:
        """Hand a reply or a stop to the procedure; return what it sends next."""
        request, reply, sent = transaction.request, transaction.reply, transaction.sent
        self._first, self._last = self._first or transaction, transaction
        if self._on_ended:
            self._on_ended(transaction)
        if self._all.witnesses.all:
            self._taken.append(transaction)
        if _acts(request) and (sent or reply.end is not End.STOPPED) and not self._cleaning_up:
            proven = reply.acknowledged and not reply.doubtful
            self._unproven = None if proven else request
            self._executed = request.text if proven and request.kind is not Kind.PROGRAM else ""
        if reply.end is not End.STOPPED:
            return self._procedure.send(reply)
        if not self._cleaning_up:
            self._cleaning_up = True
            if sent:
                self._state.reply_outstanding()
            return self._procedure.throw(Stopped(f"{self._name}: {self._fate(request, sent)}"))
        if sent:  # a second stop in the middle of the clean-up, which goes on
            return self._procedure.send(replace(reply, end=End.TIMEOUT))
        return self._request

    def _fate(self, request: Request, sent: bool) -> str:
        """Describe what a stop leaves open: of the command that was sent last, not of what was asked about it."""
        if self._executed:
            return f"'{self._executed}' was executed before the stop"
        unanswered = request if sent and request.kind is Kind.QUIET else None
        if (doubtful := self._unproven or unanswered) is not None:
            return f"'{doubtful.text}' was stopped; it is not known whether it was {_done(doubtful)}"
        if sent:
            return f"'{request.text}' was stopped before its reply came"
        return f"stopped; '{request.text}' was not sent"

    # The end

    def _end(self, result: tuple[T, ...] = (), error: BaseException | None = None) -> None:
        if isinstance(error, NoAnswer):
            error = explained(
                error, self._link, self._state.codec.family, "" if self._searching else self._state.address
            )
        elif (error is None or isinstance(error, Refused)) and self._last is not None and not self._searching:
            self._link.heard.replied(self._state.address)
        self._outcome = ConversationOutcome(result, error, self._first, self._last)
        self._leave()

    def _leave(self) -> None:
        """Publish the end, once what is owed to the drive is written down."""
        self._all.publish_notes(self._state)
        if self._all.owes(self._state):
            return self._keep(self._leave)
        self._all.leave(self, self._state)
        if not self.over.done():
            self.over.set_result(None)
        assert self._outcome is not None
        if self._all.witnesses.all:
            failed = self._outcome.error is not None
            unproven = self._unproven.text if failed and self._unproven is not None else ""
            self._all.witnesses.report(Concluded(self._state, tuple(self._taken), self._outcome, unproven))
        self._on_over(self._outcome)

    def _keep(self, then: Callable[[], None]) -> None:
        self._keeping = asyncio.get_running_loop().create_task(self._all.keep(self._state))
        self._keeping.add_done_callback(lambda _: then())

    @property
    def _name(self) -> str:
        return self._state.label or self._state.address or self._link.name


def refuse_stranger(state: DriveState, name: str) -> None:
    """Raise Inexpressible for a device that did not identify itself."""
    if state.stranger:
        raise Inexpressible(f"{name}: {state.stranger}; only what you type is sent to it")


def _acts(request: Request) -> bool:
    """Whether it is a command: one to all drives has no reply, and an empty line asks for a prompt."""
    return bool(request.text) and (request.kind not in ASKING or request.address in GLOBAL)


def _done(command: Request) -> str:
    return "stored" if command.kind is Kind.PROGRAM else "executed"


async def awaited(start: Callable[[OnOver[T]], Conversation[T]]) -> T:
    """Start a conversation and wait for its outcome. Cancelling the caller stops it, with its clean-up."""
    future: asyncio.Future[T] = asyncio.get_running_loop().create_future()

    def settle(outcome: ConversationOutcome[T]) -> None:
        if future.done():
            return
        if outcome.error is not None:
            future.set_exception(outcome.error)
        else:
            future.set_result(outcome.result[0])

    conversation = start(settle)
    try:
        return await future
    except asyncio.CancelledError:
        conversation.abandon()
        raise
