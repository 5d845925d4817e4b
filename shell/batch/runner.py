"""A run without a screen: open the URLs, await the work, close, return the exit code.

The work is one automation: its early end stops what it started. A signal ends it with exit code 130, and so does the
end of the reader of standard output, with exit code 141. The stop key stops every drive and ends it with exit code 4.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable, Sequence
from contextlib import nullcontext
from functools import partial

from multidrop.shell import configuration, stop_report
from multidrop.shell.automation import outcome, settled, stop_key_trial
from multidrop.shell.channel import SILENCE, Front
from multidrop.shell.console import swallows
from multidrop.shell.events import FAILURES, SessionEvent, StateChanged
from multidrop.shell.exit_codes import INTERRUPTED, exit_code
from multidrop.shell.log.writer import begin as begin_log
from multidrop.shell.origin import LastLine, Origin
from multidrop.shell.prompt.keyboard import on_signals, on_stop_key
from multidrop.shell.prompt.terminal_input import asker
from multidrop.shell.session import Session
from multidrop.shell.signals import early_ends
from multidrop.shell.streams.event_printer import EventPrinter
from multidrop.shell.streams.stdout import fail, finish, nonblocking, report, why_interrupted, work_done
from multidrop.shell.workspace import Workspace

Body = Callable[[Session], Awaitable[int | None]]
"""The work; it returns the exit code of a good end, where that is not 0."""


def run(
    urls: Sequence[str],
    body: Body,
    *,
    watch_keys: bool = True,
    interrupted: int = INTERRUPTED,
    lazy: bool = False,
    reconnect: bool = False,
    agreed: bool = False,
    beyond: bool = False,
    asks: bool = True,
    unsolicited: bool = True,
    replies: bool = True,
    raw: bool = False,
    tried: Sequence[str] = (),
    loop: Callable[[], asyncio.AbstractEventLoop] | None = None,
) -> int:
    """Open the URLs, await the body, close, and return the exit code (`interrupted` after a signal).

    `lazy`: each line of the body names one drive. `reconnect`: a lost bus is tried again; otherwise the body fails
    with it. `agreed`: every question is answered with yes; `beyond`: also those on travel. `asks`: a question is put to
    the terminal; otherwise, and where there is none, what needs an answer is refused. `unsolicited`: what drives send
    by themselves is printed. `replies`: standard output shows replies; otherwise the body writes there itself. `raw`:
    the URLs are opened in raw mode. `tried`: see `Session`. `loop` makes the event loop, where it is not the usual one.
    A failure is one line on standard error.
    """
    try:
        settings = configuration.load()
    except FAILURES as failure:
        return fail(failure)
    try:
        create = partial(Session, settings, lazy=lazy, reconnect=reconnect, raw=raw, tried=tried)
        make = partial(_session, create, agreed, beyond)
        printer = EventPrinter(unsolicited=unsolicited, replies=replies)
        with early_ends(), asyncio.Runner(loop_factory=loop) as runner:  # before the log has its thread
            return runner.run(_run(make, printer, urls, body, watch_keys, interrupted, asks))
    except KeyboardInterrupt:
        return interrupted


def _session(make: Callable[[], Session], agreed: bool, beyond: bool) -> Session:
    made = make()
    made.questions.agreed, made.questions.beyond = agreed, beyond
    return made


async def _run(
    make: Callable[[], Session],
    printer: EventPrinter,
    urls: Sequence[str],
    body: Body,
    watch_keys: bool,
    interrupted: int,
    asks: bool,
) -> int:
    with nonblocking() as streams:
        session = make()
        session.front = Front(ready=streams.ready)
        session.subscribe(printer.show)
        begin_log(session)
        host = _Host(session, printer, interrupted)
        stop = partial(session.stop, "Ctrl+X")
        keys = on_stop_key(session.stop_ahead, stop, host.interrupt) if watch_keys else nullcontext()
        ticking = asyncio.create_task(_tick(session, printer)) if sys.stderr.isatty() else None
        with on_signals(host.interrupt), keys as keyboard:
            if keyboard is not None and swallows() and not session.questions.agreed:
                session.doubted = stop_key_trial(session)
            ask = asker(keyboard) if asks else None
            session.front = Front(ask, ready=streams.ready, beforehand="--yes agrees beforehand")
            try:
                code = await host.result(urls, body)
            finally:
                if ticking is not None:
                    ticking.cancel()
                await session.close()
            await finish(streams, lambda: host.interrupted or session.latched)
            return code


async def _tick(session: Session, printer: EventPrinter) -> None:
    """Name what is under way in each second in which nothing was printed."""
    while True:
        await asyncio.sleep(SILENCE / 2)
        printer.tick("" if session.questions.open.busy else session.under_way.text)


class _Host:
    def __init__(self, session: Session, printer: EventPrinter, code: int) -> None:
        self._session = session
        self._printer = printer
        self._code = code
        self._work: asyncio.Task[int | None] | None = None
        self.interrupted = False

    def interrupt(self) -> None:
        self.interrupted = True
        self._session.interrupt()
        if self._work is not None:
            self._work.cancel()

    async def result(self, urls: Sequence[str], body: Body) -> int:
        self._work = asyncio.create_task(self._session.tasks.run(self._whole(urls, body)))
        code, lines = 0, [""]
        try:
            code = await self._work or 0
        except FAILURES as failure:
            code, lines = exit_code(failure), [report(failure)]
        except asyncio.CancelledError:
            if not self.interrupted:
                raise
        finally:
            work_done()
        if self._session.latched or self.interrupted:
            await settled(self._session)
        if self.interrupted:
            ended = outcome(self._session, self._session.automations.interrupted) or [""]
            said = [f"{why_interrupted()}; {ended[0]}".removesuffix("; "), *ended[1:]]
            code, lines = self._code, said if self._code else []  # a plot ends well
        elif self._session.latched and (tally := self._session.tally()).found:  # a search has closed its port by now
            lines.insert(0, f"stop: {stop_report.words(tally)}")
        for line in lines:
            if line:
                self._printer.notify(line)
        return code

    async def _whole(self, urls: Sequence[str], body: Body) -> int | None:
        async with self._session.automations.run(Origin(last=LastLine())) as origin:
            self._session.origin = origin
            await self._session.open_all(urls)
            return await body(self._session)


async def until(workspace: Workspace, holds: Callable[[], object]) -> None:
    """Wait until something holds, which can change only when the state of the session does."""
    came = asyncio.Event()

    def look(event: SessionEvent | None = None) -> None:
        if (event is None or isinstance(event, StateChanged)) and holds():
            came.set()

    leave = workspace.subscribe(look)
    try:
        look()
        await came.wait()
    finally:
        leave()
