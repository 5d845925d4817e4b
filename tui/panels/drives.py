"""The drives of a line in a row each: below the transcript of a narrow screen, and as a panel of a wide one.

Columns are fixed and numbers are right-aligned, so that nothing jumps while values change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from multidrop.drives.bus import Bus
from multidrop.shell.line_syntax import join_target
from multidrop.tui.curves.raster import BRAILLE, Curve, PlotFrame, Raster, TickScale
from multidrop.tui.curves.samples import Columns, Trace
from multidrop.tui.panels.drive import (
    NUMBER,
    SIGN,
    alarm_words,
    bar,
    difference_words,
    differs,
    flowing,
    lamp_groups,
    poll_words,
    program_words,
    to_go_words,
    trouble_of,
)
from multidrop.tui.panels.view import NOT_REFERENCED, Glance, View, glances_of
from multidrop.tui.readout import READ, SPAN, Readout, ReadoutState
from multidrop.tui.text import age, fit
from multidrop.tui.widgets.lines import ActionText, Row, Span, spread, width_of

MOST_SPARKS = 8
"""Small curves that are kept of a drive."""


def spark(readout: Readout, now: float, width: int, value: str = "position") -> str:
    """Draw a value of the first axis; a resting drive is a line at the foot, and what was not read stays empty.

    `value` names a field of `PlottedPoint`. The curve is drawn once for each column of dots that time or samples reach,
    not for each sample in it.
    """
    if not readout.points or width < 1:
        return " " * max(0, width)
    dot, shown = SPAN / (2 * width), (value, width)
    reached = (now // dot, readout.points[-1].at // dot, readout.silent_since, readout.period, len(readout.points) > 2)
    if shown not in readout.sparks or readout.sparks[shown][0] != reached:
        if len(readout.sparks) >= MOST_SPARKS:
            readout.sparks.clear()
        readout.sparks[shown] = reached, _drawn(readout, now, width, value)
    return readout.sparks[shown][1]


def _drawn(readout: Readout, now: float, width: int, value: str) -> str:
    trace = Trace()
    for point in readout.points:
        trace.add(point.at, getattr(point, value))
    low, high = min(trace.values), max(trace.values)
    if readout.silent_since is None and now - trace.at[-1] < 3 * max(readout.period, 1.0):
        trace.add(now, trace.values[-1])
    dot = SPAN / (2 * width)
    first = math.floor(now / dot) // 2 - width + 1
    columns = Columns(trace, dot, 2 * first)
    columns.update(2 * first)
    frame = PlotFrame(first, width, 1, TickScale(low, high if high > low else low + 1, 1), BRAILLE)
    return "".join(text for text, _ in Raster().draw([Curve(columns, 0)], frame)[0])


NAME = 9
STATE = 14
BAR = 10
VELOCITY = 12
MOST_SHOWN_DRIVES = 3
"""Drives that a narrow screen shows above its lamps."""


def narrow_rows(view: View, width: int) -> list[Row]:
    """A row for each of a few drives, the selected one and those in trouble first of all; lamps and rate below."""
    chosen, now = view.chosen, view.now
    if chosen is None:
        return [((fit(" no drive selected   ^O chooses one", width), "dim"),), ()]
    shown = kept(view.glances, MOST_SHOWN_DRIVES)
    rows: list[Row] = []
    for glance in shown:  # a row for each axis of the selected drive, and one for any other drive
        axes = glance.readout.axes if glance.selected else [glance.readout]
        rows += [_axis_row(glance, axis, now, width, first=axis is glance.readout) for axis in axes]
    others = [each for each in view.glances if not any(each is kept_one for kept_one in shown)]
    more = f"+{len(others)}{_in_trouble(others)} ^A   " if others else ""
    twin = difference_words(chosen.readout)
    right: list[Span] = [(f"{more}{twin}{'   ' if twin else ''}{poll_words(chosen, now, view.polling)} ", "dim")]
    groups: list[list[Span]] = []
    for axis in chosen.readout.axes:
        if axis.conditions is not None:
            inputs, outputs = lamp_groups(axis.conditions, axis.aged(now))
            groups += [*inputs, *outputs]
    lamps = flowing(groups, width - width_of(right) - 2)  # as many as there is room for
    return [*rows, spread(list(lamps[0]) if lamps else [], right, width)]


def kept(glances: Sequence[Glance], most: int) -> list[Glance]:
    """At most so many drives in their order: the selected one, those in trouble, then the first ones."""
    ranked = sorted(glances, key=lambda each: (not each.selected, not _troubled(each)))
    chosen = ranked[:most]
    return [glance for glance in glances if any(glance is each for each in chosen)]


def _in_trouble(glances: Sequence[Glance]) -> str:
    """How many of these are in trouble, in parentheses; empty: none."""
    count = sum(map(_troubled, glances))
    return f" ({count} ✗)" if count else ""


def _troubled(glance: Glance) -> bool:
    in_trouble = any(map(trouble_of, glance.readout.axes)) or glance.readout.differs
    return in_trouble or glance.state() in (ReadoutState.SILENT, ReadoutState.LOST)


def _axis_row(glance: Glance, axis: Readout, now: float, width: int, *, first: bool) -> Row:
    """Name, state, place in the travel, position, velocity, and what matters most besides."""
    position, velocity, role = glance.values(now, axis)
    moves = axis.last is not None and axis.last.velocity != 0
    own_speed = axis.figures.speed_unit or (axis.conditions is not None and axis.conditions.speed)
    per, beyond = "" if own_speed else "/s", max(0, len(position) - NUMBER)
    row: list[Span] = [
        _name(glance, axis, first=first),
        (short_words(glance, axis, now), glance.sign(now)[1]),
        (f"{bar(axis, BAR)} ", "dim" if role == "dim" else "text"),
        (f"{position:>{NUMBER}}", role),
        (f"{f' {velocity}{per}' if moves else '':>{max(0, VELOCITY - beyond)}} ", role),
    ]
    room = width - width_of(row)
    text, text_role = _besides(glance, axis, now, room, live=role != "dim")
    return (*row, (fit(text, room), text_role))


def _name(glance: Glance, axis: Readout, *, first: bool) -> Span:
    pointer = "▸" if glance.selected and first else " "
    name = f"{glance.address} {glance.label}".strip() or "drive"
    shown = f"{name} {axis.axis}".rstrip() if first else axis.axis.rjust(len(name) + 1 if axis.axis else 0)
    text = ActionText(f"{pointer}{fit(shown, NAME - 1)} ", f"act.select({glance.address!r})")
    return text, "accent" if glance.selected else "text"


def short_words(glance: Glance, axis: Readout, now: float) -> str:
    """Sign and state in few cells, with its age where it may be outdated: `■ 3 s ago`."""
    state = glance.state()
    if state in READ and axis.last is not None:
        state = axis.own_state
        if glance.readout.old(now):
            return fit(f"{state.sign} {age(now - axis.last.at)} ago", STATE)
    if state is ReadoutState.SILENT and math.isfinite(glance.readout.silent_since or 0.0):
        return fit(f"{state.sign} silent {age(now - (glance.readout.silent_since or now))}", STATE)
    return fit(f"{state.sign} {'not read' if state is ReadoutState.UNKNOWN else state.word}", STATE)


def _besides(glance: Glance, axis: Readout, now: float, room: int, *, live: bool) -> Span:
    """The trouble of an axis and its difference from its twin, a lost reference, the way to its target, its program."""
    trouble = trouble_of(axis)
    if text := alarm_words(trouble, [axis], room):
        return text, "error" if live or trouble else "dim"
    if not glance.counts(axis):
        return NOT_REFERENCED, "strong"
    target = axis.conditions.target if axis.conditions is not None else None
    if live and target is not None and axis.last is not None and axis.last.velocity:
        return f"→ {axis.figures.place(target)}  {to_go_words(axis, now)}".rstrip(), "text"
    return program_words(axis, now), "dim" if axis.program_aged(now) else "motion"


def line_trouble(view: View, bus: Bus) -> tuple[Span, str]:
    """The state of a line as a sign with a word, and the reason; both empty for a line whose drives reply."""
    if view.session.tabs.missing(bus):
        return (f"{ReadoutState.LOST.sign} {ReadoutState.LOST.word}", "error"), str(bus.lost)
    if bus.lost is not None:
        return ("· searching", "dim"), "its drives are being searched for"
    if bus.silent:
        return (f"{ReadoutState.SILENT.sign} {ReadoutState.SILENT.word}", "error"), "no drive replies"
    if bus.name in view.session.raw:
        return ("· raw", "dim"), "typed text goes to the port"
    return ("", "dim") if bus.drives else ("· no drive", "dim"), ""


def compact_rows(view: View, width: int, height: int) -> list[Row]:
    """A row for each drive of the selected bus, with its position over the last seconds; then those of other lines."""
    shown = kept(view.glances, height if len(view.glances) <= height else height - 1)
    rows = [_panel_row(glance, view.now, width) for glance in shown]
    left = [glance for glance in view.glances if not any(glance is kept_one for kept_one in shown)]
    for bus in view.session.tabs.shown:
        if bus.name == view.session.selected_bus:
            continue
        glances = glances_of(view.session, view.model, bus)
        if left or len(rows) + len(glances) > height:
            left += glances
            continue
        for glance in glances:
            named = replace(glance, address=join_target(bus.name, glance.address).removesuffix(":"), label="")
            rows.append(_panel_row(named, view.now, width))
    if left and len(rows) < height:
        trouble = _in_trouble(left)
        rows.append(((f"   {len(left)} more{trouble}; ^A shows all drives", "error" if trouble else "dim"),))
    return rows


def _panel_row(glance: Glance, now: float, width: int) -> Row:
    position, _, role = glance.values(now)
    state, state_role = glance.state(), glance.sign(now)[1]
    row: list[Span] = [
        _name(glance, glance.readout, first=True),
        (f"{state.sign} ", state_role),
        (f"{position:>{NUMBER}} ", "text" if role == "strong" else role),
    ]
    room = width - width_of(row)
    text, text_role = _besides(glance, glance.readout, now, room - 1, live=role != "dim")
    if text.startswith("→"):
        text = to_go_words(glance.readout, now)
    elif text.startswith(SIGN):
        text = differs(glance.readout, causes=False)
    stale = role == "dim" and state is not ReadoutState.UNKNOWN and not text
    if state in (ReadoutState.SILENT, ReadoutState.LOST, ReadoutState.STORING) or stale:
        text, text_role = short_words(glance, glance.readout, now)[2:].strip(), state_role
    shown = min(len(text) + 1, room) if text else 0
    drawn = spark(glance.readout, now, room - shown)
    return (*row, (drawn, "dim" if role == "dim" else "accent"), (fit(f" {text}", shown), text_role))
