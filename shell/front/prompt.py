"""The prompt: prompt_toolkit over a Session, with history, completion, hints and the stop key.

The prompt is always there: lines run behind it, one after the other, while macros and plots run beside them. So what a
person types while a macro plays is sent at once, and the lines of a paste keep their order. A line that is refused, and
a stop, hold back what was typed ahead of them: it is shown, and not sent.

On a POSIX terminal the keys are held from before anything is opened until the end (`shell.front.keyboard`), so that
the stop key is found whatever was typed before it.
"""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from functools import partial

from prompt_toolkit import PromptSession
from prompt_toolkit.application import create_app_session, get_app_or_none
from prompt_toolkit.application.current import set_app
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.filters import is_searching
from prompt_toolkit.history import History as PromptHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.output import create_output
from prompt_toolkit.search import stop_search

from shell import stops
from shell.automation import outcome, settled
from shell.connect import settings
from shell.connect.settings import Settings
from shell.events import FAILURES, SessionEvent, StateChanged
from shell.front import complete
from shell.front.collector import collected_at_rest
from shell.front.history import History
from shell.front.interrupts import on_signals
from shell.front.keyboard import Keyboard, terminal
from shell.front.prompt_keys import KeyboardInput
from shell.front.prompt_lines import LinesAbove
from shell.lines import VerbLine, parse
from shell.naming import model
from shell.output import INTERRUPTED, Printer, exit_code, finish, nonblocking, report, visible, write
from shell.session import Session
from shell.verbs.table import VERBS, Verb

BURST = 0.5
"""Seconds between two Enters below which nobody has typed the second line in the knowledge of the first."""
STOP = "^X STOP ALL"
SHOWN = 10
"""Lines that were not sent and are shown one by one."""


def run(urls: Sequence[str]) -> int:
    """Open the URLs and prompt until the end; the exit code."""
    try:
        found = settings.load()
    except FAILURES as failure:
        write(sys.stderr, report(failure))
        return exit_code(failure)
    try:
        return asyncio.run(_run(found, urls))
    except KeyboardInterrupt:
        return INTERRUPTED


async def _run(found: Settings, urls: Sequence[str]) -> int:
    with nonblocking() as streams, ExitStack() as stack:
        session = Session(found)
        session.subscribe(Printer(talkative=True).show)
        stack.enter_context(collected_at_rest(lambda: session.at_rest))
        descriptor, input_ = terminal(), None
        if descriptor is not None:
            keyboard = Keyboard(descriptor, signals=False)
            keyboard.stop_ahead = session.stop_ahead
            input_ = KeyboardInput(stack.enter_context(keyboard))
        stack.enter_context(create_app_session(input=input_, output=create_output(always_prefer_tty=True)))
        prompt = Prompt(session, input_)
        stack.enter_context(on_signals(prompt.interrupt))
        try:
            return await prompt.run(urls)
        finally:
            await session.close()
            await finish(streams, lambda: True)


