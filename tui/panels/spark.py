"""A drive's position over the last seconds in one row."""

from __future__ import annotations

import math

from tui.panels.braille import draw
from tui.screen_model import SPAN, Readout


def spark(readout: Readout, now: float, width: int) -> str:
    """Draw the first axis; a resting drive is a line at the foot, and what was not read stays empty."""
    curve = [(point.at, float(point.position)) for point in readout.points]
    if not curve or width < 1:
        return " " * max(0, width)
    values = [value for _, value in curve]
    low, high = min(values), max(values)
    dot = SPAN / (2 * width)
    end = (math.floor(now / dot) + 1) * dot
    if readout.silent_since is None and now - curve[-1][0] < 3 * max(readout.period, 1.0):
        curve.append((now, values[-1]))
    gap = max(3 * readout.period, 1.0)
    return draw(curve, end - SPAN, end, low, high if high > low else low + 1, (width, 1), gap)[0]
