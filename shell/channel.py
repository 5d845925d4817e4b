"""The channel between a session and its front ends: events, progress and questions out, answers in, on one clock.

It also runs the tasks that a stop ends: verbs, scripts, macros, waits, downloads.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Coroutine, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from typing import Any, TypeVar

from multidrop.base import foreign
from multidrop.base.errors import Diagnostic, Stopped
from multidrop.dialects import Procedure
from multidrop.drives.drive import Drive
from multidrop.drives.events import Publisher
from multidrop.shell.events import By, Notified, Output, Progressed, SessionEvent, StateChanged, kind_of
from multidrop.shell.origin import PERSON, Origin
from multidrop.shell.roles import Transcripts

T = TypeVar("T")


class Tasks:
    """Runs work so that a stop or an interruption can end it. `changed` is called at each begin and end."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._running: dict[asyncio.Task[Any], None] = {}
        """In the order in which they began, in which a stop cancels them."""
        self._stopped: dict[asyncio.Task[Any], None] = {}

    @property
    def busy(self) -> bool:
        """True if any work runs."""
        return bool(self._running)

    async def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Await the work. Raises Stopped if a stop ended it, and Diagnostic if it ended itself in that way."""
        task = asyncio.get_running_loop().create_task(work)
        self._running[task] = None
        self._changed()
        try:
            return await task
        except asyncio.CancelledError:
            if task in self._stopped:
                raise Stopped("stopped before it was done") from None
            caller = asyncio.current_task()
            if task.cancelling() or (caller is not None and caller.cancelling()):
                raise
            raise Diagnostic("cancelled before it was done") from None
        finally:
            del self._running[task]
            self._stopped.pop(task, None)
            self._changed()

    def stop(self) -> None:
        """Cancel all work except the caller's; each `run` raises Stopped."""
        for task in self._others():
            self._stopped[task] = None
            task.cancel()

    async def stopped(self, limit: float) -> None:
        """Wait for the work that a stop has ended: it reads where drives stand, or leaves program mode."""
        if self._stopped:
            await asyncio.wait(self._stopped, timeout=limit)

    def cancel(self) -> None:
        """Cancel all work except the caller's."""
        for task in self._others():
            task.cancel()

    def _others(self) -> list[asyncio.Task[Any]]:
        if not self._running:
            return []
        try:
            current = asyncio.current_task()
        except RuntimeError:  # in a signal handler or a callback
            current = None
        return [task for task in self._running if task is not current]


Callback = Callable[[SessionEvent], None]


class Channel(Publisher[SessionEvent]):
    """Publishes the events of a session on its clock."""

    def __init__(self) -> None:
        super().__init__("a front end", kind_of)
        self.front = Front()
        """The front end, as far as it can be asked."""
        self.origin = PERSON
        """The origin of lines that are passed without one: a person's, or those of the program that has the session."""

    def subscribe(self, callback: Callable[[Any], None], *kinds: type) -> Callable[[], None]:
        """Call back with every event of these kinds; see `Publisher.subscribe`. What others wrote is guarded."""
        return super().subscribe(foreign.callback(callback), *kinds)

    def publish(self, event: SessionEvent, origin: Origin | None = None) -> None:
        """Publish an event. `origin`: of the line that enters or prints it; who that belongs to hears of it first."""
        if origin is not None:
            origin.hear(event)
        super().publish(event)

    def output(self, text: str, *, columns: bool = False, origin: Origin | None = None) -> None:
        """Publish a line of a verb's result. `columns`: a screen breaks it between words.

        `origin`: that of the line; by default that of the session.
        """
        self.publish(Output(self.now(), text, columns), origin or self.origin)

    def notify(self, text: str, *, bus: str = "", warning: bool = False, outcome: bool = False) -> None:
        """Publish a notice for a person. `outcome`: of what was asked for, so that every front end shows it."""
        self.publish(Notified(self.now(), text, bus, warning, outcome))

    def changed(self) -> None:
        """Publish that buses, drives, selection, recording or latch changed."""
        self.publish(StateChanged(self.now()))

    def now(self) -> float:
        """The time on the session's clock, s: the event loop's clock."""
        return asyncio.get_running_loop().time()

    def wall(self, at: float) -> datetime:
        """Convert a session time to the time of day in the local zone."""
        return datetime.now().astimezone() - timedelta(seconds=self.now() - at)


