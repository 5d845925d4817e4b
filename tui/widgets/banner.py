"""The red line under the top line: the stop and the loss of a bus."""

from __future__ import annotations

from multidrop.shell.stop_report import Tally, headline, words
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Lines, Row


def banner_row(tally: Tally | None, lost: str, width: int) -> Row:
    """The text of the banner; an empty row if there is none.

    `tally` is what is known since a latched stop, `lost` the reason of a lost bus. A tally of drives that stood before
    their bus was lost is not shown in place of the loss.
    """
    if tally is not None and not (lost and tally.stand):
        text = f" {headline(tally, width - 1)}"
    elif lost:
        text = f" ✗ LOST - {lost}" + (f"; before that {words(tally)}" if tally is not None else "")
    else:
        return ()
    return ((fit(text, width), "stop"),)


class Banner(Lines):
    """One red line that takes no room while it is empty."""

    def __init__(self) -> None:
        super().__init__(classes="banner")

    def show(self, row: Row) -> None:
        """Show a row; hide for an empty one."""
        if self.display != bool(row):
            self.display = bool(row)
        self.put([row])
