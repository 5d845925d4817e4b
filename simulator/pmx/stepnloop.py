"""StepNLoop (manual 7.17): the target in encoder counts, how far the shaft is from it, corrections and errors.

With StepNLoop the position counter is a target in encoder counts that goes with the pulses: `1 / SLR` a pulse, and not
at all during a correction, whose pulses are there to fetch the shaft up. So the delta is linear in the pulses for as
long as the rotor's factor holds, and the moment at which it leaves the error range is found by a formula.
Counts are compared as they are read, as whole numbers.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

from simulator.pmx.settings import SCALE

if TYPE_CHECKING:
    from simulator.pmx.axis import Axis

OFF, IDLE, MOVING, CORRECTING, STOPPING, JOGGING, HOMING, Z_HOMING = 12, 0, 1, 2, 3, 5, 6, 7
RANGE_ERROR, ATTEMPTS_ERROR, STALL_ERROR, LIMIT_ERROR, LIMIT_HOMING = 8, 9, 10, 11, 13
"""What `SLS` answers (table 7.9). 4, aborting, takes no time."""
_HALF = 0.5
_NEAR = 1e-6
STATES = {
    "nothing": IDLE,
    "move": MOVING,
    "jog": JOGGING,
    "line": MOVING,
    "stopping": STOPPING,
    "correcting": CORRECTING,
    "stick": JOGGING,
}
HOMINGS = {"limit": LIMIT_HOMING, "index": Z_HOMING, "home_and_index": Z_HOMING}


class Loop:
    """StepNLoop of one axis. `error` is 0 or a status of table 7.9."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self.on = False
        self.error = 0
        self.attempts = 0
        self._target = 0.0
        self._at = 0.0

    @property
    def ratio(self) -> float:
        """Pulses for one encoder count."""
        return self._axis["SLR"] / SCALE

    def enable(self, on: bool, t: float) -> None:
        """Switch it on, with the target where the encoder is, or off."""
        if on and not self.on:
            self.error = self.attempts = 0
            self.rebase(t, target=round(self._axis.rotor.encoder(t)))
        self.on = on
        if not on:
            self.error = 0

    def target(self, t: float) -> float:
        """Where the shaft should be, encoder counts."""
        return self._target + self._gain * (self._axis.profile.position(t) - self._at)

    def delta(self, t: float) -> float:
        """`DX`: target less encoder; 0 where it is off."""
        return self.target(t) - self._axis.rotor.encoder(t) if self.on else 0.0

    @property
    def status(self) -> int:
        """`SLS`."""
        if not self.on:
            return OFF
        if self.error or self._axis.trouble:
            return self.error or LIMIT_ERROR
        homing = self._axis.homing
        if homing is not None:
            return HOMINGS.get(homing.routine.__name__, HOMING)
        return STATES.get(self._axis.doing.value, IDLE)

    def rebase(self, t: float, target: float | None = None) -> None:
        """Begin a new stretch here, before the motion changes; with a `target`, from that."""
        self._target = self.target(t) if target is None else target
        self._at = self._axis.profile.position(t)

    def shift(self, counts: float) -> None:
        """Move the target, as the encoder's counter is moved."""
        self._target += counts

    def clear(self, t: float) -> None:
        """Forget an error; the target is where the shaft is now."""
        if self.error:
            self.error = self.attempts = 0
            self.stay(t)

    def stay(self, t: float) -> None:
        """Let the target be where the shaft is now."""
        if self.on:
            self.rebase(t, target=round(self._axis.rotor.encoder(t)))

    def alarm(self, after: float) -> float:
        """When the delta leaves the error range; infinite: never on this stretch."""
        axis = self._axis
        slope = self._gain - axis.rotor.counts_a_pulse
        if not self.on or abs(slope) < 1e-12:
            return inf
        here, delta = axis.profile.position(after), self.delta(after)
        edge = axis["SLE"] + _HALF + _NEAR
        times = (axis.profile.crossing(here + (side - delta) / slope, after) for side in (edge, -edge))
        return min((at for at in times if at is not None), default=inf)

    def watch(self, t: float) -> None:
        """Look at the delta: stop on an error, correct what is left when the motor stands."""
        axis = self._axis
        if not self.on or self.error or axis.trouble:
            return
        delta = self.delta(t)
        if axis.moving(t):
            if abs(delta) >= axis["SLE"] + _HALF:
                self._fail(STALL_ERROR, t)
        elif axis.homing is None and axis.profile.end <= t:
            self._verify(delta, t)

    def _verify(self, delta: float, t: float) -> None:
        axis, off = self._axis, abs(round(delta))
        if off <= axis["SLT"]:
            self.attempts = 0
        elif off > axis["SLE"]:
            self._fail(RANGE_ERROR, t)
        elif self.attempts >= axis["SLA"]:
            self._fail(ATTEMPTS_ERROR, t)
        else:
            self.attempts += 1
            self._correct(delta, t)

    def _correct(self, delta: float, t: float) -> None:
        from simulator.pmx.axis import Doing

        axis = self._axis
        pace = axis.usual_pace(strict=False)
        pulses = round(delta * self.ratio) or (1 if delta > 0 else -1)
        axis.begin(Doing.CORRECTING, axis.trapezoid(axis.profile.position(t) + pulses, t, pace), t, pace)

    def _fail(self, error: int, t: float) -> None:
        self.error = error
        self._axis.homing = None
        self._axis.rest(t)

    @property
    def _gain(self) -> float:
        """Counts by which the target goes on with a pulse."""
        return 0.0 if self._axis.doing.value == "correcting" else 1 / self.ratio
