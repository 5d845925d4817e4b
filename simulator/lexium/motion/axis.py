"""The motor of a simulated MCode drive: motion commands, counters, what holds a motion up.

Positions inside are motor steps since power-up; the counters are these plus an offset, so that setting P moves nothing.
`profile` is what the drive commands (counter C1); where the rotor is, which the encoder sees (C2) and the world meets,
is the matter of `rotor`. With EE=1 targets and speeds come in encoder counts and are turned into steps here. A motion
that ends between two steps ends on the nearest one. What else has a hand in motion stands beside: `homing`, `encoder`
(EE=1), `hmt` (AS=1 to 3), `limits`, `heat`. Each tells when it next has something to do, and `next` gives the earliest.
Manual 5.1.16, 5.1.17, 5.1.80 to 5.1.88, 5.1.117, 7.3.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor, inf
from typing import TypedDict

from simulator.kinematics.profile import Profile, halt, move, slew
from simulator.kinematics.segments import LINEAR, Shape
from simulator.lexium.motion.backlash import Backlash
from simulator.lexium.motion.rotor import CATCHING, Rotor
from simulator.lexium.state.errors import Fault
from simulator.lexium.state.expressions import wrap
from simulator.lexium.state.memory import Memory
from simulator.world import World

TURNOVER = 2**32
"""From one end of a counter to the same again."""
STEEPEST = 1.1e9
"""The highest acceleration that a drive makes, steps/s2; an S-curve's peak may not be above it."""

WRONG, TOO_FAST, BUSY, CORRECTING, DISABLED, NO_SUPPLY = 21, 77, 85, 93, 94, 96
CALIBRATING, STEEP_UP, STEEP_DOWN = 88, 98, 99
PLUS_LIMIT, MINUS_LIMIT = 83, 84
MOVES, SLEW = ("MA", "MR"), "SL"
CORRECTION, HOMING, TORQUE = "correction", "homing", "torque"
"""Kinds of motion that no MA, MR or SL has asked for."""


class Ramps(TypedDict):
    """How the velocity changes: steps/s, steps/s2, and the shapes of both ramps."""

    vi: float
    a: float
    d: float
    up: Shape
    down: Shape


