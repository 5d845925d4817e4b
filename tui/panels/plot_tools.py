"""What a person does with the curves of a plot: set a trigger, read the cursors, save what is visible."""

from __future__ import annotations

from math import isfinite

from multidrop.dialects import Diagnostic
from multidrop.shell.plots.rerun_calls import Batch, Curve
from multidrop.shell.roles import DIFFERENCE
from multidrop.tui.curves.trigger import Setting, State
from multidrop.tui.panels.plot import columns_of
from multidrop.tui.panels.plotted import PLOTTED, Line, groups, role_of
from multidrop.tui.panels.view import View
from multidrop.tui.widgets.lines import Row, Span, width_of

EDGES = {"rise": True, "fall": False}
USUAL = "20%"
"""The share of the picture before the edge."""
FORM = "CURVE rise|fall LEVEL [SHARE%]"
SHORTEST = 0.001
"""The least time between two cursors, s, of which the frequency is shown."""


def _lines(view: View) -> list[Line]:
    return [line for group in groups(view) for line in group.lines if not line.twin]


def _named(line: Line) -> str:
    """`a velocity`, `press:b X position`: as a person types it."""
    axis = line.quantity.axis
    return " ".join(
        filter(None, (line.name.split()[0], axis if axis != line.name.split()[0] else "", line.quantity.word))
    )


def typed_trigger(view: View) -> str:
    """The trigger as it can be typed: that which is set, or one in the middle of a curve that moves."""
    lines, look = _lines(view), view.model.look
    setting = look.trigger.setting
    found = [line for line in lines if setting is not None and line.quantity == setting.quantity]
    if found and setting is not None:
        level, rising, before = found[0].conversion.value(setting.level), setting.rising, f"{setting.before:.0%}"
        return f"{_named(found[0])} {'rise' if rising == (found[0].conversion.gain > 0) else 'fall'} {level:g} {before}"
    for line in lines:
        trace = view.model.traces.get(line.quantity)
        seen = [value for _, value in trace.since(trace.count_at(view.now - look.span))] if trace is not None else []
        if seen and max(seen) - min(seen) > 2:
            level = (line.conversion.value(min(seen)) + line.conversion.value(max(seen))) / 2
            return f"{_named(line)} rise {float(f'{level:.2g}'):.10g} {USUAL}"
    return f"{_named(lines[0])} rise 100 {USUAL}" if lines else ""


def parse_trigger(view: View, text: str) -> Setting:
    """Parse `CURVE rise|fall LEVEL [SHARE%]`; the level is in the unit that is shown. Raises Diagnostic."""
    words = text.split()
    at = next((n for n, word in enumerate(words) if word.lower() in EDGES), len(words))
    named, edge, numbers = words[:at], words[at : at + 1], words[at + 1 :]
    valid = f"valid: {FORM}, as {typed_trigger(view) or 'a velocity rise 100 20%'}"
    try:
        level, share = (*map(float, numbers[:1]), float((numbers[1:] or [USUAL])[0].removesuffix("%")) / 100)
    except ValueError:
        raise Diagnostic(f"no trigger {text!r}", hint=valid) from None
    if not edge or len(numbers) > 2 or not isfinite(level) or not 0 <= share <= 1:
        raise Diagnostic(f"no trigger {text!r}", hint=valid)
    lines = _lines(view)
    found = [line for line in lines if set(named) <= _names(line)]
    if len(found) != 1:
        known = ", ".join(map(_named, found or lines)) or "nothing"
        what = "several curves are" if found else "no plotted curve is"
        raise Diagnostic(f"{what} {' '.join(named) or 'without a name'!r}", hint=f"plotted: {known}")
    gain, zero = found[0].conversion
    return Setting(found[0].quantity, (level - zero) / gain, EDGES[edge[0].lower()] == (gain > 0), share)


def _names(line: Line) -> set[str]:
    bus, address, axis, word = line.quantity
    return {bus, address, f"{bus}:{address}", axis, word, *line.name.split()}


