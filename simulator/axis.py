"""The motor of a simulated MCode drive: motion commands, counters, what holds a motion up.

Positions inside are motor steps since power-up, which is what the world calls physical; the counters are these plus an
offset, so that setting P moves nothing. Motion is a `motion.Profile` from the command to its end; with EE=1 targets
and speeds come in encoder counts and are turned into steps here. A motion that ends between two steps ends on the
nearest one. Manual 5.1.16, 5.1.17, 5.1.80 to 5.1.88, 5.1.117, 7.3.
"""

from __future__ import annotations

from math import floor, inf

from simulator.expressions import wrap
from simulator.faults import Fault
from simulator.memory import Memory
from simulator.motion import Profile, halt, move, slew
from simulator.world import World

FULL_STEPS = 200
COUNTS = 4000
"""Encoder counts a turn, of the LMD's own encoder."""

WRONG, TOO_FAST, BUSY, DISABLED, NO_SUPPLY = 21, 77, 85, 94, 96
PLUS_LIMIT, MINUS_LIMIT = 83, 84


class Axis:
    """One motor. `kind` is the command that moves or moved it, MA, MR or SL; `blocked` the directions (1, -1) in
    which a limit is active.
    """

    def __init__(self, memory: Memory, world: World) -> None:
        self.memory, self.world = memory, world
        self.profile: Profile = halt(0.0, 0.0)
        self.kind = ""
        self.supply = True
        self.blocked: set[int] = set()
        self.offsets = {"C1": 0, "C2": 0}
        self.announce = False
        self.arriving = False
        self.mark: float | None = None
        self._stopping = False
        self._counts_base = (0.0, 0.0)

    # What is read.

    def position(self, t: float) -> float:
        """Motor steps since power-up."""
        return self.profile.position(t)

    def counter(self, name: str, t: float) -> int:
        """C1 or C2."""
        return wrap(self._raw(name, t) + self.offsets[name])

    def set_counter(self, name: str, value: int, t: float) -> None:
        """Make a counter read `value` now."""
        self.offsets[name] += value - self.counter(name, t)

    def speed(self, t: float) -> int:
        """Signed velocity, steps/s; counts/s with EE=1."""
        return round(self.profile.velocity(t) / self.scale)

    def moving(self, t: float) -> bool:
        """Whether pulses are put out."""
        return self.profile.moving(t)

    def positioning(self, t: float) -> bool:
        """Whether MA or MR is under way, or in HT and MT after it."""
        delay = (self.memory.values["HT"] + self.memory.values["MT"]) / 1000
        return self.kind in ("MA", "MR") and self.profile.start <= t < self.profile.end + delay

    def changing(self, t: float) -> bool:
        """Whether it speeds up or slows down."""
        return self.profile.acceleration(t) != 0

    def settled_at(self) -> float:
        """When what H waits for is over: the motion, then MT. Infinite while nothing will end it."""
        return self.profile.end + self.memory.values["MT"] / 1000

    def at_index(self, t: float) -> bool:
        """Whether the encoder is at its index mark."""
        return floor(self._counts(t) + 0.5) % COUNTS == 0

    @property
    def source(self) -> str:
        """The counter that P is: C1, or C2 with EE=1."""
        return "C2" if self.memory.values.get("EE") else "C1"

    @property
    def scale(self) -> float:
        """Motor steps in the unit that commands are in."""
        return self.steps_per_count if self.memory.values.get("EE") else 1.0

    @property
    def steps_per_count(self) -> float:
        """Motor steps in one encoder count."""
        lines = self.memory.values.get("EL", COUNTS // 4)
        return self.memory.values["MS"] * FULL_STEPS / (lines * 4)

    def trip_position(self, value: float) -> float:
        """A value of P as steps since power-up."""
        return self._place(value - self.offsets[self.source])

    # What is commanded.

    def go(self, kind: str, value: int, t: float, announce: bool = False, run_on: bool = False) -> None:
        """MA or MR. `announce`: the name is sent when it is over; `run_on`: it does not stop there."""
        if not -0x80000000 <= value <= 0x7FFFFFFF:
            raise Fault(WRONG)
        way = value - self.counter(self.source, t) if kind == "MA" else value
        place = self._place(self._raw(self.source, t) + way)
        here = self.profile.position(t)
        self._ready(t, place - here)
        speeds = self._speeds()
        if run_on:
            top = (1 if place >= here else -1) * self.memory.values["VM"] * self.scale
            self._begin(kind, slew(t, here, self.profile.velocity(t), top, **speeds))
            self.mark = self.profile.crossing(place, t)
        else:
            top = self.memory.values["VM"] * self.scale
            self._begin(kind, move(t, here, self.profile.velocity(t), place, vm=top, **speeds))
        self.announce = announce

    def slew(self, value: int, t: float) -> None:
        """SL: turn at a velocity, or slow down and stop."""
        encoder = bool(self.memory.values.get("EE"))
        if abs(value) > (200_000 if encoder else 5_000_000):
            raise Fault(WRONG)
        if not encoder and abs(value) > self.memory.values["MS"] * 10_000:
            raise Fault(TOO_FAST)
        if value:
            self._ready(t, value)
        self.slow_to(value * self.scale, t, stopping=not value and self.kind in ("MA", "MR"))

    def slow_to(self, velocity: float, t: float, stopping: bool = False) -> None:
        """To a velocity, steps/s, with the ramps in force."""
        if not velocity and not self.profile.moving(t):
            return
        here, now = self.profile.position(t), self.profile.velocity(t)
        kind = "SL" if velocity or self.kind not in ("MA", "MR") else self.kind
        self._begin(kind, slew(t, here, now, velocity, **self._speeds()))
        self._stopping = stopping

    def stop(self, t: float) -> None:
        """Stand at once, without a ramp."""
        self.profile = halt(t, floor(self.profile.position(t) + 0.5))
        self.kind, self.announce, self.arriving, self.mark, self._stopping = "", False, False, None, False

    def arrive(self) -> bool:
        """The motion has ended: stand on a whole step. Gives whether the name is to be sent."""
        end = self.profile.end
        self.profile = halt(end, floor(self.profile.target + 0.5))
        announce, self.announce = self.announce, False
        self.arriving = self._stopping = False
        return announce

    def pass_mark(self) -> bool:
        """A motion that runs on has passed its target. Gives whether the name is to be sent."""
        announce, self.announce, self.mark, self.kind = self.announce, False, None, "SL"
        return announce

    def rescale(self, t: float, old: int, new: int) -> None:
        """MS has changed: the encoder goes on counting where it was."""
        steps, counts = self.profile.position(t) + self.world.pushed, self._counts(t)
        self._counts_base = (steps, counts)

    def restart(self, t: float) -> None:
        """Power-up or reset: it stands, and the counters begin anew."""
        self.stop(t)
        self.blocked.clear()
        for name in self.offsets:
            self.set_counter(name, 0, t)

    def target(self) -> tuple[str, float]:
        """What RS takes up again: the kind of motion and its target or its velocity, in steps."""
        if self.kind in ("MA", "MR") and self.profile.end < inf:
            return self.kind, self.profile.target
        return "SL", self.profile.segments[-1].velocity if self.profile.segments else 0.0

    def take_up(self, kind: str, value: float, t: float) -> None:
        """Go on with what was paused."""
        here, now = self.profile.position(t), self.profile.velocity(t)
        if kind == "SL":
            self.slow_to(value, t)
        else:
            top = self.memory.values["VM"] * self.scale
            self._begin(kind, move(t, here, now, value, vm=top, **self._speeds()))

    def _begin(self, kind: str, profile: Profile) -> None:
        self.kind, self.profile, self.mark = kind, profile, None
        self.arriving = profile.end < inf
        self._stopping = False
        if kind == "SL":
            self.announce = False

    def _ready(self, t: float, way: float) -> None:
        """Whether a motion may begin at all. Raises Fault."""
        if not self.memory.values["DE"]:
            raise Fault(DISABLED)
        if not self.supply:
            raise Fault(NO_SUPPLY)
        if self._stopping and self.profile.moving(t):
            raise Fault(BUSY)
        if way > 0 and 1 in self.blocked:
            raise Fault(PLUS_LIMIT)
        if way < 0 and -1 in self.blocked:
            raise Fault(MINUS_LIMIT)

    def _speeds(self) -> dict[str, float]:
        values, scale = self.memory.values, self.scale
        return {"vi": values["VI"] * scale, "a": values["A"] * scale, "d": values["D"] * scale}

    def _raw(self, name: str, t: float) -> int:
        """A counter without its offset."""
        return floor((self.profile.position(t) if name == "C1" else self._counts(t)) + 0.5)

    def _place(self, raw: float) -> float:
        """Steps since power-up at which the counter that P is would read `raw` without its offset."""
        if self.source == "C1":
            return raw
        steps, counts = self._counts_base
        return steps + (raw - counts) * self.steps_per_count - self.world.pushed

    def _counts(self, t: float) -> float:
        steps, counts = self._counts_base
        return counts + (self.profile.position(t) + self.world.pushed - steps) / self.steps_per_count
