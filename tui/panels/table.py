"""The panels by name: what each shows, how much room it takes, what must be polled for it, and its key.

The order is that of the screen, from top to bottom. `tui.panels.column` divides the room.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from multidrop.tui.panels.axis import drive_rows, drive_title
from multidrop.tui.panels.log import log_rows, log_title
from multidrop.tui.panels.plot import plot_rows, plot_title
from multidrop.tui.panels.program import program_rows, program_title
from multidrop.tui.panels.status import drives_rows
from multidrop.tui.panels.traffic import traffic_rows, traffic_title
from multidrop.tui.panels.view import View
from multidrop.tui.widgets.lines import Row

MOTION, CONDITIONS, PLOT = "motion", "conditions", "plot"
"""What a panel can want: position and velocity; lamps, errors and programs; samples as fast as the wire allows."""


class Panel(NamedTuple):
    """A panel, and how it is shown."""

    name: str
    title: Callable[[View], Row] | str
    rows: Callable[[View, int, int], list[Row]]
    """Rows in (width, height) cells: `height` of them at most, fewer if there is less to show."""
    least: int
    """Rows below which it is not shown. Its title takes one more."""
    most: int
    """Rows that it can use."""
    wants: frozenset[str]
    about: str
    """One line for the palette."""
    key: str = ""
    """The key that shows and hides it, as Textual spells it."""
    first: bool = True
    """Shown on a wide screen until a person hides it."""


PANELS: tuple[Panel, ...] = (
    Panel(
        "drive",
        drive_title,
        drive_rows,
        9,
        20,
        frozenset({MOTION, CONDITIONS}),
        "position, travel, state, lamps, error and program",
    ),
    Panel("drives", "drives", drives_rows, 3, 12, frozenset({MOTION, CONDITIONS}), "every drive of the line in a row"),
    Panel(
        "program",
        program_title,
        program_rows,
        1,
        9,
        frozenset({MOTION, CONDITIONS}),
        "the lines around the current one",
    ),
    Panel("plot", plot_title, plot_rows, 8, 60, frozenset({MOTION, PLOT}), "velocity and position", "ctrl+t"),
    Panel("traffic", traffic_title, traffic_rows, 3, 40, frozenset(), "the bytes of the line, both ways", first=False),
    Panel(
        "log",
        log_title,
        log_rows,
        2,
        12,
        frozenset(),
        "the session log: where, how large, its last entries",
        first=False,
    ),
)


def panel(name: str) -> Panel:
    """Find a panel by name."""
    return next(each for each in PANELS if each.name == name)
