"""The pulse generator of one axis of a PMX, and the shaft that its pulses turn.

`Pulses.profile` is the motion in pulses, counted from power-up. The counter is that plus an offset, so setting the
counter moves nothing. Speeds are pulses/s, times s.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, IntEnum
from math import ceil, floor, inf

from multidrop.families.pmx.simulator.settings import INT32, PmxRefusal, PmxSettings, rate, window, wrapped
from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.kinematics import LINEAR, TRIANGLE, MotionPace, Profile, Shape, halt, move, slew
from multidrop.simulator.world import TOUCH, Shaft, World

ACCELERATING, DECELERATING, CONSTANT = 1, 2, 4
PLUS, MINUS, HOME = 16, 32, 64
PLUS_ERROR, MINUS_ERROR, INDEX, JOYSTICK, TIMED_OUT = 128, 256, 512, 1024, 2048
"""Bits of the motor status (table 7.2)."""
PULSES_A_TURN = 1600.0
"""Motor steps from one index mark to the next: a motor of 1.8 degrees at an eighth of a step (manual 5.1)."""


class Doing(Enum):
    """What the motor of an axis is doing."""

    NOTHING = "nothing"
    MOVE = "move"
    JOG = "jog"
    LINE = "line"
    HOMING = "homing"
    STOPPING = "stopping"
    CORRECTING = "correcting"
    STICK = "stick"


class LoopStatus(IntEnum):
    """Values of `SLS` (table 7.9). 4, aborting, takes no time."""

    IDLE = 0
    MOVING = 1
    CORRECTING = 2
    STOPPING = 3
    JOGGING = 5
    HOMING = 6
    Z_HOMING = 7
    RANGE_ERROR = 8
    ATTEMPTS_ERROR = 9
    STALL_ERROR = 10
    LIMIT_ERROR = 11
    OFF = 12
    LIMIT_HOMING = 13


STATES = {
    Doing.NOTHING: LoopStatus.IDLE,
    Doing.MOVE: LoopStatus.MOVING,
    Doing.JOG: LoopStatus.JOGGING,
    Doing.LINE: LoopStatus.MOVING,
    Doing.STOPPING: LoopStatus.STOPPING,
    Doing.CORRECTING: LoopStatus.CORRECTING,
    Doing.STICK: LoopStatus.JOGGING,
}


def paced(
    settings: PmxSettings, axis: str, speeds: tuple[float, float], times: tuple[int, int], *, strict: bool = True
) -> MotionPace:
    """Work out the pace of an axis from low and high speed, pulses/s, and both acceleration times, ms.

    Raises PmxRefusal for a low speed that does not fit the high one; not `strict`: a low speed that fits is used.
    """
    low, high = speeds
    if not strict:
        low = min(low, high)
    elif low > high or low < min(window(high).slowest, high):
        raise PmxRefusal("?Low speed out of range")
    up = rate(low, high, times[0])
    down = rate(low, high, times[1]) if settings["EDEC"] else up
    shape = Shape(TRIANGLE if settings["SCV" + axis] else LINEAR)
    return MotionPace(low, high, up, down, shape, shape)


class PmxRotor(Shaft):
    """A shaft with an encoder and an index. Positions are physical motor steps from power-up.

    Pulses turn it by 1, by -1 where the direction's polarity is turned, by less where the motor slips.
    """

    def __init__(self, world: World, spec: WorldSpec) -> None:
        super().__init__(world, PULSES_A_TURN)
        self.counts_a_step = spec.encoder
        self.decoding = 1
        self._slip = spec.slip
        self._index = spec.index
        self._encoder_offset = 0.0
        self.turn(False)

    def turn(self, turned: bool) -> None:
        """Take the polarity of the direction; `settle` applies it."""
        self.scale = (-1.0 if turned else 1.0) * (1 - self._slip)

    def encoder(self, t: float) -> float:
        """Encoder counts, with fractions."""
        return self.counts_a_step * self.decoding * self.position(t) + self._encoder_offset

    def set_encoder(self, counts: float, t: float) -> None:
        self._encoder_offset += counts - self.encoder(t)

    def set_decoding(self, times: int, t: float) -> None:
        """Count once, twice or four times; the count stays."""
        before = self.encoder(t)
        self.decoding = times
        self.set_encoder(before, t)

    @property
    def counts_a_pulse(self) -> float:
        """Counts that one pulse makes at present, signed."""
        return self.factor * self.counts_a_step * self.decoding

    def at_index(self, t: float) -> bool:
        """Whether the shaft is within half a step of an index mark."""
        place = (self.position(t) - self._index) % PULSES_A_TURN
        return min(place, PULSES_A_TURN - place) <= 0.5

    def next_index(self, after: float) -> float:
        """The time at which the next index mark is passed; infinite: never."""
        direction = self.path.direction(after)
        if not self.path.moving(after) or not direction:
            return inf
        turns = (self.position(after) - self._index) / PULSES_A_TURN
        mark = self._index + PULSES_A_TURN * (floor(turns + TOUCH) + 1 if direction > 0 else ceil(turns - TOUCH) - 1)
        return self.path.crossing(mark - self.offset, after)


def planned(t: float, here: float, place: float, pace: MotionPace) -> Profile:
    """Plan a move from rest; where the ramps do not each fit into half of it, the first serves twice (A.2)."""
    longest = (pace.vm**2 - pace.vi**2) / (2 * min(pace.a, pace.d))
    return move(t, here, 0.0, place, pace._replace(d=pace.a) if longest > abs(place - here) / 2 else pace)


class Pulses:
    """The pulses of one axis, and the rotor that follows them. Places are pulses from power-up.

    `on_change` is called before a new profile replaces the old one.
    """

    def __init__(self, rotor: PmxRotor) -> None:
        self.rotor = rotor
        self.doing = Doing.NOTHING
        self.profile: Profile = halt(0.0, 0.0)
        self.pace = MotionPace(1.0, 1.0, 1.0, 1.0)
        self.on_change: Callable[[float], None] = lambda t: None
        self._offset = 0.0

    def counter(self, t: float) -> float:
        """The pulse counter, with fractions during a motion."""
        return self.profile.position(t) + self._offset

    def set_counter(self, count: float, t: float) -> None:
        """Let the counter read this from now on; nothing moves."""
        self._offset = count - self.profile.position(t)

    def status(self, t: float) -> int:
        """The bits of the motor status that describe the motion."""
        profile = self.profile
        if not profile.moving(t):
            return 0
        if not profile.changing(t):
            return CONSTANT
        change = profile.acceleration(t) or profile.acceleration(t + 1e-6)
        return ACCELERATING if change * profile.direction(t) > 0 else DECELERATING

    def place_of(self, count: float, t: float) -> float:
        """The place of a count of the counter, on the lap of 32 bits where the counter is now."""
        counter = self.counter(t)
        laps = round((counter - wrapped(counter)) / (2 * INT32)) * 2 * INT32
        return count + laps - self._offset

    def whole(self, place: float) -> float:
        """The nearest place of a whole count."""
        return round(place + self._offset) - self._offset

    def to_place(self, place: float, t: float, pace: MotionPace) -> Profile:
        """Plan a motion to a place, from rest or on the fly."""
        if self.profile.velocity(t):
            return self.to_place_on_the_fly(place, t, pace)
        return planned(t, self.profile.position(t), place, pace)

    def to_place_on_the_fly(self, place: float, t: float, pace: MotionPace) -> Profile:
        """Plan the rest of a motion to another place, or at another pace."""
        return move(t, self.profile.position(t), self.profile.velocity(t), place, pace)

    def to_speed(self, velocity: float, t: float, pace: MotionPace) -> Profile:
        """Plan a motion to a velocity; 0 stops."""
        return slew(t, self.profile.position(t), self.profile.velocity(t), velocity, pace)

    def begin(self, doing: Doing, profile: Profile, t: float, pace: MotionPace) -> None:
        self.on_change(t)
        self.doing, self.pace = doing, pace
        self._follow(profile, t)

    def rest(self, t: float) -> None:
        """Stop at once, on a whole count."""
        place = self.whole(self.profile.position(t))
        self.on_change(t)
        self.doing = Doing.NOTHING
        self._follow(halt(t, place), t)

    def _follow(self, profile: Profile, t: float) -> None:
        snap = profile.position(t) - self.profile.position(t)
        self.profile = profile
        self.rotor.follow(profile, t, snap)