class Prompt:
    """One prompt over one session. `input_`: the keyboard's, where it is held."""

    def __init__(self, session: Session, input_: KeyboardInput | None = None) -> None:
        self._session = session
        self._input = input_
        self._waiting: asyncio.Queue[tuple[str, int]] = asyncio.Queue()
        self._running = ""
        self._entered = 0.0
        """When Enter was last pressed."""
        self._held = ""
        """Why the rest of this burst of lines is not sent; empty: it is."""
        self._stops = session.stops
        self._interrupted = self._over = False
        self._lines = 0
        """How many were typed, but for /quit."""
        self._asked = (-1, -1)
        """Stops and lines when it was last asked whether to end."""
        self._opening: asyncio.Task[None] | None = None
        self._prompt: PromptSession[str] = PromptSession(
            history=_History(History(session.settings.history)),
            completer=_Completer(session),
            complete_while_typing=True,
            key_bindings=self._bindings(),
            bottom_toolbar=self._toolbar,
        )
        session.before_quit = self._may_quit
        self._accept = self._prompt.default_buffer.accept_handler
        self._prompt.default_buffer.accept_handler = self._accepted
        if input_ is not None:
            input_.keyboard.stop, input_.keyboard.gone = self._stop_key, self.interrupt
            input_.notify = partial(session.notify, warning=True)

    async def run(self, urls: Sequence[str] = ()) -> int:
        """Open the URLs, then read and run lines until /quit, Ctrl+D, `interrupt` or a hang-up; the exit code."""
        code = await self._open(urls)
        if code is None:
            with LinesAbove(self._prompt.app).shown():
                await self._read()
            code = INTERRUPTED if self._interrupted else 0
        return code

    async def _open(self, urls: Sequence[str]) -> int | None:
        """Open them, one after the other; the exit code where that was the end."""
        if not urls:
            return None
        self._opening = asyncio.create_task(self._session.stoppable(self._open_all(urls)))
        try:
            await self._opening
        except FAILURES as failure:
            self._say_unsent("nothing was opened", self._input.keyboard.typed.splitlines() if self._input else [])
            await self._leave()
            write(sys.stderr, report(failure))
            return exit_code(failure)
        except asyncio.CancelledError:
            if not self._interrupted:
                raise
            await self._leave()
        finally:
            self._opening = None
        return INTERRUPTED if self._interrupted else None

    async def _open_all(self, urls: Sequence[str]) -> None:
        for url in urls:
            write(sys.stderr, f"opening {url}; Ctrl+X stops")
            await self._session.open(url)

    async def _read(self) -> None:
        worker = asyncio.create_task(self._work())
        worker.add_done_callback(lambda _: self._end())
        leave = self._session.subscribe(self._noticed)
        try:
            while not (self._session.quitting or self._interrupted or worker.done()):
                try:
                    await self._prompt.prompt_async(self._message, handle_sigint=False)
                except EOFError:  # Ctrl+D, or `_end`
                    if self._session.quitting or self._interrupted or worker.done() or await self._may_quit():
                        break
        finally:
            leave()
            self._drop("the prompt has ended")
            await self._leave()
            self._over = True  # a stop may take the place of the cancellation
            worker.cancel()
            await asyncio.gather(worker, return_exceptions=True)
        if not worker.cancelled():
            worker.result()

    async def _may_quit(self) -> bool:
        """Whether to end: not at once while drives move, or may; asked a second time it is."""
        if self._asked == (self._session.stops, self._lines):
            return True
        self._asked = (self._session.stops, self._lines)
        moving = await self._session.in_motion()
        for text in moving:
            self._session.notify(text, warning=True)
        if moving:
            self._session.notify("/quit again leaves them so; Ctrl+X stops all drives", warning=True)
        return not moving

    async def _leave(self) -> None:
        """Stop what automation has started and ran on, say what became of it, and of the last stop."""
        self._session.interrupt()
        halts = self._session.automations.interrupted
        if halts or self._session.latched or self._session.busy:
            await settled(self._session)
        for line in outcome(self._session, halts):
            write(sys.stderr, line)

    def _accepted(self, buffer: Buffer) -> bool:
        """Enter was pressed. What is behind it counts as typed now, whenever its turn comes."""
        now = self._session.now()
        if now - self._entered > BURST:
            self._held = ""
        self._entered = now
        for line in buffer.text.splitlines():
            self._take(line, self._session.stops)
        if self._input is not None:
            self._input.rest()
        return self._accept(buffer) if self._accept is not None else False

    def _take(self, line: str, since: int) -> None:
        """Run a line now, beside the others or behind them; or hold it, as one of its burst has failed."""
        verb = _verb(line)
        self._lines += bool(line.strip()) and (verb is None or verb.name != "/quit")
        if verb is not None and verb.name in ("/stop", "/quit"):
            self._session.start(line, since=since)
        elif self._held:
            self._say_unsent(self._held, [line])
        elif verb is not None and verb.concurrent:
            self._session.start(line, since=since)
        elif line.strip():
            self._waiting.put_nowait((line, since))

    async def _work(self) -> None:
        while not self._over:
            self._running = ""
            self._running, since = await self._waiting.get()
            try:
                await self._session.run(self._running, since=since)
            except FAILURES:
                if since == self._session.stops:  # else what waits was typed after the stop that ended this one
                    self._held = f"'{self._running.strip()}' failed"
                    self._drop(self._held)

    def _drop(self, why: str) -> None:
        """Drop the lines that wait for their turn, and say which."""
        self._say_unsent(why, [self._waiting.get_nowait()[0] for _ in range(self._waiting.qsize())])

    def _say_unsent(self, why: str, lines: Sequence[str]) -> None:
        lines = [shown(line) for line in lines if line.strip()]
        for line in lines[:SHOWN]:
            self._session.notify(f"not sent, as {why}: {line}", warning=True)
        if len(lines) > SHOWN:
            self._session.notify(f"nor were {len(lines) - SHOWN} more lines", warning=True)

    def _typing(self) -> str:
        """The line that is being typed."""
        app = self._prompt.app
        return self._prompt.default_buffer.text if app.is_running and not app.is_done else ""

    def _noticed(self, event: SessionEvent) -> None:
        app = get_app_or_none()
        if not isinstance(event, StateChanged):
            return
        if self._stops != self._session.stops:
            self._stops = self._session.stops
            self._held = ""
            self._drop("a stop came")
        if self._session.quitting:
            self._end()
        elif app is not None and self._prompt.app.is_running:
            app.invalidate()

    def _end(self) -> None:
        app = self._prompt.app
        if app.is_running and app.future is not None and not app.future.done():
            app.exit(exception=EOFError)

    def interrupt(self) -> None:
        """A signal came, or the terminal is gone."""
        self._interrupted = True
        self._session.interrupt()
        if self._opening is not None:
            self._opening.cancel()
        self._end()

    def _stop_key(self, dropped: str) -> None:
        """The stop key was read, in front of all other keys: nothing that was typed before it is sent."""
        self._session.stop("Ctrl+X")
        if self._input is not None:
            dropped = self._input.forget(dropped)
        self._prompt.app.key_processor.reset()
        self._empty(dropped)

    def _stop(self, why: str) -> None:
        self._session.stop(why)
        self._empty()

    def _empty(self, behind: str = "") -> None:
        """Empty the line that is being typed, and what was typed behind it; it stays in the history."""
        lines = [shown(line) for line in (self._typing() + behind).splitlines() if line.strip()]
        self._say_unsent("a stop came", lines)
        for line in lines:
            self._prompt.history.append_string(line)
        self._clear()

    def _clear(self) -> None:
        app = self._prompt.app
        if app.layout.is_searching:
            with set_app(app):
                stop_search()
        self._prompt.default_buffer.reset()

    def _bindings(self) -> KeyBindings:
        bindings = KeyBindings()

        @bindings.add("c-x", eager=True)
        def stop(event: KeyPressEvent) -> None:
            self._stop("Ctrl+X")

        @bindings.add("c-c")
        def clear(event: KeyPressEvent) -> None:
            if self._session.busy:
                self._stop("Ctrl+C")
            else:
                event.current_buffer.reset()

        @bindings.add("c-s", filter=~is_searching, eager=True)
        @bindings.add("c-q", eager=True)
        def ignore(event: KeyPressEvent) -> None:
            """Who means to hold the output, and to let it go, begins no search and quotes no key."""

        return bindings

    def _message(self) -> str:
        drive = self._session.selected
        return f"{self._session.display_name(drive) if drive else self._session.selected_bus}> "

    def _toolbar(self) -> str:
        session, drive = self._session, self._session.selected
        room = self._prompt.app.output.get_size().columns - len(f"{STOP}  ")
        state = [
            STOP,
            stops.headline(session.tally(), room) if session.latched else "",
            f"playing {session.playing[-1]}" if session.playing else "",
            f"recording {session.recording}" if session.recording else "",
            f"running {self._running}" if self._running and session.busy else "",
            complete.hint(session, self._prompt.default_buffer.text)
            or (f"{drive.label} {model(drive)}".strip() if drive else "/open URL opens a line of drives"),
        ]
        return "  ".join(part for part in state if part)


def shown(line: str) -> str:
    """A line as it was typed, without the marks of a paste and with other control characters written out."""
    return visible(re.sub("\x1b\\[20[01]~", "", line)).strip()


def _verb(line: str) -> Verb | None:
    if not line.strip().startswith("/"):
        return None
    parsed = parse(line)
    return VERBS.get(parsed.name) if isinstance(parsed, VerbLine) else None


class _Completer(Completer):
    def __init__(self, session: Session) -> None:
        self._session = session

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        text = document.text_before_cursor
        if not text.strip():
            return
        for each in complete.complete(self._session, text):
            yield Completion(each.text, each.start - len(text), display_meta=each.meaning)


class _History(PromptHistory):
    """The shared history file as prompt_toolkit wants it: newest first."""

    def __init__(self, kept: History) -> None:
        super().__init__()
        self._kept = kept

    def load_history_strings(self) -> Iterable[str]:
        return reversed(self._kept.lines())

    def append_string(self, string: str) -> None:
        for line in string.splitlines():  # those of a paste are found one by one
            super().append_string(line)

    def store_string(self, string: str) -> None:
        self._kept.append(string)
