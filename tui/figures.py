"""The numbers of an axis as they are shown: in engineering units where it has a scale, else as the drive counts.

A number in units can be typed back between braces: `12.500 mm`. It has a fixed number of
decimals, as many as a tenth of a full step needs, so that nothing jumps while it changes. Files keep all of them.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, log10
from typing import TYPE_CHECKING, NamedTuple

from multidrop.dialects.units import FULL_STEPS, TURN, Takes
from multidrop.tui.text import digits

if TYPE_CHECKING:
    from multidrop.dialects.units import Measure
    from multidrop.shell.units import ScaledAxis

UNSURE = "?"
"""The sign of a scale that could not be confirmed since a program began to run."""
COARSER = 1
"""Decimals that a velocity has less than a position."""


class UnitConversion(NamedTuple):
    """Numbers of a drive to units: `value = gain * number + zero`."""

    gain: float = 1.0
    zero: float = 0.0

    def value(self, number: float) -> float:
        return self.gain * number + self.zero


class Figures(NamedTuple):
    """The figures of one axis. Without a unit they are the drive's own numbers."""

    unit: str = ""
    speed_unit: str = ""
    places: UnitConversion = UnitConversion()
    speeds: UnitConversion = UnitConversion()
    decimals: int = 0
    sign: str = ""
    """`?` after each unit while the scale is not confirmed."""
    travel: tuple[int, int] | None = None
    """The travel of the axis, counts; None: not stated, or positions do not count."""

    def number(self, counts: int) -> str:
        """A position without its unit."""
        return fixed(self.places.value(counts), self.decimals) if self.unit else digits(counts)

    def place(self, counts: int | None) -> str:
        """`12.500 mm`, or `128000`; `–` if it is not known."""
        return digits(counts) if counts is None or not self.unit else f"{self.number(counts)} {self.unit}{self.sign}"

    def distance(self, counts: int) -> str:
        """The same with its sign: `+0.500 mm`."""
        if not self.unit:
            return f"{counts:+}"
        return f"{fixed(self.places.gain * counts, self.decimals, '+')} {self.unit}{self.sign}"

    def rate(self, native: int) -> str:
        """A velocity without its unit."""
        value = self.speeds.value(native)
        return fixed(value, max(0, self.decimals - COARSER)) if self.speed_unit else digits(native)

    def speed(self, native: int | None) -> str:
        """`50.00 mm/s`, or `512000`."""
        if native is None or not self.speed_unit:
            return digits(native)
        return f"{self.rate(native)} {self.speed_unit}{self.sign}"


NATIVE = Figures()


def figures_of(axis: ScaledAxis | None, referenced: bool) -> Figures:
    """The figures of an axis: its drive's own numbers where it has no scale, or one that does not hold.

    `referenced`: its places count.
    """
    if axis is None or axis.current is None:
        return NATIVE
    return _figures(axis.current, axis.sure, referenced)


@lru_cache(maxsize=256)
def _figures(measure: Measure, sure: bool, referenced: bool) -> Figures:
    gain, travel, zero = measure.value(1, Takes.DISTANCE), measure.scale.travel, measure.scale.zero
    rated = measure.counts(Takes.VELOCITY)
    ends = sorted(round((end - zero) / measure.count) for end in travel) if travel is not None and referenced else None
    return Figures(
        unit=measure.unit,
        speed_unit=measure.unit_for(Takes.VELOCITY) if rated else "",
        places=UnitConversion(gain, measure.value(0)),
        speeds=UnitConversion(measure.value(1, Takes.VELOCITY)) if rated else UnitConversion(),
        decimals=decimals_of(measure),
        sign="" if sure else UNSURE,
        travel=None if ends is None else (ends[0], ends[1]),
    )


def decimals_of(measure: Measure) -> int:
    """Decimal places that a tenth of a full step needs in the scale's unit: 3 for 5 mm a turn, so 0.025 mm a step.

    A scale by the count of a drive that does not report the counts of a turn gets those that one count needs.
    """
    scale, turn = measure.scale, measure.scale.full_steps or FULL_STEPS
    if scale.of == TURN:
        finest = scale.value * scale.unit.factor / turn / 10
    else:
        finest = measure.count * measure.basis.turn / turn / 10 if measure.basis.turn else measure.count
    return max(0, ceil(-log10(abs(finest / scale.unit.factor))))


def fixed(value: float, decimals: int, sign: str = "-") -> str:
    """A number with its decimals; 0 has no minus."""
    return f"{round(value, decimals) + 0.0:{sign}.{decimals}f}"
