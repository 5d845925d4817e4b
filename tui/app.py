"""The app: takes in session events, paints thirty times a second at most, hands on what is typed, and stops.

The stop is found below every queue. On a POSIX terminal `tui.terminal.driver` finds it in the bytes as they arrive.
Every other key passes `post_message`, which checks for the stop again before it queues the key. So no screen, dialog,
list or input can take it. A stop from any source drops what was typed before it: waiting keys
(`tui.terminal.keyboard`), waiting lines (`tui.outbox`), the lines being edited, and dialogs.

Session events are appended to a list by a callback and folded in by a timer. Painting waits until the terminal has
swallowed the frame before; meanwhile events only gather.
"""

from __future__ import annotations

import asyncio
import inspect
import os
import re
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

from dialects import Diagnostic, DriveError
from shell.events import SessionEvent, StateChanged
from transports import TransportLost
from tui.assist import Assist
from tui.function_keys import FunctionKeys
from tui.outbox import Outbox, Place, not_sent
from tui.palette import all_commands, commands_like, lines_like
from tui.polling import Polling
from tui.presenter import Presenter
from tui.screen_model import Record, ScreenModel
from tui.screens.dialogs import LEAST, Ask, Choose, Confirm, Help, Search, TooSmall
from tui.screens.main_screen import Main
from tui.screens.questions import drive_choices, leaving, sending
from tui.screens.start import Start
from tui.session_view import SessionView
from tui.terminal.keyboard import Keyboard
from tui.widgets.banner import Banner, banner_row
from tui.widgets.entry import LONGEST, Entry
from tui.widgets.footer import Footer
from tui.widgets.theme import DEFAULTS, THEMES, theme_for

INTERRUPTED = 130
"""The exit code after a signal."""
FRAMES = 30
"""Paints a second, at most."""
KEPT = 20
"""Lines at most that go into the history of those that a stop dropped before their Enter counted."""
FAILURES = (DriveError, Diagnostic, TransportLost)
CTRL_C = "Ctrl+Q quits, Ctrl+X stops all drives"


def is_stop(message: Message) -> bool:
    """Whether a message is the stop key, however a terminal has spelt it."""
    if not isinstance(message, events.Key):
        return False
    *modifiers, key = message.key.lower().split("+")
    return key == "x" and "ctrl" in modifiers


