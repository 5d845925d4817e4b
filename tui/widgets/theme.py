"""Colours: a dark and a light theme, and one of the terminal's own sixteen.

Red belongs to the stop and to errors, amber to motion, one accent to focus. Everything else is text on background.
"""

from __future__ import annotations

from textual.theme import BUILTIN_THEMES, Theme

from multidrop.dialects.text import visible

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