class Axis:
    """One motor. `kind` is what moves or moved it: MA, MR, SL, or one of the kinds above; `blocked` the directions
    (1, -1) in which a limit switch is active. `refuse` is asked before a motion begins: the code of what forbids it,
    or 0.
    """

    def __init__(self, memory: Memory, world: World) -> None:
        self.memory, self.world = memory, world
        self.profile: Profile = halt(0.0, 0.0)
        self.rotor = Rotor(memory.values, world)
        self.backlash = Backlash(memory.values)
        self.kind = ""
        self.supply = True
        self.blocked: set[int] = set()
        self.offsets = {"C1": 0, "C2": 0}
        self.announce = False
        self.arriving = False
        self.mark: float | None = None
        self.aligned = 0.0
        self.busy: Callable[[], bool] = lambda: False
        self.locked: Callable[[], bool] = lambda: False
        self.refuse: Callable[[float, float], int] = lambda t, way: 0
        self.begun: Callable[[], None] = lambda: None
        self._after = 0.0
        self._top = 0.0
        self._way = 1.0
        self._stopping = False
        self._counts_base = (0.0, 0.0)

    # What is read.

    def position(self, t: float) -> float:
        """Motor steps since power-up, as commanded."""
        return self.profile.position(t)

    def counter(self, name: str, t: float) -> int:
        """C1 or C2."""
        return wrap(self._raw(name, t) + self.offsets[name])

    def set_counter(self, name: str, value: int, t: float) -> None:
        """Make a counter read `value` now."""
        self.offsets[name] += value - self.counter(name, t)
        if name == self.source:
            self.backlash.forget()

    def speed(self, t: float) -> int:
        """Signed velocity as commanded, steps/s; counts/s with EE=1; 0 in torque mode."""
        return 0 if self.kind == TORQUE else round(self.profile.velocity(t) / self.scale)

    def rotor_speed(self, t: float) -> int:
        """AV: what the rotor does, steps/s; 0 without hMT."""
        return round(self.rotor.velocity(t)) if self.memory.values.get("AS") else 0

    def moving(self, t: float) -> bool:
        """Whether pulses are put out, or about to be; those of make-up are some too."""
        return self.commanded(t) or (self.rotor.state == CATCHING and t < self.rotor.caught_up_at()) or self.busy()

    def commanded(self, t: float) -> bool:
        """Whether a motion is under way, or is being worked out and about to begin."""
        return t < self.profile.end

    def heading(self, t: float) -> float:
        """The velocity, or where a motion that is about to begin will go: its sign is the direction."""
        profile = self.profile
        return profile.velocity(t) if t >= profile.start else profile.target - profile.origin

    def reported(self, t: float) -> bool:
        """MV: that, and on some products MT after it."""
        if self.moving(t):
            return True
        return self.memory.model.settles and self.kind != "" and t < self.settled_at()

    def positioning(self, t: float) -> bool:
        """Whether MA or MR is under way, or in what follows it: HT and MT, or MT alone."""
        values = self.memory.values
        delay = (values["MT"] if self.memory.model.settles else values["HT"] + values["MT"]) / 1000
        return self.kind in (*MOVES, CORRECTION) and self.profile.start <= t < self.over_at() + delay

    def changing(self, t: float) -> bool:
        """Whether it speeds up or slows down."""
        return self.profile.changing(t)

    def over_at(self) -> float:
        """When the pulses of the motion that is under way end; infinite while nothing will end it."""
        if self.busy() or self._after:
            return inf
        late = self.rotor.caught_up_at() if self.rotor.closed else -inf
        if late == inf and abs(self.rotor.lag(self.profile.end)) < self.bound:
            late = -inf
        return max(self.profile.end, late)

    def settled_at(self) -> float:
        """When what H waits for is over: the motion, then MT."""
        return self.over_at() + self.memory.values["MT"] / 1000

    def physical(self, t: float) -> float:
        """Where the rotor is for the world."""
        return self.rotor.physical(t)

    def next_switch(self, t: float) -> float:
        """When the world's home or limit switches next change because of the motion; infinite if they do not."""
        return self.rotor.next_switch(t)

    def at_index(self, t: float) -> bool:
        """Whether the encoder is at its index mark."""
        here = self.rotor.position(t)
        return self.rotor.index_ahead(here - self.steps_per_count / 2, 1) <= here + self.steps_per_count / 2

    def at_rest(self, t: float) -> bool:
        """Whether no motion is commanded."""
        return not self.commanded(t) and not self.busy()

    @property
    def source(self) -> str:
        """The counter that P is: C1, or C2 with EE=1 and no hMT."""
        return "C2" if self.memory.counting else "C1"

    @property
    def scale(self) -> float:
        """Motor steps in the unit that commands are in."""
        return self.steps_per_count if self.memory.counting else 1.0

    @property
    def steps_per_turn(self) -> float:
        """Motor steps in a turn."""
        return self.memory.values["MS"] * round(360 / self.memory.values.get("SA", 1.8))

    @property
    def steps_per_count(self) -> float:
        """Motor steps in one encoder count."""
        return self.steps_per_turn / (self.memory.values.get("EL", self.memory.model.encoder_lines) * 4)

    @property
    def bound(self) -> float:
        """CB: how far the rotor may be from the stator, steps (manual 5.1.18)."""
        return (1.1, 1.3, 1.5, 1.7)[int(self.memory.values.get("CB", 1))] * self.memory.values["MS"]

    # Where P is: for trips and limits.

    @property
    def path(self) -> tuple[Profile, float]:
        """The profile that P follows, and what is added to that."""
        return self.rotor.path if self.memory.counting else (self.profile, 0.0)

    def stepping(self, steps: int, t: float) -> float:
        """The first time from t on at which C1 reads so many steps, on either side of here; infinite: never."""
        raw = steps - self.offsets["C1"]
        raw += TURNOVER * floor((self._raw("C1", t) - raw) / TURNOVER)
        found = [self.profile.crossing(place, t) for place in (raw, raw + TURNOVER)] if self.profile.end > t else []
        return min((each for each in found if each is not None), default=inf)

    def place(self, t: float) -> float:
        """Where P is, in steps since power-up."""
        return self.rotor.position(t) if self.memory.counting else self.profile.position(t)

    def trip_position(self, value: float) -> float:
        """A value of P as steps since power-up."""
        return self._place(value - self.offsets[self.source])

    def readings(self, value: float, t: float) -> tuple[float, float]:
        """Where P reads a value on either side of here, as steps since power-up: it rolls over (manual 5.1.16)."""
        raw = value - self.offsets[self.source]
        raw += TURNOVER * floor((self._raw(self.source, t) - raw) / TURNOVER)
        return self._place(raw), self._place(raw + TURNOVER)

    def passing(self, place: float, t: float, way: float = 0.0) -> float:
        """The first time from t on at which P passes a place (in the direction of `way`, if given); infinite: never."""
        profile, shift = self.path
        if profile.end <= t:
            return inf
        found = profile.crossing(place - shift, t, way)
        return inf if found is None else found

    # What is commanded.

    def go(self, kind: str, value: int, t: float, announce: bool = False, run_on: bool = False) -> None:
        """MA or MR. `announce`: the name is sent when it is over; `run_on`: it does not stop there."""
        if not -0x80000000 <= value <= 0x7FFFFFFF:
            raise Fault(WRONG)
        way = value - self.counter(self.source, t) if kind == "MA" else value
        here, raw = self.profile.position(t), self._raw(self.source, t)
        self._ready(t, way)
        if self.kind == CORRECTION and self.commanded(t):
            raise Fault(CORRECTING)
        velocity, ramps = self.profile.velocity(t), self._ramps()
        if self.kind in (SLEW, HOMING, TORQUE):
            self.backlash.flank = int(self.way(t))
        first, after = self.backlash.plan(way, absolute=kind == "MA")
        if run_on:  # and does not turn back
            first, after = first + after, 0
        shift = self.stator_shift(t)
        place = self._place(raw + first) + shift
        self._after = self._place(raw + first + after) - self._place(raw + first) if after else 0.0
        top = self._top = self.memory.values["VM"] * self.scale
        begin = t if self.profile.moving(t) else t + self.memory.model.compute
        if run_on and (way or velocity):
            self.begin(kind, slew(begin, here, velocity, top if (way or velocity) > 0 else -top, **ramps), t)
            self.mark = self.profile.crossing(place, t)
        else:
            self.begin(kind, move(begin, here, velocity, place, vm=top, **ramps), t)
        self.announce = announce

    def slew(self, value: int, t: float) -> None:
        """SL: turn at a velocity, or slow down and stop."""
        encoder = self.memory.counting
        if abs(value) > (200_000 if encoder else 5_000_000):
            raise Fault(WRONG)
        fastest = self.memory.model.per_microstep
        if fastest and not encoder and abs(value) > self.memory.values["MS"] * fastest:
            raise Fault(TOO_FAST)
        if value:
            self._ready(t, value)
        self.slow_to(value * self.scale, t, stopping=not value and self.kind in MOVES)

    def slow_to(self, velocity: float, t: float, stopping: bool = False, kind: str = "") -> None:
        """To a velocity, steps/s, with the ramps in force. `kind`: what asks for it, if not SL."""
        if not velocity and t < self.profile.start:
            self.stop(t)
        if not velocity and not self.commanded(t):
            return
        here, now = self.profile.position(t), self.profile.velocity(t)
        default = "SL" if velocity or self.kind not in MOVES else self.kind
        self._after = 0.0
        self.begin(kind or default, slew(t, here, now, velocity, **self._ramps()), t)
        self._stopping, self.announce = stopping, False

    def creep(self, distance: float, t: float) -> None:
        """Go back to where the last motion should have ended: at VI, without ramps (PM)."""
        here, vi = self.profile.position(t), self.memory.values["VI"] * self.scale
        self.begin(CORRECTION, move(t, here, 0.0, here + distance, vi=vi, vm=vi, a=1.0, d=1.0), t)

    def switch(self, word: str, value: int, t: float) -> None:
        """EE or AS change, and with them perhaps the unit of everything."""
        if value == self.memory.values[word]:
            return
        self.rescale(t)
        unit = self.scale
        self.memory.switch(word, value)
        self.backlash.convert(unit / self.scale)
        self.orient(t)
        self.align(t)

    def align(self, t: float) -> None:
        """What the rotor should reach counts from where it is."""
        self.aligned = self.profile.position(t) - self.rotor.position(t)

    def step(self, steps: int, t: float) -> None:
        """Make a few steps at once, as a clock on the inputs asks for them (FL)."""
        if self.at_rest(t) and self.memory.values["DE"] and self.supply and not self.locked():
            self._way = 1.0 if steps > 0 else -1.0
            self.profile = halt(t, self.profile.position(t) + steps)
            self.rotor.hop(self.profile, t)

    def stop(self, t: float, way: int = 0) -> None:
        """Stand at once, without a ramp: on the nearest step, or on the next one in the direction of `way`."""
        here = self.profile.position(t)
        place = floor(here) + 1 if way > 0 else -floor(-here) - 1 if way < 0 else floor(here + 0.5)
        self._take(halt(t, place), t)
        self.kind, self.announce, self.arriving, self.mark, self._stopping = "", False, False, None, False
        self._after = 0.0

    def arrive(self, t: float) -> bool:
        """The motion has ended: stand on a whole step, or go on with what follows. Gives whether the name is sent."""
        self._take(halt(t, floor(self.profile.target + 0.5)), t)
        self.arriving = self._stopping = False
        if self._after:
            place, self._after = self.profile.position(t) + self._after, 0.0
            announce = self.announce
            self.begin(self.kind, move(t, self.profile.position(t), 0.0, place, vm=self._top, **self._ramps()), t)
            self.announce = announce
            return False
        announce, self.announce = self.announce, False
        return announce

    @property
    def way_back(self) -> float:
        """Steps that follow the motion that is under way (BM=1), 0 for none."""
        return self._after

    def forgo(self) -> None:
        """They may not be made: the motion ends before its target."""
        self._after, self.announce = 0.0, False

    def pass_mark(self) -> bool:
        """A motion that runs on has passed its target. Gives whether the name is to be sent."""
        announce, self.announce, self.mark, self.kind = self.announce, False, None, "SL"
        return announce

    def rescale(self, t: float) -> None:
        """Before MS, SA or EL change: the encoder goes on counting where it is."""
        self._counts_base = (self.rotor.position(t), self._counts(t))

    def orient(self, t: float) -> None:
        """After MS, SA or RD may have changed: the rotor stays where it is."""
        self.rotor.orient(t, self.steps_per_turn, bool(self.memory.values.get("RD")))

    def restart(self, t: float) -> None:
        """Power-up or reset: it stands, and the counters begin anew."""
        self.stop(t)
        self.rotor.let_go(t)
        self.aligned = self.rotor.slip
        self.blocked.clear()
        self.backlash = Backlash(self.memory.values)
        self.orient(t)
        self._counts_base = (self.rotor.position(t), 0.0)
        for name in self.offsets:
            self.set_counter(name, 0, t)

    def pause(self, t: float) -> Callable[[float], None]:
        """Slow down and stop; what is given goes on with the motion, and with the name that is to be sent."""
        target, kind, announce, after = self._target(), self.kind, self.announce, self._after
        place = None if self.mark is None else self.profile.position(self.mark)
        self.slow_to(0, t)
        if place is not None and (mark := self.profile.crossing(place, t)) is not None:
            self.mark, self.announce = mark, announce
            kind, announce, place = "SL", False, None
        else:
            self.announce = False

        def go_on(t: float) -> None:
            way = target[1] if target[0] == "SL" else target[1] - self.profile.position(t)
            if way:
                self._ready(t, way)
            self._take_up(*target, t)
            self._after = after
            if place is not None:
                self.kind, self.mark = kind, self.profile.crossing(place, t)
            self.announce = announce

        return go_on

    def _target(self) -> tuple[str, float]:
        """The kind of motion, and its target or its velocity in steps."""
        if self.profile.end == inf:
            return SLEW, self.profile.segments[-1].velocity
        return (SLEW, 0.0) if self.kind == SLEW else (self.kind, self.profile.target)

    def _take_up(self, kind: str, value: float, t: float) -> None:
        """Go on with what was paused."""
        here, now = self.profile.position(t), self.profile.velocity(t)
        if kind == SLEW:
            self.slow_to(value, t)
        elif kind == CORRECTION:
            self.creep(value - here, t)
        else:
            top = self.memory.values["VM"] * self.scale
            self.begin(kind, move(t, here, now, value, vm=top, **self._ramps()), t)

    def begin(self, kind: str, profile: Profile, t: float) -> None:
        """A motion takes the place of the one before."""
        self.kind, self.mark = kind, None
        self.arriving = profile.end < inf
        self._stopping = False
        self.begun()
        if not self.rotor.closed:
            self.align(t)
        self._take(profile, t)
        if kind not in MOVES:
            self.announce = False

    def way(self, t: float) -> float:
        """1 or -1, the direction of the last motion."""
        return self.profile.way(t) or self._way

    def _take(self, profile: Profile, t: float) -> None:
        self._way = self.way(t)
        self.profile = profile
        self.rotor.follow(profile, t)

    def stator_shift(self, t: float) -> float:
        """By how much the command is ahead of the counter that P is, steps."""
        return self.profile.position(t) - self.rotor.position(t) if self.source == "C2" else 0.0

    def check_drive(self) -> None:
        """Whether the bridges may turn the motor at all. Raises Fault (94, 96)."""
        if self.locked() or not (self.memory.values["DE"] or self.memory.model.disabled_moves):
            raise Fault(DISABLED)
        if not self.supply:
            raise Fault(NO_SUPPLY)

    def allow(self, t: float, way: float) -> None:
        """Whether the bridges may turn the motor that way. Raises Fault (83, 84, 94, 96)."""
        self.check_drive()
        code = self.refuse(t, way)
        if code:
            raise Fault(code)

    def _ready(self, t: float, way: float) -> None:
        """Whether a motion may begin at all. Raises Fault."""
        if self.busy() or (self._stopping and self.commanded(t)):
            raise Fault(BUSY)
        self.allow(t, way)
        self.check_ramps()

    def check_ramps(self) -> None:
        """Whether a motion may begin with the S-curves that are set. Raises Fault (98, 99) for too steep a middle."""
        for shape, rate, code in (("AT", "A", STEEP_UP), ("DT", "D", STEEP_DOWN)):
            if self._shape(shape, rate) is None:
                raise Fault(code)

    def _shape(self, kind: str, rate: str) -> Shape | None:
        """What AT and AJ, or DT and DJ, make of a ramp; None where its middle would be too steep."""
        values = self.memory.values
        shape = Shape(int(values.get(kind, LINEAR)), int(values.get(f"{rate}J", 0)))
        return None if shape.kind != LINEAR and values[rate] * self.scale * shape.peak > STEEPEST else shape

    def _ramps(self) -> Ramps:
        """VI, A and D in steps, and the shapes: straight where a curve would be too steep, as stops are not refused."""
        values, scale = self.memory.values, self.scale
        up, down = self._shape("AT", "A") or Shape(), self._shape("DT", "D") or Shape()
        return {"vi": values["VI"] * scale, "a": values["A"] * scale, "d": values["D"] * scale, "up": up, "down": down}

    def _raw(self, name: str, t: float) -> int:
        """A counter without its offset."""
        return floor((self.profile.position(t) if name == "C1" else self._counts(t)) + 0.5)

    def _place(self, raw: float) -> float:
        """Where the counter that P is would read `raw` without its offset: steps since power-up."""
        if self.source == "C1":
            return raw
        steps, counts = self._counts_base
        return steps + (raw - counts) * self.steps_per_count

    def _counts(self, t: float) -> float:
        steps, counts = self._counts_base
        return counts + (self.rotor.position(t) - steps) / self.steps_per_count
