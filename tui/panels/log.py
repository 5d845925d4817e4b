"""The session log: whether it is on, where it is, its size and its last entries."""

from __future__ import annotations

from multidrop.tui.panels.view import View
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.lines import Row

OFF = (" off", " /log on: a new file in the state folder", " /log FILE: one that you name")


def log_title(view: View) -> Row:
    """The title: on or off, and the size."""
    log = view.session.log
    if log is None:
        return ((" log ", "strong"), ("off ", "dim"))
    return ((" log ", "strong"), ("◉ on ", "accent"), (f"{size_words(log.size)} ", "dim"))


def log_rows(view: View, width: int, height: int) -> list[Row]:
    """The file, and the last entries without traffic."""
    log = view.session.log
    if log is None:
        return [((fit(text, width), "dim"),) for text in OFF]
    rows: list[Row] = [((" ", "text"), (_end_of(visible(str(log.path)), width - 1), "dim"))]
    last = log.last(height - 1)
    return rows + [((fit(f" {text}", width), "text"),) for text in last]


def size_words(size: int) -> str:
    """`512 B`, `12 kB`, `3.4 MB`."""
    if size < 1000:
        return f"{size} B"
    return f"{size / 1000:.0f} kB" if size < 1e6 else f"{size / 1e6:.1f} MB"


def _end_of(path: str, width: int) -> str:
    """Shorten a path to its end, where file names differ."""
    return path if len(path) <= width else f"…{path[1 - width :]}"
