"""Colours and signs: a dark and a light theme, one of the terminal's own sixteen, and the signs that a font holds.

Red belongs to the stop and to errors, amber to motion, one accent to focus. Everything else is text on background.
All code writes the full signs. A filter replaces them at the very end, in panels, dialogs and borders alike, each by
one of the same width. So a new sign is added to the tables here, and no other module asks what a terminal can show.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from enum import Enum
from functools import lru_cache
from typing import Any

from rich.cells import cell_len
from rich.segment import Segment
from textual.app import App
from textual.color import Color
from textual.driver import Driver
from textual.filter import LineFilter
from textual.theme import BUILTIN_THEMES, Theme

from multidrop.base.text import visible
from multidrop.shell.configuration import ScreenSettings
from multidrop.tui.curves.raster import INKS, Ink

COLOURS = (
    ("primary", "#5fafd7", "#005f87", "ansi_cyan"),
    ("accent", "#5fafd7", "#005f87", "ansi_cyan"),
    ("warning", "#e0af5f", "#875f00", "ansi_yellow"),
    ("error", "#e05f5f", "#af0000", "ansi_red"),
    ("success", "#c6c6c6", "#303030", "ansi_default"),
    ("foreground", "#d0d0d0", "#1c1c1c", "ansi_default"),
    ("background", "#121212", "#eeeeee", "ansi_default"),
    ("surface", "#1c1c1c", "#e4e4e4", "ansi_default"),
    ("panel", "#1c1c1c", "#e4e4e4", "ansi_default"),
    ("muted", "#8a8a8a", "#626262", "ansi_default"),
    ("faint", "#444444", "#b2b2b2", "ansi_default"),
    ("stop-text", "#ffffff", "#ffffff", "ansi_bright_white"),
    ("stop-ground", "#af0000", "#af0000", "ansi_red"),
    ("ground", "#121212", "#eeeeee", "ansi_black"),
    ("series-2", "#87af5f", "#4f6f00", "ansi_green"),
    ("series-3", "#af87d7", "#5f3f9f", "ansi_magenta"),
    ("series-4", "#d0d0d0", "#303030", "ansi_default"),
    ("series-5", "#5fafaf", "#006f6f", "ansi_blue"),
    ("series-6", "#d787af", "#9f3f6f", "ansi_bright_cyan"),
)
"""Each colour in the dark theme, in the light one, and among the terminal's own sixteen."""
OF_TEXTUAL = frozenset(
    {"primary", "accent", "warning", "error", "success", "foreground", "background", "surface", "panel"}
)
"""Those that Textual knows; the others are variables of ours."""


def _theme(name: str, column: int, **more: Any) -> Theme:
    colours: dict[str, Any] = {row[0]: row[column] for row in COLOURS}
    variables = {**more.pop("variables", {}), **{key: colours.pop(key) for key in colours.keys() - OF_TEXTUAL}}
    return Theme(name=f"multidrop-{name}", variables=variables, **colours, **more)


DARK = _theme("dark", 1, dark=True)
LIGHT = _theme("light", 2, dark=False)
ANSI = _theme(
    "ansi", 3, dark=True, ansi=True, secondary="ansi_cyan", boost="ansi_default",
    variables=BUILTIN_THEMES["ansi-dark"].variables,
)  # fmt: skip
THEMES = (DARK, LIGHT, ANSI)
DEFAULTS = dict(DARK.variables)
"""Values of our variables, for themes that are not ours."""


def theme_for(color_system: str | None) -> str:
    """Choose the theme for a terminal's colours, as rich names them."""
    return DARK.name if color_system in ("256", "truecolor") else ANSI.name


def wrong_theme(name: str) -> list[str]:
    """One line on a theme that does not exist; empty for an empty name and for any other."""
    known = {*(theme.name for theme in THEMES), *BUILTIN_THEMES}
    if not name or name in known:
        return []
    return [f"screen.theme: no theme {visible(name)}; `Theme` in the palette lists them"]


BRAILLE = range(0x2800, 0x2900)
UPPER, LOWER = 0b00011011, 0b11100100
"""The dots of the upper and the lower half of a braille character."""


class Signs(Enum):
    """The signs that the font of a terminal holds."""

    FULL = "full"
    BOXES = "boxes"
    """Lines and blocks, no braille: the Linux console, many fonts of PuTTY."""
    ASCII = "ascii"


