"""Lists of drives in columns: what each column shows of a drive, and the columns of each list.

Columns are fixed and numbers are right-aligned, so that nothing jumps while values change. The last column takes the
rest of the row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from multidrop.base.text import visible
from multidrop.tui.panels.drive import alarm_words, program_words, trouble_of
from multidrop.tui.panels.drives import STATE, short_words, spark
from multidrop.tui.panels.machine import DriveOnLine
from multidrop.tui.panels.view import NOT_REFERENCED, View, name_of
from multidrop.tui.readout import ReadoutState
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import ActionText, Row, Span, width_of


class DriveColumn(NamedTuple):
    """A column of a list. A number that is longer than it takes the room from the next one."""

    head: str
    cells: int
    span: Callable[[DriveOnLine, View, int], Span]
    """What it shows of a drive, in so many cells."""
    right: bool = False
    gap: int = 0
    """Blank cells after it."""
    least: int = 0
    """The least width of the list with it."""
    few: int = 0
    """Its cells in a list that is not roomy; 0: as many."""

    def put(self, text: str, cells: int) -> str:
        return f"{text:>{max(0, cells)}}" if self.right else fit(text, cells)


class DriveList(NamedTuple):
    """The columns of a list; the last one fills the row."""

    columns: Sequence[DriveColumn]
    roomy: int
    """The width from which every column has all its cells."""

    def _shown(self, width: int) -> list[tuple[DriveColumn, int]]:
        """The columns in a list of a width, each with its cells."""
        shown = [column for column in self.columns if width >= column.least]
        return [(column, column.few if column.few and width < self.roomy else column.cells) for column in shown]

    def row(self, place: DriveOnLine, view: View, width: int, chosen: bool) -> Row:
        """The columns of a drive; `chosen`: it is the one that keys are for."""
        row: list[Span] = [("▸" if chosen else " ", "accent")]
        beyond, shown = 0, self._shown(width)
        for column, cells in shown[:-1]:
            text, role = column.span(place, view, cells)
            if len(row) == 1 and chosen:
                role = "accent"
            shown_text = column.put(text, cells - beyond) + " " * column.gap
            row.append((ActionText(shown_text, text.action) if isinstance(text, ActionText) else shown_text, role))
            beyond = max(0, len(text) - cells) if column.right else 0
        room = width - width_of(row)
        text, role = shown[-1][0].span(place, view, room)
        return (*row, (fit(text, room), role))

    def heads(self, width: int) -> Row:
        """The names of the columns."""
        *shown, (last, _) = self._shown(width)
        heads = [column.put(column.head, cells) + " " * column.gap for column, cells in shown]
        return ((fit(f" {''.join(heads)}{last.head}", width).rstrip(), "dim"),)


def _name(place: DriveOnLine, view: View, cells: int) -> Span:
    return visible(place.name), "text"


def _near_name(place: DriveOnLine, view: View, cells: int) -> Span:
    """The name without the line, if that is the selected one; a click selects the drive."""
    glance = place.glance
    own = place.bus == view.session.selected_bus
    name = name_of(glance) if own and (glance.address or glance.label) else place.name
    if place.axis is not None:
        name = place.axis.axis.rjust(len(glance.address) + 1)
    return ActionText(visible(name), f"act.select({glance.address!r}, {place.bus!r})"), "text"


def _state(place: DriveOnLine, view: View, cells: int) -> Span:
    return short_words(place.glance, place.readout, view.now), place.glance.sign(view.now)[1]


def _position(place: DriveOnLine, view: View, cells: int) -> Span:
    position, _, role = place.glance.values(view.now, place.readout)
    axes = place.glance.readout.axes
    axis = place.readout.axis if len(axes) > 1 else ""
    return f"{axis} {position}".strip(), "text" if role == "strong" else role


def _velocity(place: DriveOnLine, view: View, cells: int) -> Span:
    _, velocity, role = place.glance.values(view.now, place.readout)
    return f" {velocity}", role


def _speed(place: DriveOnLine, view: View, cells: int) -> Span:
    """The velocity of a drive that moves."""
    last = place.readout.last
    return _velocity(place, view, cells) if last is not None and last.velocity else ("", "dim")


def _last_seconds(place: DriveOnLine, view: View, cells: int) -> Span:
    role = place.glance.values(view.now, place.readout)[2]
    return spark(place.readout, view.now, cells), "dim" if role == "dim" else "accent"


def _besides(place: DriveOnLine, view: View, cells: int) -> Span:
    return place.besides(cells, view.now)


def _error(place: DriveOnLine, view: View, cells: int) -> Span:
    """The trouble of the axis, its difference from its twin, or that its position is not referenced; else nothing."""
    trouble = trouble_of(place.readout)
    if text := alarm_words(trouble, [place.readout], cells):
        aged = place.glance.state() is ReadoutState.LOST or place.readout.aged(view.now)
        return text, "dim" if aged and not place.readout.trouble else "error"
    return (NOT_REFERENCED, "strong") if not place.glance.counts(place.readout) else ("", "text")


def _program(place: DriveOnLine, view: View, cells: int) -> Span:
    """What its program does, else how many lines it was read to have, else nothing."""
    readout = place.readout
    if place.glance.storing:
        return "storing", "strong"
    if words := program_words(readout, view.now).removeprefix("program "):
        return words, "dim" if readout.program_aged(view.now) else "motion"
    lines = len(readout.program.lines)
    return (f"{lines} line{'s' * (lines != 1)}", "text") if lines else ("", "text")


def _sent(place: DriveOnLine, view: View, cells: int) -> Span:
    sent = place.glance.readout.sent
    return visible(sent[0]) if sent is not None and place.axis is None else "", "dim"


ROOMY, NARROW = 100, 80
"""Widths of the page of all drives: from `ROOMY` on, the column of the last seconds is wide. Below `NARROW`, neither
that column nor the velocity is shown, to leave room for trouble."""
ALL_DRIVES = DriveList(
    (
        DriveColumn("drive", 17, _name, gap=1),
        DriveColumn("state", STATE, _state),
        DriveColumn("position", 13, _position, right=True, gap=2),
        DriveColumn("velocity", 11, _velocity, right=True, gap=1, least=NARROW),
        DriveColumn("20 s", 16, _last_seconds, right=True, gap=2, least=NARROW, few=5),
        DriveColumn("", 0, _besides),
    ),
    ROOMY,
)
"""The columns of the page of all drives."""
MAIN_TABLE = DriveList(
    (
        DriveColumn("drive", 20, _near_name, gap=1, few=12),
        DriveColumn("state", STATE, _state, gap=1),
        DriveColumn("position", 13, _position, right=True, gap=2),
        DriveColumn("velocity", 12, _speed, right=True, gap=2, least=ROOMY),
        DriveColumn("20 s", 16, _last_seconds, right=True, gap=2, least=ROOMY),
        DriveColumn("error", 18, _error, gap=1, few=9),
        DriveColumn("program", 14, _program, gap=1, few=7),
        DriveColumn("last sent", 0, _sent),
    ),
    ROOMY,
)
"""The columns of the table of drives on the main screen."""
MAIN_TABLE_FROM = 66
"""Least width of that table."""
