"""A straight line of both axes of a PMX (manual 7.8.2): one motion along the way, of which each axis makes its share.

The global speeds are those along the way (the manual leaves that open), in pulses/s with StepNLoop too (7.17). What
ends the line for one axis ends it for the other.
"""

from __future__ import annotations

from math import hypot

from simulator.kinematics.profile import Profile, halt
from simulator.pmx.axis import Axis, Doing, Pace, planned
from simulator.pmx.settings import Settings


class Line:
    """The line of two axes, while one is under way. Raises Refusal for what cannot begin."""

    def __init__(self, axes: tuple[Axis, Axis], settings: Settings) -> None:
        self._axes = axes
        self._settings = settings
        self._members: tuple[Axis, ...] = ()

    def begin(self, targets: tuple[int, int], t: float) -> None:
        """To both targets at once; both axes stand."""
        axes, settings = self._axes, self._settings
        for axis in axes:
            axis.check(t)
        pace = axes[0].paced(settings["LSPD"], settings["HSPD"], settings["ACC"], settings["DEC"])
        ways = [axis.aim(target, t) - axis.profile.position(t) for axis, target in zip(axes, targets, strict=True)]
        length = hypot(*ways)
        whole = planned(t, 0.0, length, pace)
        self._members = tuple(axis for axis, way in zip(axes, ways, strict=True) if way)
        for axis, target, way in zip(axes, targets, ways, strict=True):
            axis.loop.attempts, axis.goal = 0, target
            share = abs(way) / length if length else 0.0
            axis.begin(Doing.LINE, _part(whole, axis.profile.position(t), way, length), t, _scaled(pace, share))
        for axis in axes:
            axis.live(t)
        self.watch(t)

    def others(self, axis: Axis) -> tuple[Axis, ...]:
        """The axes that a stop of this one stops: all of the line's, or just it."""
        return self._members if axis in self._members and axis.doing is Doing.LINE else (axis,)

    def watch(self, t: float) -> None:
        """Stop the axis that is left when the other one was ended before its time."""
        left = [axis for axis in self._members if axis.doing is Doing.LINE]
        if len(left) < len(self._members):
            for axis in left:
                axis.abort(t)
            self._members = ()


def _part(whole: Profile, here: float, way: float, length: float) -> Profile:
    """What one axis makes of the line: the whole way, scaled, from where it stands."""
    if not way:
        return halt(whole.start, here)
    part = whole.scaled(way / length)
    segments = tuple(each._replace(position=each.position + here) for each in part.segments)
    return Profile(part.start, part.end, here, here + way, segments)


def _scaled(pace: Pace, share: float) -> Pace:
    return Pace(pace.low * share, pace.high * share, pace.up * share, pace.down * share, pace.shape)