def _pairs(text: str) -> dict[int, str]:
    """Make a table of pairs such as `▶>`."""
    return {ord(pair[0]): pair[1] for pair in text.split()}


def _braille(halves: str) -> dict[int, str]:
    """The characters for braille by what is set: nothing, the upper half, the lower half, both."""
    return {code: halves[bool(code & UPPER) + 2 * bool(code & LOWER)] for code in BRAILLE}


_RARE = "‼! ↵< □_ ┊: ┄. ◇+ ≠! −- ✗x ✓v ●* ◉* ○o □o ›> …~ –- —- ▏| ▎| ▍| ▕| ╴- ╶- ╵| ╷|"
TABLES: Mapping[Signs, Mapping[int, str]] = {
    Signs.FULL: {},
    Signs.BOXES: _pairs(f"{_RARE} ▶► ▷» ▸► ◀◄ ◂◄ ╭┌ ╮┐ ╰└ ╯┘ ▁_ ▂▄ ▃▄ ▅▄ ▆█ ▇█ ▔▀") | _braille(" ▀▄█"),
    Signs.ASCII: _pairs(
        f"{_RARE} ▶> ▷) ▸> ►> ◀< ◂< ■# ◆@ ·. •* »}} «< →> ←< ↑^ ↓v ↔- ⇄- │| ─- ├+ ┤+ ┬+ ┴+ ┼+ ┌+ ┐+ └+ ┘+ ╭+ ╮+ ╰+ ╯+"
        " ◄< ▼v ▲^ ━= ┃| ═= ║| █# ▓# ▒: ░. ▀' ▄. ▌| ▐| ▁_ ▂_ ▃- ▄- ▅= ▆= ▇# ▔' ×x µu °o ±~ ²2 ³3"
    )
    | _braille(" '.:"),
}


def signs_for(wanted: str, environment: Mapping[str, str]) -> Signs:
    """The signs that a person set, or with `auto` those that fit the terminal."""
    if wanted != "auto":
        return Signs(wanted)
    locale = environment.get("LC_ALL") or environment.get("LC_CTYPE") or environment.get("LANG") or ""
    if locale and "utf8" not in locale.lower().replace("-", ""):
        return Signs.ASCII
    # The fonts of both have no braille; a terminal names itself on Windows, too.
    console = sys.platform == "win32" and not environment.keys() & {"WT_SESSION", "SSH_CONNECTION", "TERM_PROGRAM"}
    return Signs.BOXES if console or environment.get("TERM") == "linux" else Signs.FULL


@lru_cache(4096)
def shown_as(text: str, signs: Signs) -> str:
    """Write a text in the characters that a terminal can show, in as many cells."""
    if signs is Signs.FULL or text.isascii():
        return text
    shown = text.translate(TABLES[signs])
    if signs is Signs.BOXES or shown.isascii():
        return shown
    return "".join(character if character.isascii() else "?" * cell_len(character) for character in shown)


class SignFilter(LineFilter):
    """Replaces the signs of all that Textual paints."""

    def __init__(self, signs: Signs) -> None:
        super().__init__()
        self.font = signs

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        return [Segment(shown_as(text, self.font), style, control) for text, style, control in segments]


def ink_of(signs: Signs) -> Ink:
    return INKS[signs.value]


class Dressed(App[int]):
    """An app with our themes, and with the signs that the font of its terminal holds."""

    ENABLE_COMMAND_PALETTE = False
    """Textual's own palette; ours is a `SearchDialog`, in which keys keep their order."""

    def __init__(self, screen_settings: ScreenSettings, driver: type[Driver] | None = None) -> None:
        # With NO_COLOR, only this makes Textual take colours away altogether; else it makes greys of them.
        super().__init__(driver_class=driver, ansi_color=True if "NO_COLOR" in os.environ else None)
        self.signs = SignFilter(signs_for(screen_settings.signs, os.environ))

    def dress(self, screen_settings: ScreenSettings) -> None:
        """Use the theme that a configuration names, else one that fits the terminal."""
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = theme_for(None if self.no_color else self.console.color_system)
        if screen_settings.theme in self.available_themes and not self.no_color:
            self.theme = screen_settings.theme

    def get_line_filters(self) -> Sequence[LineFilter]:
        """The filters of Textual, and the one that replaces signs; it comes last."""
        filters = super().get_line_filters()
        return filters if self.signs.font is Signs.FULL else [*filters, self.signs]

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Colours for themes that are not ours."""
        return DEFAULTS