class MultidropApp(App[int]):
    """The screen of one Session (`session`)."""

    CSS_PATH = "multidrop.tcss"
    TITLE = "multidrop"
    ENABLE_COMMAND_PALETTE = False
    """Textual's; ours is a `Search`, in which keys keep their order."""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+q", "quit", show=False, priority=True),
        Binding("ctrl+c", "explain", show=False, priority=True),
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
        self.main = Main(self.assist.complete, self.assist.history, self._clock, self._typed, self._pasted)
        self.keyboard = Keyboard(self, self._warn)
        self.outbox = Outbox(session, self._warn, self.run_worker)
        self.mouse_on = True
        self._inbox: list[SessionEvent] = []
        self._unsubscribe = session.subscribe(self._hear)
        self._stops = session.stops
        self._place = Place("", "")
        self._meant = False
        """Whether a `/use` that was typed has selected another drive than the one that is shown."""
        self._meaning = ""
        self._half: str | None = None
        """What stood in the line as the last stop came, until it is told; None where a dialog was asked."""
        self._cut: list[str] = [""]
        """What was typed behind it and dropped, by stops; it comes in pieces."""
        self._cancelling = False
        """A stop came, and the line is still to be emptied."""
        self._own_task: asyncio.Task[Any] | None = None
        session.before_quit = self._before_quit
        self._beat = 0
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
        if is_stop(message) or self._is_click_on_stop(message):
            self.stop_all()
            return True
        if isinstance(message, events.AppFocus | events.AppBlur):
            return True  # keys go where they go, whichever window has the focus
        return self.keyboard.take(message) or super().post_message(message)

    def _is_click_on_stop(self, message: Message) -> bool:
        """Whether a button was pressed on the footer's stop, which is to be seen under dialogs, too."""
        if not isinstance(message, events.MouseDown) or not self.main.is_running or isinstance(self.screen, TooSmall):
            return False
        return message.y == self.size.height - 1 and Footer.is_stop(int(message.x))

    def stop_ahead(self) -> None:
        """Write the stop onto the wires, in the thread that reads the terminal; `stop_all` follows in the loop."""
        self.session.stop_ahead()

    def stop_all(self) -> None:
        """Stop everything, now. The banner is up before the next frame."""
        self.session.stop()
        self.model.stopped(self.session.now())

    def _hear(self, event: SessionEvent) -> None:
        self._inbox.append(event)
        if self.session.stops != self._stops:
            self._stops = self.session.stops
            self._drop_typed()
        elif isinstance(event, StateChanged) and self._place != self._selected_place():
            self._meant = self._meant or self.outbox.using(self._place)
            self.call_later(self._jumped)

    def _drop_typed(self) -> None:
        """A stop came, from wherever: what was typed before it is dropped."""
        if self._cancelling:
            self._cut.append("")
        else:
            self._half = self.main.entry.value if self.screen is self.main else None
        self.outbox.drop()
        if asyncio.current_task() is self._own_task:
            self._cancel()  # a key meant it: the keys that wait were typed after it
            return
        self._cancelling = True
        self.dropped(self.keyboard.clear())
        drop = getattr(getattr(self._driver, "keys", None), "drop", None)
        if drop is not None:
            drop()
        self.call_later(self._cancel)

    def dropped(self, text: str) -> None:
        """Take a text that was typed before the stop, behind what stands in the line; it is told as one."""
        self._cut[-1] += text
        if not self._cancelling:
            self._tell_cut()

    def _tell_cut(self) -> bool:
        """Tell of the line and of what was typed behind it and dropped; whether there was any.

        What was typed into a dialog is no line, and behind a key that is no text nobody knows.
        """
        cut, self._cut = self._cut, [""]
        if self._half is None or not any(cut):
            return False
        plain = [re.split(r"[^\t\r\n -~\xa0-\U0010ffff]", text)[0] for text in [self._half + cut[0], *cut[1:]]]
        lines = [line.strip() for text in plain for line in text.splitlines() if line.strip()]
        self._half = ""
        for line in lines[-KEPT:]:
            self.assist.keep(line)
        if lines:
            self._warn(f"stopped; {not_sent(lines)}")
        return True

    def _cancel(self) -> None:
        """Empty the lines that are being edited, and cancel dialogs. Keys that were typed after the stop come later."""
        self._cancelling = False
        told = self._tell_cut()
        for bus, text in self.main.take_lines():
            if bus != self.main.current or not told:
                self._keep_unsent(text, bus)
        self._half = "" if self._half is not None else None
        while len(self.screen_stack) > 1 and not (isinstance(self.screen, Start) and self.screen.only):
            self.screen.dismiss(None)
        self._look_at_size(self.size)

    def _keep_unsent(self, text: str, bus: str) -> None:
        self.assist.keep(text)
        self.model.page(bus).append(Record(self.session.now(), "", "!", f"not sent: {text}"))

    # Life

    def on_mount(self) -> None:
        """Begin to paint."""
        self.set_interval(1 / FRAMES, self.tick)

    async def on_ready(self) -> None:
        """The main screen is there: open what was named, or ask. Keys that were typed already count from here on."""
        self._own_task = asyncio.current_task()
        self._follow()
        if self.urls:
            self.run_worker(self._open_all())
        elif not self.session.buses:
            await self.action_open()
        self.keyboard.start()

    async def _open_all(self) -> None:
        trouble = ""
        for url in self.urls:
            self.say(f"opening {url} …")
            trouble = await self.connect(url) or trouble
        if not self.session.buses:
            self.keyboard.turn_deaf()
            await self.action_open(trouble)

    async def connect(self, url: str) -> str:
        """Open a URL; an empty string, or one line that says why not."""
        try:
            await self.session.open(url)
        except FAILURES as failure:
            if self.session.buses:
                self.say(str(failure), "x")
            return str(failure)
        return ""

    def on_unmount(self) -> None:
        """End what goes on for the screen."""
        self._unsubscribe()
        self.polling.end()

    def interrupted(self) -> None:
        """A signal came, or the terminal went: stop what automation moves, and end."""
        self.session.interrupt()
        self.exit(INTERRUPTED)

    # Frames

    def tick(self) -> None:
        """Take in what has come, and paint what has changed."""
        inbox, self._inbox[:] = self._inbox[:], []
        for event in inbox:
            self.model.take(event)
        if not self.main.is_running:
            return
        if self.model.changed:
            self.model.changed = False
            self._look_again()
        elif self._beat % 6 == 0:
            self._poll()
        ready = getattr(self._driver, "ready", None)
        if ready is not None and not ready():
            return
        self._beat += 1
        self._paint(self.session.now())
        ask = getattr(self._driver, "ask", None)
        if ask is not None:
            self.call_after_refresh(ask)

    def _paint(self, now: float) -> None:
        for name, facts in list(self.model.buses.items()):
            if facts.fresh:
                fresh, facts.fresh = facts.fresh, []
                self.main.take(name, fresh)
        if self._beat % 3 == 0:
            self.presenter.paint_frame(self.main, now)
            self.presenter.paint_status(self.main, now)
            self._show_hint()
            self._raise_banner()
        if self._beat % 2 == 0:
            self.presenter.paint_plot(self.main, now)

    def _look_again(self) -> None:
        """Buses, drives, selection, macros or the latch may have changed."""
        if self.session.quitting:
            self.exit(0)
            return
        self._jumped()
        if self.session.selected_bus not in self.main.pages:
            self._follow()
        for name in set(self.main.pages) - set(self.session.buses) - {""}:
            if text := self.main.drop_page(name):
                self._keep_unsent(text, self.main.current)
            self.model.forget(name)
        self.macros.read(self.session.macros)
        self._poll()
        self._raise_banner()

    def _selected_place(self) -> Place:
        selected = self.session.selected
        return Place(self.session.selected_bus, selected.address if selected is not None else "")

    def _follow(self) -> None:
        """Show the page of the selected bus, with its line, and the drive that the line is for."""
        main, current = self.main, self.session.selected_bus
        self._place = self._selected_place()
        if current != main.current or current not in main.pages:
            if main.current == "" and "" in main.pages and current:
                self.model.bus(current).fresh[:0] = main.pages[""].records
                main.adopt_page(current)
            main.show_page(current)
        main.set_label(self.presenter.label())

    def _jumped(self) -> None:
        """Another drive was selected. What stands in the line was typed behind the `/use` that did it, if one did.

        If not, what is half typed was for the drive before.
        """
        meant, self._meant = self._meant, False
        if self._place == self._selected_place():
            return
        if meant:
            draft = self.main.entry.exchange()
            self._follow()
            self.main.entry.take_in(draft)
            return
        if self._place.bus and self.main.entry.value:
            self.keyboard.turn_deaf()
        self._follow()

    def _poll(self) -> None:
        self.polling.update(self.session, self.model, plot=self.main.plot_shown)

    def _raise_banner(self) -> None:
        bus = self.session.buses.get(self.session.selected_bus)
        lost = str(bus.lost) if bus is not None and bus.lost is not None else ""
        if self.session.latched and not lost:
            lost = next((str(each.lost) for each in self.session.buses.values() if each.lost is not None), "")
        row = banner_row(self.session.tally() if self.session.latched else None, lost, self.size.width)
        for screen in self.screen_stack:
            for banner in screen.query(Banner):
                banner.say(row)

    def on_resize(self, event: events.Resize) -> None:
        """Too small is said; what is wide enough for a panel is polled for it."""
        self._look_at_size(event.size)
        self.model.changed = True

    def _look_at_size(self, size: Size) -> None:
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

    def say(self, text: str, mark: str = ".") -> None:
        """A line of the app's own in the transcript that is shown."""
        self.model.page("").append(Record(self.session.now(), "", mark, text))

    def _warn(self, text: str) -> None:
        self.say(text, "!")

    async def start(self, line: str) -> None:
        """Run a line in the background. A failure is told by its event; a bug brings the app down.

        When this returns the line has taken its first step: it knows what it is for.
        """
        self.run_worker(self._end_of(self.session.start(line)))
        await asyncio.sleep(0)
        self._follow()

    @staticmethod
    async def _end_of(task: asyncio.Task[bool]) -> None:
        await asyncio.wait([task])
        if not task.cancelled():
            task.result()

    def begin_line(self, text: str) -> None:
        """Put the beginning of a line where a person goes on typing."""
        self.main.entry.put(text)
        self.main.set_focus(self.main.entry)

    def on_entry_edited(self, event: Entry.Edited) -> None:
        """Show what is meant by what is typed, when no more of it waits."""
        if not self.keyboard.idle:
            return
        text = self.main.entry.value
        self._meaning = self.assist.hint(text) if len(text) <= LONGEST else ""
        self._show_hint()
        self.main.show_menu()

    def _show_hint(self) -> None:
        """What is meant by what is typed; before that, how many lines wait."""
        waiting = self.outbox.waiting
        waits = f"{waiting} lines wait" if waiting > 1 else "a line waits"
        self.main.set_hint(f"{waits} for the one before   {self._meaning}".rstrip() if waiting else self._meaning)

    async def _typed(self, line: str) -> None:
        """A person sends a line."""
        if self._place.bus and self._place != self._selected_place() and not self._meant:
            self._keep_unsent(line, self._place.bus)  # it was for the drive that is still shown
            self.keyboard.turn_deaf()
            self._jumped()
            return
        self._jumped()
        self.assist.keep(line)
        self.main.page(self.main.current).look_end(newest=True)
        if line == "/stop":
            await self.session.run(line)
            return
        self.outbox.type(line)
        await asyncio.sleep(0)  # its first step: now it has its drive, and what is done at once is done
        self._follow()

    async def _pasted(self, lines: list[str]) -> None:
        """Several lines: ask, then send them one after the other."""
        title, shown, answers = sending(self.session, lines)

        def answered(answer: str | None) -> None:
            if answer == "send":
                self.outbox.paste(lines)

        await self.push_screen(Confirm(title, shown, answers), answered)

    # Actions

    def select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus."""
        try:
            self.session.select(address, bus)
        except FAILURES as failure:
            self.say(str(failure), "x")
        self._follow()
        self.model.changed = True

    def action_bus(self, step: int) -> None:
        """The next bus, or the one before."""
        names = list(self.session.buses)
        if names:
            at = names.index(self.session.selected_bus) if self.session.selected_bus in names else 0
            self.select("", names[(at + step) % len(names)])

    def action_bus_number(self, number: int) -> None:
        """The bus with a number."""
        names = list(self.session.buses)
        if number <= len(names):
            self.select("", names[number - 1])

    async def action_play(self, key: str) -> None:
        """Play the macro on a key."""
        self.macros.read(self.session.macros)
        if self.macros.trouble:
            self.say(self.macros.trouble, "x")
        name = self.macros.keys.get(key)
        if clash := self.macros.clash(key):
            self.say(clash, "x")
        elif name is not None:
            await self.start(f"/play {name}")
        else:
            self.say(f"{key} plays nothing; /key {key} NAME puts a macro on it")

    async def action_record(self) -> None:
        """Begin a recording, asking for its name, or end the one that goes on."""
        if self.session.recording:
            await self.start("/record stop")
            return

        async def named(name: str | None) -> None:
            if name:
                await self.start(f"/record {name}")

        await self.push_screen(
            Ask("Record what is typed as a macro named", hint="Enter begins   /record stop ends it   Esc close"), named
        )

    async def action_search_history(self) -> None:
        """Search the lines typed before; what is taken stands in the line and is not sent."""

        def taken(line: str | None) -> None:
            if line is not None:
                self.begin_line(line)

        kept = list(dict.fromkeys(reversed(self.assist.history())))
        hint = "type to narrow   ^R ↓ older   Enter into the line   Esc close"
        await self.push_screen(Search("Lines typed before", lambda text: lines_like(kept, text), hint), taken)

    async def action_palette(self) -> None:
        """Everything by name."""
        if isinstance(self.screen, Search):
            return
        commands = list(all_commands(self))

        async def taken(key: str | None) -> None:
            if key is not None:
                done = commands[int(key)].callback()
                if inspect.isawaitable(done):
                    await done

        hint = "type to narrow   ↑↓ choose   Enter do it   Esc close"
        await self.push_screen(Search("Everything", lambda text: commands_like(commands, text), hint), taken)

    async def action_choose_drive(self) -> None:
        """Choose the drive that plain text goes to."""
        options, current = drive_choices(self.session, self.presenter.glances)
        if not options:
            self.notify("No drive is known: /open URL opens a line of drives", timeout=4)
            return

        def chosen(key: str | None) -> None:
            if key is not None:
                bus, _, address = key.partition("\n")
                self.select(address, bus)

        await self.push_screen(Choose("Plain text goes to", options, current), chosen)

    async def action_choose_theme(self) -> None:
        """Choose colours."""

        def chosen(name: str | None) -> None:
            if name is not None:
                self.theme = name

        themes = [(name, name) for name in sorted(self.available_themes)]
        await self.push_screen(Choose("Theme", themes, self.theme), chosen)

    def action_plot(self) -> None:
        """The plot on or off."""
        self.main.plot_on = not self.main.plot_shown
        self.main.make_room()
        self.model.changed = True

    def action_polling(self) -> None:
        """Polling on or off."""
        self.polling.on = not self.polling.on
        self.model.changed = True

    async def action_open(self, trouble: str = "") -> None:
        """The screen with what can be opened."""

        def opening(begun: bool) -> None:
            if begun:
                self.keyboard.hold()
            else:
                self.keyboard.release()

        only = not self.session.buses
        screen = Start(self.connect, self.assist.saved(), self.assist.ports, opening, only=only, trouble=trouble)
        await self.push_screen(screen)

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

    async def action_help(self) -> None:
        """Keys and signs."""
        await self.push_screen(Help())

    def action_explain(self) -> None:
        """Ctrl+C copies what is selected; it does not end the app."""
        focused = self.focused
        selected = focused.selected_text if isinstance(focused, Input) else self.screen.get_selected_text()
        if selected:
            self.copy_to_clipboard(selected)
        self.notify("Copied" if selected else CTRL_C, timeout=4)

    async def _before_quit(self) -> bool:
        """Asked by `/quit`: as Ctrl+Q, which ends the app by itself."""
        self.call_later(self.action_quit)
        return False

    async def action_quit(self) -> None:
        """Quit; asks where that would leave something unfinished."""
        if isinstance(self.screen, Confirm):
            return
        lines, answers = leaving(self.session, await self.session.in_motion(), self.outbox.waiting)
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

        await self.push_screen(Confirm("Quit?", lines, answers), answered)
