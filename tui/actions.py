"""The actions of the app: what keys and the palette run. Each is named in a binding or in `tui.palette`."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic, DriveError
from multidrop.transports import TransportLost
from multidrop.tui.palette import PADDING, PALETTE, Command, Recent, Switches, all_commands, commands_like
from multidrop.tui.panels.glance import glances_of
from multidrop.tui.screens.dialogs import Search
from multidrop.tui.screens.page import Page
from multidrop.tui.screens.table import page_entry
from multidrop.tui.view_actions import ViewActions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from multidrop.tui.assist import Assist
    from multidrop.tui.editor.texts import Texts
    from multidrop.tui.frames import Frames
    from multidrop.tui.function_keys import FunctionKeys
    from multidrop.tui.keymap import Keymap
    from multidrop.tui.opening import Opener
    from multidrop.tui.outbox import Outbox
    from multidrop.tui.polling import Polling
    from multidrop.tui.screen_model import Record, ScreenModel
    from multidrop.tui.screens.main_screen import MainScreen
    from multidrop.tui.screens.questions import Questions
    from multidrop.tui.selection import Selection
    from multidrop.tui.session_view import SessionView
    from multidrop.tui.terminal.keyboard import Keyboard

FAILURES = (DriveError, Diagnostic, TransportLost)


class Actions(ViewActions):
    """The actions; `tui.app.MultidropApp` makes the parts that they work on."""

    session: SessionView
    model: ScreenModel
    main: MainScreen
    assist: Assist
    outbox: Outbox
    polling: Polling
    macros: FunctionKeys
    selection: Selection
    questions: Questions
    keymap: Keymap
    recent: Recent
    opener: Opener
    texts: Texts
    frames: Frames
    keyboard: Keyboard

    def last_records(self, number: int) -> Sequence[Record]:
        """The last records of the transcript that is shown."""
        raise NotImplementedError

    def show_line(self, text: str, mark: str = ".") -> None:
        """Append a line of the app's own to the transcript that is shown."""
        raise NotImplementedError

    def stop_all(self) -> None:
        """Stop everything, now."""
        raise NotImplementedError

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
        """Play the macro on a key, once a press."""
        if self.macros.held(key, self.session.now()):
            return
        self.macros.read(self.session.macros)
        if self.macros.trouble:
            self.show_line(self.macros.trouble, "x")
        name = self.macros.keys.get(key)
        if clash := self.macros.clash(key):
            self.show_line(clash, "x")
        elif name is not None:
            await self.action_run_line(f"/play {name}")
        else:
            page = f" --page {self.macros.page}" if self.macros.place else ""
            self.show_line(f"{key} plays nothing; /key {key} NAME{page} puts a macro on it")

    def action_macro_page(self) -> None:
        """Use the next page of function keys."""
        self.macros.read(self.session.macros)
        if len(self.macros.pages) > 1:
            self.macros.turn()
        else:
            self.show_line("the macros are on one page of keys; /key F3 NAME --page 2 begins another")
        self.model.changed = True

    async def action_record(self) -> None:
        """Begin a recording, or end the current one."""
        if self.session.recording:
            await self.action_run_line("/record stop")
        else:
            await self.questions.macro_name(lambda name: self.action_run_line(f"/record {name}"))

    def action_twin(self) -> None:
        """Type the line that runs a twin beside each drive of the selected bus, or ends the twins."""
        self.outbox.type("/twin off" if self.model.bus("").twinned else "/twin on")

    async def action_log(self) -> None:
        """Begin the session log, or end it."""
        await self.action_run_line("/log off" if self.session.log is not None else "/log on")

    async def action_search_history(self) -> None:
        """Search the lines typed before; the one that is taken goes into the line and is not sent."""
        await self.questions.history(self.assist.history(), self.action_begin_line)

    def commands(self) -> list[Command]:
        """The commands of the palette."""
        switches = Switches(self.polling.on, self.mouse_on, self.model.bus("").twinned)
        found = list(all_commands(self.session, self.macros, self.assist.verbs(), self.keymap, switches))
        return self.recent.first(found)

    async def action_palette(self) -> None:
        """Search everything by name."""
        if isinstance(self.screen, Search):
            return
        found = self.commands()

        async def run(number: int) -> None:
            self.recent.used(found[number])
            await self.run_action(found[number].action, self.main)

        width = min(PALETTE, self.size.width) - PADDING
        await self.questions.palette(lambda typed: commands_like(found, typed, width), run)

    async def action_choose_drive(self) -> None:
        """Choose the drive that plain text goes to."""
        glances = partial(glances_of, self.session, self.model)
        await self.questions.drive(glances, self.action_select)

    async def action_page_key(self, name: str) -> None:
        """Show a page on its key; Ctrl+A within a line goes to its start first."""
        entry = self.main.entry
        if self.focused is entry and entry.cursor_position and self.keymap.keys[f"page-{name}"] == "ctrl+a":
            entry.action_home()
            return
        await self.action_page(name)

    async def action_page(self, name: str) -> None:
        """Show a page in front of the main screen; one page at a time. Raises Diagnostic."""
        page = page_entry(name).page()
        shown = next((each for each in self.screen_stack if isinstance(each, Page)), None)
        if shown is None:
            await self.push_screen(page(self))
        elif shown is self.screen and type(shown) is not page:
            await self.switch_screen(page(self))
        self.model.changed = True
        self.frames.wake()

    async def action_open(self) -> None:
        """Show what can be opened."""
        await self.opener.ask()
