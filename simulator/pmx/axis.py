"""One axis of a simulated PMX-2ED-SA: its counters, its switches and latched limits, and its time.

Theory of operation. The motion is in `pulses`; what it is for is a word (`Doing`). A motion ends at its profile's end,
at a limit, or by a stop. Nothing happens between `events`: `live(t)` looks at all that can have happened by a time.
`motions` has the commands that begin and change motions. Speeds are pulses/s, times s.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.kinematics.profile import Profile
from multidrop.simulator.pmx.homing import Homing
from multidrop.simulator.pmx.pulses import Pulses
from multidrop.simulator.pmx.rotor import Rotor
from multidrop.simulator.pmx.settings import Refusal, Settings, wrapped
from multidrop.simulator.pmx.states import HOME, INDEX, MINUS, MINUS_ERROR, PLUS, PLUS_ERROR, Doing, Pace
from multidrop.simulator.pmx.stepnloop import Loop
from multidrop.simulator.world import World

POLARITY_DIRECTION, POLARITY_HOME, POLARITY_LIMIT, POLARITY_INDEX = 1 << 1, 1 << 5, 1 << 6, 1 << 7
POLARITY_DECODING, POLARITY_ENABLE = 8, 1 << 12
LATE = 1e-9
"""Seconds that are no time: less than rounding makes."""


class Axis:
    """X or Y. Raises Refusal for what it does not take."""

    def __init__(self, name: str, settings: Settings, world: World, spec: WorldSpec) -> None:
        self.name = name
        self.settings = settings
        self.rotor = Rotor(world, spec)
        self.pulses = Pulses(self.rotor)
        self.latched = 0
        self.goal = 0
        self.homing: Homing | None = None
        self.loop = Loop(self)
        self.pulses.on_change = self.loop.rebase

    def __getitem__(self, register: str) -> int:
        """The axis's own register."""
        return self.settings[register + self.name]

    # -- what can be read -----------------------------------------------------------------------------------------

    @property
    def doing(self) -> Doing:
        """What its motor is doing."""
        return self.pulses.doing

    @property
    def homing_word(self) -> str:
        """The ASCII word of the homing routine at work; empty if there is none."""
        return self.homing.word if self.homing else ""

    @property
    def trouble(self) -> int:
        """The latched limit errors that count: none with IERR=1."""
        return 0 if self.settings["IERR"] else self.latched

    def position(self, t: float) -> int:
        """`PX`: the pulse counter, or with StepNLoop the target of this moment in encoder counts."""
        return wrapped(self.loop.target(t) if self.loop.on else self.pulses.counter(t))

    def encoder(self, t: float) -> int:
        """`EX`."""
        return wrapped(self.rotor.encoder(t))

    def speed(self, t: float) -> int:
        """`PSX` (7.2): pulses/s, or counts/s with StepNLoop except for a line."""
        scale = self.loop.ratio if self.loop.on and self.doing is not Doing.LINE else 1.0
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

    # -- what can be set ------------------------------------------------------------------------------------------

    def set_position(self, value: int, t: float) -> None:
        """`PX=`: set the counter at rest. With StepNLoop it follows the encoder and cannot be set (8.1.2)."""
        if self.pulses.moving(t):
            raise Refusal("?Moving")
        if self.loop.on:
            raise Refusal
        self.pulses.set_counter(value, t)

    def set_encoder(self, value: int, t: float) -> None:
        """`EX=`: set the counter at rest; with StepNLoop the target moves along."""
        if self.pulses.moving(t):
            raise Refusal("?Moving")
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

    # -- motions --------------------------------------------------------------------------------------------------

    def start(self, doing: Doing, profile: Profile, t: float, pace: Pace) -> None:
        """Begin a motion and deal at once with what it meets at once."""
        self.pulses.begin(doing, profile, t, pace)
        self.live(t)

    def stop(self, t: float) -> None:
        """Decelerate to rest."""
        self.homing = None
        if self.pulses.moving(t) and self.doing is not Doing.STOPPING:
            pace = self.pulses.pace
            self.start(Doing.STOPPING, self.pulses.to_speed(0.0, t, pace), t, pace)

    def abort(self, t: float) -> None:
        """Stop at once, and stay: StepNLoop has nothing to correct then."""
        self.homing = None
        stopped = self.pulses.moving(t)
        self.pulses.rest(t)
        if stopped:
            self.loop.stay(t)

    def end_homing(self) -> None:
        """End the homing routine at work."""
        self.homing = None

    # -- time -----------------------------------------------------------------------------------------------------

    def events(self, after: float) -> Iterator[float]:
        """Yield the times of its next events."""
        yield from self.rotor.events(after)
        if self.pulses.moving(after):
            yield self.pulses.profile.end
            yield self.loop.alarm(after)
        if self.homing:
            yield self.homing.due(after)

    def next_event(self, after: float) -> float:
        """The time of its next event; infinite: none."""
        return min((at for at in self.events(after) if at > after), default=inf)

    def live(self, t: float) -> None:
        """See what has happened by `t`, and what follows from it at once."""
        for _ in range(8):
            before = self.pulses.profile
            self.rotor.settle(t)
            self._meet_limits(t)
            if self.doing is not Doing.NOTHING and self.homing is None and self.pulses.profile.end <= t + LATE:
                self._end(t)
            self.loop.watch(t)
            if self.homing:
                self.homing.live(t)
                self.homing = None if self.homing.done else self.homing
            if self.pulses.profile is before:
                return

    def _end(self, t: float) -> None:
        """End a motion: the target is what it was for, or where it was stopped."""
        done = self.doing
        self.pulses.rest(t)
        if done is Doing.STOPPING:
            self.loop.stay(t)
        elif done in (Doing.MOVE, Doing.LINE) and self.loop.on:
            self.loop.rebase(t, target=self.goal)

    def _meet_limits(self, t: float) -> None:
        if not self.pulses.moving(t):
            return
        _, plus, minus = self.switches(t)
        direction = self.pulses.profile.direction(t)
        if not (plus and direction > 0 or minus and direction < 0):
            return
        if self.homing and self.homing.wants_limit(direction):
            return
        self.homing = None
        self.pulses.rest(t)
        if not self.settings["IERR"]:
            self.latched |= PLUS_ERROR if direction > 0 else MINUS_ERROR