Ask = Callable[[str], Awaitable[bool]]
"""Puts one question to a person, and returns whether the answer is yes. A stop cancels it."""


@dataclass(frozen=True)
class AskedValue:
    """A value that a person is asked for. `default` None: an answer is needed."""

    name: str
    valid: str
    default: str | None
    take: Callable[[str], object]
    """Raises Diagnostic for an invalid answer."""
    choices: tuple[str, ...] = ()
    """The only valid answers, if there are so few."""

    def problem(self, text: str) -> str:
        """Describe what is wrong with an answer in one line; empty: nothing."""
        try:
            self.take(text)
        except Diagnostic as problem:
            return str(problem)
        return ""


Fill = Callable[[str, Sequence[AskedValue]], Awaitable[Mapping[str, str] | None]]
"""Puts a form to a person; returns the answers by name, None where the person gives up. A stop cancels it."""


@dataclass
class Front:
    """The functions of a front end that a session calls. None: the front end cannot do that."""

    ask: Ask | None = None
    """Asks its person; None: it has none."""
    fill: Fill | None = None
    """Asks its person for values."""
    way: str = "--yes"
    """The way to agree to every question beforehand."""
    beyond: str = "--beyond"
    """The way to agree to moves that leave their travel."""
    beforehand: str = ""
    """The way to agree to the questions of this front end beforehand, for the message after a no."""
    ready: Callable[[], Awaitable[None]] | None = None
    """Awaited before each line: it holds back lines while its output is not read."""
    before_quit: Callable[[], Awaitable[bool]] | None = None
    """Asked by `/quit` at a terminal: True ends now."""
    renamed: Callable[[str, str], None] | None = None
    """Called when a bus gets another name, with the name before and the name now."""
    edit: Callable[[str], Awaitable[None]] | None = None
    """Its editor of files, in which Ctrl+X stops."""
    unsaved: Callable[[], Collection[str]] | None = None
    """The absolute paths of the files with a text in that editor that is not saved."""
    screen: Callable[[str], Awaitable[None]] | None = None
    """Shows a page of the screen by its name, or `tour`, or raises Diagnostic."""
    clear: Callable[[], None] | None = None
    """Empties what it shows."""
    page: Callable[[Sequence[str]], None] | None = None
    """Shows long help, a screenful at a time."""
    transcripts: Transcripts | None = None
    """The transcripts on its screen."""


