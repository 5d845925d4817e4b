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
import os
import time
from collections.abc import Awaitable, Sequence
from functools import partial
from typing import Any, ClassVar

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.app import App
from textual.binding import Binding, BindingType
from textual.driver import Driver
from textual.filter import LineFilter
from textual.geometry import Size
from textual.message import Message
from textual.screen import Screen
from textual.widgets import Input

from dialects import Diagnostic, DriveError
from drives.events import Unsolicited
from shell.events import Failed, OnBus, Printed, SessionEvent, StateChanged
from transports import TransportLost
from tui.assist import Assist
from tui.function_keys import FunctionKeys
from tui.outbox import Outbox
from tui.palette import Command, all_commands, commands_like
from tui.panels.glance import glances_of
from tui.polling import Polling
from tui.presenter import PANELS, Presenter
from tui.screen_model import Record, ScreenModel
from tui.screens.dialogs import LEAST, Over, Search, TooSmall
from tui.screens.main_screen import MainScreen
from tui.screens.page import Page
from tui.screens.questions import Questions
from tui.screens.start import Start
from tui.screens.table import PAGES, page_entry
from tui.selection import Selection
from tui.session_view import SessionView
from tui.terminal.keyboard import Keyboard
from tui.transcripts import Transcripts
from tui.unsent import Unsent
from tui.widgets.banner import Banner
from tui.widgets.entry import LONGEST, Entry
from tui.widgets.footer import Footer
from tui.widgets.signs import SignFilter, Signs, signs_for
from tui.widgets.theme import DEFAULTS, THEMES, theme_for

INTERRUPTED = 130
"""The exit code after a signal."""
FRAMES = 30
"""Paints a second, at most."""
AGEING = 0.5
"""Seconds between two paints while nothing happens."""
FAILURES = (DriveError, Diagnostic, TransportLost)
CTRL_C = "Ctrl+Q quits, Ctrl+X stops all drives"


def is_stop(message: Message) -> bool:
    """True if a message is the stop key, in any spelling of a terminal."""
    if not isinstance(message, events.Key):
        return False
    *modifiers, key = message.key.lower().split("+")
    return key == "x" and "ctrl" in modifiers


