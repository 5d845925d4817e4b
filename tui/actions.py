"""The actions of the app: what keys and the palette run. Each is named in a binding or in `tui.palette`.

They are an action target beside Textual's own, `act`.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from functools import partial

from textual.app import App
from textual.widgets import Input, TextArea

from multidrop.macros import Macro
from multidrop.shell.hooks import switches
from multidrop.shell.line_syntax import showing
from multidrop.shell.session import Session
from multidrop.tui.assist import Assist
from multidrop.tui.keymap import Keymap
from multidrop.tui.leaving import Leaving
from multidrop.tui.outbox import ended
from multidrop.tui.palette import (
    LATELY,
    PADDING,
    PALETTE,
    PaletteCommand,
    all_commands,
    commands_like,
    entries,
    ordered,
)
from multidrop.tui.palette import found as help_on
from multidrop.tui.panels.view import glances_of
from multidrop.tui.purpose import Purpose
from multidrop.tui.screens.dialogs import Ask, Choose, ListedChoice, SearchDialog
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.screens.page import Page, PageHost, page_entry
from multidrop.tui.screens.questions import ScreenQuestions, drive_choices, lines_like, place_of
from multidrop.tui.screens.start import Opener
from multidrop.tui.tour import Tour
from multidrop.tui.typist import Selection
from multidrop.tui.widgets.theme import THEMES, SignFilter, Signs, ink_of

HELP = "Help"
"""The heading of the help."""
CTRL_C = "Ctrl+Q quits, Ctrl+X stops all drives"


def names_of(session: Session) -> list[str]:
    """The names of the buses that have tabs."""
    return [bus.name for bus in session.tabs.shown]


@dataclass
class ScreenParts(PageHost):
    """The parts of one app that its actions work on."""

    app: App[int]
    main: MainScreen
    assist: Assist
    purpose: Purpose
    selection: Selection
    questions: ScreenQuestions
    keymap: Keymap
    opener: Opener
    tour: Tour
    signs: SignFilter
    leaving: Leaving
    recent: list[str] = field(default_factory=list)
    """The actions of the commands used lately, the last one first."""
    mouse_on: bool = True


class ScreenActions:
    """The target of actions: they change what is shown, send lines, select, open pages and dialogs."""

    def __init__(self, parts: ScreenParts) -> None:
        self._parts = parts
        self._key = ""
        """The function key that the last recording was begun for."""

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool:
        """True if an action is possible: Escape ends the tour unless it closes something."""
        entry = self._parts.main.entry
        if action == "end_tour":
            return self._parts.tour.on and self._parts.app.focused is entry and not entry.listing.open
        return True

    # What is shown; nothing is sent

    def action_panel(self, name: str) -> None:
        self._parts.main.toggle_panel(name)
        self._parts.model.changed = True

    def action_polling(self) -> None:
        polling = self._parts.purpose.polling
        polling.on = not polling.on
        self._parts.model.changed = True

    def action_clear(self) -> None:
        self._parts.main.transcript.clear()

    def action_copy_view(self) -> None:
        self._parts.app.copy_to_clipboard(self._parts.main.transcript.plain)
        self._parts.app.notify("Sent to the terminal's clipboard", timeout=4)

    def action_mouse(self) -> None:
        """Take the mouse, or leave it to the terminal."""
        self._parts.mouse_on = not self._parts.mouse_on
        switch = getattr(self._parts.app._driver, "mouse", None)
        if switch is not None:
            switch(self._parts.mouse_on)

    def action_repaint(self) -> None:
        repaint = getattr(self._parts.app._driver, "repaint", None)
        if repaint is not None:
            repaint()

    async def action_choose_theme(self) -> None:
        app, ours = self._parts.app, [theme.name for theme in THEMES]
        themes = [ListedChoice(name, name) for name in [*ours, *sorted(set(app.available_themes) - set(ours))]]
        await self._parts.questions.open(Choose("Theme", themes, app.theme), partial(setattr, app, "theme"))

    async def action_choose_signs(self) -> None:
        answers = [
            ListedChoice(Signs.FULL.value, "full     ⣀⠔⠉ ▶ ■ ✗ ● ○   all signs"),
            ListedChoice(Signs.BOXES.value, "boxes    no braille: Linux console, PuTTY"),
            ListedChoice(Signs.ASCII.value, "ascii    nothing but ASCII"),
        ]
        await self._parts.questions.open(Choose("Signs", answers), lambda name: self.show_signs(Signs(name)))

    def show_signs(self, signs: Signs) -> None:
        parts = self._parts
        parts.signs.font = signs
        parts.model.look.ink = ink_of(signs)
        parts.app.refresh_css()
        parts.app.refresh(layout=True)  # an equal style sheet paints nothing

    async def action_help(self) -> None:
        parts = self._parts
        sheet = getattr(parts.app.screen, "SHEET", "main")
        if getattr(parts.app.screen, "heading", "") == HELP:
            return
        rows = entries(sheet, parts.keymap, parts.macros.bound)
        width = min(PALETTE, parts.app.size.width) - PADDING
        await parts.app.push_screen(SearchDialog(HELP, lambda typed: help_on(rows, typed, width), "close"))

    def action_explain(self) -> None:
        """Copy the selected text on Ctrl+C, else name the keys that end and stop."""
        app, focused = self._parts.app, self._parts.app.focused
        selected = focused.selected_text if isinstance(focused, Input | TextArea) else app.screen.get_selected_text()
        if selected:
            app.copy_to_clipboard(selected)
        app.notify("Copied" if selected else CTRL_C, timeout=4)

    def action_end_tour(self) -> None:
        self._parts.tour.end()
        self._parts.model.changed = True

    async def action_split(self) -> None:
        """Split the screen: choose what the other half shows; once it is split, type to the other half."""
        parts, beside = self._parts, self._parts.main.beside
        if not beside.display:
            drives, _ = drive_choices(parts.session, partial(glances_of, parts.session, parts.model))
            lines = [ListedChoice(f"{name}\n", f" {name:<8} all of the line") for name in names_of(parts.session)]
            if lines:
                halves = Choose("The other half shows", [*drives, *lines])
                await parts.questions.open(halves, lambda key: self._show_half(*place_of(key)))
            return
        place, (bus, address) = parts.session.place, (beside.bus, beside.address)
        self._show_half(place.address, place.bus)
        parts.selection.select(address, bus)

    def _show_half(self, address: str, bus: str) -> None:
        self._parts.main.beside.show(bus, address, self._parts.main.page(bus))
        self._parts.model.changed = True

    def action_unsplit(self) -> None:
        self._parts.main.beside.hide()

    # Lines, the selection, pages and dialogs

    async def action_run_line(self, line: str, shown: Macro | None = None) -> None:
        """Run a line in the background. Its event reports a failure; a bug ends the app.

        `shown`: the macro that the line plays, as a person knows it. When this returns the line has taken its first
        step and has its drive.
        """
        typed = line if shown is None else showing(line, shown) or line
        self._parts.app.run_worker(ended(self._parts.session.start(typed)))
        await asyncio.sleep(0)
        self._parts.selection.follow()

    def action_begin_line(self, text: str) -> None:
        self._parts.main.entry.put(text)
        self._parts.main.take_keys()

    def action_select(self, address: str, bus: str = "") -> None:
        self._parts.selection.select(address, bus)

    def action_bus(self, step: int) -> None:
        """Show the next bus, or the one before."""
        names, selected = names_of(self._parts.session), self._parts.session.selected_bus
        if names:
            at = names.index(selected) if selected in names else 0
            self._parts.selection.select("", names[(at + step) % len(names)])

    def action_bus_number(self, number: int) -> None:
        names = names_of(self._parts.session)
        if number <= len(names):
            self._parts.selection.select("", names[number - 1])

    async def action_play(self, key: str) -> None:
        """Play the macro on a key, once a press."""
        macros, parts = self._parts.macros, self._parts
        if macros.held(key, self._parts.session.now()):
            return
        before, shown = macros.keys.get(key), macros.shown_macros
        macros.read(self._parts.session.macros)
        if macros.trouble:
            parts.show_line(macros.trouble, "x")
        name = macros.keys.get(key)
        if clash := macros.clash(key):
            parts.show_line(clash, "x")
        elif name is not None and (name != before or macros.shown_macros[name] != shown[name]):
            what = f"{key} plays {name} now" if name != before else f"macro {name} has changed on the disk"
            parts.show_line(f"{what}; nothing was sent, press {key} again to play it as it is now", "!")
            parts.model.changed = True
        elif name is not None:
            await self.action_run_line(f"/play {name}", macros.shown_macros[name])
        elif parts.session.recording:
            self._end_recording(key, parts.session.recording)
        else:
            self._key = key
            await self._begin_recording(key)

    async def _begin_recording(self, key: str = "") -> None:
        """Ask for the name of a macro that is recorded; for a key, which ends the recording."""
        title = f"{key and f'{key} plays nothing yet. '}Record what is typed as a macro named"
        box = Ask(title, about=f"{key or '/record stop'} ends it")
        await self._parts.questions.open(box, lambda name: self.action_run_line(f"/record {name}"))

    def _end_recording(self, key: str, name: str) -> None:
        """End the recording that was begun on a key, and put it there; another key ends none."""
        macros = self._parts.macros
        if key == self._key:
            self._parts.outbox.type("/record stop")
            self._parts.outbox.type(f"/key {key} {name}{f' --page {macros.page}' if macros.place else ''}")
        else:
            self._parts.show_line(f"{key} plays nothing; /record stop ends the recording of {name}", ".")

    def action_macro_page(self) -> None:
        macros = self._parts.macros
        macros.read(self._parts.session.macros)
        if len(macros.pages) > 1:
            macros.turn()
        else:
            text = "the macros are on one page of keys; /key F3 NAME --page 2 begins another"
            self._parts.show_line(text, ".")
        self._parts.model.changed = True

    async def action_record(self) -> None:
        if self._parts.session.recording:
            await self.action_run_line("/record stop")
        else:
            await self._begin_recording()

    def action_switch(self, name: str) -> None:
        """Type the line that changes a switch of a feature."""
        self._parts.outbox.type(next(switch.typed(self._parts.session) for switch in switches() if switch.name == name))

    def action_units(self) -> None:
        """Type the line that shows the drives' own numbers, or units again."""
        self._parts.outbox.type("/units off" if self._parts.session.units.shown else "/units on")

    async def action_log(self) -> None:
        await self.action_run_line("/log off" if self._parts.session.log is not None else "/log on")

    async def action_search_history(self) -> None:
        """Search the lines typed before; the one that is taken goes into the line and is not sent."""
        kept = list(dict.fromkeys(reversed(self._parts.assist.history())))
        box = SearchDialog("Lines typed before", lambda text: lines_like(kept, text), "into the line")
        await self._parts.questions.open(box, self.action_begin_line)

    def commands(self) -> list[PaletteCommand]:
        parts = self._parts
        front = parts.app.screen
        sheet = front.SHEET if isinstance(front, Page) else ""
        switches = {"polling": parts.purpose.polling.on, "mouse": parts.mouse_on}
        commands = all_commands(parts.session, parts.macros, parts.assist.verbs(), parts.keymap, switches, sheet)
        return ordered(list(commands), parts.recent)

    async def action_palette(self) -> None:
        parts = self._parts
        if isinstance(parts.app.screen, SearchDialog):
            return
        commands, page = self.commands(), parts.app.screen

        async def run(key: str) -> None:
            taken = commands[int(key)]
            parts.recent = [taken.action, *(action for action in parts.recent if action != taken.action)][:LATELY]
            await parts.app.run_action(taken.action, page if taken.here else parts.main)

        width = min(PALETTE, parts.app.size.width) - PADDING
        everything = SearchDialog("Everything", lambda typed: commands_like(commands, typed, width), "do it")
        await parts.questions.open(everything, run)

    async def action_choose_drive(self) -> None:
        parts = self._parts
        options, current = drive_choices(parts.session, partial(glances_of, parts.session, parts.model))
        if not options:
            parts.app.notify("No drive is known: /open URL opens a line of drives", timeout=4)
            return
        box = Choose("Plain text goes to", options, current)
        await parts.questions.open(box, lambda key: parts.selection.select(*place_of(key)))

    async def action_page_key(self, name: str) -> None:
        """Show a page on its key; Ctrl+A within a line goes to its start first."""
        entry = self._parts.main.entry
        on_key = self._parts.keymap.keys[f"page-{name}"] == "ctrl+a"
        if self._parts.app.focused is entry and entry.cursor_position and on_key:
            entry.action_home()
            return
        await self.action_page(name)

    async def action_start_of_line(self) -> None:
        """Go to the start of the line on Home; there show all drives, as Ctrl+A does, which screen takes."""
        field = self._parts.app.focused
        if isinstance(field, Input) and (field.cursor_position or field is not self._parts.main.entry):
            field.action_home()
        else:
            await self.action_page("drives")

    async def action_page(self, name: str) -> None:
        """Show a page in front of the main screen; one page at a time. Raises Diagnostic."""
        parts, app = self._parts, self._parts.app
        page = page_entry(name).page()
        if why := parts.purpose.refused(name):
            parts.show_line(why, "x")
            return
        shown = next((screen for screen in app.screen_stack if isinstance(screen, Page)), None)
        if shown is None:
            await app.push_screen(page(parts))
        elif shown is app.screen and type(shown) is not page:
            await app.switch_screen(page(parts))
        parts.model.changed = True
        parts.frames.wake()

    async def action_edit_wrong(self) -> None:
        """Show the configuration in the editor, at the first line that is wrong. Raises Diagnostic."""
        self._parts.texts.open_at(self._parts.session.settings.problems[0].where)
        await self.action_page("program")

    async def action_open(self) -> None:
        await self._parts.opener.ask()
