"""Panels one above the other in a column: the room of each, its title, and what found no room.

A panel gets between its least and its most rows. Room that one does not use goes to those below it, and then to those
above it that can use more.
"""

from __future__ import annotations

from collections.abc import Sequence

from multidrop.tui.panels.table import Panel
from multidrop.tui.panels.view import View
from multidrop.tui.text import fit
from multidrop.tui.widgets.lines import Row, width_of

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
    """A rule with the title of a panel in it."""
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
