"""The state of drives as rows of text: two lines for a narrow screen, two panels for a wide one.

Columns are fixed and numbers are right-aligned, so that nothing jumps while values change.
"""

from __future__ import annotations

from tui.panels.glance import STATE, Glance, firmware_of, name_of
from tui.panels.view import View
from tui.screen_model import Readout
from tui.text import fit
from tui.widgets.lines import Row, Span, spread

POSITION = 14
"""Width of the longest position, -2,147,483,648."""
VELOCITY = 10
OTHER = 17


def narrow_rows(view: View, width: int) -> list[Row]:
    """Two lines: the selected drive; the others, and the rate of polling."""
    chosen, now = view.chosen, view.now
    if chosen is None:
        return [((fit(" no drive selected   ^O chooses one", width), "dim"),), ()]
    position, velocity, role = chosen.values(now)
    first: Row = (
        (f" {fit(name_of(chosen), 12)} ", "accent"),
        chosen.sign(now),
        (f"{position:>{POSITION}} ", role),
        (fit(chosen.unit, 6), "dim"),
        (f"{velocity:>{VELOCITY}} ", role),
        (fit(f"{chosen.unit}/s", 8), "dim"),
    )
    others: list[Span] = [span for axis in chosen.readout.others.values() for span in _axis_spans(chosen, axis, now)]
    others += [(f" {each.axis} {each.trouble} ", "error") for each in chosen.readout.axes if each.trouble]
    for glance in view.glances:
        if not glance.selected:
            others.append((f" {glance.address} ", "text"))
            others.append(glance.sign(now, OTHER))
    return [first, spread(others, [(f"{poll_words(chosen, now, view.polling)} ", "dim")], width)]


def _axis_spans(glance: Glance, axis: Readout, now: float) -> list[Span]:
    """Position and velocity of a further axis, below those of the first."""
    position, velocity, role = glance.values(now, axis)
    return [
        (fit("", 14 + STATE - 2), "dim"),
        (f"{axis.axis} ", "dim"),
        (f"{position:>{POSITION}} ", role),
        (fit(glance.unit, 6), "dim"),
        (f"{velocity:>{VELOCITY}} ", role),
        (fit(f"{glance.unit}/s", 8), "dim"),
    ]


def poll_words(glance: Glance, now: float, polling: bool) -> str:
    """The rate of polling on the wire: `polls 41 Hz`."""
    if glance.lost:
        return "not polled"
    if not polling:
        return "polling off"
    rate = glance.readout.rate(now)
    return f"polls {rate:.0f} Hz" if rate >= 1 or not rate else f"polls {rate:.1f} Hz"


def drive_title(view: View) -> Row:
    """Name, product and firmware of the selected drive."""
    if view.chosen is None:
        return ((" drive ", "strong"),)
    firmware = firmware_of(view.chosen)
    about = f"{view.chosen.product}  fw {firmware}" if firmware else view.chosen.product
    return ((f" {name_of(view.chosen)} ", "accent"), (f"{about} ", "dim"))


def drive_rows(view: View, width: int, height: int) -> list[Row]:
    """The selected drive: position, velocity and trouble of each axis, its state, the rate of polling."""
    glance, now = view.chosen, view.now
    if glance is None:
        return [((" no drive selected", "dim"),), ((" ^O chooses one", "dim"),)]
    return [
        *(row for axis in glance.readout.axes for row in _axis_rows(glance, axis, now)),
        spread([(" ", "text"), glance.sign(now)], [(f"{poll_words(glance, now, view.polling)} ", "dim")], width),
    ]


def drives_rows(view: View, width: int, height: int) -> list[Row]:
    """A row for each drive of the selected bus."""
    return [_other_row(glance, view.now) for glance in view.glances[:height]]


def _axis_rows(glance: Glance, axis: Readout, now: float) -> list[Row]:
    """Position, velocity and trouble of an axis; its name if there are several."""
    position, velocity, role = glance.values(now, axis)
    name = f" {axis.axis}" if axis.axis else ""
    rows: list[Row] = [
        ((f"{name} position ", "dim"), (f"{position:>{POSITION}}", role), (f" {glance.unit}", "dim")),
        ((f"{name} velocity ", "dim"), (f"{velocity:>{POSITION}}", role), (f" {glance.unit}/s", "dim")),
    ]
    return [*rows, ((f"{name} {axis.trouble}", "error"),)] if axis.trouble else rows


def _other_row(glance: Glance, now: float) -> Row:
    position, _, role = glance.values(now)
    pointer = "▸" if glance.selected else " "
    return (
        (f"{pointer}{fit(glance.address, 2)} ", "accent" if glance.selected else "text"),
        glance.sign(now),
        (f"{position:>{POSITION}}", role if role == "dim" else "text"),
    )
