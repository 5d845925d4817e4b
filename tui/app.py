"""The app: takes in session events, paints thirty times a second at most, hands on what is typed, and stops.

The stop stands below everything. On a POSIX terminal it is found in the bytes that come (`tui.terminal`); every other
key comes through `post_message`, where it is caught again before it is queued. So no screen, dialog, list or input
can take it.

Session events are appended to a list by a callback and folded in by a timer. Painting waits until the terminal has
swallowed the frame before; meanwhile events only gather.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from textual import events
from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.driver import Driver
from textual.geometry import Size
from textual.message import Message
from textual.screen import Screen
from textual.widgets import Input
from textual.worker import Worker

from dialects import Diagnostic, DriveError
from shell.events import SessionEvent
from transports import TransportLost
from tui.aids import Aids
from tui.banner import Banner, banner_row
from tui.board import Board, Record
from tui.commands import all_commands
from tui.desk import Desk
from tui.entry import Entry
from tui.footer import Footer
from tui.macrokeys import MacroKeys
from tui.main import Main
from tui.painter import Painter
from tui.polling import Polling
from tui.questions import drive_choices, leaving, sending
from tui.screens import LEAST, Ask, Choose, Confirm, Help, TooSmall
from tui.start import Start
from tui.theme import DEFAULTS, THEMES, theme_for
from tui.topline import TopLine

INTERRUPTED = 130
"""The exit code after a signal."""
FRAMES = 30
"""Paints a second, at most."""
FAILURES = (DriveError, Diagnostic, TransportLost)
CTRL_C = "Ctrl+Q quits, Ctrl+X stops all drives"


def is_stop(message: Message) -> bool:
    """Whether a message is the stop key, however a terminal has spelt it."""
    if not isinstance(message, events.Key):
        return False
    *modifiers, key = message.key.lower().split("+")
    return key == "x" and "ctrl" in modifiers


class MultidropApp(App[int]):
    """The screen of one Session (`desk`)."""

    CSS_PATH = "multidrop.tcss"
    TITLE = "multidrop"
    ENABLE_COMMAND_PALETTE = True
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+q", "quit", show=False, priority=True),
        Binding("ctrl+c", "explain", show=False, priority=True),
    ]

    def __init__(
        self, desk: Desk, urls: Sequence[str], aids: Aids | None = None, driver: type[Driver] | None = None
    ) -> None:
        # With NO_COLOR, only this makes Textual take colours away altogether; else it makes greys of them.
        super().__init__(driver_class=driver, ansi_color=True if "NO_COLOR" in os.environ else None)
        self.desk, self.urls, self.aids = desk, list(urls), aids or Aids()
        self.board = Board(lambda: desk.selected_bus)
        self.polling, self.macros = Polling(), MacroKeys()
        self.painter = Painter(desk, self.board, self.polling, self.macros)
        self.main = Main(self.aids.complete, self.aids.history, self._clock)
        self.mouse_on = True
        self._inbox: list[SessionEvent] = []
        self._unsubscribe = desk.subscribe(self._inbox.append)
        self._beat = 0
        self._sending: Worker[None] | None = None
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = theme_for(None if self.no_color else self.console.color_system)

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Our own colours, for themes that are not ours."""
        return DEFAULTS

    def get_default_screen(self) -> Screen[Any]:
        """The main screen is the one under all others."""
        return self.main

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """What the palette offers."""
        return all_commands(self)

    # The stop

    def post_message(self, message: Message) -> bool:
        """Every key enters here, before any queue."""
        if is_stop(message):
            self.stop_all()
            return True
        return super().post_message(message)

    def stop_all(self) -> None:
        """Stop everything, now. The banner is up before the next frame."""
        self.desk.stop()
        if self._sending is not None:
            self._sending.cancel()
        self.board.stopped(self.desk.now())

    def on_click(self, event: events.Click) -> None:
        """A click on the footer's stop stops."""
        if isinstance(event.widget, Footer) and event.widget.is_stop(event.x):
            self.stop_all()

    # Life

    def on_mount(self) -> None:
        """Begin: open what was named, or ask."""
        self.set_interval(1 / FRAMES, self.tick)
        if self.urls:
            self.run_worker(self._open_all())
        elif not self.desk.buses:
            self.action_open()

    async def _open_all(self) -> None:
        trouble = ""
        for url in self.urls:
            self.say(f"opening {url} …")
            trouble = await self.connect(url) or trouble
        if not self.desk.buses:
            self.action_open(trouble)

    async def connect(self, url: str) -> str:
        """Open a URL; an empty string, or one line that says why not."""
        try:
            await self.desk.open(url)
        except FAILURES as failure:
            if self.desk.buses:
                self.say(str(failure), "x")
            return str(failure)
        return ""

    def on_unmount(self) -> None:
        """End what goes on for the screen."""
        self._unsubscribe()
        self.polling.end()

    def interrupted(self) -> None:
        """A signal came, or the terminal went: stop what automation moves, and end."""
        if self.desk.busy:
            self.desk.stop("interrupted")
        self.exit(INTERRUPTED)

    # Frames

    def tick(self) -> None:
        """Take in what has come, and paint what has changed."""
        inbox, self._inbox[:] = self._inbox[:], []
        for event in inbox:
            self.board.take(event)
        if not self.main.is_running:
            return
        if self.board.changed:
            self.board.changed = False
            self._look_again()
        elif self._beat % 6 == 0:
            self._poll()
        ready = getattr(self._driver, "ready", None)
        if ready is not None and not ready():
            return
        self._beat += 1
        self._paint(self.desk.now())
        ask = getattr(self._driver, "ask", None)
        if ask is not None:
            self.call_after_refresh(ask)

    def _paint(self, now: float) -> None:
        for name, facts in list(self.board.buses.items()):
            if facts.fresh:
                fresh, facts.fresh = facts.fresh, []
                self.main.take(name, fresh)
        if self._beat % 3 == 0:
            self.painter.paint_frame(self.main, now)
            self.painter.paint_status(self.main, now)
        if self._beat % 2 == 0:
            self.painter.paint_plot(self.main, now)

    def _look_again(self) -> None:
        """Buses, drives, selection, macros or the latch may have changed."""
        if self.desk.quitting:
            self.exit(0)
            return
        main, current = self.main, self.desk.selected_bus
        for name in set(main.pages) - set(self.desk.buses) - {""}:
            main.drop_page(name)
            self.board.forget(name)
        if current != main.current or current not in main.pages:
            if main.current == "" and "" in main.pages and current:
                self.board.bus(current).fresh[:0] = main.pages[""].records
                main.drop_page("")
            main.show_page(current)
        self.macros.read(self.desk.macros)
        self._poll()
        self._raise_banner()

    def _poll(self) -> None:
        self.polling.update(self.desk, self.board, plot=self.main.plot_shown)

    def _raise_banner(self) -> None:
        bus = self.desk.buses.get(self.desk.selected_bus)
        lost = str(bus.lost) if bus is not None and bus.lost is not None else ""
        row = banner_row(self.desk.latched, lost, self.size.width)
        for screen in self.screen_stack:
            for banner in screen.query(Banner):
                banner.say(row)

    def on_resize(self, event: events.Resize) -> None:
        """Too small is said; what is wide enough for a panel is polled for it."""
        self._look_at_size(event.size)
        self.board.changed = True

    def _look_at_size(self, size: Size) -> None:
        small = size.width < LEAST[0] or size.height < LEAST[1]
        said = isinstance(self.screen, TooSmall)
        if small and not said:
            self.push_screen(TooSmall())
        elif said and not small:
            self.pop_screen()

    # Typing

    def _clock(self, at: float) -> str:
        return f"{self.desk.wall(at):%H:%M:%S}"

    def say(self, text: str, mark: str = ".") -> None:
        """A line of the app's own in the transcript that is shown."""
        self.board.bus("").fresh.append(Record(self.desk.now(), "", mark, text))

    def start(self, line: str) -> None:
        """Run a line in the background. A failure is told by its event; a bug brings the app down."""
        self.run_worker(self._end_of(self.desk.start(line)))

    @staticmethod
    async def _end_of(task: asyncio.Task[None]) -> None:
        await asyncio.wait([task])
        if not task.cancelled():
            task.result()

    def begin_line(self, text: str) -> None:
        """Put the beginning of a line where a person goes on typing."""
        self.main.entry.put(text)
        self.main.entry.focus()

    def on_entry_edited(self, event: Entry.Edited) -> None:
        """Show what is meant by what is typed."""
        self.main.set_hint(self.aids.hint(self.main.entry.value))
        self.main.show_menu()

    def on_entry_typed(self, event: Entry.Typed) -> None:
        """A person sends a line."""
        self.aids.keep(event.line)
        self.main.page(self.main.current).look_end(newest=True)
        self.start(event.line)

    def on_entry_pasted(self, event: Entry.Pasted) -> None:
        """Several lines: ask, then send them one after the other."""
        lines = event.lines
        title, shown, answers = sending(self.desk, lines)

        def answered(answer: str | None) -> None:
            if answer == "send":
                self._sending = self.run_worker(self._send_all(lines))

        self.push_screen(Confirm(title, shown, answers), answered)

    async def _send_all(self, lines: Sequence[str]) -> None:
        for sent, line in enumerate(lines):
            try:
                await self.desk.run(line)
            except FAILURES:
                if sent + 1 < len(lines):
                    self.say(f"{len(lines) - sent - 1} of {len(lines)} pasted lines were not sent", "!")
                return
            except asyncio.CancelledError:
                self.say(f"{len(lines) - sent - 1} of {len(lines)} pasted lines were not sent", "!")
                raise

    # Actions

    def on_top_line_chosen(self, event: TopLine.Chosen) -> None:
        """A tab was clicked."""
        self.action_bus_number(event.number)

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus."""
        try:
            self.desk.select(address, bus)
        except FAILURES as failure:
            self.say(str(failure), "x")
        self.board.changed = True

    def action_bus(self, step: int) -> None:
        """The next bus, or the one before."""
        names = list(self.desk.buses)
        if names:
            at = names.index(self.desk.selected_bus) if self.desk.selected_bus in names else 0
            self.select("", names[(at + step) % len(names)])

    def action_bus_number(self, number: int) -> None:
        """The bus with a number."""
        names = list(self.desk.buses)
        if number <= len(names):
            self.select("", names[number - 1])

    def action_play(self, key: str) -> None:
        """Play the macro on a key."""
        self.macros.read(self.desk.macros)
        if self.macros.trouble:
            self.say(self.macros.trouble, "x")
        name = self.macros.keys.get(key)
        if clash := self.macros.clash(key):
            self.say(clash, "x")
        elif name is not None:
            self.start(f"/play {name}")
        else:
            self.say(f"{key} plays nothing; /key {key} NAME puts a macro on it")

    def action_record(self) -> None:
        """Begin a recording, asking for its name, or end the one that goes on."""
        if self.desk.recording:
            self.start("/record stop")
            return

        def named(name: str | None) -> None:
            if name:
                self.start(f"/record {name}")

        self.push_screen(
            Ask("Record what is typed as a macro named", hint="Enter begins   ^R ends and keeps it   Esc close"), named
        )

    def action_choose_drive(self) -> None:
        """Choose the drive that plain text goes to."""
        options, current = drive_choices(self.desk, self.painter)
        if not options:
            self.notify("No drive is known: /open URL opens a line of drives", timeout=4)
            return

        def chosen(key: str | None) -> None:
            if key is not None:
                bus, _, address = key.partition("\n")
                self.select(address, bus)

        self.push_screen(Choose("Plain text goes to", options, current), chosen)

    def action_plot(self) -> None:
        """The plot on or off."""
        self.main.plot_on = not self.main.plot_shown
        self.main.make_room()
        self.board.changed = True

    def action_polling(self) -> None:
        """Polling on or off."""
        self.polling.on = not self.polling.on
        self.board.changed = True

    def action_open(self, trouble: str = "") -> None:
        """The screen with what can be opened."""
        self.push_screen(
            Start(self.connect, self.aids.saved(), self.aids.ports, only=not self.desk.buses, trouble=trouble)
        )

    def action_clear(self) -> None:
        """Forget the transcript that is shown."""
        self.main.page(self.main.current).clear()

    def action_copy_view(self) -> None:
        """The transcript in view to the clipboard."""
        self.copy_to_clipboard(self.main.page(self.main.current).plain)
        self.notify("Copied", timeout=2)

    def action_mouse(self) -> None:
        """Take the mouse, or leave it to the terminal."""
        self.mouse_on = not self.mouse_on
        switch = getattr(self._driver, "mouse", None)
        if switch is not None:
            switch(self.mouse_on)

    def action_help(self) -> None:
        """Keys and signs."""
        self.push_screen(Help())

    def action_explain(self) -> None:
        """Ctrl+C copies what is selected; it does not end the app."""
        focused = self.focused
        selected = focused.selected_text if isinstance(focused, Input) else self.screen.get_selected_text()
        if selected:
            self.copy_to_clipboard(selected)
        self.notify("Copied" if selected else CTRL_C, timeout=4)

    async def action_quit(self) -> None:
        """Quit; asks where that would leave something unfinished."""
        if isinstance(self.screen, Confirm):
            return
        lines, answers = leaving(self.desk, self.painter)
        if not lines:
            self.exit(0)
            return

        def answered(answer: str | None) -> None:
            if answer == "stop":
                self.stop_all()
            if answer in ("stop", "leave"):
                self.exit(0)
            self._look_at_size(self.size)

        if isinstance(self.screen, TooSmall):
            self.pop_screen()

        self.push_screen(Confirm("Quit?", lines, answers), answered)
