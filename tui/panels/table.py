"""The panels by name: what each shows, how much room it takes, what must be polled for it, and its key.

The order is that of the screen, from top to bottom. On a wide screen several are shown, one above the other in a
column; on a narrow one a single one, below the transcript. A panel gets between its least and its most rows. Room that
one does not use goes to those below it, and then to those above it that can use more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from multidrop.tui.panels.drive import drive_rows, drive_title
from multidrop.tui.panels.drives import drives_rows
from multidrop.tui.panels.plot import plot_rows, plot_title
from multidrop.tui.panels.program import program_rows, program_title
from multidrop.tui.panels.traffic import traffic_rows, traffic_title
from multidrop.tui.panels.view import View
from multidrop.tui.text import fit, visible
from multidrop.tui.widgets.lines import Row, width_of

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


MOTION, CONDITIONS, PLOT = "motion", "conditions", "plot"
"""The wants of a panel: position and velocity; lamps, errors and programs; samples as fast as the wire allows."""


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
    Panel("plot", plot_title, plot_rows, 8, 60, frozenset({MOTION, PLOT}), "velocity and position"),
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
    return next(each for each in PANELS if each.name == name)


class Shown:
    """The panels that a person shows and hides."""

    def __init__(self) -> None:
        self._by_hand: dict[str, bool] = {}
        self._alone = ""
        """The panel of a narrow screen."""

    def panels(self, wide: bool) -> list[Panel]:
        """The panels to show, from top to bottom."""
        if not wide:
            return [panel for panel in PANELS if panel.name == self._alone]
        return [panel for panel in PANELS if self._by_hand.get(panel.name, panel.first)]

    def toggle(self, name: str, wide: bool) -> bool:
        """Show a panel, or hide it; return whether it is shown now."""
        on = name not in [panel.name for panel in self.panels(wide)]
        if wide:
            self._by_hand[name] = on
        if not wide or on:
            self._alone = name if on else ""
        return on


HEAD = 1
"""Rows of a title."""


def fitting(panels: Sequence[Panel], height: int) -> list[Panel]:
    """The panels that find room, first come, first served."""
    shown: list[Panel] = []
    for panel in panels:
        if sum(each.least + HEAD for each in [*shown, panel]) <= height:
            shown.append(panel)
    return shown


def divided(panels: Sequence[Panel]) -> tuple[list[Panel], list[Panel]]:
    """The panels in two columns of about equal need, in their order."""
    needs = [panel.least + HEAD for panel in panels]
    cuts = range(min(1, len(panels)), len(panels) + 1)
    cut = min(cuts, key=lambda n: abs(sum(needs[:n]) - sum(needs[n:])))
    return list(panels[:cut]), list(panels[cut:])


def column_rows(panels: Sequence[Panel], view: View, width: int, height: int, border: bool) -> list[Row]:
    """Exactly `height` rows of `width` cells with these panels, with a border at the left if there is one."""
    shown = fitting(panels, height)
    left_out = [panel.name for panel in panels if panel not in shown]
    if left_out:
        height -= 1
        shown = fitting(shown, height)
        left_out = [panel.name for panel in panels if panel not in shown]
    side: Row = (("│", "rule"),) if border else ()
    rows: list[Row] = []
    for panel, body in zip(shown, _bodies(shown, view, width - len(side), height), strict=True):
        rows.append(title_row(panel, view, width, "├" if border else "─"))
        rows += [(*side, *row) for row in body]
    rows += [side] * (height - len(rows))
    if left_out:
        text = fit(f" no room: {', '.join(left_out)}", width - len(side))
        rows.append((*side, (text, "dim")))
    return rows


def title_row(panel: Panel, view: View, width: int, edge: str) -> Row:
    title: Row = ((f" {panel.title} ", "strong"),) if isinstance(panel.title, str) else panel.title(view)
    kept: list[tuple[str, str]] = [(edge, "rule")]
    for text, role in title:
        room = width - width_of(kept)
        kept.append((text if width_of([(text, role)]) <= room else fit(text, room), role))
    return (*kept, ("─" * max(0, width - width_of(kept)), "rule"))


def _bodies(panels: Sequence[Panel], view: View, width: int, height: int) -> list[list[Row]]:
    room = height - sum(panel.least + HEAD for panel in panels)
    bodies: list[list[Row]] = []
    given: list[int] = []
    for number, panel in enumerate(panels):
        spare = -(-room // (len(panels) - number))
        given.append(min(panel.most, panel.least + spare))
        body = panel.rows(view, width, given[-1])[: given[-1]]
        room -= len(body) - panel.least
        bodies.append(body)
    for number, panel in enumerate(panels):
        more = min(panel.most - len(bodies[number]), room)
        if more > 0 and len(bodies[number]) == given[number]:
            body = panel.rows(view, width, given[number] + more)[: given[number] + more]
            room -= len(body) - len(bodies[number])
            bodies[number] = body
    return bodies