def trigger_row(view: View) -> Row:
    """The state of the trigger and its condition; nothing while it is off."""
    trigger = view.model.look.trigger
    if trigger.state is State.OFF or (setting := trigger.setting) is None:
        return ()
    once = ", once" if trigger.single else ""
    line = next((each for each in _lines(view) if each.quantity == setting.quantity), None)
    if line is None:
        return ((f" {trigger.state.value}{once} ", "accent"), (f"by {setting.quantity.word}, not plotted now", "dim"))
    return ((f" {trigger.state.value}{once} ", "accent"), (typed_trigger(view), "dim"))


def cursor_rows(view: View, width: int, most: int) -> list[Row]:
    """The times of the cursors, their differences, and the values of each curve there, in at most so many rows."""
    look = view.model.look
    at, other = look.cursor, look.other
    if at is None:
        return []
    clocks = [f"{view.session.wall(each):%H:%M:%S.%f}"[:-4] for each in (other, at) if each is not None]
    since = at - (view.now if look.zero is None else look.zero)
    pieces: list[list[Span]] = [[(f" {' to '.join(clocks)} ", "strong"), (f" {since:.2f} s  ", "dim")]]
    if other is not None:
        apart = f"dt {at - other:+.3f} s  "
        pieces[0][1:] = [(f" {apart}", "strong")]
        if abs(at - other) >= SHORTEST:
            pieces.append([(f"1/dt {1 / abs(at - other):.4g} Hz  ", "strong")])
    for group in groups(view):
        chart = look.charts.get((group.word, group.key, columns_of(width)))
        for line in group.lines if chart is not None else ():
            values = [None if chart is None else chart.value_at(line.quantity, each) for each in (other or at, at)]
            texts = ["not known" if value is None else line.text(value) for value in values]
            text = texts[1] if other is None else f"{texts[0]} to {texts[1]}"
            if other is not None and values[0] is not None and values[1] is not None:
                text += f" ({line.apart(values[1] - values[0])})"
            pieces.append([(f"{line.shown} {group.word} ", role_of(line.number)), (f"{text}  ", "strong")])
    rows: list[list[Span]] = [[]]
    for number, piece in enumerate(pieces):
        if rows[-1] and width_of(rows[-1]) + width_of(piece) > width:
            if len(rows) == most:
                rows[-1].append((f"and {len(pieces) - number} more", "dim"))
                break
            rows.append([(" ", "text")])
        rows[-1] += piece
    return [tuple(row) for row in rows]


def visible(view: View, width: int) -> Batch:
    """The samples that are visible in a plot of this width: each curve with its own numbers, and in its unit."""
    look = view.model.look
    window = look.window(view.now, columns_of(width), look.ink.wide)
    begin, end = window.first * window.cell, (window.last + 1) * window.cell
    wall = view.session.wall(begin).timestamp()
    batch = Batch()
    for group in groups(view):
        for line in group.lines:
            trace = view.model.traces.get(line.quantity)
            seen = [each for each in trace.since(trace.count_at(begin)) if each[0] < end] if trace is not None else []
            if not seen:
                continue
            bus, address, axis, word = line.of_drive.quantity
            curve = Curve(bus, address, axis, word, twin=line.twin or word == DIFFERENCE)
            batch.labels[bus, address] = view.session.buses[bus].drives[address].label
            batch.curves[curve] = [(at - begin, wall + at - begin, value) for at, value in seen]
            if line.figures.unit and word in PLOTTED and not line.twin:
                shown = [(*times, line.conversion.value(value)) for *times, value in batch.curves[curve]]
                batch.curves[curve._replace(unit=line.unit.rstrip("?"))] = [
                    (one, two, each) for one, two, each in shown
                ]
    if not batch.curves:
        raise Diagnostic("nothing to save", hint="there are no samples in the time that is shown")
    return batch
