"""The panel of the selected drive: each axis with state, position, velocity and travel, then its conditions.

Numbers have fixed columns, so that nothing jumps while they change. The first rows are those that a person needs
most, as a low screen cuts the last ones.
"""

from __future__ import annotations

from multidrop.tui.panels.glance import NOT_REFERENCED, Glance, firmware_of, name_of
from multidrop.tui.panels.lamps import error_span, facts_groups, flowing, lamp_groups
from multidrop.tui.panels.travel import LEARNT, LIMITS, SEEN, bar, phase, to_go_words, travel_of
from multidrop.tui.panels.twin import twin_rows
from multidrop.tui.panels.view import View
from multidrop.tui.readout import READ, Readout
from multidrop.tui.text import digits, fit
from multidrop.tui.widgets.lines import Row, Span, spread, width_of

NUMBER = 12
"""Width of the longest position, -2147483648, and a space."""
WORDS = {LIMITS: "software limits", LEARNT: "between limit switches", SEEN: "seen so far"}


def drive_title(view: View) -> Row:
    """Name, product, firmware and modes of the selected drive, and the rate at which it is polled."""
    glance = view.chosen
    if glance is None:
        return ((" drive ", "strong"),)
    conditions = glance.readout.conditions
    parts = (glance.product, firmware_of(glance), conditions.modes if conditions is not None else "")
    about = " ".join(filter(None, parts))
    return (
        (f" {name_of(glance)} ", "accent"),
        (f"{about}  " if about else "", "dim"),
        (f"{poll_words(glance, view.now, view.polling)} ", "dim"),
    )


def poll_words(glance: Glance, now: float, polling: bool) -> str:
    """The rate of polling on the wire: `polls 41 Hz`."""
    if glance.lost:
        return "not polled"
    if not polling:
        return "polling off"
    rate = glance.readout.rate(now)
    return f"polls {rate:.0f} Hz" if rate >= 1 or not rate else f"polls {rate:.1f} Hz"


def drive_rows(view: View, width: int, height: int) -> list[Row]:
    """Every axis, then error, program, currents and lamps."""
    glance, now = view.chosen, view.now
    if glance is None:
        return [((" no drive selected", "dim"),), ((" ^O chooses one", "dim"),)]
    axes = glance.readout.axes
    rows = [row for axis in axes for row in axis_rows(glance, axis, now, width)]
    for axis in axes:
        rows += _condition_rows(glance, axis, now, width, named=len(axes) > 1)
    return rows[:height]


def axis_rows(glance: Glance, axis: Readout, now: float, width: int) -> list[Row]:
    """State and velocity, position and target, and the travel of an axis; its trouble, where it has any."""
    position, velocity, role = glance.values(now, axis)
    unit = unit_of(axis, glance.unit)
    live = role != "dim" and axis.last is not None and axis.last.velocity != 0
    name = f" {axis.axis}" if axis.axis else ""
    speed: list[Span] = [(velocity, role), (f" {unit}/s ", "dim")]
    rows: list[Row] = [spread(_state(glance, axis, now, width - width_of(speed) - 1), speed, width)]
    rows += [((f"{name} {text}", role_of),) for text, role_of in _troubles(axis, now)]
    if not glance.counts(axis):
        verb = f"/referenced {glance.address}".rstrip()
        rows.append(((f"{name} {NOT_REFERENCED}: home it, set it, or {verb}", "strong"),))
    target = axis.conditions.target if axis.conditions is not None and live else None
    arrow = f"   → {digits(target)}" if target is not None else ""
    togo = to_go_words(axis, now) if live else ""
    right: list[Span] = [(f"{togo} to go ", "text")] if togo else []
    rows.append(spread([(f" {position:>{NUMBER}} ", role), (unit, "dim"), (arrow, role)], right, width))
    rows += twin_rows(axis, unit, NUMBER, width, dim=role == "dim")
    return [*rows, *_travel_rows(axis, role, width)[: 1 if name else 2]]


def _troubles(axis: Readout, now: float) -> list[Span]:
    """The trouble that polls report, and the error with its text."""
    found: list[Span] = [(f"✗ {axis.trouble}", "error")] if axis.trouble else []
    if axis.conditions is not None and axis.conditions.error:
        found.append(error_span(axis.conditions, axis.aged(now)))
    return found


def unit_of(axis: Readout, otherwise: str) -> str:
    """The unit of positions of an axis."""
    return axis.conditions.unit if axis.conditions is not None else otherwise


def _state(glance: Glance, axis: Readout, now: float, width: int) -> list[Span]:
    """The sign and words of an axis, and the phase of its move; as wide as there is room, so that nothing jumps."""
    words, role = glance.sign(now)
    name: list[Span] = [(f" {axis.axis}", "accent")] if axis.axis else []
    if axis.axis and glance.state() in READ and axis.last is not None:
        state = axis.own_state
        words, role = (f"{state.sign} {state.word}", state.role) if role != "dim" else (words, role)
    live = role not in ("dim", "error")
    text = f"{words.rstrip()} {phase(axis) if live else ''}".rstrip()
    return [*name, (f" {fit(text, width - width_of(name) - 1)}", role)]


def _travel_rows(axis: Readout, role: str, width: int) -> list[Row]:
    """The bar, and the ends of the travel with the way in which they are known."""
    travel = travel_of(axis)
    drawn = "dim" if role == "dim" or travel is None or travel.known_by == SEEN else "text"
    row: Row = ((f" {bar(axis, width - 2)}", drawn),)
    if travel is None:
        return [row, ((" travel not known", "dim"),)]
    ends: list[Span] = [(f" {travel.low}", "dim")]
    return [row, spread([*ends, (f"  {WORDS[travel.known_by]}", "dim")], [(f"{travel.high} ", "dim")], width)]


def _condition_rows(glance: Glance, axis: Readout, now: float, width: int, *, named: bool) -> list[Row]:
    """Error, program and what else has words, then the lamps of inputs and of outputs in rows of their own."""
    conditions = axis.conditions
    if conditions is None:
        return []
    old = axis.aged(now) or glance.lost
    inputs, outputs = lamp_groups(conditions, old)
    indent = f" {axis.axis} " if named else " "
    facts = flowing(list(facts_groups(axis, now)), width, indent)
    return [*facts, *flowing(inputs, width, indent), *flowing(outputs, width, indent)]
