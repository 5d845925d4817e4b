"""The travel of an axis, a bar with its place in it, the phase of its move, and the time to go.

A bar between known limits has solid ends, one of the range seen so far has dotted ones. Where a limit is not known,
nothing is drawn that looks like one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from multidrop.dialects.values import Pace
from multidrop.tui.readout import SWITCHES, Point, Readout

LIMITS, LEARNT, SEEN = "limits", "switches", "seen"
"""Where a travel comes from: software limits, limit switches that were reached, the positions seen so far."""
SHORTEST_BAR = 6
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
    limits = readout.conditions.limits if readout.conditions is not None else None
    if limits is not None:
        return Travel(*limits, LIMITS)
    low, high = (readout.travel.at_switch.get(name) for name in SWITCHES)
    if low is not None and high is not None and low < high:
        return Travel(low, high, LEARNT)
    target = readout.conditions.target if readout.conditions is not None else None
    seen = [each for each in (readout.travel.low, readout.travel.high, target) if each is not None]
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
    cells[_cell(last.position, travel, width)] = _sign(last.position, travel)
    return "".join(cells)


def _cell(position: int, travel: Travel, width: int) -> int:
    share = (position - travel.low) / (travel.high - travel.low)
    return 1 + round(min(1.0, max(0.0, share)) * (width - 3))


def _sign(position: int, travel: Travel) -> str:
    """The place; an arrow beyond an end."""
    return "◀" if position < travel.low else "▶" if position > travel.high else "●"


def phase(readout: Readout) -> str:
    """`accelerates`, `cruises` or `slows down`; empty at rest, and where one reading is all there is."""
    if readout.last is None or not readout.last.velocity:
        return ""
    before = _earlier(readout)
    if before is None:
        return ""
    now, then = abs(readout.last.velocity), abs(before.velocity)
    if abs(now - then) <= STEADY * max(now, then):
        return "cruises"
    return "accelerates" if now > then else "slows down"


def _earlier(readout: Readout) -> Point | None:
    """The newest reading that is old enough to compare with the last one."""
    assert readout.last is not None
    points = reversed(readout.points)
    return next((each for each in points if readout.last.at - each.at >= LOOK_BACK), None)


def seconds_to_go(readout: Readout, now: float) -> float | None:
    """The time to the target by the profile that was read; None where target, profile or direction are not known."""
    last, conditions = readout.last, readout.conditions
    if last is None or conditions is None or conditions.target is None or conditions.pace is None:
        return None
    left = conditions.target - last.position
    if not last.velocity or (left > 0) != (last.velocity > 0):
        return None
    found = _duration(abs(left), abs(last.velocity), conditions.pace, braking=phase(readout) == "slows down")
    return max(0.0, found - (now - last.at))


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
