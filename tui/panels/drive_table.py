"""The table of all drives on a wide main screen: a row each, those of the selected line first.

A line without drives has a row that says what is the matter with it. If there is not enough room, the drives that
matter least are left out and counted.
"""

from __future__ import annotations

from multidrop.drives.bus import Bus
from multidrop.tui.panels.drive_columns import MAIN_TABLE, MAIN_TABLE_FROM
from multidrop.tui.panels.drives import compact_rows, line_trouble
from multidrop.tui.panels.machine import AT_REST, DriveOnLine, all_drives
from multidrop.tui.panels.view import View
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, Span, width_of


def drives_rows(view: View, width: int, height: int) -> list[Row]:
    """The names of the columns and a row for each axis of each drive; a narrow panel has shorter rows of its own."""
    if width < MAIN_TABLE_FROM:
        return compact_rows(view, width, height)
    places = [*all_drives(view)]
    empty = [bus for bus in view.session.tabs.shown if not bus.drives]
    room = height - 1 - len(empty)
    every = [place._replace(axis=axis) for place in places for axis in (None, *place.glance.readout.others.values())]
    if len(every) <= room:
        places = every
    shown = places if len(places) <= room else _foremost(places, room - 1)
    rows = [
        MAIN_TABLE.heads(width),
        *(MAIN_TABLE.row(place, view, width, place.glance.selected and place.axis is None) for place in shown),
        *(_line_row(view, bus, width) for bus in empty),
    ]
    left_out = [place for place in places if place not in shown]
    if left_out:
        rows.append(_left_out_row(left_out, view, width))
    return rows[:height]


def _foremost(places: list[DriveOnLine], most: int) -> list[DriveOnLine]:
    """At most so many drives in their order: the selected one, then those in trouble, then those that may move."""
    ranked = sorted(places, key=lambda place: (not place.glance.selected, *place.urgency))
    kept = {(place.bus, place.glance.address) for place in ranked[: max(0, most)]}
    return [place for place in places if (place.bus, place.glance.address) in kept]


def _left_out_row(places: list[DriveOnLine], view: View, width: int) -> Row:
    trouble = sum(place.in_trouble for place in places)
    resting = all(place.glance.state() in AT_REST for place in places)
    words = f"{trouble} in trouble" if trouble else "all at rest" if resting else "not all at rest"
    return (
        (
            fit(f"  {len(places)} more, {words}   {view.keys.shown('page-drives')} shows them", width),
            "error" if trouble else "dim",
        ),
    )


def _line_row(view: View, bus: Bus, width: int) -> Row:
    """A line without drives: its name, its state, and the reason."""
    (state, role), reason = line_trouble(view, bus)
    name: Span = (
        f" {fit(bus.name, MAIN_TABLE.columns[0].few)} ",
        "accent" if bus.name == view.session.selected_bus else "text",
    )
    row: Row = (name, (f"{state}   ", role))
    return (*row, (fit(reason, width - width_of(row)), "error" if role == "error" else "dim"))
