"""Tables and line plots as HTML, for notebooks. Every text is escaped; nothing is loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from math import isfinite

from multidrop.api.drives import DriveFacts
from multidrop.api.sessions import AsyncSession, Run
from multidrop.api.telemetry import Sample, Samples

MOST_ROWS = 200
"""The largest number of rows of a table."""
WIDTH, HEIGHT = 640, 160
"""The size of a plot, pixels."""
POINTS = 1000
"""The largest number of points of a curve."""
MARGIN = 8
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf")
Curve = tuple[str, Sequence[float], Sequence[float]]
"""A name, the times in s, and the values."""


def table(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; of a long one the first rows."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows[:MOST_ROWS])
    more = f"<tr><td colspan='{len(heads)}'>and {len(rows) - MOST_ROWS} more</td></tr>" if len(rows) > MOST_ROWS else ""
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}{more}</table>"


def _cell(text: str) -> str:
    return f"<td style='white-space:pre-wrap;text-align:left'>{escape(text)}</td>"


def of_run(run: Run) -> str:
    """Return a table of the lines of a script."""
    rows = [
        (f"{result.line.number}", result.sent, "\n".join(result.printed) or result.error, f"{result.seconds:.3f}")
        for result in run.results
    ]
    return table(run.file, ("line", "sent", "printed", "s"), rows)


def of_session(session: AsyncSession) -> str:
    """Return the drives of a session: name, product, version, and the last reading of their velocity."""
    if not session._calls.opened:
        return "<p>multidrop: a closed session</p>"
    rows = []
    for bus in session._shell.buses.values():
        for drive in bus.all_drives:
            seen = "" if drive.seen is None else f"{drive.seen.velocity}"
            rows.append((bus.name, drive.address, drive.label, drive.product, drive.version, seen))
        if not bus.all_drives:
            rows.append((bus.name, "no drive", "", "", "", ""))
    state = " (stopped)" if session._shell.latched else ""
    return table(f"multidrop{state}", ("bus", "address", "name", "product", "version", "last velocity"), rows)


def of_drive(drive: DriveFacts) -> str:
    """Return what is known of a drive."""
    seen = "" if drive._drive.seen is None else f"{drive._drive.seen.velocity}"
    heads = ("drive", "axis", "product", "version", "last velocity")
    return table("drive", heads, [(drive.name, drive.axis, drive.product, drive.version, seen)])


def of_samples(samples: Samples) -> str:
    """Return plots of position and velocity."""
    return plot("position", _curves(samples, "position")) + plot("velocity", _curves(samples, "velocity"))


def _curves(samples: Samples, field: str) -> Iterator[Curve]:
    series: dict[tuple[str, str], list[Sample]] = {}
    for row in samples:
        series.setdefault((row.drive, row.axis), []).append(row)
    for (drive, axis), rows in series.items():
        finite = [row for row in rows if isfinite(getattr(row, field))]
        yield f"{drive} {axis}".strip(), [row.elapsed for row in finite], [getattr(row, field) for row in finite]


def plot(title: str, curves: Iterable[Curve]) -> str:
    """Return a line plot as SVG, with its extremes as text."""
    drawn = [(name, *_thinned(times, values)) for name, times, values in curves if len(times)]
    if not drawn:
        return f"<p>{escape(title)}: no samples</p>"
    times = [time for _, own, _ in drawn for time in own]
    values = [value for _, _, own in drawn for value in own]
    box = (min(times), max(times), min(values), max(values))
    lines = "".join(
        f"<polyline fill='none' stroke='{_colour(at)}' stroke-width='1.5' points='{_points(x, y, box)}'/>"
        for at, (_, x, y) in enumerate(drawn)
    )
    names = "".join(
        f"<tspan fill='{_colour(at)}' dx='8'>{escape(name)}</tspan>" for at, (name, _, _) in enumerate(drawn)
    )
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{WIDTH}' height='{HEIGHT + 40}' "
        f"viewBox='0 -20 {WIDTH} {HEIGHT + 40}' font-family='sans-serif' font-size='12' role='img'>"
        f"<rect x='0' y='0' width='{WIDTH}' height='{HEIGHT}' fill='none' stroke='#888' stroke-width='0.5'/>"
        f"<text x='0' y='-6' fill='currentColor'>{escape(title)}{names}</text>{lines}"
        f"<text x='0' y='{HEIGHT + 14}' fill='currentColor'>{box[0]:.3f} s .. {box[1]:.3f} s, "
        f"{box[2]:g} .. {box[3]:g}</text></svg>"
    )


def _colour(at: int) -> str:
    return COLOURS[at % len(COLOURS)]


def _thinned(times: Sequence[float], values: Sequence[float]) -> tuple[list[float], list[float]]:
    """Keep the lowest and the highest value of each stretch, in their order, so that no peak is lost."""
    if len(times) <= POINTS:
        return list(times), list(values)
    stretch = -(-len(times) // (POINTS // 2))
    kept: list[int] = []
    for begin in range(0, len(times), stretch):
        part = range(begin, min(begin + stretch, len(times)))
        kept += sorted({min(part, key=values.__getitem__), max(part, key=values.__getitem__)})
    return [times[at] for at in kept], [values[at] for at in kept]


def _points(times: Sequence[float], values: Sequence[float], box: tuple[float, float, float, float]) -> str:
    left, right, low, high = box
    across, up = (right - left) or 1.0, (high - low) or 1.0
    return " ".join(
        f"{MARGIN + (time - left) / across * (WIDTH - 2 * MARGIN):.1f},"
        f"{HEIGHT - MARGIN - (value - low) / up * (HEIGHT - 2 * MARGIN):.1f}"
        for time, value in zip(times, values, strict=True)
    )
