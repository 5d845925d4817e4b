"""The last line: the keys and their functions. The stop always comes first; the rest gives way from the right."""

from __future__ import annotations

from collections.abc import Sequence

from tui.text import fit
from tui.widgets.lines import Lines, Row, Span, width_of

STOP = "^X STOP ALL"


def footer_row(keys: Sequence[tuple[str, str]], recording: bool, latched: bool, width: int, progress: str = "") -> Row:
    """The stop and the keys that work here, (key, word), in `width` cells; a function without a key is left out.

    `progress`: the words on the job that runs, after the stop.
    """
    keys = [(key, word[:14]) for key, word in keys if key]
    if recording:
        keys.insert(0, ("/record stop", "ends it"))
    if latched:
        keys.insert(0, ("/resume", "run again"))
    row: list[Span] = [*STOP_ROW]
    if progress:
        row.append((f" {fit(progress, max(0, width - width_of(row) - 2)).rstrip()} ", "strong"))
    for key, what in keys:
        span: list[Span] = [("  ", "text"), (key, "key"), (f" {what}", "dim")]
        if width_of(row) + width_of(span) > width - 1:
            break
        row += span
    return tuple(row)


STOP_ROW: Row = ((" ", "text"), (f" {STOP} ", "stop"), (" ", "text"))


class StopSign(Lines):
    """The stop alone, for screens that lie over a footer and dim it."""

    def on_mount(self) -> None:
        """Show it."""
        self.put([STOP_ROW])


class Footer(Lines):
    """The footer. The app handles a click on the stop."""

    @staticmethod
    def is_stop(x: int) -> bool:
        """True if a column belongs to the stop."""
        return 0 < x <= len(STOP) + 2
