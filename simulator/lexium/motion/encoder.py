"""What an encoder is for with EE=1 and without hMT: stalls, the check at the end of a move, position maintenance.

The error is how far the rotor is from where the last motion should have put it. A stall is an error of SF (86, ST=1);
with SM=0 it stops the motor. MT after the end of MA or MR the error must be within DB; otherwise it is made good at
VI, while MA and MR are refused (93), unless it is a stall and SM=0; if that does not help it is error 92. With PM=1
the same happens whenever the standing rotor is pushed out of DB. Manual 5.1.28, 5.1.100, 5.1.116, 5.1.118, 5.1.120,
7.3.7.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.motion.axis import CORRECTION, MOVES, Axis
from multidrop.simulator.lexium.motion.counters import Limits
from multidrop.simulator.lexium.motion.rotor import FOLLOWING
from multidrop.simulator.lexium.state.interpreter import Core
from multidrop.simulator.lexium.state.timeline import Event, when

TOUCH = 1e-3
"""Steps that are rounding."""


class Encoder:
    """The encoder functions of one drive."""

    def __init__(self, core: Core, axis: Axis, limits: Limits, stop: Callable[[float], None]) -> None:
        self._memory, self._values, self._timeline = core.memory, core.values, core.timeline
        self._axis, self._limits, self._interpreter, self._stop = axis, limits, core.interpreter, stop
        self._stalled = False
        self._check_at = inf
        self._tries = 0

    @property
    def watching(self) -> bool:
        """Return whether they are in force."""
        values = self._values
        return bool(values.get("EE") and not values.get("AS") and self._axis.bridges.driving)

    def error(self, t: float) -> float:
        """The lag of the rotor, steps, with a sign."""
        return self._axis.position(t) - self._axis.aligned - self._axis.rotor.position(t)

    def restart(self) -> None:
        self._stalled, self._check_at = False, inf

    def begin(self) -> None:
        """Let a motion stall that begins: what it should reach counts from where the rotor is.

        Not one that is still held up while its velocity changes, nor the correction after a stall.
        """
        self._check_at = inf
        axis = self._axis
        held_up = axis.rotor.state != FOLLOWING and axis.commanded(self._timeline.now)
        if axis.kind not in ("", CORRECTION) and not held_up:
            self._stalled = False

    def clear(self) -> None:
        """Carry out ST=0: the next stall is one, even if the rotor is still out of place."""
        self._stalled = False

    def arrive(self, t: float) -> None:
        """Plan the check of a motion that has ended, once it has settled."""
        if self.watching and self._axis.kind in (*MOVES, CORRECTION):
            self._check_at = t + self._values["MT"] / 1000

    def look(self, t: float) -> None:
        if not self.watching:
            return
        if abs(self.error(t)) < self._stall_at - TOUCH:
            self._stalled = False
        elif not self._stalled:
            self._stall(t)
        if self._axis.at_rest(t) and self._check_at == inf and self._values["PM"]:
            self._tries = 0
            self._correct(t, tried=False)

    def next(self, t: float) -> Event:
        """A stall that is coming, or the check after a move."""
        if not self.watching:
            return inf, self._stall
        return min((self._stalls(t), self._stall), (self._check_at, self._check), key=when)

    @property
    def _stall_at(self) -> float:
        return max(float(self._values["SF"]), 1.0) * self._memory.steps_per_count

    def _stalls(self, t: float) -> float:
        axis = self._axis
        if self._stalled or axis.rotor.state == FOLLOWING or not axis.commanded(t):
            return inf
        even = axis.rotor.position(t) + axis.aligned
        found = [axis.profile.crossing(even + direction * self._stall_at, t, direction) for direction in (1, -1)]
        return min((each for each in found if each is not None), default=inf)

    def _stall(self, t: float) -> None:
        self._stalled = True
        self._values["ST"] = 1
        if not self._values["SM"]:
            self._stop(t)
            self._check_at = inf
        self._interpreter.raise_error(E.STALL)

    def _check(self, t: float) -> None:
        self._check_at = inf
        self._tries = self._tries + 1 if self._axis.kind == CORRECTION else 0
        self._correct(t, tried=self._tries >= self._memory.model.tries)

    def _correct(self, t: float, tried: bool) -> None:
        """Go back, unless that has been tried or may not be."""
        error, axis, values = self.error(t), self._axis, self._values
        if abs(error) <= values["DB"] * self._memory.steps_per_count + TOUCH:
            return
        self._timeline.replan()
        limit = self._limits.refuse(t, error)
        if tried or limit:
            self._interpreter.raise_error(E.POSITION_OFF if tried else limit)
        elif abs(error) < self._stall_at - TOUCH or values["SM"]:
            axis.correct(error, t)
