"""One axis of a simulated PMX-2ED-SA: its counters, what its motor is doing, limits, and changes on the fly.

Theory of operation. `profile` is the motion in pulses, counted from power-up; the position counter is that plus an
offset, so setting it moves nothing. What the motor does is a word (`Doing`); a motion ends at its profile's end, at a
limit, or by a stop. Nothing happens between `events`: `live(t)` looks at all that can have happened by a time.
Speeds are pulses/s, times s.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from math import inf
from typing import NamedTuple

from simulator.cell.spec import WorldSpec
from simulator.kinematics.profile import Profile, Shape, halt, move, slew
from simulator.kinematics.segments import LINEAR, TRIANGLE
from simulator.pmx.homing import Homing, Routine
from simulator.pmx.rotor import Rotor
from simulator.pmx.settings import INT32, WINDOWS, Refusal, Settings, rate, window, wrapped
from simulator.pmx.stepnloop import Loop
from simulator.world import World

ACCELERATING, DECELERATING, CONSTANT = 1, 2, 4
PLUS, MINUS, HOME = 16, 32, 64
PLUS_ERROR, MINUS_ERROR, INDEX, JOYSTICK, TIMED_OUT = 128, 256, 512, 1024, 2048
"""Bits of the motor status (table 7.2)."""
POLARITY_DIRECTION, POLARITY_HOME, POLARITY_LIMIT, POLARITY_INDEX = 1 << 1, 1 << 5, 1 << 6, 1 << 7
POLARITY_DECODING, POLARITY_ENABLE = 8, 1 << 12
LATE = 1e-9
"""Seconds that are no time: less than rounding makes."""


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


class Pace(NamedTuple):
    """How a motion is to run: low and high speed, pulses/s, and both rates, pulses/s2."""

    low: float
    high: float
    up: float
    down: float
    shape: Shape = Shape()


def planned(t: float, here: float, place: float, pace: Pace) -> Profile:
    """From standing to a place; where the ramps do not each fit into half of it, the first serves twice (A.2)."""
    longest = (pace.high**2 - pace.low**2) / (2 * min(pace.up, pace.down))
    down = pace.up if longest > abs(place - here) / 2 else pace.down
    shape = pace.shape
    return move(t, here, 0.0, place, vi=pace.low, vm=pace.high, a=pace.up, d=down, up=shape, down=shape)


class Axis:
    """X or Y. Raises Refusal for what it does not take."""

    def __init__(self, name: str, settings: Settings, world: World, spec: WorldSpec) -> None:
        self.name = name
        self.settings = settings
        self.rotor = Rotor(world, spec)
        self.doing = Doing.NOTHING
        self.profile: Profile = halt(0.0, 0.0)
        self.pace = Pace(1.0, 1.0, 1.0, 1.0)
        self.latched = 0
        self.goal = 0
        self.loop = Loop(self)
        self.homing: Homing | None = None
        self._offset = 0.0

    def __getitem__(self, register: str) -> int:
        """The axis's own register."""
        return self.settings[register + self.name]

    # -- what can be read -----------------------------------------------------------------------------------------

    def moving(self, t: float) -> bool:
        """Whether pulses are being made."""
        return self.profile.moving(t)

    def pulses(self, t: float) -> float:
        """The pulse counter, with fractions while it moves."""
        return self.profile.position(t) + self._offset

    def position(self, t: float) -> int:
        """What `PX` answers: the pulse counter, or with StepNLoop the target of this moment in encoder counts."""
        return wrapped(self.loop.target(t) if self.loop.on else self.pulses(t))

    def encoder(self, t: float) -> int:
        """What `EX` answers."""
        return wrapped(self.rotor.encoder(t))

    def speed(self, t: float) -> int:
        """What `PSX` answers (7.2): pulses/s, or counts/s with StepNLoop but for a line."""
        scale = self.loop.ratio if self.loop.on and self.doing is not Doing.LINE else 1.0
        return round(abs(self.profile.velocity(t)) / scale)

    def status(self, t: float) -> int:
        """The motor status but for the joystick and the time-out (table 7.2)."""
        home, plus, minus = self.switches(t)
        index = self.rotor.at_index(t) != bool(self["POL"] & POLARITY_INDEX)
        bits = self._motion_bits(t) | self.latched
        return bits | plus * PLUS | minus * MINUS | home * HOME | index * INDEX

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, limit plus, limit minus: which are active, as the polarity has it."""
        home, plus, minus = self.rotor.switches(t)
        normal, limits = bool(self["POL"] & POLARITY_HOME), bool(self["POL"] & POLARITY_LIMIT)
        return home != normal, plus != limits, minus != limits

    def _motion_bits(self, t: float) -> int:
        if not self.moving(t):
            return 0
        if not self.profile.changing(t):
            return CONSTANT
        change = self.profile.acceleration(t) or self.profile.acceleration(t + 1e-6)
        return ACCELERATING if change * self.profile.way(t) > 0 else DECELERATING

    @property
    def trouble(self) -> int:
        """The latched limit errors that count: none with IERR=1."""
        return 0 if self.settings["IERR"] else self.latched

    # -- what can be set ------------------------------------------------------------------------------------------

    def set_position(self, value: int, t: float) -> None:
        """`PX=`: the counter, while it stands; with StepNLoop it follows the encoder and cannot be set (8.1.2)."""
        if self.moving(t):
            raise Refusal("?Moving")
        if self.loop.on:
            raise Refusal
        self._offset = value - self.profile.position(t)

    def set_encoder(self, value: int, t: float) -> None:
        """`EX=`: the counter, while it stands; with StepNLoop the target goes with it."""
        if self.moving(t):
            raise Refusal("?Moving")
        self.loop.shift(value - self.rotor.encoder(t))
        self.rotor.set_encoder(value, t)

    def zero(self, t: float) -> None:
        """Both counters are 0 here, in the middle of a motion too."""
        self._offset = -self.profile.position(t)
        self.rotor.set_encoder(0, t)
        self.loop.rebase(t, target=0.0)

    def polarize(self, t: float, enabled: bool) -> None:
        """Take over the polarity and whether the driver has current."""
        polarity = self["POL"]
        self.rotor.turned = bool(polarity & POLARITY_DIRECTION)
        times = {0: 1, 1: 2, 2: 4}.get(polarity >> POLARITY_DECODING & 3, 4)
        if times != self.rotor.decoding:
            self.rotor.set_decoding(times, t)
        self.rotor.current = enabled != bool(polarity & POLARITY_ENABLE)

    def power_up(self, t: float) -> None:
        """Counters at 0, nothing latched, standing."""
        self.abort(t)
        self.latched = 0
        self.loop.enable(False, t)
        self.polarize(t, False)
        self.zero(t)
        self.loop.enable(bool(self["SL"]), t)

    def clear(self, t: float) -> None:
        """`CLR`: latched limits and StepNLoop's errors."""
        self.latched = 0
        self.loop.clear(t)

    # -- motions --------------------------------------------------------------------------------------------------

    def usual_pace(self, strict: bool = True) -> Pace:
        """The pace of this axis alone: its own speeds, or the global ones where those are 0 (7.1)."""
        low, high = (self.settings.of(name, self.name) for name in ("LSPD", "HSPD"))
        acc, dec = (self.settings.of(name, self.name) for name in ("ACC", "DEC"))
        return self.paced(low, high, acc, dec, self.loop.ratio if self.loop.on else 1.0, strict)

    def paced(self, low: float, high: float, acc: int, dec: int, scale: float = 1.0, strict: bool = True) -> Pace:
        """A pace of speeds in units of `scale` pulses/s. Raises Refusal for a low speed that does not fit."""
        low, high = min(low, inf if strict else high) * scale, high * scale
        if strict and (low > high or low < min(window(high).slowest, high)):
            raise Refusal("?Low speed out of range")
        up = rate(low, high, acc)
        down = rate(low, high, dec) if self.settings["EDEC"] else up
        return Pace(low, high, up, down, Shape(TRIANGLE if self["SCV"] else LINEAR))

    def check(self, t: float) -> None:
        """Whether a motion may begin. Raises Refusal."""
        if self.moving(t) or self.homing:
            raise Refusal("?Moving")
        if self.loop.error:
            raise Refusal("?Clear SNL Error")
        if self.trouble:
            raise Refusal("?Clear SNL Error" if self.loop.on else "")

    def go(self, target: int, t: float) -> None:
        """To a position of the counter (counts with StepNLoop)."""
        self.check(t)
        pace = self.usual_pace()
        self.loop.attempts, self.goal = 0, target
        self.start(Doing.MOVE, self.trapezoid(self.aim(target, t), t, pace), t, pace)

    def jog(self, way: float, t: float) -> None:
        """On and on."""
        self.check(t)
        pace = self.usual_pace()
        self.loop.attempts = 0
        self.start(Doing.JOG, self.slewing(way * pace.high, t, pace), t, pace)

    def home(self, routine: Routine, way: float, t: float) -> None:
        """One of the homing routines (7.10)."""
        self.check(t)
        pace = self.usual_pace()
        self.loop.attempts = 0
        self.homing = Homing(self, routine, way, pace)
        self.homing.begin(t)
        self.live(t)

    def retarget(self, target: int, t: float) -> None:
        """`TX`: another target on the fly, for a move of this axis alone."""
        if self.doing is not Doing.MOVE or not self.moving(t):
            raise Refusal("?ABS/INC is not in operation")
        self.goal = target
        self.start(Doing.MOVE, self._moved(self.aim(target, t), t, self.pace), t, self.pace)

    def check_respeed(self, speed: int) -> None:
        """Whether `SSPDX=` may be. Raises Refusal."""
        if self.doing is Doing.LINE:
            raise Refusal("?ICommandOn")
        if self["SCV"]:
            raise Refusal("?S-curve on")
        mode = self["SSPDM"]
        if not mode:
            raise Refusal("?SSPD Mode not Initialized")
        pulses = speed * (self.loop.ratio if self.loop.on else 1.0)
        limits = WINDOWS[mode - 1]
        if not max(limits.low, 1) <= pulses <= limits.high:
            raise Refusal("?Speed out of range")

    def respeed(self, speed: int, t: float) -> None:
        """`SSPDX=`: another speed on the fly, for a move or a jog; nothing where neither is going on."""
        self.check_respeed(speed)
        if not self.moving(t) or self.doing not in (Doing.MOVE, Doing.JOG):
            return
        pulses = speed * (self.loop.ratio if self.loop.on else 1.0)
        pace = self.pace._replace(high=pulses, low=min(self.pace.low, pulses))
        if self.doing is Doing.JOG:
            self.start(Doing.JOG, self.slewing(self.profile.way(t) * pulses, t, pace), t, pace)
        else:
            self.start(Doing.MOVE, self._moved(self.profile.target, t, pace), t, pace)

    def stop(self, t: float) -> None:
        """Slow down and stand."""
        self.homing = None
        if self.moving(t) and self.doing is not Doing.STOPPING:
            self.start(Doing.STOPPING, self.slewing(0.0, t, self.pace), t, self.pace)

    def abort(self, t: float) -> None:
        """Stand at once, and stay: StepNLoop has nothing to fetch up then."""
        self.homing = None
        stopped = self.moving(t)
        self.rest(t)
        if stopped:
            self.loop.stay(t)

    # -- profiles -------------------------------------------------------------------------------------------------

    def aim(self, target: float, t: float) -> float:
        """Where a target of the counter lies in pulses from power-up."""
        here = self.profile.position(t)
        if self.loop.on:
            return self._whole(here + (target - self.loop.target(t)) * self.loop.ratio)
        laps = round((self.pulses(t) - self.position(t)) / (2 * INT32)) * 2 * INT32
        return target + laps - self._offset

    def trapezoid(self, place: float, t: float, pace: Pace) -> Profile:
        """To a place, from standing or on the fly."""
        if self.profile.velocity(t):
            return self._moved(place, t, pace)
        return planned(t, self.profile.position(t), place, pace)

    def _moved(self, place: float, t: float, pace: Pace) -> Profile:
        here, now = self.profile.position(t), self.profile.velocity(t)
        a, d, shape = pace.up, pace.down, pace.shape
        return move(t, here, now, place, vi=pace.low, vm=pace.high, a=a, d=d, up=shape, down=shape)

    def slewing(self, velocity: float, t: float, pace: Pace) -> Profile:
        """To a speed, or (0) to a stop."""
        here, now = self.profile.position(t), self.profile.velocity(t)
        return slew(t, here, now, velocity, vi=pace.low, a=pace.up, d=pace.down, up=pace.shape, down=pace.shape)

    def start(self, doing: Doing, profile: Profile, t: float, pace: Pace) -> None:
        """Begin a motion and deal at once with what it meets at once."""
        self.begin(doing, profile, t, pace)
        self.live(t)

    def begin(self, doing: Doing, profile: Profile, t: float, pace: Pace) -> None:
        """Begin a motion, in place of any other."""
        self.loop.rebase(t)
        self.doing, self.pace = doing, pace
        self._follow(profile, t)

    def rest(self, t: float) -> None:
        """Stand, on a whole pulse of the counter."""
        place = self._whole(self.profile.position(t))
        self.loop.rebase(t)
        self.doing = Doing.NOTHING
        self._follow(halt(t, place), t)

    def _whole(self, place: float) -> float:
        return round(place + self._offset) - self._offset

    def _follow(self, profile: Profile, t: float) -> None:
        snap = profile.position(t) - self.profile.position(t)
        self.profile = profile
        self.rotor.follow(profile, t, snap)

    # -- time -----------------------------------------------------------------------------------------------------

    def events(self, after: float) -> Iterator[float]:
        """When something happens by itself."""
        yield from self.rotor.events(after)
        if self.moving(after):
            yield self.profile.end
            yield self.loop.alarm(after)
        if self.homing:
            yield self.homing.due(after)

    def next_event(self, after: float) -> float:
        """The first of them; infinite: none."""
        return min((at for at in self.events(after) if at > after), default=inf)

    def live(self, t: float) -> None:
        """See what has happened by `t`, and what follows from it at once."""
        for _ in range(8):
            before = self.profile
            self.rotor.settle(t)
            self._meet_limits(t)
            if self.doing is not Doing.NOTHING and self.homing is None and self.profile.end <= t + LATE:
                self._end(t)
            self.loop.watch(t)
            if self.homing:
                self.homing.live(t)
            if self.profile is before:
                return

    def _end(self, t: float) -> None:
        """A motion has come to its end: what it was for is the target, or where it was stopped."""
        done = self.doing
        self.rest(t)
        if done is Doing.STOPPING:
            self.loop.stay(t)
        elif done in (Doing.MOVE, Doing.LINE) and self.loop.on:
            self.loop.rebase(t, target=self.goal)

    def _meet_limits(self, t: float) -> None:
        if not self.moving(t):
            return
        _, plus, minus = self.switches(t)
        way = self.profile.way(t)
        if not (plus and way > 0 or minus and way < 0):
            return
        if self.homing and self.homing.wants_limit(way):
            return
        self.homing = None
        self.rest(t)
        if not self.settings["IERR"]:
            self.latched |= PLUS_ERROR if way > 0 else MINUS_ERROR
