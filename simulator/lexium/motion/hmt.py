"""hMT, the closed loop of an LMDC drive: lead and lag, the locked rotor, torque mode, calibration.

With AS=1 and 2 the drive knows how far the rotor is behind the command (LL) and makes that good as MU says (the way
it catches up is in `rotor`). LD and LG are errors (106, 107). A rotor that stands for LT at the bounds (CB) is
locked: error 104, and the bridges are off until CF. A TA that waits for one of these takes the error's place. With
MU=1 or 2, where a move is to end on time, one that ends without its rotor is error 108. With AS=3 the motor turns at
once, at TS, towards TD, as long as TQ is more than the load needs. Manual 5.1.2, 5.1.6, 5.1.18, 5.1.20, 5.1.72 to
5.1.79, 5.1.87, 5.1.122 to 5.1.131, section 8.

Chosen where the manual is silent: calibration takes `CALIBRATION` when AS leaves 0 (at power-up it is done by the time
of the sign-on); 16 in AF stands while there is lead or lag, 64 once it has been made good; lead and lag are counted
against the direction of the last motion.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

from simulator.kinematics.profile import halt, meeting, move
from simulator.lexium.motion.axis import MOVES, TORQUE
from simulator.lexium.motion.rotor import FOLLOWING, STANDING, TOUCH
from simulator.lexium.state.errors import Fault

if TYPE_CHECKING:
    from simulator.lexium.device import MCodeDevice
    from simulator.lexium.motion.rotor import Event

CALIBRATION = 0.02
"""s."""
FIXED, VARIABLE, TORQUE_MODE = 1, 2, 3
"""Values of AS."""
LEAD, LAG, MOST, LOCKED, HYBRID, FAULT, ZERO, READY, FAILED = 1, 2, 4, 8, 16, 32, 64, 128, 256
"""Bits of AF."""
TA_CALIBRATED, TA_ACTIVE, TA_LOCKED, TA_LAG, TA_LEAD = 1, 2, 4, 8, 16
WRONG, WRONG_MODE_MOVING, LOCKED_ROTOR, LEAD_REACHED, LAG_REACHED, NOT_ZERO, NOT_ENABLED = (
    21,
    87,
    104,
    106,
    107,
    108,
    109,
)
NO_MAKE_UP, MOVING, BAD_RESOLUTION, NOT_TESTED = 110, 89, 100, 103
TEST = "test"
"""The kind of motion that SC makes."""
MOST_LAG = 0x7FFFFFFF


class Hmt:
    """hMT of one drive; in force on products that have AS."""

    locked: bool
    """Whether a locked rotor has switched the bridges off; in torque mode there is only the flag, LR."""

    def __init__(self, device: MCodeDevice) -> None:
        self.device = device
        self.locked = False
        self._ready_at = inf
        self._failed = self._zero = self._active = False
        self._held_since = inf
        self._reported: set[int] = set()
        self._tested = 0.0
        self._halted = False

    # What is read.

    @property
    def mode(self) -> int:
        """AS, 0 where there is none."""
        return int(self.device.memory.values.get("AS", 0))

    @property
    def closed(self) -> bool:
        """Whether the rotor is kept track of."""
        values = self.device.memory.values
        return self.mode in (FIXED, VARIABLE) and bool(values["DE"]) and not self.locked and self.device.axis.supply

    @property
    def calibrating(self) -> bool:
        """Whether no move may be made yet (88)."""
        return self._ready_at < inf

    def lag(self, t: float) -> int:
        """LL: steps that the rotor is behind, negative where it leads."""
        if not self.closed:
            return 0
        return max(-MOST_LAG, min(MOST_LAG, round(self.device.axis.way(t) * self.device.axis.rotor.lag(t))))

    def status(self, t: float) -> int:
        """AF."""
        values, lag = self.device.memory.values, self.lag(t)
        bits = FAILED if self._failed else 0 if self.calibrating else READY
        if self.mode in (FIXED, VARIABLE):
            bits |= LEAD if lag < 0 and -lag >= values["LD"] else 0
            bits |= LAG if lag > 0 and lag >= values["LG"] else 0
            bits |= MOST if abs(lag) >= MOST_LAG else 0
            bits |= (HYBRID if lag else 0) | (ZERO if self._zero and not lag else 0)
            bits |= FAULT if self.locked else 0
        return bits | (LOCKED if values["LR"] else 0)

    @property
    def bounds(self) -> int:
        """CB, which in torque mode is 0 whatever it was set to (manual 5.1.18)."""
        return 0 if self.mode == TORQUE_MODE else int(self.device.memory.values["CB"])

    # What is commanded.

    def set_bounds(self, mode: int) -> None:
        """CB. Raises Fault (21) for another one than there is in torque mode."""
        if self.mode == TORQUE_MODE:
            if mode:
                raise Fault(WRONG)
            return
        self.device.memory.values["CB"] = mode
        self.device.stale = True

    def set_mode(self, mode: int, t: float) -> None:
        """AS. Raises Fault (87, 109)."""
        device, axis = self.device, self.device.axis
        was = self.mode
        if axis.moving(t) and not (was == TORQUE_MODE and axis.kind == TORQUE):
            raise Fault(WRONG_MODE_MOVING)
        if mode and not device.memory.values["DE"]:
            self._failed = True
            raise Fault(NOT_ENABLED)
        axis.switch("AS", mode, t)
        self._halted = self._failed = False
        device.stale = True
        if was == TORQUE_MODE and mode != was:
            axis.slow_to(0, t)
        self.changed(was, t)

    def changed(self, was: int, t: float) -> None:
        """AS was something else: begin anew, with a calibration where it has left 0."""
        mode = self.mode
        if mode == was:
            return
        self._zero = self._failed = self._halted = False
        self._held_since = inf
        if not (self.calibrating and mode in (FIXED, VARIABLE)):
            self._ready_at = t + CALIBRATION if mode in (FIXED, VARIABLE) and not was else inf

    def halt(self) -> bool:
        """A stop, in torque mode: it slows down and stands until AS is set again. Gives whether it was in that mode."""
        if self.mode != TORQUE_MODE:
            return False
        self._halted = self.device.stale = True
        return True

    def go_on(self, t: float) -> None:
        """What was only paused turns again."""
        self._halted = False
        self.device.stale = True

    def clear(self) -> None:
        """CF: the bridges are on again, and what the rotor has lost is forgotten."""
        self.device.memory.values["LR"] = 0
        if self.locked:
            self.device.axis.align(self.device.now)
        self.locked = False
        self._zero, self._held_since = False, inf
        self.device.motor.tune()
        self.device.stale = True

    def make_up(self, mode: int, clearing: int, t: float) -> None:
        """MU. Raises Fault (110) in torque mode."""
        if self.mode == TORQUE_MODE:
            raise Fault(NO_MAKE_UP)
        self.device.memory.values["MU"] = mode
        if clearing:
            self.device.axis.rotor.let_go(t)
        self.device.stale = True

    def disable(self) -> None:
        """The bridges are off: the mode of make-up is cleared."""
        if self.mode in (FIXED, VARIABLE):
            self.device.memory.values["MU"] = 0

    def test(self, t: float) -> None:
        """SC: half a turn, to see what the encoder makes of it. Raises Fault (89, 94, 96, 103)."""
        device, axis = self.device, self.device.axis
        if not device.memory.values["DE"]:
            raise Fault(NOT_TESTED)
        if axis.moving(t):
            raise Fault(MOVING)
        axis.allow(t, 1.0)
        here, vi = axis.position(t), device.memory.values["VI"] * axis.scale
        self._tested = axis.rotor.position(t)
        top, rate = device.memory.values["VM"] * axis.scale, device.memory.values["A"] * axis.scale
        axis.begin(TEST, move(t, here, 0.0, here + axis.steps_per_turn / 2, vi=vi, vm=top, a=rate, d=rate), t)
        device.stale = True

    # What happens.

    def restart(self) -> None:
        """Power-up: calibrated already."""
        self._ready_at = self._held_since = inf
        self._failed = self._zero = self._active = self.locked = self._halted = False
        self._reported.clear()

    def arrive(self, t: float) -> None:
        """A commanded motion has ended."""
        device, axis = self.device, self.device.axis
        if axis.kind == TEST and abs(axis.rotor.position(t) - self._tested - axis.steps_per_turn / 2) > 1:
            device.raise_error(BAD_RESOLUTION)
        over = axis.kind in MOVES and not axis.way_back
        if self.closed and over and device.memory.values["MU"] and self.lag(t):
            device.raise_error(NOT_ZERO)

    def look(self, t: float) -> None:
        """See what the rotor has been up to."""
        if self.mode == TORQUE_MODE:
            self._turn(t)
        elif self.mode:
            self._watch(t)

    def next(self, t: float) -> Event:
        """When lead or lag next reach something, a rotor is locked, or calibration is over."""
        if not self.mode:
            return inf, self._nothing
        found = [(self._ready_at, self._calibrated), (self._locks_at(), self._lock)]
        axis = self.device.axis
        if self.closed and axis.rotor.state != FOLLOWING:
            found += [(self._lags_at(limit, t), self._nothing) for limit in self._levels()]
            turned = axis.profile.turning(-axis.way(t), t)
            found.append((inf if turned is None else turned, self._nothing))
        return min(found, key=lambda each: each[0])

    def _nothing(self, t: float) -> None:
        """The next look sees it."""

    def _levels(self) -> tuple[float, ...]:
        values = self.device.memory.values
        return self.device.axis.bound, float(values["LG"]), float(values["LD"])

    def _lags_at(self, limit: float, t: float) -> float:
        """When the command gets a distance away from the rotor, either way, if it is not as far away now."""
        rotor, command = self.device.axis.rotor, self.device.axis.profile
        lag, (own, _) = rotor.lag(t), rotor.path
        times = []
        for way in (1.0, -1.0):
            if lag * way >= limit - TOUCH:
                continue
            if rotor.state == STANDING:
                times.append(command.crossing(own.position(t) + rotor.slip + way * limit, t, way))
            else:
                times.append(meeting(own, command, -rotor.slip - way * limit, t))
        return min((each for each in times if each is not None), default=inf)

    def _watch(self, t: float) -> None:
        values, axis = self.device.memory.values, self.device.axis
        lag = axis.way(t) * axis.rotor.lag(t)
        at_bound = axis.rotor.state == STANDING and abs(lag) >= axis.bound - 1e-3
        if at_bound and self._held_since == inf:
            self._held_since = t
        elif not at_bound:
            self._held_since = inf
        self._report(LAG_REACHED, TA_LAG, lag >= values["LG"] - 1e-3 and lag > 0, t)
        self._report(LEAD_REACHED, TA_LEAD, -lag >= values["LD"] - 1e-3 and lag < 0, t)
        active = abs(lag) >= axis.bound - 1e-3
        if active and not self._active:
            self.device.trips.hmt(TA_ACTIVE, t)
        if self._active and axis.rotor.state == FOLLOWING:
            self._zero = True
        self._zero = self._zero and not active
        self._active = axis.rotor.state != FOLLOWING and (active or self._active)

    def pushed(self) -> None:
        """The encoder has moved: the time of a locked rotor begins anew."""
        self._held_since = inf

    def _report(self, code: int, bit: int, holds: bool, t: float) -> None:
        if not holds:
            self._reported.discard(code)
        elif code not in self._reported:
            self._reported.add(code)
            if not self.device.trips.hmt(bit, t):
                self.device.raise_error(code)

    def _locks_at(self) -> float:
        values = self.device.memory.values
        told = self.locked or (values["LR"] and self.mode == TORQUE_MODE)
        return inf if told else self._held_since + values["LT"] / 1000

    def _lock(self, t: float) -> None:
        device = self.device
        device.memory.values["LR"] = 1
        self._held_since = inf
        if self.mode != TORQUE_MODE:
            self.locked = True
            device.motor.stop(t)
            self.disable()
        device.motor.tune()
        device.stale = True
        if not device.trips.hmt(TA_LOCKED, t):
            device.raise_error(LOCKED_ROTOR)

    def _calibrated(self, t: float) -> None:
        self._ready_at = inf
        self.device.stale = True
        self.device.trips.hmt(TA_CALIBRATED, t)

    # Torque mode.

    def _turn(self, t: float) -> None:
        """Turn as TS and TD say, or stand while something is in the way, or a limit is active."""
        values, axis = self.device.memory.values, self.device.axis
        way = 1.0 if values["TD"] else -1.0
        driven = values["DE"] and axis.supply and not self.locked
        free = driven and not self._halted and not self.device.motor.limits.refuse(t, way)
        speed = float(values["TS"]) if free else 0.0
        held = axis.rotor.holds(way) or values["TQ"] <= 100 * self.device.world.load
        if speed and held:
            if axis.profile.moving(t) and axis.profile.velocity(t) * way >= 0:
                axis.begin(TORQUE, halt(t, axis.position(t)), t)
                self.device.stale = True
            if self._held_since == inf:
                self._held_since = t
            return
        self._held_since = inf
        wanted = way * speed
        final = axis.profile.segments[-1].velocity if axis.profile.end == inf else 0.0
        if wanted != final and (wanted or axis.profile.end == inf):
            axis.slow_to(wanted, t, kind=TORQUE)
            self.device.stale = True
