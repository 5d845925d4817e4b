"""A drive's position over the last seconds in one row."""

from __future__ import annotations

import math

from multidrop.tui.curves.columns import Columns
from multidrop.tui.curves.ink import BRAILLE
from multidrop.tui.curves.raster import Curve, Frame, Raster
from multidrop.tui.curves.scale import Scale
from multidrop.tui.curves.trace import Trace
from multidrop.tui.readout import SPAN, Readout


def spark(readout: Readout, now: float, width: int) -> str:
    """Draw the first axis; a resting drive is a line at the foot, and what was not read stays empty."""
    if not readout.points or width < 1:
        return " " * max(0, width)
    trace = Trace()
    for point in readout.points:
        trace.add(point.at, point.position)
    low, high = min(trace.values), max(trace.values)
    if readout.silent_since is None and now - trace.at[-1] < 3 * max(readout.period, 1.0):
        trace.add(now, trace.values[-1])
    dot = SPAN / (2 * width)
    first = math.floor(now / dot) // 2 - width + 1
    columns = Columns(trace, dot, 2 * first)
    columns.update(2 * first)
    frame = Frame(first, width, 1, Scale(low, high if high > low else low + 1, 1), BRAILLE)
    return "".join(text for text, _ in Raster().draw([Curve(columns, 0)], frame)[0])
