"""One axis of a simulated PMX-2ED-SA: its counters, switches and latched limits, StepNLoop, homing, and its time.

The motion is in `pulses`; what it is for is a word (`Doing`). A motion ends at its profile's end, at a limit, or by a
stop. Nothing happens between events: `PmxAxis.live(t)` looks at all that can have happened by a time. `motions` has the
commands that begin and change motions. Speeds are pulses/s, times s.

StepNLoop (manual 7.17). With it the position counter is a target in encoder counts. It advances with the pulses by
`1 / SLR` a pulse, and not at all during a correction, whose pulses bring the shaft to the target. So the delta is
linear in the pulses while the rotor's factor is constant, and a formula gives the time at which it leaves the error
range. Counts are compared as whole numbers, as they are read.

Homing (manual 7.10). A routine is a generator: it starts a motion and yields what it waits for; it is resumed with the
time of that. A limit that it does not search ends it, as a stop does. A direction is 1 or -1.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from math import inf

from multidrop.families.pmx.simulator.pulses import (
    HOME,
    INDEX,
    MINUS,
    MINUS_ERROR,
    PLUS,
    PLUS_ERROR,
    STATES,
    Doing,
    LoopStatus,
    PmxRotor,
    Pulses,
    paced,
)
from multidrop.families.pmx.simulator.settings import SCALE, PmxRefusal, PmxSettings, wrapped
from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.kinematics import MotionPace, Profile
from multidrop.simulator.world import World

POLARITY_DIRECTION, POLARITY_HOME, POLARITY_LIMIT, POLARITY_INDEX = 1 << 1, 1 << 5, 1 << 6, 1 << 7
POLARITY_DECODING, POLARITY_ENABLE = 8, 1 << 12
TIME_TOLERANCE = 1e-9
"""Seconds that are no time: less than rounding makes."""


class PmxAxis:
    """X or Y. Raises PmxRefusal for what it does not take."""

    def __init__(self, name: str, settings: PmxSettings, world: World, spec: WorldSpec) -> None:
        self.name = name
        self.settings = settings
        self.rotor = PmxRotor(world, spec)
        self.pulses = Pulses(self.rotor)
        self.latched = 0
        self.goal = 0
        self.homing: PmxHoming | None = None
        self.loop = Loop(self)
        self.pulses.on_change = self.loop.rebase

    def __getitem__(self, register: str) -> int:
        return self.settings[register + self.name]

    @property
    def trouble(self) -> int:
        """The latched limit errors that count: none with IERR=1."""
        return 0 if self.settings["IERR"] else self.latched

    @property
    def unit(self) -> float:
        """Pulses for a unit of position or speed: with StepNLoop units are encoder counts."""
        return self.loop.ratio if self.loop.on else 1.0

    def own_pace(self, *, strict: bool = True) -> MotionPace:
        """Work out its pace alone: its own speeds, or the global ones where those are 0 (7.1).

        Raises PmxRefusal for a low speed that does not fit, as for `paced`.
        """
        low, high, up, down = (self.settings.of(name, self.name) for name in ("LSPD", "HSPD", "ACC", "DEC"))
        return paced(self.settings, self.name, (low * self.unit, high * self.unit), (up, down), strict=strict)

    def position(self, t: float) -> int:
        """`PX`: the pulse counter, or with StepNLoop the target of this moment in encoder counts."""
        return wrapped(self.loop.target(t) if self.loop.on else self.pulses.counter(t))

    def speed(self, t: float) -> int:
        """`PSX` (7.2): pulses/s, or counts/s with StepNLoop except for a line."""
        scale = 1.0 if self.pulses.doing is Doing.LINE else self.unit
        return round(abs(self.pulses.profile.velocity(t)) / scale)

    def status(self, t: float) -> int:
        """The motor status without joystick and time-out (table 7.2)."""
        home, plus, minus = self.switches(t)
        index = self.rotor.at_index(t) != bool(self["POL"] & POLARITY_INDEX)
        bits = self.pulses.status(t) | self.latched
        return bits | plus * PLUS | minus * MINUS | home * HOME | index * INDEX

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, limit plus, limit minus: which are active, with the polarity applied."""
        home, plus, minus = self.rotor.switches(t)
        normal, limits = bool(self["POL"] & POLARITY_HOME), bool(self["POL"] & POLARITY_LIMIT)
        return home != normal, plus != limits, minus != limits

    def set_position(self, value: int, t: float) -> None:
        """`PX=`: set the counter at rest. With StepNLoop it follows the encoder and cannot be set (8.1.2)."""
        if self.pulses.profile.moving(t):
            raise PmxRefusal("?Moving")
        if self.loop.on:
            raise PmxRefusal
        self.pulses.set_counter(value, t)

    def set_encoder(self, value: int, t: float) -> None:
        """`EX=`: set the counter at rest; with StepNLoop the target moves along."""
        if self.pulses.profile.moving(t):
            raise PmxRefusal("?Moving")
        self.loop.shift(value - self.rotor.encoder(t))
        self.rotor.set_encoder(value, t)

    def zero(self, t: float) -> None:
        """Set both counters to 0, during a motion too."""
        self.pulses.set_counter(0, t)
        self.rotor.set_encoder(0, t)
        self.loop.rebase(t, target=0.0)

    def polarize(self, t: float, enabled: bool) -> None:
        """Apply the polarity, and whether the driver is enabled."""
        polarity = self["POL"]
        self.rotor.turn(bool(polarity & POLARITY_DIRECTION))
        times = {0: 1, 1: 2, 2: 4}.get(polarity >> POLARITY_DECODING & 3, 4)
        if times != self.rotor.decoding:
            self.rotor.set_decoding(times, t)
        self.rotor.powered = enabled != bool(polarity & POLARITY_ENABLE)

    def power_up(self, t: float) -> None:
        """Begin at rest, with counters at 0 and nothing latched."""
        self.abort(t)
        self.latched = 0
        self.loop.enable(False, t)
        self.polarize(t, False)
        self.zero(t)
        self.loop.enable(bool(self["SL"]), t)

    def clear(self, t: float) -> None:
        """`CLR`: clear latched limits and StepNLoop's errors."""
        self.latched = 0
        self.loop.clear(t)

    def start(self, doing: Doing, profile: Profile, t: float, pace: MotionPace) -> None:
        """Begin a motion and deal at once with what it meets at once."""
        self.pulses.begin(doing, profile, t, pace)
        self.live(t)

    def home(self, word: str, direction: float, pace: MotionPace, t: float) -> None:
        self.homing = PmxHoming(self, word, direction, pace, t)
        self.live(t)

    def stop(self, t: float) -> None:
        self.homing = None
        pulses = self.pulses
        if pulses.profile.moving(t) and pulses.doing is not Doing.STOPPING:
            self.start(Doing.STOPPING, pulses.to_speed(0.0, t, pulses.pace), t, pulses.pace)

    def halt(self, t: float) -> None:
        self.homing = None
        self.pulses.rest(t)

    def abort(self, t: float) -> None:
        """Stop at once, and stay: StepNLoop has nothing to correct then."""
        stopped = self.pulses.profile.moving(t)
        self.halt(t)
        if stopped:
            self.loop.stay(t)

    def next_event(self, after: float) -> float:
        times = [*self.rotor.events(after)]
        if self.pulses.profile.moving(after):
            times += [self.pulses.profile.end, self.loop.alarm(after)]
        if self.homing:
            times.append(self.homing.due(after))
        return min((at for at in times if at > after), default=inf)

    def live(self, t: float) -> None:
        for _ in range(8):
            before = self.pulses.profile
            self.rotor.settle(t)
            if before.moving(t):
                self._meet_limits(before.direction(t), t)
            done = self.pulses.doing
            if done is not Doing.NOTHING and self.homing is None and self.pulses.profile.end <= t + TIME_TOLERANCE:
                self.pulses.rest(t)  # the target is what the motion was for, or where it was stopped
                if done is Doing.STOPPING:
                    self.loop.stay(t)
                elif done in (Doing.MOVE, Doing.LINE) and self.loop.on:
                    self.loop.rebase(t, target=self.goal)
            self.loop.watch(t)
            if self.homing:
                self.homing.live(t)
                self.homing = None if self.homing.done else self.homing
            if self.pulses.profile is before:
                return

    def _meet_limits(self, direction: float, t: float) -> None:
        _, plus, minus = self.switches(t)
        sought = self.homing and self.homing.awaited is Until.LIMIT and direction == self.homing.direction
        if sought or not (plus and direction > 0 or minus and direction < 0):
            return
        self.halt(t)
        if not self.settings["IERR"]:
            self.latched |= PLUS_ERROR if direction > 0 else MINUS_ERROR


