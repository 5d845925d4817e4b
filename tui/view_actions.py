"""The actions that change what is shown, and send nothing."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from textual.widgets import Input, TextArea

from multidrop.tui.palette import PADDING, PALETTE
from multidrop.tui.panels.glance import glances_of
from multidrop.tui.screens.framed import Framed
from multidrop.tui.screens.help import entries
from multidrop.tui.screens.help import found as help_on
from multidrop.tui.session_view import selected_place
from multidrop.tui.themed import Themed

if TYPE_CHECKING:
    from multidrop.tui.function_keys import FunctionKeys
    from multidrop.tui.keymap import Keymap
    from multidrop.tui.polling import Polling
    from multidrop.tui.screens.questions import Questions
    from multidrop.tui.session_view import SessionView
    from multidrop.tui.tour import Tour

CTRL_C = "Ctrl+Q quits, Ctrl+X stops all drives"


class ViewActions(Themed):
    """The actions on the view."""

    session: SessionView
    polling: Polling
    macros: FunctionKeys
    questions: Questions
    keymap: Keymap
    tour: Tour
    mouse_on: bool

    def action_panel(self, name: str) -> None:
        """Show a panel, or hide it."""
        self.main.toggle_panel(name)
        self.model.changed = True

    def action_polling(self) -> None:
        """Switch polling on or off."""
        self.polling.on = not self.polling.on
        self.model.changed = True

    def action_clear(self) -> None:
        """Clear the transcript that is shown."""
        self.main.page(self.main.current).clear()

    def action_copy_view(self) -> None:
        """Copy the transcript in view to the clipboard."""
        self.copy_to_clipboard(self.main.page(self.main.current).plain)
        self.notify("Sent to the terminal's clipboard", timeout=4)

    def action_mouse(self) -> None:
        """Take the mouse, or leave it to the terminal."""
        self.mouse_on = not self.mouse_on
        switch = getattr(self._driver, "mouse", None)
        if switch is not None:
            switch(self.mouse_on)

    def action_repaint(self) -> None:
        """Paint everything, whatever the terminal shows."""
        repaint = getattr(self._driver, "repaint", None)
        if repaint is not None:
            repaint()

    async def action_choose_theme(self) -> None:
        """Choose colours."""
        await self.questions.theme()

    async def action_choose_signs(self) -> None:
        """Choose the signs that the terminal's font holds."""
        await self.questions.signs(self.show_signs)

    async def action_help(self) -> None:
        """Search the help for the screen that is shown."""
        shown = [each for each in self.screen_stack if isinstance(each, Framed)]
        found = entries(shown[-1], self.keymap, self.macros.bound)
        width = min(PALETTE, self.size.width) - PADDING
        await self.questions.help(lambda typed: help_on(found, typed, width))

    def action_explain(self) -> None:
        """Copy the selected text on Ctrl+C, else name the keys that end and stop."""
        focused = self.focused
        selected = focused.selected_text if isinstance(focused, Input | TextArea) else self.screen.get_selected_text()
        if selected:
            self.copy_to_clipboard(selected)
        self.notify("Copied" if selected else CTRL_C, timeout=4)

    def action_end_tour(self) -> None:
        """End the tour."""
        self.tour.end()
        self.model.changed = True

    async def action_split(self) -> None:
        """Split the screen: choose what the other half shows; once it is split, type to the other half."""
        beside = self.main.beside
        if not beside.display:
            await self.questions.half(partial(glances_of, self.session, self.model), self._show_half)
            return
        place, (bus, address) = selected_place(self.session), (beside.bus, beside.address)
        self._show_half(place.address, place.bus)
        self.action_select(address, bus)

    def _show_half(self, address: str, bus: str) -> None:
        self.main.beside.show(bus, address, self.main.page(bus))
        self.model.changed = True

    def action_unsplit(self) -> None:
        """Show one transcript alone."""
        self.main.beside.hide()

    def action_select(self, address: str, bus: str = "") -> None:
        """Select a drive or a bus."""
        raise NotImplementedError