class MultidropApp(App[int]):
    """The screen of one Session."""

    CSS_PATH = "multidrop.tcss"
    TITLE = "multidrop"
    ENABLE_COMMAND_PALETTE = False
    """Textual's own palette; ours is a `Search`, in which keys keep their order."""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+q", "quit", show=False, priority=True),
        Binding("ctrl+c", "explain", show=False, priority=True),
        *(Binding(page.key, f"page('{page.name}')", show=False, priority=True) for page in PAGES if page.key),
    ]

    def __init__(
        self,
        session: SessionView,
        urls: Sequence[str],
        assist: Assist | None = None,
        driver: type[Driver] | None = None,
    ) -> None:
        # With NO_COLOR, only this makes Textual take colours away altogether; else it makes greys of them.
        super().__init__(driver_class=driver, ansi_color=True if "NO_COLOR" in os.environ else None)
        self.session, self.urls, self.assist = session, list(urls), assist or Assist()
        self.model = ScreenModel(lambda: session.selected_bus, lambda: session.buses)
        self.polling, self.macros = Polling(), FunctionKeys()
        self.presenter = Presenter(session, self.model, self.polling, self.macros)
        self.main = MainScreen(self.assist.complete, self.assist.history, self._clock, self._typed, self._pasted)
        self.keyboard = Keyboard(self, self._warn)
        self.outbox = Outbox(session, self._warn, self.run_worker)
        self.selection = Selection(session, self.model, self.main, self.presenter.label, self.keyboard.turn_deaf)
        self.unsent = Unsent(self.main, self.model, session.now, self.assist.keep, self._warn)
        self.questions = Questions(self, session)
        session.transcripts = Transcripts(self.main, session, self.outbox, self.questions.paste)
        self.mouse_on = True
        self._inbox: list[SessionEvent] = []
        self._unsubscribe = session.subscribe(self._receive)
        self._stops = session.stops
        self._meaning = ""
        self._own_task: asyncio.Task[Any] | None = None
        session.before_quit, session.ask, session.screen = self._before_quit, self._go_on, self.action_page
        self._beat = 0
        self._due = False
        """A frame is about to be painted."""
        self._panels_owed = False
        """More than records has changed since the panels were painted."""
        self._painted_at = 0.0
        self._hurried = False
        """The reply to a typed line was painted early since the last frame."""
        self._owed = False
        """It is to be painted as soon as the terminal takes it."""
        self._signs = SignFilter(signs_for("auto", os.environ))
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = theme_for(None if self.no_color else self.console.color_system)

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Colours for themes that are not ours."""
        return DEFAULTS

    def get_line_filters(self) -> Sequence[LineFilter]:
        """The filters of Textual, and the one that replaces signs; it comes last."""
        filters = super().get_line_filters()
        return filters if self._signs.signs is Signs.FULL else [*filters, self._signs]

    def show_signs(self, signs: Signs) -> None:
        """Show only these signs from now on."""
        self._signs.signs = signs
        self.refresh_css()

    def get_default_screen(self) -> Screen[Any]:
        """The main screen, below all others."""
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
            self.wake()
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
        self.model.stopped(self.session.now())

    def _receive(self, event: SessionEvent) -> None:
        self._inbox.append(event)
        self.wake(panels=not (isinstance(event, OnBus) and isinstance(event.event, Unsolicited)))
        if self.session.stops != self._stops:
            self._stops = self.session.stops
            self._drop_typed()
        elif isinstance(event, StateChanged) and self.selection.changed:
            self.selection.expect(self.outbox.using(self.selection.shown))
            self.call_later(self.selection.catch_up)
        elif isinstance(event, Printed | Failed) and not self._hurried and not self.outbox.idle:
            self._hurried = self.call_later(self._hurry)  # the reply to a typed line is shown now, once between frames

    def _drop_typed(self) -> None:
        """Drop what was typed before a stop, from whatever source the stop came."""
        self.unsent.stopped(self.main.entry.value if self.focused is self.main.entry else None)
        self.outbox.drop()
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

    def _cancel(self) -> None:
        """Empty the lines that are being edited, and cancel dialogs. Keys that were typed after the stop come later."""
        self.unsent.empty()
        self.main.reader.close()
        while isinstance(self.screen, Over) and not (isinstance(self.screen, Start) and self.screen.only):
            self.screen.dismiss(None)
        self._check_size(self.size)

    # Life

    def on_mount(self) -> None:
        """Begin to paint."""
        self.set_interval(AGEING, self._age)

    async def on_ready(self) -> None:
        """Open what was named, or ask. The main screen exists: keys that were typed before count from here on."""
        self._own_task = asyncio.current_task()
        self.selection.follow()
        if self.urls:
            self.tick()
            self.call_after_refresh(self._begin)  # the first frame is shown before anything is opened
        elif not self.session.buses:
            await self.action_open()
        self.keyboard.start()

    def _begin(self) -> None:
        self.run_worker(self._open_all())

    async def _open_all(self) -> None:
        failures: list[str] = []

        def failed(number: int, failure: BaseException) -> None:
            if not isinstance(failure, FAILURES):
                raise failure
            failures.append(str(failure))
            self.show_line(failures[-1], "x")

        for url in self.urls:
            self.show_line(f"opening {url} …")
        await self.session.open_all(self.urls, failed)
        if not self.session.buses:
            self.keyboard.turn_deaf()
            await self.action_open(failures[-1])

    async def connect(self, url: str) -> str:
        """Open a URL; return an empty string, or one line with the reason of the failure."""
        try:
            await self.session.open(url)
        except FAILURES as failure:
            if self.session.buses:
                self.show_line(str(failure), "x")
            return str(failure)
        return ""

    def on_unmount(self) -> None:
        """End the subscriptions of the screen."""
        self._unsubscribe()
        self.polling.end()

    def interrupted(self) -> None:
        """Stop what automation moves, and end: a signal came, or the terminal is gone."""
        self.session.interrupt()
        self.exit(INTERRUPTED)

    # Frames

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        """Write a picture as the terminal's driver has it: only the cells that differ."""
        show = getattr(self._driver, "show", None)
        if show is None or self._batch_count or not isinstance(renderable, ChopsUpdate | LayoutUpdate):
            super()._display(screen, renderable)
            return
        if self._running and not self._closed and self._driver is not None:
            cursor = self.screen.outer_size.clamp_offset(self.cursor_position)
            if drawn := show(renderable, self.size, cursor):
                self._begin_update()
                self._driver.write(drawn)
                self._end_update()
                self._driver.flush()
        self.post_display_hook()

    def wake(self, panels: bool = True) -> None:
        """Paint soon: something has happened. `panels`: it may be more than a record."""
        self._panels_owed = self._panels_owed or panels
        if not self._due:
            self._due = True
            delay = max(0.0, self._painted_at + 1 / FRAMES - time.monotonic())
            asyncio.get_running_loop().call_later(delay, self.call_later, self._frame)

    def _frame(self) -> None:
        """Paint a frame, and another one until all is painted that has come."""
        self._due = self._hurried = self._owed = False
        now = time.monotonic()
        if now - self._painted_at >= PANELS / FRAMES:  # the first for a while shows all
            self._beat += (PANELS - 1 - self._beat) % PANELS
        self._painted_at = now
        painted = self.tick()
        if painted and self._beat % PANELS == 0:
            self._panels_owed = False
        if not painted or self._panels_owed or self.presenter.behind:
            self.wake(panels=False)

    def _age(self) -> None:
        """Paint what changes by itself: the clock, and how old values are."""
        if time.monotonic() - self._painted_at > AGEING / 2:
            self.wake()

    def _hurry(self) -> None:
        self._owed = not self.tick()

    def terminal_ready(self) -> None:
        """Paint what waits for the terminal, which has swallowed the last frame."""
        if self._owed:
            self._hurry()

    def tick(self) -> bool:
        """Take in what has come, and paint what has changed; return whether the terminal takes it."""
        inbox, self._inbox[:] = self._inbox[:], []
        for event in inbox:
            self.model.take(event)
        if not self.main.is_running:
            return False
        if self.model.changed:
            self.model.changed = False
            self._look_again()
        elif self._beat % PANELS == PANELS - 1:
            self._poll()
        self.presenter.take_records(self.main)
        ready = getattr(self._driver, "ready", None)
        if ready is not None and not ready():
            return False
        self._beat += 1
        page = next((each for each in self.screen_stack if isinstance(each, Page) and each.is_running), None)
        self.presenter.paint(self.main, self.session.now(), self._beat, page)
        if self._beat % PANELS == 0:
            self._show_hint()
            self._raise_banner()
        return True

    def _look_again(self) -> None:
        """Read buses, drives, selection, macros and the latch again: any may have changed."""
        if self.session.quitting:
            self.exit(0)
            return
        self.selection.catch_up()
        if self.session.selected_bus not in self.main.pages:
            self.selection.follow()
        for name in set(self.main.pages) - set(self.session.buses) - {""}:
            if text := self.main.drop_page(name):
                self.unsent.keep(text, self.main.current)
            self.model.forget(name)
        self.macros.read(self.session.macros)
        self._poll()
        self._raise_banner()

    def _poll(self) -> None:
        page = next((each for each in self.screen_stack if isinstance(each, Page)), None)
        self.polling.update(self.session, self.model, self.main.wants() if page is None else page.WANTS)

    def _raise_banner(self) -> None:
        row = self.presenter.banner(self.size.width)
        for screen in self.screen_stack:
            for banner in screen.query(Banner):
                banner.show(row)

    def on_resize(self, event: events.Resize) -> None:
        """Report a terminal that is too small; poll again, as a wide one has a panel."""
        self._check_size(event.size)
        self.model.changed = True

    def _check_size(self, size: Size) -> None:
        small = size.width < LEAST[0] or size.height < LEAST[1]
        said = isinstance(self.screen, TooSmall)
        if small and not said:
            self.push_screen(TooSmall())
        elif said and not small:
            self.keyboard.turn_deaf()
            self.pop_screen()

    # Typing

    def _clock(self, at: float) -> str:
        return f"{self.session.wall(at):%H:%M:%S}"

    def show_line(self, text: str, mark: str = ".") -> None:
        """Append a line of the app's own to the transcript that is shown."""
        self.model.page("").append(Record(self.session.now(), "", mark, text))
        self.wake()

    def _warn(self, text: str) -> None:
        self.show_line(text, "!")

    def on_entry_edited(self, event: Entry.Edited) -> None:
        """Show the meaning of the typed text, once no more keys wait."""
        if not self.keyboard.idle:
            return
        text = self.main.entry.value
        self._meaning = self.assist.hint(text) if len(text) <= LONGEST else ""
        self._show_hint()
        self.main.show_menu()

    def _show_hint(self) -> None:
        """Show how many lines wait, and the meaning of the typed text."""
        waiting = self.outbox.waiting
        waits = f"{waiting} lines wait" if waiting > 1 else "a line waits"
        self.main.set_hint(f"{waits} for the one before   {self._meaning}".rstrip() if waiting else self._meaning)

    def _typed(self, line: str) -> Awaitable[None]:
        """Send a line on behalf of a person; what is returned follows once the input line is empty."""
        if self.selection.changed or line == "/stop":
            return self._typed_meanwhile(line)
        self.outbox.type(line)
        return self._sent(line)

    async def _sent(self, line: str) -> None:
        """Follow a line that was sent."""
        await asyncio.sleep(0)  # its first step: now it has its drive, and what is immediate is done
        self.assist.keep(line)
        self.main.page(self.main.current).look_end(newest=True)
        self.selection.follow()

    async def _typed_meanwhile(self, line: str) -> None:
        """Send a line that stops, or before which another drive was selected."""
        if self.selection.unexpected:
            self.unsent.keep(line, self.selection.shown.bus)  # it was for the drive that is still shown
            self.keyboard.turn_deaf()
            self.selection.catch_up()
            return
        self.selection.catch_up()
        if line == "/stop":
            self.assist.keep(line)
            await self.session.run(line)
            return
        self.outbox.type(line)
        await self._sent(line)

    async def _pasted(self, lines: list[str]) -> None:
        """Ask before several lines are sent one after the other."""
        await self.questions.paste(lines, self.outbox.paste)

    async def _go_on(self, question: str) -> bool:
        """Put a question of the session. Keys typed ahead answer nothing."""
        self.keyboard.turn_deaf()
        self.presenter.take_records(self.main)
        before = self.main.page(self.main.current).since_typed()
        return await self.questions.go_on(question, before, lambda: self._check_size(self.size))

    # Actions

    def action_stop_all(self) -> None:
        """Stop everything."""
        self.stop_all()

    async def action_run_line(self, line: str) -> None:
        """Run a line in the background. Its event reports a failure; a bug ends the app.

        When this returns the line has taken its first step and has its drive.
        """
        self.run_worker(self._end_of(self.session.start(line)))
        await asyncio.sleep(0)
        self.selection.follow()

    @staticmethod
    async def _end_of(task: asyncio.Task[bool]) -> None:
        await asyncio.wait([task])
        if not task.cancelled():
            task.result()

    def action_begin_line(self, text: str) -> None:
        """Put the beginning of a line into the input line."""
        self.main.entry.put(text)
        self.main.set_focus(self.main.entry)

    def action_select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus."""
        try:
            self.session.select(address, bus)
        except FAILURES as failure:
            self.show_line(str(failure), "x")
        self.selection.follow()
        self.model.changed = True

    def action_bus(self, step: int) -> None:
        """Show the next bus, or the one before."""
        names = list(self.session.buses)
        if names:
            at = names.index(self.session.selected_bus) if self.session.selected_bus in names else 0
            self.action_select("", names[(at + step) % len(names)])

    def action_bus_number(self, number: int) -> None:
        """Show the bus with a number."""
        names = list(self.session.buses)
        if number <= len(names):
            self.action_select("", names[number - 1])

    async def action_play(self, key: str) -> None:
        """Play the macro on a key."""
        self.macros.read(self.session.macros)
        if self.macros.trouble:
            self.show_line(self.macros.trouble, "x")
        name = self.macros.keys.get(key)
        if clash := self.macros.clash(key):
            self.show_line(clash, "x")
        elif name is not None:
            await self.action_run_line(f"/play {name}")
        else:
            self.show_line(f"{key} plays nothing; /key {key} NAME puts a macro on it")

    async def action_record(self) -> None:
        """Begin a recording, or end the current one."""
        if self.session.recording:
            await self.action_run_line("/record stop")
        else:
            await self.questions.macro_name(lambda name: self.action_run_line(f"/record {name}"))

    async def action_search_history(self) -> None:
        """Search the lines typed before; the one that is taken goes into the line and is not sent."""
        await self.questions.history(self.assist.history(), self.action_begin_line)

    def commands(self) -> list[Command]:
        """What the palette offers."""
        verbs = self.assist.verbs()
        return list(all_commands(self.session, self.macros, verbs, polling=self.polling.on, mouse=self.mouse_on))

    async def action_palette(self) -> None:
        """Search everything by name."""
        if not isinstance(self.screen, Search):
            found = self.commands()
            run = self.run_action
            await self.questions.palette(
                partial(commands_like, found), lambda number: run(found[number].action, self.main)
            )

    async def action_choose_drive(self) -> None:
        """Choose the drive that plain text goes to."""
        glances = partial(glances_of, self.session, self.model)
        await self.questions.drive(glances, self.action_select)

    async def action_choose_theme(self) -> None:
        """Choose colours."""
        await self.questions.theme()

    def action_panel(self, name: str) -> None:
        """Show a panel, or hide it."""
        self.main.toggle_panel(name)
        self.model.changed = True

    async def action_page(self, name: str) -> None:
        """Show a page in front of the main screen; one page at a time. Raises Diagnostic."""
        entry = page_entry(name)
        shown = next((each for each in self.screen_stack if isinstance(each, Page)), None)
        if shown is None:
            await self.push_screen(entry.make(self))
        elif shown is self.screen and type(shown) is not entry.make:
            await self.switch_screen(entry.make(self))
        self.model.changed = True

    def action_polling(self) -> None:
        """Switch polling on or off."""
        self.polling.on = not self.polling.on
        self.model.changed = True

    async def action_open(self, trouble: str = "") -> None:
        """Show what can be opened. Keys wait while a connection opens, as their meaning is unknown until then."""

        def opening(begun: bool) -> None:
            if begun:
                self.keyboard.hold()
            else:
                self.keyboard.release()

        only = not self.session.buses
        screen = Start(self.connect, self.assist.saved(), self.assist.ports, opening, only=only, trouble=trouble)
        await self.push_screen(screen)

    def action_clear(self) -> None:
        """Clear the transcript that is shown."""
        self.main.page(self.main.current).clear()

    def action_copy_view(self) -> None:
        """Copy the transcript in view to the clipboard."""
        self.copy_to_clipboard(self.main.page(self.main.current).plain)
        self.notify("Copied", timeout=2)

    def action_mouse(self) -> None:
        """Take the mouse, or leave it to the terminal."""
        self.mouse_on = not self.mouse_on
        switch = getattr(self._driver, "mouse", None)
        if switch is not None:
            switch(self.mouse_on)

    async def action_help(self) -> None:
        """Show keys and signs."""
        await self.questions.help()

    def action_explain(self) -> None:
        """Copy the selected text on Ctrl+C, else name the keys that end and stop."""
        focused = self.focused
        selected = focused.selected_text if isinstance(focused, Input) else self.screen.get_selected_text()
        if selected:
            self.copy_to_clipboard(selected)
        self.notify("Copied" if selected else CTRL_C, timeout=4)

    async def _before_quit(self) -> bool:
        """Take `/quit` as Ctrl+Q, which ends the app by itself."""
        self.call_later(self.action_quit)
        return False

    async def action_quit(self) -> None:
        """Quit; ask if that would leave something unfinished."""
        await self.questions.quit(lambda: self.outbox.waiting, self.stop_all, lambda: self._check_size(self.size))
