"""The prompt: prompt_toolkit over a Session, with history, completion, hints and the stop key.

The prompt is always there: lines run behind it, one after the other, while macros and plots run beside them. So what a
person types while a macro plays is sent at once, and the lines of a paste keep their order.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterable, Sequence

from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app_or_none
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import History as PromptHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.patch_stdout import patch_stdout

from shell import batch, complete, settings
from shell.addressing import VerbLine, parse
from shell.events import SessionEvent, StateChanged
from shell.history import History
from shell.interrupts import on_signals
from shell.naming import model
from shell.output import INTERRUPTED, Printer, exit_code, report, write
from shell.session import FAILURES, Session
from shell.verbs import VERBS, Verb


def run(urls: Sequence[str]) -> int:
    """Open the URLs and prompt until the end; the exit code."""
    return asyncio.run(_run(urls))


async def _run(urls: Sequence[str]) -> int:
    try:
        session = Session(settings.load())
        session.subscribe(Printer(talkative=True).show)
        for url in urls:
            await session.open(url)
    except FAILURES as failure:
        write(sys.stderr, report(failure))
        return exit_code(failure)
    try:
        return await Prompt(session).loop()
    finally:
        await session.close()


class Prompt:
    """One prompt over one session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._waiting: asyncio.Queue[str] = asyncio.Queue()
        self._running = ""
        self._interrupted = False
        self._prompt: PromptSession[str] = PromptSession(
            history=_History(History(session.settings.history)),
            completer=_Completer(session),
            complete_while_typing=True,
            key_bindings=self._bindings(),
            bottom_toolbar=self._toolbar,
        )

    async def loop(self) -> int:
        """Read and run lines until /quit, Ctrl+D or a signal; the exit code."""
        worker = asyncio.create_task(self._work())
        leave = self._session.subscribe(self._noticed)
        try:
            with patch_stdout(raw=True), on_signals(self._signalled):
                while not self._session.quitting and not self._interrupted:
                    try:
                        line = await self._prompt.prompt_async(self._message, handle_sigint=False)
                    except EOFError:
                        break
                    await self._take(line)
        finally:
            leave()
            if self._session.busy:
                self._session.stop("left while something ran")
            if self._session.latched:
                await batch.linger(self._session)
            worker.cancel()
        return INTERRUPTED if self._interrupted else 0

    async def _take(self, line: str) -> None:
        """Run a line now, beside the others or behind them."""
        verb = _verb(line)
        if verb is not None and verb.name in ("/stop", "/quit"):
            await self._session.start(line)
        elif verb is not None and verb.aside:
            self._session.start(line)
        else:
            self._waiting.put_nowait(line)

    async def _work(self) -> None:
        while True:
            self._running = ""
            self._running = await self._waiting.get()
            await self._session.start(self._running)

    def _noticed(self, event: SessionEvent) -> None:
        app = get_app_or_none()
        if isinstance(event, StateChanged) and self._prompt.app.is_running:
            if self._session.quitting:
                self._end()
            elif app is not None:
                app.invalidate()

    def _end(self) -> None:
        app = self._prompt.app
        if app.is_running and app.future is not None and not app.future.done():
            app.exit(exception=EOFError)

    def _signalled(self) -> None:
        self._interrupted = True
        if self._session.busy:
            self._session.stop("interrupted")
        self._end()

    def _stop(self, why: str) -> None:
        while not self._waiting.empty():
            self._waiting.get_nowait()
        self._session.stop(why)

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

        return bindings

    def _message(self) -> str:
        drive = self._session.selected
        return f"{self._session.called(drive) if drive else self._session.selected_bus}> "

    def _toolbar(self) -> str:
        session, drive = self._session, self._session.selected
        state = [
            "^X STOP ALL",
            "STOPPED: /resume lets macros run" if session.latched else "",
            f"playing {session.playing[-1]}" if session.playing else "",
            f"recording {session.recording}" if session.recording else "",
            f"running {self._running}" if self._running and session.busy else "",
            complete.hint(session, self._prompt.default_buffer.text)
            or (f"{drive.label} {model(drive)}".strip() if drive else "/open URL opens a line of drives"),
        ]
        return "  ".join(part for part in state if part)


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

    def store_string(self, string: str) -> None:
        self._kept.append(string)
