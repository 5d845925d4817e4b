"""The last line: the keys and their functions. The stop always comes first; the rest gives way from the right."""

from __future__ import annotations

from collections.abc import Sequence

from tui.text import fit
from tui.widgets.lines import Lines, Row, Span, width_of

STOP = "^X STOP ALL"
KEYS = (("^P", "everything"), ("^O", "drive"), ("^T", "plot"), ("^R", "history"), ("^Q", "quit"))
"""The keys of the main screen."""


def footer_row(
    macros: Sequence[tuple[str, str]],
    recording: bool,
    latched: bool,
    width: int,
    progress: str = "",
    more: Sequence[tuple[str, str]] = KEYS,
) -> Row:
    """The keys in `width` cells. `macros` holds (key, name) of those on function keys.

    `progress`: the words on the job that runs, after the stop. `more`: the keys of the screen after the macros.
    """
    keys: list[tuple[str, str]] = [("F1", "help"), *((key, name[:14]) for key, name in macros), *more]
    if recording:
        keys.insert(0, ("/record stop", "ends it"))
    if latched:
        keys.insert(0, ("/resume", "run again"))
    row: list[Span] = [(" ", "text"), (f" {STOP} ", "stop"), (" ", "text")]
    if progress:
        row.append((f" {fit(progress, max(0, width - width_of(row) - 2)).rstrip()} ", "strong"))
    for key, what in keys:
        span: list[Span] = [("  ", "text"), (key, "key"), (f" {what}", "dim")]
        if width_of(row) + width_of(span) > width - 1:
            break
        row += span
    return tuple(row)


class Footer(Lines):
    """The footer. The app handles a click on the stop."""

    @staticmethod
    def is_stop(x: int) -> bool:
        """True if a column belongs to the stop."""
        return 0 < x <= len(STOP) + 2
