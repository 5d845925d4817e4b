"""A bus: a line, its transport and the event loop. The one owner of a port.

It writes what the line says, gives it what comes, and tells its watchers everything. A conversation with a drive has
the drive to itself until it is over; different drives' conversations take turns on the wire. A stop goes around all
of this: it is written at once, from whatever the caller is doing, and everything else fails.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeVar
from weakref import WeakKeyDictionary

from dialects import Codec, DriveState, End, Hints, Kind, Owed, Procedure, Reply, Request, Stopped
from dialects.families import DEFAULT, IDENTIFY, PLAIN
from drives.apart import apart
from drives.drive import GLOBAL, Drive
from drives.events import (
    BusEvent,
    Changed,
    Ended,
    Notice,
    Sent,
    Traffic,
    Transaction,
    Unsolicited,
)
from drives.keeping import Keeper
from drives.line import Finished, Line, Write
from drives.procedure import ProcedureRunner
from drives.stopping import Halt, WrittenStop, confirm_stop, stop_forms
from drives.telemetry import Telemetry
from drives.wreck import LASTS, Wreck
from transports import Preemptible, Transport, TransportLost

T = TypeVar("T")


class Bus:
    """An open line with its drives. All methods are called from the event loop's thread."""

    def __init__(
        self,
        name: str,
        transport: Transport,
        *,
        baud: int = 0,
        local_echo: bool = False,
        timeout: float = 1.0,
        family: str = "",
        keeper: Keeper | None = None,
    ) -> None:
        self.name = name
        self.transport = transport
        self.family = family or DEFAULT
        self.drives: dict[str, Drive] = {}
        self.unlisted: dict[str, Drive] = {}
        """Addresses that were spoken to and are not among the drives: a stop must reach them, too."""
        self.probing: tuple[str, ...] = ()
        """The drives that are being looked for."""
        self.lost: TransportLost | None = None
        self._keeper = keeper
        self._kept: WeakKeyDictionary[DriveState, Owed | None] = WeakKeyDictionary()
        self._marked = False
        """A line that may move something is on its way, and the keeper knows."""
        self.line = Line(PLAIN[self.family], baud=baud, local_echo=local_echo, timeout=timeout)
        self.telemetry = Telemetry(self)
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._waiting: dict[int, asyncio.Future[Transaction]] = {}
        self._watchers: list[Callable[[BusEvent], None]] = []
        self._locks: WeakKeyDictionary[DriveState, asyncio.Lock] = WeakKeyDictionary()
        self._talks: set[asyncio.Task[object]] = set()
        self._confirming: set[asyncio.Task[None]] = set()
        self.last_stop: Halt | None = None
        """The last stop of the whole line, and what is known of each drive since."""
        self.stops = 0
        """How many stops of the whole line there were; what began before one must not go on after it."""
        self._halts: WeakKeyDictionary[DriveState, int] = WeakKeyDictionary()
        """How many stops there were of one drive."""
        self._wreck = Wreck()
        self._cuts = 0
        """How many stops of any kind were written."""
        self._ahead: WrittenStop | None = None
        """The stop that another thread has written and the loop has not yet taken note of."""

    def start(self) -> None:
        """Begin to read."""
        self.transport.start(self._received, self._broke)

    def now(self) -> float:
        """The clock of this bus's events, s."""
        return self._loop.time()

    def watch(self, watcher: Callable[[BusEvent], None]) -> Callable[[], None]:
        """Tell `watcher` everything from now on; the function returned ends that."""
        self._watchers.append(watcher)
        return lambda: self._watchers.remove(watcher) if watcher in self._watchers else None

    def publish(self, event: BusEvent) -> None:
        """Tell the watchers. One that fails keeps neither the others nor the wire from anything."""
        for watcher in tuple(self._watchers):
            with apart(f"a watcher of {self.name}"):
                watcher(event)

    def notify(self, text: str, address: str = "", warning: bool = False) -> None:
        """Tell the watchers something that a person should know."""
        self.publish(Notice(self.now(), text, address, warning))

    async def identify(self, hints: Hints) -> list[Drive]:
        """Find out what is on the line and how it is set. Raises NoAnswer where nobody answers."""
        self.family = hints.family or self.family
        self.probing = hints.drives
        found = await self.run(IDENTIFY[self.family](hints), DriveState(PLAIN[self.family]))
        for state in found:
            self._tell_notes(state)
            self.drives[state.address] = Drive(self, state)
            await self._keep(state, again=True)
        self.probing = ()
        if self._keeper is not None:
            self._keeper.ended()  # what was cut off before has overflowed
        self._follow()
        self.publish(Changed(self.now()))
        return list(self.drives.values())

    @property
    def all_drives(self) -> list[Drive]:
        """Every drive that was found here or spoken to."""
        return list({**self.unlisted, **self.drives}.values())

    def at(self, address: str) -> Drive:
        """The drive at an address; for one that is not known, and for all (`*`, `^`), one set like the first."""
        if address in self.drives:
            return self.drives[address]
        if address in self.unlisted:
            return self.unlisted[address]
        like: Codec = next((d.codec for d in self.drives.values()), PLAIN[self.family])
        return Drive(self, DriveState(like, address, settings_unknown=address not in GLOBAL))

    async def ask(self, request: Request) -> Reply:
        """Send one request and wait for its answer. Raises TransportLost."""
        return (await self.transact(request)).reply

    async def transact(self, request: Request) -> Transaction:
        """Send one request; the whole transaction. Raises TransportLost."""
        if self.lost:
            raise self.lost
        ticket = self.line.ask(request)
        future: asyncio.Future[Transaction] = self._loop.create_future()
        self._waiting[ticket] = future
        self._advance()
        try:
            return await future
        finally:
            self._waiting.pop(ticket, None)
            self.line.withdraw(ticket)

    def engaged(self, drive: Drive) -> bool:
        """Whether a conversation with this drive is under way."""
        return drive.state in self._locks and self._locks[drive.state].locked()

    async def run(self, talk: Procedure[T], state: DriveState, ended: Callable[[Transaction], None] | None = None) -> T:
        """Hold a conversation with one drive to its end. Cancelling the caller stops it with its clean-up."""
        task = self._loop.create_task(self._run(talk, state, ended, self._stops_of(state)))
        self._talks.add(task)
        task.add_done_callback(self._talks.discard)
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            task.cancel()
            task.add_done_callback(lambda ended: ended.cancelled() or ended.exception())  # nobody is left to hear it
            raise

    async def _run(
        self, talk: Procedure[T], state: DriveState, ended: Callable[[Transaction], None] | None, stops: int
    ) -> T:
        async with self._locks.setdefault(state, asyncio.Lock()):
            if stops != self._stops_of(state):
                talk.close()
                raise Stopped(f"{state.address or self.name}: stopped before it was sent")
            try:
                return await self._stepped(ProcedureRunner(talk), state, ended, stops)
            finally:
                await self._keep(state)
                self._tell_notes(state)

    async def _stepped(
        self, procedure: ProcedureRunner[T], state: DriveState, ended: Callable[[Transaction], None] | None, stops: int
    ) -> T:
        failed = False
        while procedure.request is not None:
            if await self._keep(state) and not failed:
                failed = True
                procedure.fail(Stopped(f"{self._whose(state)}: interrupted"))
                continue
            if stops != self._stops_of(state) and not failed:  # it came between an answer and what is asked next
                failed = True
                procedure.fail(Stopped(f"{self._whose(state)}: stopped; '{procedure.request.text}' was not sent"))
                self._tell_notes(state)
                continue
            try:
                send = self._uninterrupted if failed else self.transact
                transaction = await send(procedure.request)
            except asyncio.CancelledError:
                failed = state.reply_pending = True
                procedure.fail(Stopped(f"{self._whose(state)}: interrupted"))
            except TransportLost as error:
                failed = True
                procedure.fail(error)
            else:
                if ended:
                    ended(transaction)
                if transaction.reply.end is not End.STOPPED:
                    procedure.answer(transaction.reply)
                elif not failed:
                    failed = True
                    self._stopped(procedure, transaction, state)
                elif transaction.sent:  # a second stop in the middle of the clean-up, which goes on
                    procedure.answer(replace(transaction.reply, end=End.TIMEOUT))
            self._tell_notes(state)
        return procedure.result

    async def _keep(self, state: DriveState, again: bool = False) -> bool:
        """Have the keeper write down what is owed to a drive before that is changed; whether it was interrupted.

        What is being written is written to its end.
        """
        if self._keeper is None or (not again and state.restore is self._kept.get(state)):
            return False
        self._kept[state] = state.restore
        task, interrupted = self._loop.create_task(self._keeper.owes(state)), False
        while not task.done():
            try:
                await asyncio.shield(task)
            except asyncio.CancelledError:
                interrupted = True
        return interrupted

    def _whose(self, state: DriveState) -> str:
        return state.address or self.name

    async def _uninterrupted(self, request: Request) -> Transaction:
        """A transaction of a clean-up, which is not itself interrupted: a stop cancels whoever asked, too."""
        task = self._loop.create_task(self.transact(request))
        while not task.done():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.shield(task)
        return task.result()

    def _stopped(self, procedure: ProcedureRunner[T], transaction: Transaction, state: DriveState) -> None:
        state.reply_pending = state.reply_pending or transaction.sent
        fate = "it is not known whether it was executed" if transaction.sent else "it was not sent"
        procedure.fail(Stopped(f"{self._whose(state)}: '{transaction.request.text}' was stopped; {fate}"))

    def _tell_notes(self, state: DriveState) -> None:
        notes, state.notes = state.notes, []
        remarks, state.remarks = state.remarks, []
        for note in notes:
            self.notify(note, state.address, warning=True)
        for remark in remarks:
            self.notify(remark, state.address)

    def _stops_of(self, state: DriveState) -> int:
        return self.stops + self._halts.get(state, 0)

    def stop(self, only: Iterable[Drive] | None = None) -> Halt:
        """Stop every drive at once, or some: drop what is unsent, make half-sent lines harmless, fail what waits."""
        halt = self.halt(only)
        self.halted(halt)
        return halt

    def halt(self, only: Iterable[Drive] | None = None) -> Halt:
        """Write a stop, and nothing else: no watcher hears of it before `halted`. Does not fail; the stop says so."""
        whole = only is None
        halt = Halt(self, self.now(), self._cuts, whole, tuple(self.all_drives if only is None else only))
        if whole:
            self.stops, self.last_stop = self.stops + 1, halt
        self._write_stop(halt)
        return halt

    def halted(self, halt: Halt) -> None:
        """Tell of a stop that was written, fail what waited, and see whether it works."""
        if self.lost:
            return
        self._tell_of_stop(halt)
        task = self._loop.create_task(confirm_stop(self, halt))
        self._confirming.add(task)
        task.add_done_callback(self._confirming.discard)

    def repeat(self, halt: Halt) -> None:
        """Write a stop once more."""
        if halt.whole:
            self.stops += 1
        self._write_stop(halt)
        self._tell_of_stop(halt)

    def stop_ahead(self) -> None:
        """Write the stop of the whole line from any thread, whatever the loop is doing; `stop` must follow in the loop.

        From then until that `stop` the loop writes nothing. Does nothing on a transport that cannot be preempted.
        """
        if self.lost or not isinstance(self.transport, Preemptible):
            return
        forms, now = stop_forms(self), self.now()

        def written(dropped: int) -> bytes:
            self._ahead = forms.written(bool(dropped or self.line.half_sent(now)))
            return self._ahead.data

        self.transport.preempt(forms.framed, written)

    def _write_stop(self, halt: Halt) -> None:
        self._cuts += 1
        if self.lost:
            halt.trouble.append("lost")
            return
        with apart(f"the stop of {self.name}", halt.trouble):
            self._cut(halt, None if halt.whole else halt.drives)
        if not halt.whole:
            for drive in halt.affected:
                self._halts[drive.state] = self._halts.get(drive.state, 0) + 1

    def _cut(self, halt: Halt, only: Iterable[Drive] | None) -> None:
        """The bytes first, then what the line thinks of them."""
        now = self.now()
        stop = self._written_ahead(halt) or self._written_now(halt, only)
        halt.data = stop.data
        halt.missed.update(stop.forms.missed)
        if only is not None:
            halt.others = tuple(
                each for each in self.all_drives if each not in halt.drives and each.hears_stop(stop.data)
            )
        reached = None if only is None else {*GLOBAL, *(d.address for d in halt.affected)}
        self.line.stop(now, *stop.forms.repeat, only=reached)
        self.line.wrote(stop.data, now, whole=stop.invalidated)
        cut = self._wreck.sent + stop.data.decode("latin-1")
        self._wreck = Wreck(cut, self._wreck.asked, self.line.transmitted + LASTS)

    def _written_ahead(self, halt: Halt) -> WrittenStop | None:
        """What another thread has written already; a stop of the whole line takes note of it."""
        ahead = self._ahead
        if halt.whole and isinstance(self.transport, Preemptible):
            self._ahead = None
            self.transport.yielded()
        return ahead

    def _written_now(self, halt: Halt, only: Iterable[Drive] | None) -> WrittenStop:
        forms, dropped = stop_forms(self, only), 1
        with apart(f"taking back what {self.name} has not sent", halt.trouble):
            dropped = self.transport.discard(whole=forms.framed)
        stop = forms.written(bool(dropped or self.line.half_sent(self.now())))
        self.transport.write(stop.data)
        return stop

    def _tell_of_stop(self, halt: Halt) -> None:
        if halt.data:
            self.publish(Traffic(self.now(), True, halt.data))
        self._advance()

    async def stopped(self) -> None:
        """Wait until the last stop was repeated and seen to work, or not."""
        while self._confirming:
            await asyncio.wait(tuple(self._confirming))

    async def settled(self) -> None:
        """Wait until the last stop was seen to work, or not, and the conversations of now are over, clean-ups too."""
        if tasks := {*self._confirming, *self._talks}:
            await asyncio.wait(tasks)

    def _received(self, data: bytes) -> None:
        now = self.now()
        self.publish(Traffic(now, False, data))
        self.line.receive(data, now)
        self._advance()

    def _advance(self) -> None:
        """Do what the line says, and come back when it has more to say."""
        cuts = self._cuts
        for event in self.line.events(self.now()):
            if isinstance(event, Write):
                if cuts == self._cuts or event.request is None:  # else a watcher has stopped it meanwhile
                    self._write(event)
            elif isinstance(event, Finished):
                self._finished(event)
            elif isinstance(event, Unsolicited):
                self._heard(event)
        if (deadline := self.line.deadline) is not None and not self.lost:
            self._come_back(deadline)

    def _come_back(self, deadline: float) -> None:
        """At that time at the latest: an alarm that comes too early costs less than a new one for every request."""
        if self._timer is not None and self._timer.when() > deadline:
            self._timer.cancel()
            self._timer = None
        if self._timer is None:
            self._timer = self._loop.call_at(deadline, self._alarm)

    def _alarm(self) -> None:
        self._timer = None
        self._advance()

    def _heard(self, event: Unsolicited) -> None:
        """A line that nobody asked for; a drive that was restarted is set as it was saved."""
        for drive in self.drives.values():
            drive.state.settings_unknown = drive.state.settings_unknown or drive.codec.restarted(event.text)
        if not self._wreck.holds(event.text, self.line.idle.stop_sign, self.now()):
            self.publish(event)

    def _write(self, event: Write) -> None:
        self.transport.write(event.data)
        if self._keeper is not None and event.request is not None:
            self._mark(self._keeper, event.request)
        self._written(event)
        self.publish(Traffic(self.now(), True, event.data))
        if event.request is not None:
            self.publish(Sent(self.now(), event.request))

    def _mark(self, keeper: Keeper, request: Request) -> None:
        """Have the keeper know of a command, which would do something else if a part of it were all that leaves.

        A program's lines are stored and do nothing; a part of a setting or of a question moves nothing.
        """
        if request.kind is Kind.COMMAND or request.address in GLOBAL:
            self._marked = True
            keeper.begun(f"{request.address}{request.text}")

    def _written(self, event: Write) -> None:
        """Keep what a stop may cut off next, and how long the debris of the last one may come."""
        if event.request is None:
            self._wreck.until = self.line.transmitted + LASTS
        elif self.now() > self._wreck.until:
            self._wreck = Wreck(event.data.decode("latin-1"), event.request)
        else:
            self._wreck.sent += event.data.decode("latin-1")
            self._wreck.asked = event.request

    def _finished(self, event: Finished) -> None:
        transaction = Transaction(
            event.request, event.reply, event.sent_at, event.ended_at, event.transmitted_at, event.sent
        )
        if self._marked and event.sent and event.reply.end is not End.STOPPED:
            self._unmark()
        self.publish(Ended(event.ended_at, transaction))
        future = self._waiting.get(event.ticket)
        if future is not None and not future.done():
            future.set_result(transaction)

    def _broke(self, error: TransportLost) -> None:
        if self.lost:
            return
        self.lost = error
        if self._timer:
            self._timer.cancel()
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(error)
        self.notify(str(error), warning=True)
        self.publish(Changed(self.now()))

    def _unmark(self) -> None:
        """A whole line has left after the one that the keeper knows of, or that one is answered."""
        self._marked = False
        if self._keeper is not None:
            self._keeper.ended()

    def conversation_ended(self, drive: Drive, before: str, commanded: bool) -> None:
        """A conversation with a drive is over; `before` is what its address was, which DN and PY change."""
        if self.drives.get(before) is drive and drive.address != before:
            self.drives = {d.address: d for d in self.drives.values()}
        if not commanded or self.drives.get(drive.address) is drive:
            self.unlisted.pop(before, None)
        self._follow()

    def _follow(self) -> None:
        """What nobody asked for is read as the first drive words it."""
        self.line.idle = next((drive.codec for drive in self.drives.values()), self.line.idle)

    async def close(self) -> None:
        """End telemetry and conversations, and close the transport."""
        self.telemetry.close()
        tasks = [task for task in (*self._talks, *self._confirming) if not task.done()]
        for task in tasks:
            task.cancel()
        whole = not self.lost
        if whole and (again := self.line.take_again()):
            with apart(f"the stop of {self.name}"):
                self.transport.write(again)
        self._broke_quietly()
        await asyncio.gather(*tasks, return_exceptions=True)
        if self._timer:
            self._timer.cancel()
        await self.transport.close()
        if self._marked and whole:
            self._unmark()
        if self._keeper is not None:
            self._keeper.close()

    def _broke_quietly(self) -> None:
        """Fail what waits, so that a conversation's clean-up ends instead of waiting for answers."""
        self.lost = self.lost or TransportLost(f"{self.transport.name} is closed")
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(self.lost)


__all__ = ["GLOBAL", "Bus"]
