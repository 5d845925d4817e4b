"""Conversations with drives on a link: one at a time with each drive; those with several drives take turns.

A stop or a cancellation is thrown into the conversation, which may then clean up; nothing interrupts that.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

from dialects import DriveState, End, Owed, Procedure, Request, Stopped
from drives.events import Transaction
from drives.keeping import Keeper
from drives.link import Link
from drives.procedure import ProcedureRunner
from transports import TransportLost

T = TypeVar("T")
OnEnded = Callable[[Transaction], None]
"""Called with each transaction of a conversation once it has ended."""


class Conversations:
    """The conversations of one link, and the stops that ended them."""

    def __init__(self, link: Link, keeper: Keeper) -> None:
        self.link = link
        self._keeper = keeper
        self._kept: WeakKeyDictionary[DriveState, Owed | None] = WeakKeyDictionary()
        self._locks: WeakKeyDictionary[DriveState, asyncio.Lock] = WeakKeyDictionary()
        self._tasks: set[asyncio.Task[object]] = set()
        self._stops = 0
        self._stops_by_drive: WeakKeyDictionary[DriveState, int] = WeakKeyDictionary()

    @property
    def tasks(self) -> set[asyncio.Task[object]]:
        """The conversations under way, clean-ups included."""
        return set(self._tasks)

    def engaged(self, state: DriveState) -> bool:
        """Whether a conversation with this drive is under way."""
        return state in self._locks and self._locks[state].locked()

    async def run(self, procedure: Procedure[T], state: DriveState, on_ended: OnEnded | None = None) -> T:
        """Run a conversation with one drive to its end. Cancelling the caller stops it, with its clean-up."""
        task = asyncio.get_running_loop().create_task(self._run(procedure, state, on_ended, self.stops(state)))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            task.cancel()
            task.add_done_callback(lambda ended: ended.cancelled() or ended.exception())  # nobody else retrieves it
            raise

    async def _run(self, procedure: Procedure[T], state: DriveState, on_ended: OnEnded | None, stops: int) -> T:
        async with self._locks.setdefault(state, asyncio.Lock()):
            if stops != self.stops(state):
                procedure.close()
                raise Stopped(f"{state.address or self.link.name}: stopped before it was sent")
            try:
                return await _Conversation(self, procedure, state, on_ended, stops).run()
            finally:
                await self.keep(state)
                self.publish_notes(state)

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

    async def keep(self, state: DriveState, again: bool = False) -> bool:
        """Have the keeper write down what is owed to a drive before that changes; return whether it was interrupted.

        What is being written is written to its end. `again`: also where nothing has changed.
        """
        if not again and state.restore is self._kept.get(state):
            return False
        self._kept[state] = state.restore
        task, interrupted = asyncio.get_running_loop().create_task(self._keeper.owes(state)), False
        while not task.done():
            try:
                await asyncio.shield(task)
            except asyncio.CancelledError:
                interrupted = True
        return interrupted

    def publish_notes(self, state: DriveState) -> None:
        """Publish what conversations have noted about a drive."""
        notes, remarks = state.take_messages()
        for note in notes:
            self.link.notify(note, state.address, warning=True)
        for remark in remarks:
            self.link.notify(remark, state.address)


class _Conversation(Generic[T]):
    """One conversation under way. Its first failure starts its clean-up, which runs to its end."""

    def __init__(
        self,
        conversations: Conversations,
        procedure: Procedure[T],
        state: DriveState,
        on_ended: OnEnded | None,
        stops: int,
    ) -> None:
        self._all = conversations
        self._link = conversations.link
        self._procedure = ProcedureRunner(procedure)
        self._state = state
        self._on_ended = on_ended
        self._stops = stops
        self._cleaning_up = False

    async def run(self) -> T:
        """Send its requests until it returns or raises."""
        while (request := self._procedure.request) is not None:
            await self._step(request)
            self._all.publish_notes(self._state)
        return self._procedure.result

    async def _step(self, request: Request) -> None:
        interrupted = await self._all.keep(self._state)
        if not self._cleaning_up:
            if interrupted:
                return self._fail(Stopped(f"{self._name}: interrupted"))
            if self._stops != self._all.stops(self._state):  # between a reply and the next request
                return self._fail(Stopped(f"{self._name}: stopped; '{request.text}' was not sent"))
        try:
            transaction = await self._transact(request)
        except asyncio.CancelledError:
            self._state.reply_outstanding()
            self._fail(Stopped(f"{self._name}: interrupted"))
        except TransportLost as error:
            self._fail(error)
        else:
            self._ended(transaction)

    def _ended(self, transaction: Transaction) -> None:
        if self._on_ended:
            self._on_ended(transaction)
        if transaction.reply.end is not End.STOPPED:
            self._procedure.answer(transaction.reply)
        elif not self._cleaning_up:
            self._stopped(transaction)
        elif transaction.sent:  # a second stop in the middle of the clean-up, which goes on
            self._procedure.answer(replace(transaction.reply, end=End.TIMEOUT))

    def _stopped(self, transaction: Transaction) -> None:
        if transaction.sent:
            self._state.reply_outstanding()
        fate = "it is not known whether it was executed" if transaction.sent else "it was not sent"
        self._fail(Stopped(f"{self._name}: '{transaction.request.text}' was stopped; {fate}"))

    def _fail(self, error: Exception) -> None:
        self._cleaning_up = True
        self._procedure.fail(error)

    async def _transact(self, request: Request) -> Transaction:
        """Send a request. In a clean-up nothing interrupts it: a stop cancels the caller, too."""
        if not self._cleaning_up:
            return await self._link.transact(request)
        task = asyncio.get_running_loop().create_task(self._link.transact(request))
        while not task.done():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.shield(task)
        return task.result()

    @property
    def _name(self) -> str:
        return self._state.address or self._link.name
