"""The red line under the top line: what must be dealt with before anything else."""

from __future__ import annotations

from shell.stops import Tally, headline, words
from tui.text import fit
from tui.widgets.lines import Lines, Row


def banner_row(tally: Tally | None, lost: str, width: int) -> Row:
    """What it says; an empty row when there is nothing to say.

    `tally` is what is known since a stop that stands, `lost` why a bus is lost. That drives stood before their bus was
    lost is not said in its place.
    """
    if tally is not None and not (lost and tally.stand):
        text = f" {headline(tally, width - 1)}"
    elif lost:
        text = f" ✗ LOST - {lost}" + (f"; before that {words(tally)}" if tally is not None else "")
    else:
        return ()
    return ((fit(text, width), "stop"),)


class Banner(Lines):
    """One red line that takes no room while it has nothing to say."""

    def __init__(self) -> None:
        super().__init__(classes="banner")

    def say(self, row: Row) -> None:
        """Show a row, or go away for an empty one."""
        if self.display != bool(row):
            self.display = bool(row)
        self.put([row])
