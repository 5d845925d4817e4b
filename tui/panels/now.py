"""The line below the tabs on every page: the worst thing on all lines and the key that helps, else what moves."""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.drives.bus import Bus
from multidrop.tui.panels.drives import line_trouble
from multidrop.tui.panels.machine import DriveOnLine, all_drives
from multidrop.tui.panels.view import View
from multidrop.tui.readout import ReadoutState
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, Span, width_of

MOST_NAMED = 3
"""Drives that are named as moving; the others are counted."""


def now_row(view: View, width: int) -> Row:
    """The worst thing with the key that helps, or what moves; an empty row if nothing is wrong and nothing moves."""
    places = [*all_drives(view)]
    found = _line(view) or _worst(places, view) or _moving(places) or _running(places)
    if found is None:
        return ()
    row: list[Span] = [(" ", "text")]
    said, helps = found
    for text, role in said:
        room = width - width_of(row) - 1
        row.append((text if len(text) <= room else fit(text, max(0, room)), role))
    if helps and width_of(row) + 3 + width_of(helps) < width:
        row += [("   ", "text"), *helps]
    return tuple(row)


Said = tuple[Sequence[Span], Sequence[Span]]
"""What there is to say, and the key that helps."""


def _line(view: View) -> Said | None:
    """A line without drives that is lost or silent; the loss of the selected line has a banner."""
    for bus in view.session.tabs.shown:
        (state, role), reason = line_trouble(view, bus)
        lost = view.session.tabs.missing(bus)
        if role != "error" or (lost and bus.name == view.session.selected_bus):
            continue  # the banner says why the selected line is lost
        return [(f"{state} {bus.name}: ", role), (reason, role)], [] if lost else search_keys(view, bus)
    return None


def search_keys(view: View, bus: Bus) -> list[Span]:
    """The key, or the line, that searches a line for its drives."""
    key = "Enter" if bus.name == view.session.selected_bus else f"/scan {bus.name}"
    return [(key, "key"), (" searches for its drives", "dim")]


def _worst(places: Sequence[DriveOnLine], view: View) -> Said | None:
    troubled = sorted(
        (place for place in places if place.in_trouble and place.glance.state() is not ReadoutState.LOST),
        key=lambda place: place.urgency,
    )
    if not troubled:
        return None
    worst = troubled[0]
    silent = worst.glance.state() is ReadoutState.SILENT
    mark, _, words = (worst.glance.sign(view.now)[0].strip() if silent else worst.alarm()).partition(" ")
    said: list[Span] = [(f"{mark} {worst.name}  {words}", "error")]
    if len(troubled) > 1:
        said.append((f"   {len(troubled) - 1} more", "error"))
    return said, why_keys(worst, view)


def why_keys(place: DriveOnLine, view: View) -> list[Span]:
    """The keys that lead to the reason for a drive's trouble: of the selected one, or of the worst of all drives."""
    own = place.bus == view.session.selected_bus and place.glance.selected
    if own and (key := view.keys.shown("page-why")):
        return [(key, "key"), (" why", "dim")]
    return [(f"{view.keys.shown('page-drives')} Enter", "key"), (" why", "dim")]


def _moving(places: Sequence[DriveOnLine]) -> Said | None:
    moving = [place.name for place in places if place.glance.state() is ReadoutState.MOVING]
    return _named(ReadoutState.MOVING, moving) if moving else None


def _running(places: Sequence[DriveOnLine]) -> Said | None:
    """The drives whose program runs and can move them at any time."""
    runs = [place.name for place in places if place.glance.state() is ReadoutState.DWELL]
    return _named(ReadoutState.DWELL, runs, "program runs") if runs else None


def _named(state: ReadoutState, names: Sequence[str], words: str = "") -> Said:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return [(f"{state.sign} {words or state.word}: {', '.join(names[:MOST_NAMED])}{more}", state.role)], []
