"""The prompt: prompt_toolkit over a session, with history, completion, hints and the stop key.

The prompt is always visible. Lines run in the background one after the other (`shell.prompt.line_queue`), with macros
and plots beside them: a line typed while a macro plays is sent at once, and the lines of a paste keep their order.

At a terminal the keys are held from the beginning, before anything is opened (`shell.prompt.keyboard`). So the
stop key is found whatever was typed before it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial

from prompt_toolkit import PromptSession
from prompt_toolkit.application import create_app_session, get_app_or_none
from prompt_toolkit.application.current import get_app_session, set_app
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory, ConditionalAutoSuggest
from prompt_toolkit.buffer import Buffer
from prompt_toolkit.filters import Condition, is_searching
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.keys import Keys
from prompt_toolkit.output import ColorDepth, Output, create_output
from prompt_toolkit.output.vt100 import Vt100_Output
from prompt_toolkit.search import stop_search
from prompt_toolkit.styles import Style
from prompt_toolkit.utils import is_dumb_terminal

from multidrop.base.errors import Diagnostic
from multidrop.base.files import lines_of
from multidrop.shell import configuration, stop_report
from multidrop.shell.automation import outcome, settled, stop_key_trial
from multidrop.shell.channel import Front
from multidrop.shell.console import swallows
from multidrop.shell.events import FAILURES, Progressed, SessionEvent, StateChanged
from multidrop.shell.exit_codes import INTERRUPTED
from multidrop.shell.hooks import Prepare, nothing
from multidrop.shell.log.writer import begin as begin_log
from multidrop.shell.prompt.collector import at_rest, collected_at_rest
from multidrop.shell.prompt.keyboard import Keyboard, on_signals, terminal
from multidrop.shell.prompt.keys import KeyboardInput, PromptQuestion
from multidrop.shell.prompt.line_queue import History, LineQueue, shown
from multidrop.shell.prompt.terminal_input import filled
from multidrop.shell.prompt.view import LinesAbove, Pager, PlainOutput, SessionCompleter, SharedHistory, Toolbar
from multidrop.shell.quitting import ENDING
from multidrop.shell.session import Session
from multidrop.shell.signals import early_ends
from multidrop.shell.streams.event_printer import EventPrinter
from multidrop.shell.streams.stdout import fail, finish, nonblocking, write

STYLE = Style.from_dict(
    {"prompt": "ansicyan", "question": "ansiyellow", "stop": "ansired", "auto-suggestion": "ansibrightblack"}
)
"""Colours among the terminal's own sixteen; NO_COLOR and a dumb terminal have none."""
TICK = 1.0
"""The time between two updates of the seconds that a line has run, s."""
MARKS = re.compile("\x1b\\[[0-9;]*[A-Za-z~]")
"""The sequences of keys that are no text, and the marks of a paste."""
FIRST_FRAME = 0.05
"""The longest wait for the first frame, s."""


def run(
    urls: Sequence[str],
    reconnect: bool = True,
    agreed: bool = False,
    beyond: bool = False,
    raw: bool = False,
    prepare: Prepare = nothing,
) -> int:
    """Open the URLs and prompt until the end; return the exit code.

    `reconnect`: lost buses are tried again. `agreed`: every question is answered with yes; `beyond`: those on travel,
    too. `raw`: the URLs are opened in raw mode. `prepare`: takes the session before a URL is opened.
    """
    try:
        settings = configuration.load(lenient=True)
    except FAILURES as failure:
        return fail(failure)
    write(sys.stderr, *map(str, settings.problems))
    try:
        with early_ends():  # before the log has its thread
            make = partial(_session, partial(Session, settings, reconnect=reconnect, raw=raw), prepare)
            return asyncio.run(_run(make, urls, agreed, beyond))
    except KeyboardInterrupt:
        return INTERRUPTED


def _session(make: Callable[[], Session], prepare: Prepare) -> Session:
    session = make()
    prepare(session)
    return session