class Questions:
    """The questions of a session to the person at its front end, one at a time."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self.agreed = False
        """Every question is answered with yes beforehand (`--yes`), but not those on moves that leave their travel."""
        self.beyond = False
        """Those are answered with yes, too (`--beyond`)."""
        self.open = Tasks(channel.changed)
        """The open questions. A stop ends them."""
        self._turn = asyncio.Lock()

    async def confirm(
        self,
        what: str,
        where: str = "",
        so_far: str = "nothing was sent",
        by: By = By.OPERATOR,
        beyond: bool = False,
    ) -> None:
        """Return once a person has agreed to `what`, one line that says what will happen. A script cannot ask.

        Raises Diagnostic after any other answer and without a person to ask, Stopped after a stop. `so_far`: what a
        caller that has sent something says instead. `beyond`: it is a move that leaves its travel.
        """
        if self.beyond if beyond else self.agreed:
            return
        front = self._channel.front
        way = front.beyond if beyond else front.way
        if by is not By.OPERATOR:
            hint = f"{way} agrees beforehand, or type the line"
            raise Diagnostic(f"{what}; a {by.value} cannot ask, {so_far}", where, hint)
        if front.ask is None:
            raise Diagnostic(f"{what}; {so_far}", where, f"{way} agrees to it")
        question = f"{where}: {what}" if where else what
        try:
            agreed = await self.open.run(self._in_turn(partial(front.ask, question)))
        except Stopped:
            raise Stopped(f"{where}: not done, as a stop came before the answer".removeprefix(": ")) from None
        if not agreed:
            beforehand = f"{way} agrees beforehand" if beyond and front.beforehand else front.beforehand
            raise Diagnostic("the answer was no, so it was not done", where, beforehand)
        self._channel.notify(f"{question}: the answer was yes")

    async def agrees(self, what: str) -> bool:
        """Ask a person about a change that can be left. False without a person; `--yes` does not answer it."""
        ask = self._channel.front.ask
        if ask is None:
            return False
        try:
            return await self.open.run(self._in_turn(partial(ask, what)))
        except Stopped:
            return False

    async def fill_in(self, title: str, fields: Sequence[AskedValue]) -> Mapping[str, str]:
        """Ask a person for values. Raises Diagnostic without answers or a person, Stopped after a stop."""
        fill = self._channel.front.fill
        if fill is None:
            raise Diagnostic("values are needed, and no person can be asked", title, "give them as NAME=VALUE")
        try:
            answers = await self.open.run(self._in_turn(partial(fill, title, fields)))
        except Stopped:
            raise Stopped(f"{title}: not done, as a stop came before the answer") from None
        if answers is None:
            raise Diagnostic("no values were given; nothing was sent", title)
        return answers

    async def _in_turn(self, ask: Callable[[], Awaitable[T]]) -> T:
        async with self._turn:
            return await ask()


SILENCE = 1.0
"""The time from which a wait is named, s."""


class UnderWay:
    """What a session is waiting for: the lines that run, the URLs that are being opened."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._open: list[tuple[str, float]] = []

    @contextmanager
    def __call__(self, what: str) -> Iterator[None]:
        entry = (what, self._channel.now())
        self._open.append(entry)
        try:
            yield
        finally:
            self._open.remove(entry)

    @property
    def text(self) -> str:
        """The latest of them and its seconds, `running /wait idle, 3 s`; empty in the first second."""
        what, since = self._open[-1] if self._open else ("", 0.0)
        took = self._channel.now() - since
        return f"{what}, {took:.0f} s" if what and took >= SILENCE else ""


PROGRESS_PERIOD = 0.1
"""The shortest time between two reports of a job, s."""
EARLIEST = 0.5
"""The time after which the pace of a job says how long it will take, s."""


class Job:
    """A long job. Call it with the number of steps done and the number in all, as often as they change."""

    def __init__(self, channel: Channel, what: str) -> None:
        self._channel = channel
        self._what = what
        self._began = channel.now()
        self._first = self._total = 0
        """The first count of steps, and the steps in all: the pace is measured from there."""
        self._shown_at = float("-inf")

    def __call__(self, done: int, total: int) -> None:
        """Report progress; most reports are not published."""
        now = self._channel.now()
        if total != self._total or done < self._first:
            self._began, self._first, self._total = now, done, total
        if done < total and now - self._shown_at >= PROGRESS_PERIOD:
            self._shown_at = now
            self._channel.publish(Progressed(now, self._what, done, total, self._left(done, now)))

    def _left(self, done: int, now: float) -> float | None:
        """The time that the rest takes at the pace so far; None before there is a pace."""
        took, steps = now - self._began, done - self._first
        return took / steps * (self._total - done) if steps and took >= EARLIEST else None

    def end(self) -> None:
        if self._shown_at > float("-inf"):
            total = self._total
            self._channel.publish(Progressed(self._channel.now(), self._what, total, total, 0.0))


@contextmanager
def running(channel: Channel, what: str) -> Iterator[Job]:
    """Publish the progress of a job; `what` names it with its drive (`a: download`). It ends with the block."""
    job = Job(channel, what)
    try:
        yield job
    finally:
        job.end()


async def transferring(drive: Drive, procedure: Procedure[T]) -> T:
    """Run a conversation of many requests; polls of the drive wait."""
    drive.transferring = True
    try:
        return await drive.run(procedure)
    finally:
        drive.transferring = False
