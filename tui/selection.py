"""The selected drive on the screen: its page, its label and the line that was typed for it.

A line is for the drive that was shown when it was typed. If the selection changes by itself, the half-typed line stays
with the page of the drive before, and keys do not count until the person pauses. If a typed `/use` changed it, the line
was typed for the new drive and goes with it.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.screens.main_screen import MainScreen
from multidrop.tui.session_view import Place, SessionView, selected_place
from multidrop.tui.widgets.lines import Row


class Selection:
    """Makes the main screen follow the session's selection.

    `label` returns the row before the input line, `turn_deaf` discards keys until a pause.
    """

    def __init__(
        self,
        session: SessionView,
        model: ScreenModel,
        main: MainScreen,
        label: Callable[[], Row],
        turn_deaf: Callable[[], None],
    ) -> None:
        self._session, self._model, self._main = session, model, main
        self._label, self._turn_deaf = label, turn_deaf
        self.shown = Place("", "")
        """The drive that the screen shows."""
        self._meant = False
        """A typed `/use` selected another drive than the one that is shown."""

    @property
    def changed(self) -> bool:
        """True if another drive is selected than the one that is shown."""
        return self.shown != selected_place(self._session)

    @property
    def unexpected(self) -> bool:
        """True if the selection changed by itself, and the screen does not show it yet."""
        return bool(self.shown.bus) and self.changed and not self._meant

    def expect(self, by_use: bool) -> None:
        """Note that the selection changed, and whether a typed `/use` did it."""
        self._meant = self._meant or by_use

    def rename(self, before: str, now: str) -> None:
        """Know the drive that is shown by the new name of its bus."""
        self._model.rename(before, now)
        self._main.rename_page(before, now)
        if self.shown.bus == before:
            self.shown = self.shown._replace(bus=now)

    def follow(self) -> None:
        """Show the page of the selected bus with its line, and the label of the selected drive."""
        main, current = self._main, self._session.selected_bus
        self.shown = selected_place(self._session)
        if current != main.current or current not in main.pages:
            if main.current == "" and "" in main.pages and current:
                self._model.bus(current).fresh.extendleft(reversed(main.pages[""].records))
                main.adopt_page(current)
            main.show_page(current)
        main.set_label(self._label())

    def catch_up(self) -> None:
        """Follow a selection that changed; see the module for what becomes of the half-typed line."""
        meant, self._meant = self._meant, False
        if not self.changed:
            return
        if meant:
            draft = self._main.entry.exchange()
            self.follow()
            self._main.entry.take_in(draft)
            return
        if self.shown.bus and self._main.entry.unsent:
            self._turn_deaf()
        self.follow()
