"""What an encoder is for with EE=1 and without hMT: stalls, the check at the end of a move, position maintenance.

The error is how far the rotor is from where the last motion should have put it. A stall is an error of SF (86, ST=1);
with SM=0 it stops the motor. MT after the end of MA or MR the error must be within DB; otherwise it is made good by
creeping at VI, while MA and MR are refused (93), unless it is a stall and SM=0; if that does not help it is error 92.
With PM=1 the same happens whenever the standing rotor is pushed out of DB. Manual 5.1.28, 5.1.100, 5.1.116, 5.1.118,
5.1.120, 7.3.7.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

from simulator.lexium.motion.axis import CORRECTION, MOVES
from simulator.lexium.motion.rotor import FOLLOWING

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice
    from simulator.lexium.motion.rotor import Event

STALLED, NOT_THERE = 86, 92
TOUCH = 1e-3
"""Steps that are rounding."""


class Encoder:
    """The encoder functions of one drive."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self._stalled = False
        self._check_at = inf
        self._tries = 0

    @property
    def watching(self) -> bool:
        """Whether they are in force."""
        values, axis = self.device.memory.values, self.device.axis
        driven = values["DE"] and axis.supply and not axis.locked()
        return bool(values.get("EE") and not values.get("AS") and driven)

    def error(self, t: float) -> float:
        """How far the rotor is behind where it should be, steps, with a sign."""
        axis = self.device.axis
        return axis.position(t) - axis.aligned - axis.rotor.position(t)

    def restart(self) -> None:
        """Forget what was going on."""
        self._stalled, self._check_at = False, inf

    def begin(self) -> None:
        """A motion begins: what it should reach counts from where the rotor is, so that it may stall anew.

        Not one that is still held up while its velocity changes, nor the correction behind a stall.
        """
        self._check_at = inf
        axis, t = self.device.axis, self.device.now
        held_up = axis.rotor.state != FOLLOWING and axis.commanded(t)
        if axis.kind not in ("", CORRECTION) and not held_up:
            self._stalled = False

    def clear(self) -> None:
        """ST=0: the next stall is one, even if the rotor is still out of place."""
        self._stalled = False

    def arrive(self, t: float) -> None:
        """The motion has ended; once it has settled it is checked."""
        axis = self.device.axis
        if self.watching and axis.kind in (*MOVES, CORRECTION):
            self._check_at = t + axis.memory.values["MT"] / 1000

    def look(self, t: float) -> None:
        """The rotor was pushed, or is free again."""
        if not self.watching:
            return
        if abs(self.error(t)) < self._stall_at - TOUCH:
            self._stalled = False
        elif not self._stalled:
            self._stall(t)
        if self.device.axis.at_rest(t) and self._check_at == inf and self.device.memory.values["PM"]:
            self._tries = 0
            self._correct(t, tried=False)

    def next(self, t: float) -> Event:
        """A stall that is coming, or the check after a move."""
        if not self.watching:
            return inf, self._stall
        return min((self._stalls(t), self._stall), (self._check_at, self._check), key=lambda each: each[0])

    @property
    def _stall_at(self) -> float:
        axis = self.device.axis
        return max(float(axis.memory.values["SF"]), 1.0) * axis.steps_per_count

    def _stalls(self, t: float) -> float:
        axis = self.device.axis
        if self._stalled or axis.rotor.state == FOLLOWING or not axis.commanded(t):
            return inf
        even = axis.rotor.position(t) + axis.aligned
        found = [axis.profile.crossing(even + way * self._stall_at, t, way) for way in (1, -1)]
        return min((each for each in found if each is not None), default=inf)

    def _stall(self, t: float) -> None:
        device = self.device
        self._stalled = True
        device.memory.values["ST"] = 1
        if not device.memory.values["SM"]:
            device.motor.stop(t)
            self._check_at = inf
        device.stale = True
        device.raise_error(STALLED)

    def _check(self, t: float) -> None:
        self._check_at = inf
        self._tries = self._tries + 1 if self.device.axis.kind == CORRECTION else 0
        self._correct(t, tried=self._tries >= self.device.model.tries)

    def _correct(self, t: float, tried: bool) -> None:
        """Creep back, unless that has been tried or may not be."""
        device, axis = self.device, self.device.axis
        error = self.error(t)
        if abs(error) <= axis.memory.values["DB"] * axis.steps_per_count + TOUCH:
            return
        device.stale = True
        limit = device.motor.limits.refuse(t, error)
        if tried or limit:
            device.raise_error(NOT_THERE if tried else limit)
        elif abs(error) < self._stall_at - TOUCH or axis.memory.values["SM"]:
            axis.creep(error, t)