async def _run(make: Callable[[], Session], urls: Sequence[str], agreed: bool, beyond: bool) -> int:
    with nonblocking() as streams, ExitStack() as stack:
        session = make()
        session.questions.agreed, session.questions.beyond = agreed, beyond
        session.subscribe(EventPrinter(talkative=True).show)
        begin_log(session)
        stack.enter_context(collected_at_rest(partial(at_rest, session)))
        descriptor, input_ = terminal(), None
        if descriptor is not None:
            keyboard = Keyboard(descriptor, signals=False)
            keyboard.stop_ahead = session.stop_ahead
            input_ = KeyboardInput(stack.enter_context(keyboard))
        stack.enter_context(create_app_session(input=input_, output=_output()))
        prompt = Prompt(session, input_)
        stack.enter_context(on_signals(prompt.interrupt))
        if swallows() and not agreed:
            session.doubted = stop_key_trial(session)
        try:
            return await prompt.run(urls)
        finally:
            await prompt.stopped_late()
            await session.close()
            await finish(streams, lambda: True)


def _output() -> Output:
    if sys.platform == "win32" and terminal() is not None:  # sequences, through our writer, which waits for no reader
        return Vt100_Output.from_pty(sys.stdout if sys.stdout.isatty() else sys.stderr)
    return PlainOutput() if is_dumb_terminal() else create_output(always_prefer_tty=True)


