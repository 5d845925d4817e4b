"""The red line under the top line: what must be dealt with before anything else."""

from __future__ import annotations

from tui.lines import Lines, Row
from tui.text import fit


def banner_row(latched: bool, lost: str, width: int) -> Row:
    """What it says; an empty row when there is nothing to say."""
    if latched:
        text = " ✗ STOPPED - /resume to run automation again"
    elif lost:
        text = f" ✗ LOST - {lost}"
    else:
        return ()
    return ((fit(text, width), "stop"),)


class Banner(Lines):
    """One red line that takes no room while it has nothing to say."""

    def __init__(self) -> None:
        super().__init__(classes="banner")

    def say(self, row: Row) -> None:
        """Show a row, or go away for an empty one."""
        self.display = bool(row)
        self.put([row])
