"""The pulse generator of one axis of a PMX: its profile, its counter, and what it is doing.

Theory of operation. `profile` is the motion in pulses, counted from power-up. The counter is that plus an offset, so
setting the counter moves nothing. `on_change` is called before a new profile replaces the old one.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.simulator.kinematics.profile import Profile, halt, move, slew
from multidrop.simulator.pmx.rotor import Rotor
from multidrop.simulator.pmx.settings import INT32, wrapped
from multidrop.simulator.pmx.states import ACCELERATING, CONSTANT, DECELERATING, Doing, Pace


def planned(t: float, here: float, place: float, pace: Pace) -> Profile:
    """Plan a move from rest; where the ramps do not each fit into half of it, the first serves twice (A.2)."""
    longest = (pace.high**2 - pace.low**2) / (2 * min(pace.up, pace.down))
    down = pace.up if longest > abs(place - here) / 2 else pace.down
    shape = pace.shape
    return move(t, here, 0.0, place, vi=pace.low, vm=pace.high, a=pace.up, d=down, up=shape, down=shape)


class Pulses:
    """The pulses of one axis, and the rotor that follows them. Places are pulses from power-up."""

    def __init__(self, rotor: Rotor) -> None:
        self.rotor = rotor
        self.doing = Doing.NOTHING
        self.profile: Profile = halt(0.0, 0.0)
        self.pace = Pace(1.0, 1.0, 1.0, 1.0)
        self.on_change: Callable[[float], None] = lambda t: None
        self._offset = 0.0

    # -- what can be read -----------------------------------------------------------------------------------------

    def moving(self, t: float) -> bool:
        """Whether pulses are being made."""
        return self.profile.moving(t)

    def place(self, t: float) -> float:
        """Pulses from power-up."""
        return self.profile.position(t)

    def counter(self, t: float) -> float:
        """The pulse counter, with fractions during a motion."""
        return self.profile.position(t) + self._offset

    def status(self, t: float) -> int:
        """The bits of the motor status that describe the motion."""
        if not self.moving(t):
            return 0
        if not self.profile.changing(t):
            return CONSTANT
        change = self.profile.acceleration(t) or self.profile.acceleration(t + 1e-6)
        return ACCELERATING if change * self.profile.direction(t) > 0 else DECELERATING

    def place_of(self, count: float, t: float) -> float:
        """The place of a count of the counter, on the lap of 32 bits where the counter is now."""
        counter = self.counter(t)
        laps = round((counter - wrapped(counter)) / (2 * INT32)) * 2 * INT32
        return count + laps - self._offset

    def whole(self, place: float) -> float:
        """The nearest place of a whole count."""
        return round(place + self._offset) - self._offset

    def set_counter(self, count: float, t: float) -> None:
        """Let the counter read this from now on; nothing moves."""
        self._offset = count - self.profile.position(t)

    # -- profiles -------------------------------------------------------------------------------------------------

    def to_place(self, place: float, t: float, pace: Pace) -> Profile:
        """Plan a motion to a place, from rest or on the fly."""
        if self.profile.velocity(t):
            return self.to_place_on_the_fly(place, t, pace)
        return planned(t, self.place(t), place, pace)

    def to_place_on_the_fly(self, place: float, t: float, pace: Pace) -> Profile:
        """Plan the rest of a motion to another place, or at another pace."""
        here, now = self.profile.position(t), self.profile.velocity(t)
        a, d, shape = pace.up, pace.down, pace.shape
        return move(t, here, now, place, vi=pace.low, vm=pace.high, a=a, d=d, up=shape, down=shape)

    def to_speed(self, velocity: float, t: float, pace: Pace) -> Profile:
        """Plan a motion to a velocity; 0 stops."""
        here, now = self.profile.position(t), self.profile.velocity(t)
        return slew(t, here, now, velocity, vi=pace.low, a=pace.up, d=pace.down, up=pace.shape, down=pace.shape)

    # -- motions --------------------------------------------------------------------------------------------------

    def begin(self, doing: Doing, profile: Profile, t: float, pace: Pace) -> None:
        """Begin a motion in place of any other."""
        self.on_change(t)
        self.doing, self.pace = doing, pace
        self._follow(profile, t)

    def rest(self, t: float) -> None:
        """Stop at once, on a whole count."""
        place = self.whole(self.place(t))
        self.on_change(t)
        self.doing = Doing.NOTHING
        self._follow(halt(t, place), t)

    def _follow(self, profile: Profile, t: float) -> None:
        snap = profile.position(t) - self.profile.position(t)
        self.profile = profile
        self.rotor.follow(profile, t, snap)
