"""The app: takes in session events, paints thirty times a second at most, hands on what is typed, and stops.

The stop is found below every queue. On a POSIX terminal `tui.terminal.driver` finds it in the bytes as they arrive.
Every other key passes `post_message`, which checks for the stop again before it queues the key. So no screen, dialog,
list or input can take it. A stop from any source drops what was typed before it: waiting keys
(`tui.terminal.keyboard`), waiting lines (`tui.outbox`), the lines being edited, and dialogs.

A callback appends session events to a list, and a timer folds them in. Painting waits until the terminal has swallowed
the frame before; meanwhile events only gather.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.binding import BindingType
from textual.driver import Driver
from textual.geometry import Size
from textual.message import Message
from textual.screen import Screen

from multidrop.base.errors import Diagnostic
from multidrop.drives.events import Conditioned, Sample, Unsolicited, Valued
from multidrop.shell.broken_configuration import placed, placed_in_file
from multidrop.shell.configuration import DEFAULT_SCREEN, ScreenSettings, Settings, parse
from multidrop.shell.connect.urls import wrong_urls
from multidrop.shell.events import Failed, OnBus, Predicted, Printed, SessionEvent, StateChanged
from multidrop.shell.sections import sections
from multidrop.shell.session import Session
from multidrop.tui.actions import ScreenActions, ScreenParts
from multidrop.tui.assist import Assist
from multidrop.tui.boundary import Boundary
from multidrop.tui.frame_scheduler import AGEING, Frames
from multidrop.tui.key_table import bound
from multidrop.tui.keymap import FunctionKeys, keymap
from multidrop.tui.leaving import Leaving
from multidrop.tui.outbox import Outbox
from multidrop.tui.panels.view import between_at, figures_at, name_at
from multidrop.tui.presenter import Presenter
from multidrop.tui.purpose import Purpose
from multidrop.tui.screen_model import Record, ScreenModel
from multidrop.tui.screens.dialogs import LEAST_SIZE, Over, TooSmall
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.page import Framed, Page, show_rows
from multidrop.tui.screens.questions import ScreenQuestions
from multidrop.tui.screens.start import Opener, Start
from multidrop.tui.session_hooks import Hooks
from multidrop.tui.terminal.keyboard import Keyboard
from multidrop.tui.texts import Texts, unsaved_of
from multidrop.tui.tour import Tour
from multidrop.tui.typist import Selection, Typist, Unsent
from multidrop.tui.widgets.bars import Banner, Footer
from multidrop.tui.widgets.entry import Entry
from multidrop.tui.widgets.theme import Dressed, ink_of, wrong_theme

TOLD = 5.0
"""Seconds for which a line about a key is shown."""
INTERRUPTED = 130
"""The exit code after a signal."""


def is_stop(message: Message) -> bool:
    """True if a message is the stop key, in any spelling of a terminal."""
    if not isinstance(message, events.Key):
        return False
    *modifiers, key = message.key.lower().split("+")
    return key == "x" and "ctrl" in modifiers


def take_in(inbox: list[SessionEvent], model: ScreenModel, boundary: Boundary) -> None:
    """Fold the events that have come into the facts of the screen, and empty the inbox."""
    come, inbox[:] = inbox[:], []
    for event in come:
        with boundary.at("what has happened"):
            model.take(event)


class MultidropApp(Dressed):
    """The screen of one Session."""

    typist: Typist

    CSS_PATH = "multidrop.tcss"
    TITLE = "multidrop"
    BINDINGS: ClassVar[list[BindingType]] = bound("app")

    def __init__(
        self,
        session: Session,
        urls: Sequence[str],
        assist: Assist,
        driver: type[Driver] | None = None,
        screen_settings: ScreenSettings = DEFAULT_SCREEN,
        model: ScreenModel | None = None,
        purpose: Purpose | None = None,
    ) -> None:
        self._is_composed = False
        """The main screen has its parts: they can be painted."""
        super().__init__(screen_settings, driver)
        self.session, self.urls, self.assist = session, list(urls), assist
        figures, named, between = partial(figures_at, session), partial(name_at, session), partial(between_at, session)
        self.model = model or ScreenModel(lambda: session.selected_bus, lambda: session.buses, figures, named, between)
        self.boundary = Boundary(session.settings.state, partial(self.show_line, mark="x"))
        self.boundary.own(self, lambda: self._is_composed)
        self._end_boundary: Callable[[], None] = lambda: None
        self.purpose, self.macros = purpose or Purpose(session), FunctionKeys()
        self.keymap = keymap(bindings(), screen_settings.keys)
        self.presenter = Presenter(session, self.model, self.purpose, self.macros, self.keymap, self.boundary)
        self.main = MainScreen(
            self.assist.complete,
            self.assist.history,
            self._clock,
            lambda line, empty: self.typist.typed(line, empty),
            lambda lines: self.typist.pasted(lines),
        )
        self.main.times = screen_settings.times
        self.keyboard = Keyboard(self, self._tell)
        self.outbox = Outbox(session, self._warn, self.run_worker)
        self.selection = Selection(
            session, self.model, self.main, self.purpose.label, self.keyboard.turn_deaf, self.show_line
        )
        self.unsent = Unsent(self.main, self.model, session.now, self.assist.keep, self._warn)
        self.questions = ScreenQuestions(self, session, self.main, self.keyboard, lambda: self._check_size(self.size))
        self.tour = Tour(session, self.keymap, lambda: getattr(self.screen, "heading", type(self.screen).__name__))
        self.opener = Opener(self, session, self.assist, self.keyboard, self.show_line, self.tour.begin)
        self.typist = Typist(
            session, self.main, self.assist, self.outbox, self.selection, self.unsent, self.keyboard, self.questions
        )
        self.texts = Texts(self.assist.drafts())
        unsaved = partial(unsaved_of, self.texts)
        self.leaving = Leaving(
            self, session, self.keyboard, self.outbox, self.questions, self.stop_all, unsaved, self._warn
        )
        self._inbox: list[SessionEvent] = []
        self._unsubscribe, self._stops = session.subscribe(self._receive), session.stops
        self.stops_to_the_end = False
        """The reading of the terminal goes on after the app, until `Terminal.release`, for the stop key."""
        self._own_task: asyncio.Task[Any] | None = None
        self.frames = Frames(self._paint, self.call_later, lambda: self.presenter.behind)
        self.dress(screen_settings)
        self.model.look.ink = ink_of(self.signs.font)
        self._set_actions()
        self.set_keymap(self.keymap.changed)
        self._troubles = [*map(str, session.settings.problems)]
        wrong = [*self.keymap.troubles, *wrong_theme(screen_settings.theme)]
        self._troubles += [str(placed_in_file(trouble, screen_settings.where)) for trouble in wrong]

    def _set_actions(self) -> None:
        """Make what keys, the palette and the session ask of the screen."""
        self.outbox.follows = self._enter_waits
        parts = ScreenParts(
            self.session,
            self.model,
            self.outbox,
            self.texts,
            self.macros,
            self.frames,
            self.keyboard,
            self.selection.select,
            self.show_line,
            self.last_records,
            troubles_of_text,
            self,
            self.main,
            self.assist,
            self.purpose,
            self.selection,
            self.questions,
            self.keymap,
            self.opener,
            self.tour,
            self.signs,
            self.leaving,
        )
        self.act = ScreenActions(parts)
        self._action_targets |= {"act"}
        Hooks(parts, self.act, self.presenter)

    def get_default_screen(self) -> Screen[Any]:
        return self.main

    # The stop

    def post_message(self, message: Message) -> bool:
        """Receive every key, before any queue."""
        if is_stop(message) or self._is_click_on_stop(message):
            self.stop_all()
            return True
        if isinstance(message, events.AppFocus | events.AppBlur):
            return True  # keys go where they go, whichever window has the focus
        if isinstance(message, events.InputEvent):
            self.frames.wake()
        return self.keyboard.take(message) or super().post_message(message)

    def _is_click_on_stop(self, message: Message) -> bool:
        """True if a button was pressed on the footer's stop, which is visible under dialogs, too."""
        if not isinstance(message, events.MouseDown) or not self.main.is_running or isinstance(self.screen, TooSmall):
            return False
        return message.y == self.size.height - 1 and Footer.is_stop(int(message.x))

    def stop_ahead(self) -> None:
        """Write the stop to the wires, in the thread that reads the terminal; `stop_all` follows in the loop."""
        self.session.stop_ahead()

    def stop_all(self) -> None:
        """Stop everything, now. The banner appears before the next frame."""
        self.session.stop()

    def _receive(self, event: SessionEvent) -> None:
        self._inbox.append(event)
        stopped, self._stops = self.session.stops != self._stops, self.session.stops
        if stopped:  # first: a defect in what is shown must not leave it for a later event, with what was typed since
            self._drop_typed()
        inner = event.event if isinstance(event, OnBus) else None
        if self.model.quiet(event):
            if isinstance(inner, Sample | Conditioned):
                take_in(
                    self._inbox, self.model, self.boundary
                )  # nothing is painted for it, but a key may ask how old the last reading is
        else:
            if isinstance(inner, Sample | Valued | Predicted):
                self.frames.follow()
            else:
                self.frames.wake(panels=not isinstance(inner, Unsolicited))
        if stopped:
            self.model.stopped(self.session.now())
        elif isinstance(event, StateChanged) and self.selection.changed:
            self.selection.expect(self.outbox.using(self.selection.shown))
            self.call_later(self.selection.catch_up)
        elif isinstance(event, Printed | Failed) and not self.outbox.idle:
            self.frames.hurry()

    def _drop_typed(self) -> None:
        """Drop what was typed before a stop, from whatever source the stop came."""
        self.unsent.stopped(self.main.entry.unsent if self.focused is self.main.entry else None)
        self.outbox.drop()
        self.keyboard.hear()
        if asyncio.current_task() is self._own_task:
            self._cancel()  # a key stopped: the keys that wait were typed after it
            return
        self.unsent.gather()
        self.dropped(self.keyboard.clear())
        drop = getattr(getattr(self._driver, "keys", None), "drop", None)
        if drop is not None:
            drop()
        self.call_later(self._cancel)

    def dropped(self, text: str) -> None:
        """Report a text that was typed before the stop and not parsed; a NUL in it is a key that is not text."""
        self.unsent.dropped(text)

    def _enter_waits(self) -> bool:
        """Whether another Enter has come already, behind the key that is worked off."""
        unparsed = getattr(self._driver, "keys", None)
        return self.keyboard.enter_waits or (unparsed is not None and bool(unparsed.enter_waits))

    def _cancel(self) -> None:
        """Empty the lines that are being edited, and cancel dialogs. Keys that were typed after the stop come later."""
        self.unsent.empty()
        self.main.reader.close()
        if isinstance(self.screen, Start):
            self.screen.stopped()
        while isinstance(self.screen, Over) and not (isinstance(self.screen, Start) and self.screen.only):
            self.screen.dismiss(None)
        self._check_size(self.size)

    # Life

    def on_mount(self) -> None:
        self._end_boundary = self.boundary.look_at(asyncio.get_running_loop())
        self.set_interval(AGEING, self.frames.age)
        self.set_interval(AGEING, lambda: self.boundary.try_again(self.screen_stack))

    async def on_ready(self) -> None:
        """Open what was named, or ask. The main screen exists: keys that were typed before count from here on."""
        self._own_task, self._is_composed = asyncio.current_task(), True
        self.selection.follow()
        for trouble in self._troubles:
            self._warn(trouble)
        for problem in self.session.settings.problems[:1]:
            with contextlib.suppress(Diagnostic):
                self.texts.open_at(problem.where)
                self._warn(f"{self.keymap.shown('page-program')} edits {problem.where}")
        if self.urls:
            self.frames.first()
            self.call_after_refresh(self._begin)  # the first frame is shown before anything is opened
        elif (filling := self.purpose.fill()) is not None:
            self.run_worker(filling)
        elif not self.session.buses:
            await self.opener.ask()
            self.run_worker(self.assist.prepare())
        self.keyboard.start()

    def _begin(self) -> None:
        self.run_worker(self._open())

    async def _open(self) -> None:
        await self.opener.open_all(self.urls)
        await self.assist.prepare()

    def on_unmount(self) -> None:
        """Keep copies of texts that are not saved, and end the subscriptions of the screen."""
        self.texts.flush()
        self._unsubscribe()
        self.purpose.polling.end()
        self._end_boundary()

    def interrupted(self) -> None:
        """Stop what automation moves, and end: a signal came, or the terminal is gone."""
        self.session.interrupt()
        self.leaving.accept()
        self.exit(INTERRUPTED)

    # Frames

    def refresh_css(self, animate: bool = True) -> None:
        """Read the style sheet again, for other colours; at the start Textual reads it by itself."""
        if self.main.is_attached:
            super().refresh_css(animate)
        else:
            self.stylesheet.set_variables(self.get_css_variables())

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        """Write a picture as the terminal's driver has it: only the cells that differ."""
        show = getattr(self._driver, "show", None)
        if show is None or self._batch_count or not isinstance(renderable, ChopsUpdate | LayoutUpdate):
            super()._display(screen, renderable)
            return
        with self.boundary.at("what is drawn") as attempt:
            if self._running and not self._closed and self._driver is not None:
                cursor = self.screen.outer_size.clamp_offset(self.cursor_position)
                if drawn := show(renderable, self.size, cursor):
                    self._begin_update()
                    self._driver.write(drawn)
                    self._end_update()
                    self._driver.flush()
        if attempt.trouble:
            super()._display(screen, renderable)  # without the canvas: slower, and shown all the same
        else:
            self.post_display_hook()

    def terminal_ready(self) -> None:
        """Paint what waits for the terminal, which has swallowed the last frame."""
        self.frames.ready()

    def tick(self) -> bool:
        """Take in what has come, and paint what has changed; return whether the terminal takes it."""
        return self.frames.tick()

    def _paint(self, panels: bool) -> bool:
        """Paint new records, and all else if `panels`; return whether the terminal takes it."""
        take_in(self._inbox, self.model, self.boundary)
        if not self._is_composed:
            return False
        if self.model.changed:
            self.model.changed = False
            with self.boundary.at("what is open"):
                self._read_again()
        elif panels:
            self._poll()
        with self.boundary.at("the transcripts"):
            self.presenter.take_records(self.main)
        ready = getattr(self._driver, "ready", None)
        if ready is not None and not ready():
            return False
        page = next((screen for screen in self.screen_stack if isinstance(screen, Page) and screen.is_running), None)
        self.presenter.paint(self.main, self.session.now(), panels, page)
        if panels:
            with self.boundary.at("the tour"):
                show_rows(self.main.lines("tour"), self.tour.rows(self.size.width) if self.tour.on else [])
            with self.boundary.at("the hint"):
                self.typist.show_hint()
            self._raise_banner()
        return True

    def _read_again(self) -> None:
        """Read buses, drives, selection, macros and the latch again: any may have changed."""
        if self.session.quitting:
            if not self.leaving.over:
                self.leaving.accept()
                self.exit(0)
            return
        self.selection.catch_up()
        if self.session.selected_bus not in self.main.pages:
            self.selection.follow()
        for name in set(self.main.pages) - set(self.session.buses) - {""}:
            if text := self.main.drop_page(name):
                self.unsent.keep(text, self.main.current)
            self.model.forget(name)
        for name in self.macros.read(self.session.macros):
            self._warn(f"macro {name} has changed: it is played as it is now")
        self._poll()
        self._raise_banner()

    def _poll(self) -> None:
        page = next((screen for screen in self.screen_stack if isinstance(screen, Page)), None)
        with self.boundary.at("the polls"):
            wants = self.main.wants() if page is None else page.WANTS
            self.purpose.polling.update(self.session, self.model, wants)

    def _raise_banner(self) -> None:
        row = self.boundary.do(
            "the banner", lambda: self.presenter.banner(self.size.width), lambda text: ((f" {text}", "error"),)
        )
        for screen in self.screen_stack:
            for part in screen.children:
                if isinstance(part, Banner):
                    part.show(row)

    def on_resize(self, event: events.Resize) -> None:
        """Report a terminal that is too small; poll again, as a wide one has a panel."""
        self._check_size(event.size)
        self.model.changed = True
        if (resized := getattr(self._driver, "resized", None)) is not None:
            resized()

    def _check_size(self, size: Size) -> None:
        small = size.width < LEAST_SIZE[0] or size.height < LEAST_SIZE[1]
        said = isinstance(self.screen, TooSmall)
        if small and not said:
            self.push_screen(TooSmall())
        elif said and not small:
            self.keyboard.turn_deaf()
            self.pop_screen()

    # Typing

    def _clock(self, at: float) -> str:
        return f"{self.session.wall(at):%H:%M:%S.%f}"[:-3]

    def last_records(self, number: int) -> Sequence[Record]:
        records = self.main.page(self.main.current).records
        return [record for _, record in records.since(records.taken - number)]

    def show_line(self, text: str, mark: str = ".") -> None:
        """Append a line of the app's own to the transcript that is shown."""
        self.model.page("").append(Record(self.session.now(), "", mark, text, private=True))
        self.frames.wake()

    def _warn(self, text: str) -> None:
        self.show_line(text, "!")

    def _tell(self, text: str) -> None:
        """Warn in the box that is open, else in the transcript."""
        if isinstance(self.screen, Over):
            self.screen.tell(text)
        else:
            self._warn(text)

    def notify(self, message: str, *, timeout: float | None = None, **_: object) -> None:
        """Show a line for a while where it covers nothing: in the box that is open, else above the footer."""
        shown = next((screen for screen in reversed(self.screen_stack) if isinstance(screen, Over | Framed)), None)
        if shown is not None:
            shown.tell(message)
            self.set_timer(timeout or TOLD, lambda: shown.tell("") if shown.told == message else None)

    def on_entry_edited(self, event: Entry.Edited) -> None:
        """Show the meaning of the typed text, once no more keys wait."""
        if self.keyboard.idle:
            self.typist.edited()

    def action_stop_all(self) -> None:
        self.stop_all()

    async def action_quit(self) -> None:
        self.leaving.key()


def bindings() -> list[BindingType]:
    """The keys of all screens that can be set, those of the app first; no page has one of its own."""
    screens: list[type[Framed]] = [Framed, MainScreen, Page]
    return [*MultidropApp.BINDINGS, *(binding for screen in screens for binding in screen.BINDINGS)]


def configuration_troubles(found: Settings, text: str, where: str) -> list[Diagnostic]:
    """What is wrong in a configuration beyond its form: keys, themes, the URLs of connections, files that it names."""
    screen_settings = found.screen
    troubles = [*keymap(bindings(), screen_settings.keys).troubles, *wrong_theme(screen_settings.theme)]
    for name, section in sections().items():
        try:
            troubles += section.unreadable(found.section(name))
        except Diagnostic as problem:  # of a feature by others
            troubles.append(f"{name}: {problem.message}")
    troubles += wrong_urls(found.connections.values())
    return [placed(trouble, text, where) for trouble in troubles]


def troubles_of_text(text: str, where: str) -> list[Diagnostic]:
    """The same of the text of a configuration file that is being edited."""
    return configuration_troubles(parse(text, where, lenient=True), text, where)
