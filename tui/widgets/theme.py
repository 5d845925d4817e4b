"""Colours and signs: a dark and a light theme, one of the terminal's own sixteen, and the signs that a font holds.

Red belongs to the stop and to errors, amber to motion, one accent to focus. Everything else is text on background.
All code writes the full signs. A filter replaces them at the very end, in panels, dialogs and borders alike, each by
one of the same width. So a new sign is added to the tables here, and no other module asks what a terminal can show.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from functools import lru_cache

from rich.cells import cell_len
from rich.segment import Segment
from textual.app import App
from textual.color import Color
from textual.filter import LineFilter
from textual.theme import BUILTIN_THEMES, Theme

from multidrop.dialects.text import visible
from multidrop.shell.configuration import Look
from multidrop.tui.curves.raster import INKS, Ink

DARK = Theme(
    name="multidrop-dark",
    primary="#5fafd7",
    accent="#5fafd7",
    warning="#e0af5f",
    error="#e05f5f",
    success="#c6c6c6",
    foreground="#d0d0d0",
    background="#121212",
    surface="#1c1c1c",
    panel="#1c1c1c",
    dark=True,
    variables={
        "muted": "#8a8a8a",
        "faint": "#444444",
        "stop-text": "#ffffff",
        "stop-ground": "#af0000",
        "ground": "#121212",
        "series-2": "#87af5f",
        "series-3": "#af87d7",
        "series-4": "#d0d0d0",
        "series-5": "#5fafaf",
        "series-6": "#d787af",
    },
)
LIGHT = Theme(
    name="multidrop-light",
    primary="#005f87",
    accent="#005f87",
    warning="#875f00",
    error="#af0000",
    success="#303030",
    foreground="#1c1c1c",
    background="#eeeeee",
    surface="#e4e4e4",
    panel="#e4e4e4",
    dark=False,
    variables={
        "muted": "#626262",
        "faint": "#b2b2b2",
        "stop-text": "#ffffff",
        "stop-ground": "#af0000",
        "ground": "#eeeeee",
        "series-2": "#4f6f00",
        "series-3": "#5f3f9f",
        "series-4": "#303030",
        "series-5": "#006f6f",
        "series-6": "#9f3f6f",
    },
)
ANSI = Theme(
    name="multidrop-ansi",
    ansi=True,
    primary="ansi_cyan",
    secondary="ansi_cyan",
    accent="ansi_cyan",
    warning="ansi_yellow",
    error="ansi_red",
    success="ansi_default",
    foreground="ansi_default",
    background="ansi_default",
    surface="ansi_default",
    panel="ansi_default",
    boost="ansi_default",
    dark=True,
    variables={
        **BUILTIN_THEMES["ansi-dark"].variables,
        "muted": "ansi_default",
        "faint": "ansi_default",
        "stop-text": "ansi_bright_white",
        "stop-ground": "ansi_red",
        "ground": "ansi_black",
        "series-2": "ansi_green",
        "series-3": "ansi_magenta",
        "series-4": "ansi_default",
        "series-5": "ansi_blue",
        "series-6": "ansi_bright_cyan",
    },
)
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


_RARE = "□_ ┊: ┄. ◇+ ≠! −- ✗x ✓v ●* ◉* ○o □o ›> …~ –- —- ▏| ▎| ▍| ▕| ╴- ╶- ╵| ╷|"
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
    return Signs.BOXES if environment.get("TERM") == "linux" else Signs.FULL


@lru_cache(4096)
def shown_as(text: str, signs: Signs) -> str:
    """Write a text in the characters that a terminal can show, in as many cells."""
    if signs is Signs.FULL or text.isascii():
        return text
    found = text.translate(TABLES[signs])
    if signs is Signs.BOXES or found.isascii():
        return found
    return "".join(each if each.isascii() else "?" * cell_len(each) for each in found)


class SignFilter(LineFilter):
    """Replaces the signs of all that Textual paints."""

    def __init__(self, signs: Signs) -> None:
        super().__init__()
        self.font = signs

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        return [Segment(shown_as(text, self.font), style, control) for text, style, control in segments]


def ink_of(signs: Signs) -> Ink:
    return INKS[signs.value]


def dress(app: App[int], look: Look) -> None:
    """Use the theme that a configuration names, else one that fits the terminal."""
    for theme in THEMES:
        app.register_theme(theme)
    app.theme = theme_for(None if app.no_color else app.console.color_system)
    if look.theme in app.available_themes and not app.no_color:
        app.theme = look.theme
