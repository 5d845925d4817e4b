"""Values and bytes as text for a person: numbers, k and M, ages, visible control characters."""

from __future__ import annotations

import re

from rich.cells import cell_len, chop_cells, set_cell_size

from multidrop.base.text import visible as written_out

LONGEST_SHOWN_TEXT = 4096
"""Greatest number of characters shown of one line; noise without line ends has any length."""


def visible(text: str) -> str:
    r"""Write out control and direction characters (`\x06`), and cut a line of any length."""
    shown = written_out(text[:LONGEST_SHOWN_TEXT])
    return shown if len(text) <= LONGEST_SHOWN_TEXT else f"{shown} … ({len(text)} characters)"


def digits(value: int | None) -> str:
    """Format a number, without separators, so that a copy of it may be typed; `–` if it is unknown."""
    return "–" if value is None else str(value)


def short(value: float, step: float, width: int = 8, *, prefixes: bool = True) -> str:
    """Format a tick's label in k or M with its sign (`600k`, `-1.25M`) and as many decimals as `step` needs.

    `prefixes` False: without k and M. A label wider than `width` becomes the plain number, or its end (`…483648`).
    Neighbouring ticks never have equal labels.
    """
    text = _scaled(value, step, prefixes)
    if len(text) <= width:
        return text
    plain = f"{value:.0f}"
    return plain if len(plain) <= width else f"…{plain[1 - width :]}"


def _scaled(value: float, step: float, prefixes: bool) -> str:
    for limit, unit in ((1e6, "M"), (1e3, "k"), (1.0, ""))[0 if prefixes else 2 :]:
        if max(abs(value), step) >= limit or not unit:
            scaled = step / limit
            decimals = 0
            while decimals < 6 and abs(scaled - round(scaled, decimals)) > scaled * 1e-6:
                decimals += 1
            text = f"{value / limit:.{decimals}f}"
            return "0" if float(text) == 0 else text + unit
    raise AssertionError


def age(seconds: float) -> str:
    """Format an age: `0.4 s`, `3 s`, `12 min`."""
    if seconds < 0.95:
        return f"{max(seconds, 0.0):.1f} s"
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def shorter(hint: str, width: int) -> str:
    """Fit a hint, `SYNTAX   MEANING; manual PLACE`, into a width: the longest form that keeps the meaning whole."""
    syntax, gap, meaning = hint.partition("   ")
    if not gap or not syntax.strip() or syntax.startswith("/"):
        forms = [hint, syntax]  # of a verb, the usage says more
    else:
        plain, told = re.sub(r"\s*\[[^]]*\]", "", syntax), meaning.partition("; manual ")[0]
        forms = [hint, f"{plain}   {meaning}", f"{plain}   {told}", f"{syntax.split()[0]}   {told}", told]
    return next((form for form in forms if cell_len(form) <= width), fit(forms[-1], width))


def ago(seconds: float) -> str:
    """Format how long something is past: `just now`, `12 min ago`, `3 h ago`, `5 days ago`."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.0f} {unit} ago"
    return "just now"


def at_words(text: str, width: int) -> list[str]:
    """Break the text between words into rows of at most `width` cells; break only longer words."""
    rows: list[str] = []
    row: str | None = None
    for word in text.split(" "):
        longer = word if row is None else f"{row} {word}"
        if cell_len(longer) <= width:
            row = longer
            continue
        if row is not None:
            rows.append(row)
        *full, row = chop_cells(word, width) or [""]
        rows += full
    return [*rows, row or ""]


def fit(text: str, width: int) -> str:
    """Pad the text to exactly `width` cells, or cut it with `…`."""
    if width <= 0:
        return ""
    if cell_len(text) <= width:
        return set_cell_size(text, width)
    return set_cell_size(text, width - 1) + "…"


def key_words(key: str) -> str:
    """Write a key of Textual as the screen does: `^T` for `ctrl+t`, `F3`, `Alt+1`."""
    *modifiers, name = key.split("+")
    short = {"pageup": "PgUp", "pagedown": "PgDn"}.get(name, name.capitalize())
    shown = name.upper() if len(name) == 1 or name[1:].isdigit() else short
    return "".join("^" if modifier == "ctrl" else f"{modifier.capitalize()}+" for modifier in modifiers) + shown