_HALF, _NEAR = 0.5, 1e-6


class Loop:
    """StepNLoop of one axis. `error` is 0 or a status of table 7.9."""

    def __init__(self, axis: PmxAxis) -> None:
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
        return self._axis["SLR"] / SCALE

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
        return self._target + self._gain * (self._pulses.profile.position(t) - self._at)

    def delta(self, t: float) -> float:
        """`DX`: target less encoder; 0 while it is off."""
        return self.target(t) - self._pulses.rotor.encoder(t) if self.on else 0.0

    @property
    def status(self) -> int:
        """`SLS`."""
        if not self.on:
            return LoopStatus.OFF
        if self.error or self._axis.trouble:
            return self.error or LoopStatus.LIMIT_ERROR
        if self._axis.homing:
            return ROUTINES[self._axis.homing.word][1]
        return STATES[self._pulses.doing]

    def rebase(self, t: float, target: float | None = None) -> None:
        """Begin a new stretch here, before the motion changes; `target` replaces the target."""
        self._target = self.target(t) if target is None else target
        self._at = self._pulses.profile.position(t)

    def shift(self, counts: float) -> None:
        self._target += counts

    def clear(self, t: float) -> None:
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
        here, delta = self._pulses.profile.position(after), self.delta(after)
        edge = self._axis["SLE"] + _HALF + _NEAR
        return min(self._pulses.profile.crossing(here + (side - delta) / slope, after) for side in (edge, -edge))

    def watch(self, t: float) -> None:
        """Check the delta: stop on an error, correct the rest when the motor is at rest."""
        axis = self._axis
        if not self.on or self.error or axis.trouble:
            return
        delta = self.delta(t)
        if self._pulses.profile.moving(t):
            if abs(delta) >= axis["SLE"] + _HALF:
                self._fail(LoopStatus.STALL_ERROR, t)
        elif axis.homing or self._pulses.profile.end > t:
            return
        elif (off := abs(round(delta))) <= axis["SLT"]:
            self.attempts = 0
        elif off > axis["SLE"]:
            self._fail(LoopStatus.RANGE_ERROR, t)
        elif self.attempts >= axis["SLA"]:
            self._fail(LoopStatus.ATTEMPTS_ERROR, t)
        else:
            self.attempts += 1
            pulses, pace = self._pulses, axis.own_pace(strict=False)
            steps = round(delta * self.ratio) or (1 if delta > 0 else -1)
            pulses.begin(Doing.CORRECTING, pulses.to_place(pulses.profile.position(t) + steps, t, pace), t, pace)

    def _fail(self, error: int, t: float) -> None:
        self.error = error
        self._axis.halt(t)

    @property
    def _gain(self) -> float:
        """Counts by which the target advances with a pulse."""
        return 0.0 if self._pulses.doing is Doing.CORRECTING else 1 / self.ratio


