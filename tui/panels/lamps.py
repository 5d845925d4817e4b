"""Lamps of inputs and outputs, the error, program and currents of an axis, as words with roles.

A lamp is a sign beside its name and function: `●` active, `○` not, `·` not reported. What is older than a few readings
is dim.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multidrop.dialects.values import UNREAD, Conditions, Lamp
from multidrop.tui.readout import Readout
from multidrop.tui.text import age
from multidrop.tui.widgets.lines import Row, Span, width_of

LIMITS = ("lim+", "lim-")
MANY = 6
"""Lamps without functions that stand close together."""


def flowing(groups: Sequence[Sequence[Span]], width: int, indent: str = " ") -> list[Row]:
    """Put groups of spans into rows of a width; no group is divided, and a longer one is cut by the screen."""
    rows: list[Row] = []
    row: list[Span] = []
    for group in groups:
        if row and width_of(row) + 2 + width_of(group) > width:
            rows.append(tuple(row))
            row = []
        row += [("  ", "text"), *group] if row else [(indent, "text"), *group]
    return [*rows, tuple(row)] if row else rows


def lamp_span(lamp: Lamp, old: bool) -> list[Span]:
    """`3 lim- ○`: name and function in text, the sign in its role."""
    name = f"{lamp.name} {lamp.function}".strip()
    if lamp.name == "ai":
        return [(name, "dim" if old else "text")]
    sign = "·" if lamp.on is None else "●" if lamp.on else "○"
    role = "dim" if old or not lamp.on else "error" if lamp.function in LIMITS else "strong"
    return [(f"{name} ", "dim" if old or not lamp.function else "text"), (sign, role)]


def _row_of(lamps: Sequence[Lamp], old: bool) -> list[Span]:
    """`1-8 ○○●○○○○○`: many lamps without functions."""
    signs = "".join("·" if lamp.on is None else "●" if lamp.on else "○" for lamp in lamps)
    return [(f"{lamps[0].name}-{lamps[-1].name} ", "dim"), (signs, "dim" if old or "●" not in signs else "strong")]


def lamp_groups(conditions: Conditions, old: bool) -> tuple[list[list[Span]], list[list[Span]]]:
    """The lamps of inputs, and those of outputs, each with its heading before the first one."""
    found: list[list[list[Span]]] = []
    for output, head in ((False, "in "), (True, "out ")):
        lamps = [lamp for lamp in conditions.lamps if lamp.output is output]
        plain = [lamp for lamp in lamps if lamp.name.isdigit() and not lamp.function]
        plain = plain if len(plain) >= MANY else []
        groups = [lamp_span(lamp, old) for lamp in lamps if lamp not in plain]
        if plain:
            groups.append(_row_of(plain, old))
        if groups:
            groups[0].insert(0, (head, "dim"))
        found.append(groups)
    return found[0], found[1]


def error_span(conditions: Conditions, old: bool) -> Span:
    """The error with its text, or `error none`."""
    if not conditions.error:
        return "error none", "dim"
    number = "" if conditions.error == UNREAD else f" {conditions.error}"
    text = f"✗ error{number}: {conditions.error_text}"
    return (f"{text} (old)", "dim") if old else (text, "error")


def trouble_of(axis: Readout) -> str:
    """The trouble of an axis in few words: as polled, the limit that is active, or its error."""
    conditions = axis.conditions
    if axis.trouble or conditions is None or not conditions.error:
        return axis.trouble
    limits = [lamp.function for lamp in conditions.lamps if lamp.on and lamp.function in LIMITS]
    return limits[0] if limits else "error" if conditions.error == UNREAD else f"error {conditions.error}"


def program_words(readout: Readout, now: float) -> str:
    """`program running`, `program at 15` where its place is known, `program ran 3 s ago` after a stop; empty: none."""
    conditions, name = readout.conditions, readout.program.name
    if not name:
        return ""
    if readout.program.past:
        return f"program ran {age(now - readout.program.known_at)} ago"
    place = conditions.line if conditions is not None else ""
    place = place or (str(readout.program.line) if readout.program.line is not None else "")
    shown = f" {name}" if not place or name != "running" else ""
    return f"program{shown}{f' at {place}' if place else ''}"


def facts_groups(readout: Readout, now: float) -> Iterator[list[Span]]:
    """Error, program, currents, and what only the family has; with their age once they are old."""
    conditions = readout.conditions
    if conditions is None:
        return
    old = readout.aged(now)
    role = "dim" if old else "text"
    if not conditions.error:
        yield [error_span(conditions, old)]
    if words := program_words(readout, now):
        yield [(words, "dim" if readout.program_aged(now) else "motion")]
    if conditions.no_current:
        yield [("no current ", "dim" if old else "strong"), (f"({conditions.no_current})", role)]
    for name, value in (("run", conditions.run_current), ("hold", conditions.hold_current)):
        if value is not None:
            yield [(f"{name} ", "dim"), (f"{value} %", role)]
    for name, text in conditions.more:
        yield [(f"{name} ", "dim"), (text, role)]
    if old:
        yield [(f"read {age(now - readout.conditioned_at)} ago", "dim")]
