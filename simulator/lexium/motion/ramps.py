"""Ramps: how the velocity changes, from VI, A, D and the S-curves (manual 5.1.7, 5.1.9, 5.1.27, 5.1.30)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

from dialects.mcode.manual.errors import ErrorNumber as E
from simulator.kinematics.segments import LINEAR, Shape
from simulator.lexium.motion.units import Units
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import Value

STEEPEST = 1.1e9
"""The highest acceleration that a drive makes, steps/s2; an S-curve's peak may not be above it."""
STRAIGHT = Shape()


class RampValues(TypedDict):
    """Steps/s, steps/s2, and the shapes of both ramps."""

    vi: float
    a: float
    d: float
    up: Shape
    down: Shape


class Ramps:
    """The ramps that are set."""

    def __init__(self, values: Mapping[str, Value], units: Units) -> None:
        self._values, self._units = values, units

    def check(self) -> None:
        """Check that a motion may begin with these S-curves. Raises Fault (98, 99) for too steep a middle."""
        for shape, rate, code in (("AT", "A", E.NO_ACCELERATION_FITS), ("DT", "D", E.NO_DECELERATION_FITS)):
            if self._shape(shape, rate) is None:
                raise Fault(code)

    def values(self) -> RampValues:
        """The ramps in steps: straight where a curve would be too steep, as a stop is never refused."""
        values, scale = self._values, self._units.scale
        up, down = self._shape("AT", "A") or STRAIGHT, self._shape("DT", "D") or STRAIGHT
        return {"vi": values["VI"] * scale, "a": values["A"] * scale, "d": values["D"] * scale, "up": up, "down": down}

    def _shape(self, kind: str, rate: str) -> Shape | None:
        """What AT and AJ, or DT and DJ, make of a ramp; None where its middle would be too steep."""
        values = self._values
        if int(values.get(kind, LINEAR)) == LINEAR:
            return STRAIGHT
        shape = Shape(int(values.get(kind, LINEAR)), int(values.get(f"{rate}J", 0)))
        return shape if values[rate] * self._units.scale * shape.peak <= STEEPEST else None
