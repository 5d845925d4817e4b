"""The panel of the selected drive: each axis with state, position, velocity, travel and twin, then its conditions.

Numbers have fixed columns, so that nothing jumps while they change. The first rows are those that a person needs
most, as a low screen cuts the last ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from multidrop.dialects.values import UNREAD, Conditions, Lamp, Pace
from multidrop.tui.panels.view import NOT_REFERENCED, Glance, View, firmware_of, name_of
from multidrop.tui.readout import READ, SWITCHES, Readout
from multidrop.tui.text import age, at_words, fit
from multidrop.tui.widgets.lines import Row, Span, spread, width_of

# Lamps of inputs and outputs, the error, program and currents of an axis, as words with roles.
#
# A lamp is a sign beside its name and function: `●` active, `○` not, `·` not reported. What is older than a few
# readings is dim.


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


def lamp_groups(conditions: Conditions, old: bool) -> tuple[list[list[Span]], list[list[Span]]]:
    """The lamps of inputs, and those of outputs, each with its heading before the first one."""
    of_axes: list[list[list[Span]]] = []
    for output, head in ((False, "in "), (True, "out ")):
        lamps = [lamp for lamp in conditions.lamps if lamp.output is output and (lamp.function or lamp.known)]
        plain = [lamp for lamp in lamps if lamp.name.isdigit() and not lamp.function]
        plain = plain if len(plain) >= MANY else []
        groups = [lamp_span(lamp, old) for lamp in lamps if lamp not in plain]
        if plain:
            signs = "".join("·" if lamp.on is None else "●" if lamp.on else "○" for lamp in plain)
            role = "dim" if old or "●" not in signs else "strong"
            groups.append([(f"{plain[0].name}-{plain[-1].name} ", "dim"), (signs, role)])
        if groups:
            groups[0].insert(0, (head, "dim"))
        of_axes.append(groups)
    return of_axes[0], of_axes[1]


def error_span(conditions: Conditions, old: bool) -> Span:
    if not conditions.error:
        return "error none", "dim"
    text = f"✗ {conditions.error_name}: {conditions.error_text}"
    return (f"{text} (old)", "dim") if old else (text, "error")


def trouble_of(axis: Readout) -> str:
    """The trouble of an axis in few words: as polled, the limit that is active, or its error."""
    conditions = axis.conditions
    if axis.trouble or conditions is None or not conditions.error:
        return axis.trouble
    limits = [lamp.function for lamp in conditions.lamps if lamp.on and lamp.function in LIMITS]
    unnumbered = conditions.cause if conditions.error == UNREAD else ""
    return limits[0] if limits else unnumbered or conditions.error_name


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


# The travel of an axis, a bar with its place in it, the phase of its move, and the time to go.
#
# A bar between known limits has solid ends, one of the range seen so far has dotted ones. Where a limit is not known,
# nothing is drawn that looks like one.


STATED, SOFTWARE, LEARNT, SEEN = "travel", "limits", "switches", "seen"
"""Where a travel comes from: the scale, software limits, limit switches that were reached, the places seen so far."""
SHORTEST_BAR = 6
SLOWING = "slowing down"
STEADY = 0.01
"""Share of the velocity below which a change counts as none."""
LOOK_BACK = 0.15
"""Seconds between two velocities that are compared."""


class Travel(NamedTuple):
    """The range of an axis, and how it is known."""

    low: int
    high: int
    known_by: str


def travel_of(readout: Readout) -> Travel | None:
    """The best known travel; None before the axis was seen at two positions. What was seen reaches to the target."""
    if readout.figures.travel is not None:
        return Travel(*readout.figures.travel, STATED)
    limits = readout.conditions.limits if readout.conditions is not None else None
    if limits is not None:
        return Travel(*limits, SOFTWARE)
    low, high = (readout.travel.at_switch.get(name) for name in SWITCHES)
    if low is not None and high is not None and low < high:
        return Travel(low, high, LEARNT)
    target = readout.conditions.target if readout.conditions is not None else None
    seen = [end for end in (readout.travel.low, readout.travel.high, target) if end is not None]
    return Travel(min(seen), max(seen), SEEN) if readout.last is not None and min(seen) < max(seen) else None


def bar(readout: Readout, width: int) -> str:
    """Draw the place of an axis in its travel; dots where none is known. The target is `◇`."""
    travel, last = travel_of(readout), readout.last
    if width < SHORTEST_BAR:
        return ""
    if travel is None or last is None:
        return "┊" + "┄" * (width - 2) + "┊"
    known = travel.known_by != SEEN
    cells = list(("├" + "─" * (width - 2) + "┤") if known else ("┊" + "┄" * (width - 2) + "┊"))
    target = readout.conditions.target if readout.conditions is not None else None
    if target is not None and last.velocity:
        cells[_cell(target, travel, width)] = "◇"
    beyond = "◀" if last.position < travel.low else "▶" if last.position > travel.high else ""
    cells[_cell(last.position, travel, width)] = beyond or "●"
    if readout.figures.places.gain < 0:  # the lower end in units is at the left
        cells = [MIRRORED.get(cell, cell) for cell in reversed(cells)]
    return "".join(cells)


MIRRORED = {"├": "┤", "┤": "├", "◀": "▶", "▶": "◀"}


def _cell(position: int, travel: Travel, width: int) -> int:
    share = (position - travel.low) / (travel.high - travel.low)
    return 1 + round(min(1.0, max(0.0, share)) * (width - 3))


def phase(readout: Readout) -> str:
    """Return `speeding up`, `cruising` or `slowing down`; empty at rest, or if there is only one reading."""
    if readout.last is None or not readout.last.velocity:
        return ""
    at = readout.last.at
    before = next((point for point in reversed(readout.points) if at - point.at >= LOOK_BACK), None)
    if before is None:
        return ""
    now, then = abs(readout.last.velocity), abs(before.velocity)
    if abs(now - then) <= STEADY * max(now, then):
        return "cruising"
    return "speeding up" if now > then else SLOWING


def seconds_to_go(readout: Readout, now: float) -> float | None:
    """The time to the target by the profile that was read; None where target, profile or direction are not known."""
    last, conditions = readout.last, readout.conditions
    if last is None or conditions is None or conditions.target is None or conditions.pace is None:
        return None
    left = conditions.target - last.position
    if not last.velocity or (left > 0) != (last.velocity > 0):
        return None
    seconds = _duration(abs(left), abs(last.velocity), conditions.pace, braking=phase(readout) == SLOWING)
    return max(0.0, seconds - (now - last.at))


def _duration(left: float, speed: float, pace: Pace, *, braking: bool) -> float:
    """Seconds for a distance at trapezoidal ramps, from a speed to the initial one."""
    up, down, slowest = pace.acceleration, pace.deceleration, pace.initial
    to_stop = max(0.0, speed * speed - slowest * slowest) / (2 * down)
    if braking or left <= to_stop:
        return 2 * left / (speed + min(slowest, speed)) if speed + slowest else 0.0
    peak = math.sqrt((2 * left * up * down + speed * speed * down + slowest * slowest * up) / (up + down))
    peak = max(min(peak, pace.maximum), speed)
    ramps = (peak * peak - speed * speed) / (2 * up) + max(0.0, peak * peak - slowest * slowest) / (2 * down)
    return (peak - speed) / up + max(0.0, peak - slowest) / down + max(0.0, left - ramps) / peak


def to_go_words(readout: Readout, now: float) -> str:
    """`0.4 s to go`; empty where that is not known."""
    seconds = seconds_to_go(readout, now)
    if seconds is None:
        return ""
    return f"{seconds:.1f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


SIGN = "≠"
"""The drive differs from its twin by more than the limit."""
CAUSES = 3
"""Most rows of causes."""


def twin_rows(axis: Readout, unit: str, number: int, width: int, *, dim: bool) -> Iterator[Row]:
    """The predicted position and velocity, and the difference, each below what was measured; `number`: their width."""
    twin = axis.twin
    if twin is None or twin.predicted is None:
        return
    predicted, diverged = twin.predicted, twin.diverged
    role = "dim" if dim or twin.behind(axis.last) else "text"
    figures = axis.figures
    velocity: list[Span] = [(figures.rate(predicted.velocity), role), (f" {figures.speed_unit or f'{unit}/s'} ", "dim")]
    yield spread([(f" {figures.number(predicted.position):>{number}} ", role), ("twin", "dim")], velocity, width)
    apart = figures.distance(predicted.difference)
    if diverged is None:
        yield ((f" {apart:>{number}} ", role), ("difference", "dim"))
        return
    alarm = "dim" if role == "dim" else "error"
    limit: list[Span] = [(f"limit {figures.distance(diverged.limit).removeprefix('+')} ", "dim")]
    yield spread([(f" {SIGN} {apart:>{number - 2}} ", alarm), ("difference", alarm)], limit, width)
    for text in at_words(", ".join(diverged.causes), width - 4)[:CAUSES]:
        yield ((f"   {text}", alarm),)


def differs(axis: Readout, *, causes: bool = True) -> str:
    """`≠ +8112 stall, load`: the difference from the twin while it is above the limit; empty otherwise."""
    twin = axis.twin
    if twin is None or twin.diverged is None:
        return ""
    now = (twin.predicted or twin.diverged).difference
    return f"{SIGN} {axis.figures.distance(now)} {', '.join(twin.diverged.causes) if causes else ''}".rstrip()


def alarm_words(trouble: str, axes: Sequence[Readout], room: int) -> str:
    """`≠ +8112 stall, load`, or `✗ error ≠ +8112`, or `✗ error ≠` where there is no room; empty without an alarm."""
    if not trouble:
        return "; ".join(filter(None, map(differs, axes)))
    words = "; ".join(filter(None, (differs(axis, causes=False) for axis in axes)))
    whole = f"✗ {trouble} {words}".rstrip()
    return whole if len(whole) <= room or not words else f"✗ {trouble} {SIGN}"


def difference_words(axis: Readout) -> str:
    """`twin +14`, where a twin runs from which the drive does not differ."""
    twin = axis.twin
    if twin is None or twin.predicted is None or twin.diverged is not None:
        return ""
    return f"twin {axis.figures.distance(twin.predicted.difference)}"


NUMBER = 12
"""Width of the longest position, -2147483648, and a space."""
COMMANDED = "commanded"
"""Said of a position that no encoder shows: whether the motor followed is unknown."""
WORDS = {STATED: "travel", SOFTWARE: "software limits", LEARNT: "between limit switches", SEEN: "seen so far"}


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
    if glance.stranger:
        return "not identified, not polled"
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
    unit, figures = unit_of(axis, glance.unit), axis.figures
    live = role != "dim" and axis.last is not None and axis.last.velocity != 0
    name = f" {axis.axis}" if axis.axis else ""
    rate = axis.conditions.speed_unit if axis.conditions is not None else f"{unit}/s"
    speed: list[Span] = [(velocity, role), (f" {'' if figures.speed_unit else f'{rate} '}", "dim")]
    rows: list[Row] = [spread(_state(glance, axis, now, width - width_of(speed) - 1), speed, width)]
    for text, role_of in _troubles(axis, now):
        pieces = at_words(text, max(1, width - len(name) - 1))
        rows += [
            ((f"{name} {piece}" if not n else f"{' ' * len(name)}   {piece}", role_of),)
            for n, piece in enumerate(pieces)
        ]
    if not glance.counts(axis):
        verb = f"/referenced {glance.address}".rstrip()
        rows.append(((f"{name} {NOT_REFERENCED}: home it, set it, or {verb}", "strong"),))
    target = axis.conditions.target if axis.conditions is not None and live else None
    own_counter = axis.conditions is not None and axis.conditions.commanded and axis.last is not None
    arrow = f"   → {figures.place(target)}" if target is not None else f"  {COMMANDED}" if own_counter else ""
    togo = to_go_words(axis, now) if live else ""
    right: list[Span] = [(f"{togo} to go ", "text")] if togo else []
    number, _, own = position.partition(" ")
    rows.append(
        spread(
            [(f" {number:>{NUMBER}} ", role), (own or unit, "dim"), (arrow, role if target is not None else "dim")],
            right,
            width,
        )
    )
    rows += twin_rows(axis, unit, NUMBER, width, dim=role == "dim")
    return [*rows, *_travel_rows(axis, role, width)[: 1 if name else 2]]


def _troubles(axis: Readout, now: float) -> list[Span]:
    """The trouble that polls report, and the error with its text, which may say the same."""
    known = axis.conditions if axis.conditions is not None and axis.conditions.error else None
    same = known is not None and known.error_text == axis.trouble and not axis.aged(now)
    troubles: list[Span] = [(f"✗ {axis.trouble}", "error")] if axis.trouble and not same else []
    return [*troubles, error_span(known, axis.aged(now))] if known is not None else troubles


def unit_of(axis: Readout, otherwise: str) -> str:
    return axis.conditions.unit if axis.conditions is not None else otherwise


def _state(glance: Glance, axis: Readout, now: float, width: int) -> list[Span]:
    """The sign and words of an axis, and the phase of its move; as wide as there is room, so that nothing jumps."""
    words, role = glance.sign(now)
    name: list[Span] = [(f" {axis.axis}", "accent")] if axis.axis else []
    if axis.axis and glance.state() in READ and axis.last is not None:
        state = axis.own_state
        words, role = (f"{state.sign} {state.word}", state.role) if role != "dim" else (words, role)
    live = role not in ("dim", "error")
    text = ", ".join(filter(None, (words.rstrip(), phase(axis) if live else "")))
    return [*name, (f" {fit(text, width - width_of(name) - 1)}", role)]


def _travel_rows(axis: Readout, role: str, width: int) -> list[Row]:
    """The bar, and the ends of the travel with the way in which they are known; no row if none is."""
    travel = travel_of(axis)
    if travel is None:
        return []
    drawn = "dim" if role == "dim" or travel.known_by == SEEN else "text"
    row: Row = ((f" {bar(axis, width - 2)}", drawn),)
    low, high = sorted((travel.low, travel.high), key=axis.figures.places.value)
    ends: list[Span] = [(f" {axis.figures.place(low)}", "dim")]
    right: list[Span] = [(f"{axis.figures.place(high)} ", "dim")]
    return [row, spread([*ends, (f"  {WORDS[travel.known_by]}", "dim")], right, width)]


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
