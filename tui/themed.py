"""The colours and signs of the app: our themes, and a filter that replaces signs that a terminal lacks."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from textual.app import App
from textual.filter import LineFilter

from multidrop.shell.connect.settings_tables import Look
from multidrop.tui.curves.ink import INKS
from multidrop.tui.widgets.signs import SignFilter, Signs, signs_for
from multidrop.tui.widgets.theme import DEFAULTS, THEMES, theme_for

if TYPE_CHECKING:
    from multidrop.tui.screen_model import ScreenModel
    from multidrop.tui.screens.main_screen import MainScreen


class Themed(App[int]):
    """An app with the theme and the signs of a configuration."""

    model: ScreenModel
    main: MainScreen
    _signs: SignFilter

    def dress(self, look: Look) -> None:
        """Use the theme and the signs that a configuration names, else those that fit the terminal."""
        self._signs = SignFilter(signs_for(look.signs, os.environ))
        self.model.look.ink = INKS[self._signs.font.value]
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = theme_for(None if self.no_color else self.console.color_system)
        if look.theme in self.available_themes and not self.no_color:
            self.theme = look.theme

    def show_signs(self, signs: Signs) -> None:
        """Show only these signs from now on."""
        self._signs.font = signs
        self.model.look.ink = INKS[signs.value]
        self.refresh_css()
        self.refresh(layout=True)  # an equal style sheet paints nothing

    def get_line_filters(self) -> Sequence[LineFilter]:
        """The filters of Textual, and the one that replaces signs; it comes last."""
        filters = super().get_line_filters()
        return filters if self._signs.font is Signs.FULL else [*filters, self._signs]

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Colours for themes that are not ours."""
        return DEFAULTS

    def refresh_css(self, animate: bool = True) -> None:
        """Read the style sheet again, for other colours; at the start Textual reads it by itself."""
        if self.main.is_attached:
            super().refresh_css(animate)
        else:
            self.stylesheet.set_variables(self.get_css_variables())
