"""Least squares: what makes a rotor lag its field as it was measured, and how well that is known.

Theory of operation. A rotor lags its field by the arc sine of the part of the torque that its load, friction and
inertia take (`simulator.torque`). The speed and the acceleration of each point are those that the drive commanded. A
position counts whole counts from a place that is not known either, to half a count: one more unknown, which moves in
both directions tell from a load. A value is told where three standard deviations are at most `TOLD` of it; the current
margin, where they are at most that of the torque that is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import Any, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.simulator.cell.spec import MotorSpec, WorldSpec
from multidrop.simulator.family import Effort
from multidrop.simulator.torque import Torque

TOLD = 0.05
FEWEST = 12
"""Points without which nothing is told."""
SIGMAS = 3.0
TINY = 1e-9
"""N m: as good as no torque."""
MOST_STRANGE = 0.2
HALF_COUNT = 0.29
"""The standard deviation of a rounding, in counts."""
RELATIVE = 1e-6
"""A combination of values that the points see this much less than the best one is not seen."""
INSTALL = "pip install 'multidrop[fit]'"
LOAD, FRICTION, INERTIA, MARGIN = "load", "friction", "inertia", "current margin"
UNITS = {LOAD: "of the holding torque", FRICTION: "N m for each rev/s", INERTIA: "kg m2", MARGIN: "of the torque"}


class LagPoint(NamedTuple):
    """A measured lag along the turn, full steps, at a speed and an acceleration along it, rev/s and rev/s2."""

    lag: float
    speed: float
    acceleration: float
    current: float
    grain: float
    """Full steps in a count."""
    direction: float
    """1 or -1; 1 where the lag itself was read, which is rounded in one way."""


@dataclass(frozen=True)
class AxisEvidence:
    """What a log has of one axis. `moves`: those that did not stall; `seen`: a stall would have been seen."""

    points: Sequence[LagPoint] = ()
    moves: Sequence[Effort] = ()
    stalled: int = 0
    seen: bool = False
    strange: int = 0
    """Lags of more than a full step in a move that has lost none."""
    odd: Sequence[bool] = ()
    """For each sample of such a move, whether the cell commands no such velocity near it."""

    @property
    def different(self) -> Sequence[LagPoint]:
        """The points without those that repeat."""
        return list(
            {
                (round(point.lag, 4), round(point.speed, 4), round(point.acceleration, 2)): point
                for point in self.points
            }.values()
        )

    @property
    def fits(self) -> bool:
        """The moves are those that the cell commands."""
        strange = self.strange > MOST_STRANGE * len(self.points)
        return not strange and sum(self.odd) <= MOST_STRANGE * len(self.odd)


class Estimate(NamedTuple):
    """A value and three standard deviations of it; `most`: what it is at most, where it is not told.

    `whole`: it is told where it is known to a part of this.
    """

    value: float
    within: float
    whole: float
    most: float = inf

    @property
    def told(self) -> bool:
        return self.within <= TOLD * self.whole


def estimates(evidence: AxisEvidence, motor: MotorSpec) -> dict[str, Estimate]:
    """Estimate each value. Raises Diagnostic where scipy is missing."""
    if len(evidence.different) >= FEWEST and evidence.fits:
        return _Fit(evidence, motor).estimates()
    unknown = dict.fromkeys(UNITS, Estimate(0.0, inf, 0.0))
    if evidence.seen and evidence.moves:
        torque = Torque(WorldSpec(motor=motor, load=1.0))
        used = max(torque.most_used(move.profile, move.current, move.turn) for move in evidence.moves)
        unknown[LOAD] = Estimate(0.0, inf, 0.0, 1 / used if used else inf)
    return unknown


class _Fit:
    """The fit of one axis. The unknowns are in units in which they are near 1."""

    def __init__(self, evidence: AxisEvidence, motor: MotorSpec) -> None:
        try:
            import numpy  # comes with scipy
            from scipy.optimize import least_squares  # takes half a second to import
        except ImportError:
            raise Diagnostic("scipy is missing", "twin fit", INSTALL) from None
        self._evidence, self._motor, self._numpy = evidence, motor, numpy
        # A machine that does the same again is rounded in the same way: samples that repeat tell nothing new.
        holding, points = motor.curve[0][1], evidence.different
        fastest = max(point.speed for point in points)
        steepest = max(abs(point.acceleration) for point in points)
        self._units = (1.0, holding / fastest, holding / (2 * pi * steepest) if steepest else 1.0)
        # The torque of each point is that of the rotor alone and a part for each unknown: rows of a matrix.
        torques = [Torque(self._world([float(n == index) for index in range(3)])) for n in range(4)]
        alone = torques.pop()
        there = [max(point.current * alone.available(point.speed), TINY) for point in points]
        rotor = [alone.needed(point.speed, point.acceleration) for point in points]
        parts = [[one.needed(point.speed, point.acceleration) for one in torques] for point in points]
        self._there, self._rotor = numpy.array(there), numpy.array(rotor)
        self._parts = numpy.array(parts) - self._rotor[:, None]
        self._lags, self._grains, self._directions = (
            numpy.array(column) for column in zip(*((p.lag, p.grain, p.direction) for p in points), strict=True)
        )
        fitted = least_squares(
            self._residuals, (0.1, 0.01, 0.01, 0.0), bounds=((0, 0, 0, -1), (10, 100, 100, 1)), loss="soft_l1"
        )
        self._x: list[float] = fitted.x.tolist()
        self._jacobian: Any = fitted.jac
        residuals = self._residuals(fitted.x)
        scatter = sqrt(float(residuals @ residuals) / (len(residuals) - len(self._x)))
        self._sigma = max(scatter, HALF_COUNT)

    def estimates(self) -> dict[str, Estimate]:
        world = self._world(self._x)
        values = {LOAD: world.load, FRICTION: world.friction, INERTIA: world.inertia}
        estimates = {}
        for n, (name, value) in enumerate(values.items()):
            within = self._within([float(n == index) for index in range(4)]) * self._units[n]
            estimates[name] = Estimate(value, within, value, value + within)
        steps = [[x + (1e-4 if n == index else 0.0) for index, x in enumerate(self._x)] for n in range(4)]
        margin = self._margin(self._x)
        slope = [(self._margin(step) - margin) / 1e-4 for step in steps]
        estimates[MARGIN] = Estimate(margin, self._within(slope), 1 - margin)
        return estimates

    def _world(self, x: Sequence[float]) -> WorldSpec:
        load, friction, inertia = (value * unit for value, unit in zip(x, self._units, strict=False))
        return WorldSpec(motor=self._motor, load=load, friction=friction, inertia=inertia)

    def _margin(self, x: Sequence[float]) -> float:
        """What the hardest move leaves of the torque."""
        torque = Torque(self._world(x))
        return 1 - max(torque.most_used(move.profile, move.current, move.turn) for move in self._evidence.moves)

    def _residuals(self, x: Any) -> Any:
        """The differences of all points in counts, after that of the place of a count."""
        numpy = self._numpy
        used = (self._rotor + self._parts @ x[:3]) / self._there
        lags = numpy.arcsin(numpy.clip(used, -1.0, 1.0)) * 2 / pi
        return numpy.concatenate((x[3:], (lags - self._lags) / self._grains + self._directions * x[3]))

    def _within(self, slope: Sequence[float]) -> float:
        """Three standard deviations of a combination of the unknowns; infinite: the points do not see it."""
        _, sizes, rows = self._numpy.linalg.svd(self._jacobian, full_matrices=False)
        variance, long = 0.0, max(map(abs, slope), default=0.0)
        for size, row in zip(sizes.tolist(), rows.tolist(), strict=True):
            part = sum(a * b for a, b in zip(row, slope, strict=True))
            if size > RELATIVE * sizes[0]:
                variance += (part / size) ** 2
            elif abs(part) > RELATIVE * long:
                return inf
        return SIGMAS * self._sigma * sqrt(variance)