class Prompt:
    """One prompt over one session. `input_`: the input of a held keyboard."""

    def __init__(self, session: Session, input_: KeyboardInput | None = None) -> None:
        self._session = session
        self._input = input_
        self._lines = LineQueue(session)
        self._stops = self._stops_reported = session.stops
        self._interrupted = False
        self._half = ""
        """The text of the line when the prompt was ended."""
        self._asked = (-1, -1)
        """The stops and lines at the last question whether to end."""
        self._opening: asyncio.Task[None] | None = None
        self._prompt: PromptSession[str] = PromptSession(
            history=SharedHistory(History(session.settings.history)),
            completer=SessionCompleter(session),
            complete_while_typing=True,
            bottom_toolbar=lambda: self._toolbar(),
            auto_suggest=ConditionalAutoSuggest(AutoSuggestFromHistory(), Condition(lambda: not self._question.shown)),
            style=STYLE,
            color_depth=ColorDepth.DEPTH_1_BIT if "NO_COLOR" in os.environ else None,
            output=get_app_session().output,
        )
        self._pager = Pager(session, self._prompt.app)
        self._naming: asyncio.Task[None] | None = None
        """Reads which drives move, after Ctrl+C."""
        self._toolbar = Toolbar(session, self._lines, self._prompt)
        self._question = PromptQuestion(self._prompt.app, self._ask_alone, partial(self._stop, "/stop"))
        self._prompt.key_bindings = self._bindings()
        fill = partial(filled, self._question.ask_text, partial(session.notify, warning=True))
        session.front = Front(
            self._question.ask, fill, before_quit=self._may_quit, clear=self._prompt.app.renderer.clear
        )
        session.front.page = self._pager.show
        self._prompt.app.after_render += lambda _: self._echo(self._typing())
        self._accept = self._prompt.default_buffer.accept_handler
        self._prompt.default_buffer.accept_handler = self._accepted
        if input_ is not None:
            input_.keyboard.stop, input_.keyboard.gone = self._stop_key, self.interrupt
            input_.notify = partial(session.notify, warning=True)

    async def run(self, urls: Sequence[str] = ()) -> int:
        """Open the URLs and run lines until /quit, Ctrl+D, `interrupt` or a hang-up. Return the exit code.

        The prompt is shown first; lines that are entered meanwhile run after the opening.
        """
        try:
            with LinesAbove(self._prompt.app).shown():
                await self._read(urls)
        except FAILURES as failure:
            return fail(failure)
        return INTERRUPTED if self._interrupted else 0

    async def _work(self, urls: Sequence[str]) -> None:
        """Open the URLs, then run the lines."""
        if urls:
            self._lines.opening = True
            await self._first_frame()
            self._opening = asyncio.create_task(self._session.tasks.run(self._open_all(urls)))
            try:
                await self._opening
            except FAILURES:
                self._prompt.app.erase_when_done = True  # it leaves no trace; what was typed meanwhile is shown
                typed = self._typing() + (self._input.keyboard.typed if self._input else "")
                self._lines.drop("nothing was opened")
                self._lines.show_unsent("nothing was opened", typed.splitlines())
                raise
            finally:
                self._opening, self._lines.opening = None, False
        await self._lines.run()

    async def _first_frame(self) -> None:
        """Wait until the whole prompt is drawn, which takes the terminal's reply: opening may import for a while."""
        app, drawn = self._prompt.app, asyncio.Event()

        def rendered(_: object) -> None:
            if app.renderer.height_is_known:
                drawn.set()

        app.after_render += rendered
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(drawn.wait(), FIRST_FRAME)
        app.after_render -= rendered

    async def _open_all(self, urls: Sequence[str]) -> None:
        for url in urls:
            write(sys.stderr, f"opening {url}; Ctrl+X stops")
        await self._session.open_all(urls)

    async def _read(self, urls: Sequence[str]) -> None:
        worker, ticking = asyncio.create_task(self._work(urls)), asyncio.create_task(self._tick())
        worker.add_done_callback(lambda _: self._end())

        def begin() -> None:
            if self._interrupted or worker.done():  # before the prompt could be ended
                self._end()

        leave = self._session.subscribe(self._noticed)
        try:
            while not (self._session.quitting or self._interrupted or worker.done()):
                try:
                    await self._prompt.prompt_async(self._message, handle_sigint=False, pre_run=begin)
                except EOFError:  # Ctrl+D, or `_end`
                    if self._session.quitting or self._interrupted or worker.done() or await self._may_quit():
                        break
        finally:
            leave()
            if self._opening is not None:
                self._opening.cancel()
            self._lines.drop("the prompt has ended")
            self._drop_typed(ENDING)
            await self._leave()
            self._lines.close()
            others = [ticking, self._naming] if self._naming is not None else [ticking]
            for task in (worker, *others):
                task.cancel()
            await asyncio.gather(worker, *others, return_exceptions=True)
        if not worker.cancelled():
            worker.result()

    async def _tick(self) -> None:
        """Draw the seconds for which something has been under way."""
        while True:
            await asyncio.sleep(TICK)
            if self._prompt.app.is_running and self._session.under_way.text:
                self._prompt.app.invalidate()

    async def _name_moving(self) -> None:
        """Name the drives that move or may move: Ctrl+C has stopped none of them."""
        if moving := await self._session.in_motion():
            for text in moving:
                self._session.notify(text, warning=True)
            self._session.notify("Ctrl+C stopped nothing; Ctrl+X stops all drives", warning=True)

    async def _may_quit(self) -> bool:
        """Return True to end. While drives move or may move, only a second question in a row returns True."""
        now = (self._session.stops, self._lines.count)
        if self._asked == now:
            return True
        self._asked = now
        with self._lines.deciding():
            moving = await self._session.in_motion()
            for text in moving:
                self._session.notify(text, warning=True)
            if moving:
                self._session.notify("/quit again leaves them moving; Ctrl+X stops all drives", warning=True)
                self._drop_typed("it was typed after a quit")
        return not moving

    def _drop_typed(self, why: str) -> None:
        """Drop and name the text that no Enter has entered yet."""
        typed, self._half = self._half + self._typing(), ""
        if self._input is not None:
            typed += self._input.drop_typed()
        lines = ["".join(filter(str.isprintable, line)) for line in re.split(r"\r\n|\r|\n", MARKS.sub("", typed))]
        self._lines.show_unsent(why, lines)
        if typed and self._prompt.app.is_running:
            self._prompt.default_buffer.reset()

    async def _leave(self) -> None:
        """Stop what automation started, and write the outcome of that stop and of the last one."""
        self._stops_reported = self._session.stops
        if not self._session.automations.was_interrupted:
            self._session.interrupt()
        await self._session.automations.over(lambda text: write(sys.stderr, text))
        halts = self._session.automations.interrupted
        if halts or self._session.latched or self._session.busy:
            await settled(self._session)
        for line in outcome(self._session, halts):
            write(sys.stderr, line)
        await self.stopped_late()

    async def stopped_late(self) -> None:
        """Name what was typed since the end of the prompt, and write the outcome of the stops since."""
        self._drop_typed(ENDING)
        while self._stops_reported != self._session.stops:
            self._stops_reported = self._session.stops
            await settled(self._session)
            write(sys.stderr, f"stop: {stop_report.words(self._session.tally())}")

    def _echo(self, typed: str) -> None:
        if isinstance(plain := self._prompt.app.output, PlainOutput):
            plain.echo(self._message()[0][1], typed)

    def _accepted(self, buffer: Buffer) -> bool:
        self._echo(buffer.text)
        if self._question.takes(buffer.text):
            buffer.reset()  # an answer is not a line: the history does not keep it
            return True
        if self._pager.takes(buffer.text):
            buffer.reset()
            return True
        self._pager.rest.clear()
        followed = self._input is not None and self._input.enters_follow
        self._lines.enter(buffer.text or self._session.enter_alone(), followed)
        if self._input is not None:
            self._input.rest()
        return self._accept(buffer) if self._accept is not None else False

    def _typing(self) -> str:
        app = self._prompt.app
        return self._prompt.default_buffer.text if app.is_running and not app.is_done else ""

    def _noticed(self, event: SessionEvent) -> None:
        app = get_app_or_none()
        if isinstance(event, Progressed):
            self._toolbar.progress = None if event.over else event
            if self._prompt.app.is_running:
                self._prompt.app.invalidate()
        if not isinstance(event, StateChanged):
            return
        if self._stops != self._session.stops:
            self._stops = self._session.stops
            self._lines.stopped()
        if self._session.quitting:
            self._end()
        elif app is not None and self._prompt.app.is_running:
            app.invalidate()

    def _end(self) -> None:
        app = self._prompt.app
        if app.is_running and app.future is not None and not app.future.done():
            self._half = self._typing()
            app.exit(exception=EOFError)

    def interrupt(self) -> None:
        """End the prompt after a signal or a hang-up of the terminal."""
        self._interrupted = True
        self._session.interrupt()
        if self._opening is not None:
            self._opening.cancel()
        self._end()

    def _stop_key(self, dropped: str) -> None:
        """Stop, ahead of all other keys: nothing typed before the stop key is sent."""
        self._session.stop("Ctrl+X")
        if self._input is not None:
            dropped = self._input.forget(dropped)
        self._prompt.app.key_processor.reset()
        self._empty(dropped)

    def _stop(self, why: str) -> None:
        self._session.stop(why, follows=False)
        self._empty()

    def _empty(self, typed_ahead: str = "") -> None:
        """Clear the line that is being typed and the text typed after it; both stay in the history."""
        lines = [shown(line) for line in (self._typing() + typed_ahead).splitlines() if line.strip()]
        self._lines.show_unsent("a stop came", lines)
        for line in lines:
            self._prompt.history.append_string(line)
        self._clear()

    def _ask_alone(self) -> None:
        """Drop the line that is being typed: a question takes the keys now."""
        lines = [shown(line) for line in self._typing().splitlines() if line.strip()]
        self._lines.show_unsent("a question came", lines)
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

        @bindings.add("c-c", eager=True)
        def clear(event: KeyPressEvent) -> None:
            if self._question.taking():
                event.current_buffer.reset()
                self._question.no()
            elif self._session.busy:
                self._stop("Ctrl+C")
            elif self._question.open():
                self._question.no()
            else:
                event.current_buffer.reset()
                if self._naming is None or self._naming.done():
                    self._naming = asyncio.create_task(self._name_moving())

        @bindings.add(Keys.BracketedPaste)
        def paste(event: KeyPressEvent) -> None:
            try:
                event.current_buffer.insert_text("\n".join(lines_of(event.data)))
            except Diagnostic as problem:
                self._session.notify(f"{problem}; nothing was pasted", warning=True)

        @bindings.add("c-s", filter=~is_searching, eager=True)
        @bindings.add("c-q", eager=True)
        def ignore(event: KeyPressEvent) -> None:
            """Ignore the keys of flow control: they begin no search and quote no key."""

        self._question.bind(bindings)
        return bindings

    def _message(self) -> StyleAndTextTuples:
        if self._question.shown:
            return [("class:question", self._question.shown)]
        drive = self._session.selected
        if (bus := self._session.selected_bus) in self._session.raw:
            return [("class:prompt", f"{bus} raw> ")]
        return [("class:prompt", f"{self._session.display_name(drive) if drive else bus}> ")]