class Until(Enum):
    """What a routine waits for."""

    HOME = "home"
    AWAY = "away"
    LIMIT = "limit"
    SLOW = "slow"
    INDEX = "index"
    END = "end"


Steps = Generator[Until, float, None]


class PmxHoming:
    """A routine at work on one axis. `direction` is that of the search, 1 or -1; `word` is its ASCII word."""

    def __init__(self, axis: PmxAxis, word: str, direction: float, pace: MotionPace, t: float) -> None:
        self._axis, self.word, self.direction, self.pace = axis, word, direction, pace
        self._pulses = axis.pulses
        self.done = False
        self._index_at = inf
        self._index_path: object = None
        self._now = t
        self._steps = self._run()
        self.awaited: Until | None = next(self._steps)

    def due(self, after: float) -> float:
        """The time of what is awaited, if that is neither a switch nor the end of a motion."""
        if self.awaited is Until.SLOW:
            return self._pulses.profile.segments[-1].start if self._pulses.profile.segments else inf
        if self.awaited is Until.INDEX:
            self._find_index(after)
            return self._index_at
        return inf

    def live(self, t: float) -> None:
        """Continue while what is awaited has come."""
        while self.awaited is not None and self._met(self.awaited, t):
            self._now, self._index_path = t, None
            try:
                self.awaited = self._steps.send(t)
            except StopIteration:
                self.awaited, self.done = None, True

    # The routines' words.

    def run(self, direction: float, speed: float) -> None:
        """Turn without an end, from low speed up to this speed."""
        self._start(self._pulses.to_speed(direction * speed, self._now, self.pace))

    def slow(self, on: bool = False) -> None:
        """Decelerate to low speed, and stop there or go on."""
        self._start(self._pulses.to_speed(self.direction * self.pace.vi if on else 0.0, self._now, self.pace))

    def go(self, place: float) -> None:
        self._start(self._pulses.to_place(place, self._now, self.pace))

    def stop(self) -> None:
        self._pulses.rest(self._now)

    def zero(self) -> None:
        self._axis.zero(self._now)

    def correction(self, register: str) -> float:
        """LCA or HCA, in pulses against the direction of the search."""
        return -self.direction * self._axis.settings.of(register, self._axis.name)

    @property
    def here(self) -> float:
        """The place now, pulses from power-up."""
        return self._pulses.profile.position(self._now)

    def _run(self) -> Steps:
        yield from ROUTINES[self.word][0](self)
        if self._axis.settings["RZ"] and self._pulses.counter(self._now):
            self.go(self.here - self._pulses.counter(self._now))
            yield Until.END
            self.stop()

    def _start(self, profile: Profile) -> None:
        self._pulses.begin(Doing.HOMING, profile, self._now, self.pace)

    def _find_index(self, t: float) -> None:
        path = (self._pulses.profile, self._pulses.rotor.factor)
        if self._index_path != path:
            self._index_path, self._index_at = path, self._pulses.rotor.next_index(t)

    def _met(self, awaited: Until, t: float) -> bool:
        home, plus, minus = self._axis.switches(t)
        profile = self._pulses.profile
        if awaited is Until.HOME:
            return home
        if awaited is Until.AWAY:
            return not home
        if awaited is Until.LIMIT:
            return plus if self.direction > 0 else minus
        if awaited is Until.SLOW:
            return not profile.segments or t >= profile.segments[-1].start
        if awaited is Until.INDEX:
            self._find_index(t)
            return t >= self._index_at
        return profile.end <= t + TIME_TOLERANCE


