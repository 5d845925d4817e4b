"""StepNLoop (manual 7.17): the target in encoder counts, the deviation of the shaft, corrections and errors.

With StepNLoop the position counter is a target in encoder counts. It advances with the pulses by `1 / SLR` a pulse, and
not at all during a correction, whose pulses bring the shaft to the target. So the delta is linear in the pulses while
the rotor's factor is constant, and a formula gives the time at which it leaves the error range. Counts are compared as
whole numbers, as they are read.
"""

from __future__ import annotations

from math import inf
from typing import Protocol

from multidrop.simulator.pmx.pulses import Pulses
from multidrop.simulator.pmx.settings import SCALE, Settings
from multidrop.simulator.pmx.states import Doing, own_pace

OFF, IDLE, MOVING, CORRECTING, STOPPING, JOGGING, HOMING, Z_HOMING = 12, 0, 1, 2, 3, 5, 6, 7
RANGE_ERROR, ATTEMPTS_ERROR, STALL_ERROR, LIMIT_ERROR, LIMIT_HOMING = 8, 9, 10, 11, 13
"""Values of `SLS` (table 7.9). 4, aborting, takes no time."""
_HALF = 0.5
_NEAR = 1e-6
STATES = {
    Doing.NOTHING: IDLE,
    Doing.MOVE: MOVING,
    Doing.JOG: JOGGING,
    Doing.LINE: MOVING,
    Doing.STOPPING: STOPPING,
    Doing.CORRECTING: CORRECTING,
    Doing.STICK: JOGGING,
}
HOMINGS = {"H": HOMING, "HL": HOMING, "L": LIMIT_HOMING, "Z": Z_HOMING, "ZH": Z_HOMING}
"""By the ASCII word of the homing routine."""


class LoopedAxis(Protocol):
    """What StepNLoop needs of its axis."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def settings(self) -> Settings: ...  # noqa: D102
    @property
    def pulses(self) -> Pulses: ...  # noqa: D102
    @property
    def trouble(self) -> int:
        """The latched limit errors that count."""

    @property
    def homing_word(self) -> str:
        """The ASCII word of the homing routine at work; empty if there is none."""

    def end_homing(self) -> None:
        """End the homing routine at work."""


class Loop:
    """StepNLoop of one axis. `error` is 0 or a status of table 7.9."""

    def __init__(self, axis: LoopedAxis) -> None:
        self._axis = axis
        self._pulses = axis.pulses
        self.on = False
        self.error = 0
        self.attempts = 0
        self._target = 0.0
        self._at = 0.0

    @property
    def ratio(self) -> float:
        """Pulses for one encoder count."""
        return self._setting("SLR") / SCALE

    def enable(self, on: bool, t: float) -> None:
        """Switch it on, with the target at the encoder's count, or off."""
        if on and not self.on:
            self.error = self.attempts = 0
            self.rebase(t, target=round(self._pulses.rotor.encoder(t)))
        self.on = on
        if not on:
            self.error = 0

    def target(self, t: float) -> float:
        """The target of the shaft, encoder counts."""
        return self._target + self._gain * (self._pulses.place(t) - self._at)

    def delta(self, t: float) -> float:
        """`DX`: target less encoder; 0 while it is off."""
        return self.target(t) - self._pulses.rotor.encoder(t) if self.on else 0.0

    @property
    def status(self) -> int:
        """`SLS`."""
        if not self.on:
            return OFF
        if self.error or self._axis.trouble:
            return self.error or LIMIT_ERROR
        if word := self._axis.homing_word:
            return HOMINGS[word]
        return STATES[self._pulses.doing]

    def rebase(self, t: float, target: float | None = None) -> None:
        """Begin a new stretch here, before the motion changes; `target` replaces the target."""
        self._target = self.target(t) if target is None else target
        self._at = self._pulses.place(t)

    def shift(self, counts: float) -> None:
        """Shift the target together with the encoder's counter."""
        self._target += counts

    def clear(self, t: float) -> None:
        """Clear an error; the target is where the shaft is now."""
        if self.error:
            self.error = self.attempts = 0
            self.stay(t)

    def stay(self, t: float) -> None:
        """Set the target to where the shaft is now."""
        if self.on:
            self.rebase(t, target=round(self._pulses.rotor.encoder(t)))

    def alarm(self, after: float) -> float:
        """The time at which the delta leaves the error range; infinite: never on this stretch."""
        slope = self._gain - self._pulses.rotor.counts_a_pulse
        if not self.on or abs(slope) < 1e-12:
            return inf
        here, delta = self._pulses.place(after), self.delta(after)
        edge = self._setting("SLE") + _HALF + _NEAR
        times = (self._pulses.profile.crossing(here + (side - delta) / slope, after) for side in (edge, -edge))
        return min((at for at in times if at is not None), default=inf)

    def watch(self, t: float) -> None:
        """Check the delta: stop on an error, correct the rest when the motor is at rest."""
        axis = self._axis
        if not self.on or self.error or axis.trouble:
            return
        delta = self.delta(t)
        if self._pulses.moving(t):
            if abs(delta) >= self._setting("SLE") + _HALF:
                self._fail(STALL_ERROR, t)
        elif not axis.homing_word and self._pulses.profile.end <= t:
            self._verify(delta, t)

    def _verify(self, delta: float, t: float) -> None:
        off = abs(round(delta))
        if off <= self._setting("SLT"):
            self.attempts = 0
        elif off > self._setting("SLE"):
            self._fail(RANGE_ERROR, t)
        elif self.attempts >= self._setting("SLA"):
            self._fail(ATTEMPTS_ERROR, t)
        else:
            self.attempts += 1
            self._correct(delta, t)

    def _correct(self, delta: float, t: float) -> None:
        pulses = self._pulses
        pace = own_pace(self._axis.settings, self._axis.name, self.ratio, strict=False)
        steps = round(delta * self.ratio) or (1 if delta > 0 else -1)
        pulses.begin(Doing.CORRECTING, pulses.to_place(pulses.place(t) + steps, t, pace), t, pace)

    def _fail(self, error: int, t: float) -> None:
        self.error = error
        self._axis.end_homing()
        self._pulses.rest(t)

    def _setting(self, name: str) -> int:
        return self._axis.settings[name + self._axis.name]

    @property
    def _gain(self) -> float:
        """Counts by which the target advances with a pulse."""
        return 0.0 if self._pulses.doing is Doing.CORRECTING else 1 / self.ratio
