"""The functions that know where the rotor is: those of the encoder (EE=1), hMT (AS=1, 2) and torque mode (AS=3).

hMT is the closed loop of an LMDC drive: lead and lag, the locked rotor, calibration. With AS=1 and 2 the drive knows
how far the rotor lags the command (LL) and makes that good as MU says (the way it catches up is in `rotor`). LD and LG
are errors (106, 107). A rotor at rest for LT at the bounds (CB) is locked: error 104, and the bridges are off until CF.
A TA that waits for one of these takes the error's place. With MU=1 or 2, where a move is to end on time, one that ends
without its rotor is error 108. In torque mode (AS=3) the motor turns at TS towards TD, as long as TQ is more than the
load needs. Manual 5.1.2, 5.1.6, 5.1.18, 5.1.20, 5.1.72 to 5.1.79, 5.1.87, 5.1.122 to 5.1.131, section 8.

Chosen where the manual is silent: calibration takes `CALIBRATION` when AS leaves 0 (at power-up it is done by the time
of the sign-on). 16 is in AF while there is lead or lag, 64 once that has been made good. Lead and lag are counted
against the direction of the last motion.

With EE=1 and without hMT an encoder detects stalls, checks the end of a move and maintains the position. The error is
how far the rotor is from where the last motion should have put it. A stall is an error of SF (86, ST=1); with SM=0 it
stops the motor. MT after the end of MA or MR the error must be within DB; otherwise it is made good at VI, while MA and
MR are refused (93), unless it is a stall and SM=0; if that does not help it is error 92. With PM=1 the same happens
whenever the standing rotor is pushed out of DB. Manual 5.1.28, 5.1.100, 5.1.116, 5.1.118, 5.1.120, 7.3.7.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from multidrop.families.lexium.manual.errors import ErrorNumber as E
from multidrop.families.lexium.simulator.motion.axis import CORRECTION, MOVES, TORQUE, Axis
from multidrop.families.lexium.simulator.motion.counters import DriveLimits, Trips
from multidrop.families.lexium.simulator.motion.rotor import FOLLOWING, STANDING
from multidrop.families.lexium.simulator.state.errors import DriveFault, Event, nothing, when
from multidrop.families.lexium.simulator.state.interpreter import Core
from multidrop.simulator.kinematics import halt, meeting
from multidrop.simulator.world import TOUCH

NEAR = 1e-3
"""Steps that are rounding where a distance is compared."""


class Encoder:
    """The encoder functions of one drive."""

    def __init__(self, core: Core, axis: Axis, limits: DriveLimits, stop: Callable[[float], None]) -> None:
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
        if abs(self.error(t)) < self._stall_at - NEAR:
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
        return min(axis.profile.crossing(even + direction * self._stall_at, t, direction) for direction in (1, -1))

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
        if abs(error) <= values["DB"] * self._memory.steps_per_count + NEAR:
            return
        self._timeline.replan()
        limit = self._limits.refuse(t, error)
        if tried or limit:
            self._interpreter.raise_error(E.POSITION_OFF if tried else limit)
        elif abs(error) < self._stall_at - NEAR or values["SM"]:
            axis.correct(error, t)


FIXED, VARIABLE, TORQUE_MODE = 1, 2, 3
"""Values of AS."""


class TorqueMode:
    """Torque mode of one drive. `halted`: a stop lets it stand until AS is set again, a pause until it goes on."""

    def __init__(self, core: Core, axis: Axis, limits: DriveLimits) -> None:
        self._values, self._timeline, self._world = core.values, core.timeline, core.world
        self._axis, self._limits = axis, limits
        self.halted = False

    @property
    def active(self) -> bool:
        return self._values.get("AS") == TORQUE_MODE

    def set_speed(self, speed: int) -> None:
        self._values["TS"] = speed
        self._timeline.replan()

    def halt(self) -> bool:
        """Slow down and stand, in torque mode. Return whether the drive is in that mode."""
        if not self.active:
            return False
        self.halted = True
        self._timeline.replan()
        return True

    def go_on(self, t: float) -> None:
        self.halted = False
        self._timeline.replan()

    def turn(self, t: float) -> bool:
        """Turn as TS and TD say, or stand while halted or at a limit. Return whether something holds the rotor."""
        values, axis = self._values, self._axis
        direction = 1.0 if values["TD"] else -1.0
        free = self._axis.bridges.driving and not self.halted and not self._limits.refuse(t, direction)
        speed = float(values["TS"]) if free else 0.0
        if speed and (axis.rotor.holds(direction) or values["TQ"] <= 100 * self._world.load):
            if axis.profile.moving(t) and axis.profile.velocity(t) * direction >= 0:
                axis.begin(TORQUE, halt(t, axis.position(t)), t)
                self._timeline.replan()
            return True
        wanted = direction * speed
        final = axis.profile.segments[-1].velocity if axis.profile.end == inf else 0.0
        if wanted != final and (wanted or axis.profile.end == inf):
            axis.slow_to(wanted, t, kind=TORQUE)
            self._timeline.replan()
        return False


CALIBRATION = 0.02
"""s."""
LEAD, LAG, MOST, LOCKED, HYBRID, FAULT, ZERO, READY, FAILED = 1, 2, 4, 8, 16, 32, 64, 128, 256
"""Bits of AF."""
TA_CALIBRATED, TA_ACTIVE, TA_LOCKED, TA_LAG, TA_LEAD = 1, 2, 4, 8, 16
"""Bits of TA."""
MOST_LAG = 0x7FFFFFFF


class Hmt:
    """hMT of one drive; in force on products that have AS."""

    def __init__(self, core: Core, axis: Axis, torque: TorqueMode, trips: Trips, stop: Callable[[float], None]) -> None:
        self._memory, self._values, self._timeline = core.memory, core.values, core.timeline
        self._axis, self._rotor, self._bridges, self._torque = axis, axis.rotor, axis.bridges, torque
        self._trips, self._interpreter, self._stop = trips, core.interpreter, stop
        self._ready_at = inf
        self._failed = self._zero = self._active = False
        self._held_since = inf
        self._reported: set[int] = set()

    # What is read.

    @property
    def mode(self) -> int:
        """AS, 0 where there is none."""
        return int(self._values.get("AS", 0))

    @property
    def closed(self) -> bool:
        """Return whether the rotor is kept track of."""
        return self.mode in (FIXED, VARIABLE) and self._bridges.driving

    @property
    def calibrating(self) -> bool:
        """Return whether no move may be made yet (88)."""
        return self._ready_at < inf

    def lag(self, t: float) -> int:
        """LL: steps that the rotor lags, negative where it leads."""
        if not self.closed:
            return 0
        return max(-MOST_LAG, min(MOST_LAG, round(self._axis.direction(t) * self._rotor.lag(t))))

    def shown_lag(self, t: float) -> int:
        """LL as it is reported: with the lag of the rotor behind its field while it follows."""
        lag = self.lag(t)
        return lag if lag or not self.closed else round(self._axis.direction(t) * self._rotor.field_lag(t))

    def status(self, t: float) -> int:
        """AF."""
        values, lag, follows = self._values, self.lag(t), self.mode in (FIXED, VARIABLE)
        conditions = {
            LEAD: follows and lag < 0 and -lag >= values["LD"],
            LAG: follows and lag > 0 and lag >= values["LG"],
            MOST: follows and abs(lag) >= MOST_LAG,
            LOCKED: bool(values["LR"]),
            HYBRID: follows and lag != 0,
            FAULT: follows and self._bridges.locked,
            ZERO: follows and self._zero and not lag,
            READY: not self._failed and not self.calibrating,
            FAILED: self._failed,
        }
        return sum(bit for bit, holds in conditions.items() if holds)

    @property
    def bounds(self) -> int:
        """CB, which in torque mode is 0 whatever it was set to (manual 5.1.18)."""
        return 0 if self._torque.active else int(self._values["CB"])

    # What is commanded.

    def set_bounds(self, mode: int) -> None:
        """Set CB. Raises DriveFault (21) for another one than there is in torque mode."""
        if self._torque.active:
            if mode:
                raise DriveFault(E.OUT_OF_RANGE)
            return
        self._values["CB"] = mode
        self._timeline.replan()

    def set_mode(self, mode: int, t: float) -> None:
        """Set AS. Raises DriveFault (87, 109): torque mode turns until SL 0 or another stop."""
        was = self.mode
        if self._axis.status.moving(t):
            raise DriveFault(E.AS_WHILE_MOVING)
        if mode and not self._bridges.enabled:
            self._failed = True
            raise DriveFault(E.CALIBRATION_FAILED)
        self._axis.switch_unit("AS", mode, t)
        self._torque.halted = self._failed = False
        self._timeline.replan()
        self.changed(was, t)

    def changed(self, was: int, t: float) -> None:
        """Start again where AS was something else, with a calibration where it has left 0."""
        mode = self.mode
        if mode == was:
            return
        self._zero = self._failed = self._torque.halted = False
        self._held_since = inf
        if not (self.calibrating and mode in (FIXED, VARIABLE)):
            self._ready_at = t + CALIBRATION if mode in (FIXED, VARIABLE) and not was else inf

    def settle(self, t: float) -> None:
        """Let a calibration that has begun be over."""
        if self.calibrating:
            self._calibrated(t)

    def clear(self) -> None:
        """Carry out CF: the bridges are on again, and what the rotor has lost is forgotten."""
        self._values["LR"] = 0
        if self._bridges.locked:
            self._axis.align(self._timeline.now)
        self._bridges.locked = False
        self._zero, self._held_since = False, inf
        self.tune()
        self._timeline.replan()

    def make_up(self, mode: int, clearing: int, t: float) -> None:
        """Set MU. Raises DriveFault (110) in torque mode."""
        if self._torque.active:
            raise DriveFault(E.MAKE_UP_OFF)
        self._values["MU"] = mode
        if clearing:
            self._rotor.release(t)
        self._timeline.replan()

    def disable(self) -> None:
        """Clear the mode of make-up: the bridges are off."""
        if self.mode in (FIXED, VARIABLE):
            self._values["MU"] = 0

    def tune(self) -> None:
        """Follow AS, DE, LR or the supply: where the loop opens or closes, lead and lag are forgotten."""
        if self._rotor.closed != self.closed:
            self._rotor.closed = self.closed
            self._rotor.release(self._timeline.now)

    # What happens.

    def restart(self) -> None:
        self._ready_at = self._held_since = inf
        self._failed = self._zero = self._active = self._bridges.locked = self._torque.halted = False
        self._reported.clear()

    def arrive(self, t: float) -> None:
        """Report a move that has ended without its rotor."""
        over = self._axis.kind in MOVES and not self._axis.back
        if self.closed and over and self._values["MU"] and self.lag(t):
            self._interpreter.raise_error(E.LEAD_LAG_LEFT)

    def look(self, t: float) -> None:
        if self._torque.active:
            self._note_held(self._torque.turn(t), t)
        elif self.mode:
            self._watch(t)

    def pushed(self) -> None:
        """Count the time of a locked rotor again: the encoder has moved."""
        self._held_since = inf

    def next(self, t: float) -> Event:
        """When lead or lag next reach something, a rotor is locked, or calibration is over."""
        if not self.mode:
            return inf, nothing
        reported = self._bridges.locked or (self._values["LR"] and self._torque.active)
        locks_at = inf if reported else self._held_since + self._values["LT"] / 1000
        events = [(self._ready_at, self._calibrated), (locks_at, self._lock)]
        if self.closed and self._rotor.state != FOLLOWING:
            levels = (self._memory.bound, float(self._values["LG"]), float(self._values["LD"]))
            events += [(self._lags_at(limit, t), nothing) for limit in levels]
            events.append((self._axis.profile.turning(-self._axis.direction(t), t), nothing))
        return min(events, key=when)

    def _lags_at(self, limit: float, t: float) -> float:
        """When the command gets a distance away from the rotor, either way, if it is not as far away now."""
        rotor, command = self._rotor, self._axis.profile
        lag, (own, _) = rotor.lag(t), rotor.path
        times = [inf]
        for direction in (1.0, -1.0):
            if lag * direction >= limit - TOUCH:
                continue
            if rotor.state == STANDING:
                times.append(command.crossing(own.position(t) + rotor.slip + direction * limit, t, direction))
            else:
                times.append(meeting(own, command, -rotor.slip - direction * limit, t))
        return min(times)

    def _watch(self, t: float) -> None:
        """Report lead and lag that have reached their limits, and see the rotor stand at its bounds."""
        values, rotor = self._values, self._rotor
        lag = self._axis.direction(t) * rotor.lag(t)
        active = abs(lag) >= self._memory.bound - NEAR
        self._note_held(active and rotor.state == STANDING, t)
        self._report(E.LAG_LIMIT, TA_LAG, lag >= values["LG"] - NEAR and lag > 0, t)
        self._report(E.LEAD_LIMIT, TA_LEAD, -lag >= values["LD"] - NEAR and lag < 0, t)
        if active and not self._active:
            self._trips.hmt(TA_ACTIVE, t)
        if self._active and rotor.state == FOLLOWING:
            self._zero = True
        self._zero = self._zero and not active
        self._active = rotor.state != FOLLOWING and (active or self._active)

    def _note_held(self, held: bool, t: float) -> None:
        self._held_since = min(self._held_since, t) if held else inf

    def _report(self, code: int, bit: int, holds: bool, t: float) -> None:
        if not holds:
            self._reported.discard(code)
        elif code not in self._reported:
            self._reported.add(code)
            if not self._trips.hmt(bit, t):
                self._interpreter.raise_error(code)

    def _lock(self, t: float) -> None:
        """Lock the rotor: switch the bridges off; in torque mode there is only the flag, LR."""
        self._values["LR"] = 1
        self._held_since = inf
        if not self._torque.active:
            self._bridges.locked = True
            self._stop(t)
            self.disable()
        self.tune()
        self._timeline.replan()
        if not self._trips.hmt(TA_LOCKED, t):
            self._interpreter.raise_error(E.LOCKED_ROTOR)

    def _calibrated(self, t: float) -> None:
        self._ready_at = inf
        self._timeline.replan()
        self._trips.hmt(TA_CALIBRATED, t)