def home_input(homing: PmxHoming) -> Steps:
    """`H`: move at high speed to the home input; 0 is there, the motor stops a ramp beyond it (7.10.1)."""
    homing.run(homing.direction, homing.pace.vm)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stop()


def limit(homing: PmxHoming) -> Steps:
    """`L`: move at high speed to the limit, and back by LCA; 0 is there (7.10.2)."""
    homing.run(homing.direction, homing.pace.vm)
    yield Until.LIMIT
    homing.stop()
    homing.go(homing.here + homing.correction("LCA"))
    yield Until.END
    homing.stop()
    homing.zero()


def home_and_index(homing: PmxHoming) -> Steps:
    """`ZH`: move to the home input, and on at low speed to the next index mark, which is 0 (7.10.3)."""
    homing.run(homing.direction, homing.pace.vm)
    yield Until.HOME
    homing.slow(on=True)
    yield Until.SLOW
    yield Until.INDEX
    homing.stop()
    homing.zero()


def index(homing: PmxHoming) -> Steps:
    """`Z`: move at low speed to the next index mark, which is 0 (7.10.4)."""
    homing.run(homing.direction, homing.pace.vi)
    yield Until.INDEX
    homing.stop()
    homing.zero()


def home_twice(homing: PmxHoming) -> Steps:
    """`HL`: move to the home input, back past it by HCA, and at low speed to it again, which is 0 (7.10.5)."""
    homing.run(homing.direction, homing.pace.vm)
    yield Until.HOME
    homing.zero()
    homing.slow()
    yield Until.END
    homing.stop()
    homing.run(-homing.direction, homing.pace.vm)
    yield Until.AWAY
    homing.go(homing.here + homing.correction("HCA"))
    yield Until.END
    homing.stop()
    homing.run(homing.direction, homing.pace.vi)
    yield Until.HOME
    homing.zero()
    homing.stop()


ROUTINES: dict[str, tuple[Callable[[PmxHoming], Steps], LoopStatus]] = {
    "H": (home_input, LoopStatus.HOMING),
    "L": (limit, LoopStatus.LIMIT_HOMING),
    "ZH": (home_and_index, LoopStatus.Z_HOMING),
    "Z": (index, LoopStatus.Z_HOMING),
    "HL": (home_twice, LoopStatus.HOMING),
}
"""By the ASCII word: the routine, and what SLS is during it."""
