"""A straight line of both axes of a PMX (manual 7.8.2): one motion along the path, of which each axis makes its share.

The global speeds are those along the path (the manual leaves that open), in pulses/s with StepNLoop too (7.17). What
ends the line for one axis ends it for the other.
"""

from __future__ import annotations

from math import hypot

from simulator.kinematics.profile import Profile, halt
from simulator.pmx import motions
from simulator.pmx.axis import Axis
from simulator.pmx.pulses import planned
from simulator.pmx.settings import Settings
from simulator.pmx.states import Doing, Pace, paced


class Line:
    """The line of two axes, during a motion. Raises Refusal for a line that cannot begin."""

    def __init__(self, axes: tuple[Axis, Axis], settings: Settings) -> None:
        self._axes = axes
        self._settings = settings
        self._members: tuple[Axis, ...] = ()

    def begin(self, targets: tuple[int, int], t: float) -> None:
        """Move both axes from rest to their targets."""
        axes, settings = self._axes, self._settings
        for axis in axes:
            motions.check(axis, t)
        speeds, times = (settings["LSPD"], settings["HSPD"]), (settings["ACC"], settings["DEC"])
        pace = paced(settings, axes[0].name, speeds, times)
        shares = [
            motions.aim(axis, target, t) - axis.pulses.place(t) for axis, target in zip(axes, targets, strict=True)
        ]
        length = hypot(*shares)
        whole = planned(t, 0.0, length, pace)
        self._members = tuple(axis for axis, share in zip(axes, shares, strict=True) if share)
        for axis, target, share in zip(axes, targets, shares, strict=True):
            axis.loop.attempts, axis.goal = 0, target
            part = _part(whole, axis.pulses.place(t), share, length)
            axis.pulses.begin(Doing.LINE, part, t, _scaled(pace, abs(share) / length if length else 0.0))
        for axis in axes:
            axis.live(t)
        self.watch(t)

    def others(self, axis: Axis) -> tuple[Axis, ...]:
        """The axes that stop with this one: all axes of a line, or only this one."""
        return self._members if axis in self._members and axis.doing is Doing.LINE else (axis,)

    def watch(self, t: float) -> None:
        """Stop the other axis if one was ended before its time."""
        left = [axis for axis in self._members if axis.doing is Doing.LINE]
        if len(left) < len(self._members):
            for axis in left:
                axis.abort(t)
            self._members = ()


def _part(whole: Profile, here: float, share: float, length: float) -> Profile:
    """The share of one axis: the whole path, scaled, from where the axis is."""
    if not share:
        return halt(whole.start, here)
    part = whole.scaled(share / length)
    segments = tuple(each._replace(position=each.position + here) for each in part.segments)
    return Profile(part.start, part.end, here, here + share, segments)


def _scaled(pace: Pace, factor: float) -> Pace:
    return Pace(pace.low * factor, pace.high * factor, pace.up * factor, pace.down * factor, pace.shape)
