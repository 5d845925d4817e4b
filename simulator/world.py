"""The physical surroundings of one axis: what is wired to its drive, the obstacles of its rotor, a shaft in them.

Positions are physical: motor steps from where the rotor was at power-up, independent of the drive's counters (setting P
moves nothing). The drive says where the rotor is; the world says which switches that closes, and what drives the
inputs. Times are those of the caller; the schedule begins at `powered_up`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import copysign, inf, nextafter

from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.kinematics import Profile, halt
from multidrop.simulator.torque import TOLERANCE, Torque

REVOLUTION = 51200.0
"""Motor steps of a turn: 200 full steps of 256 microsteps."""
TOUCH = 1e-6
"""Steps; less than this is rounding."""
AFTER = (0.0, 1e-12, 1e-9, 1e-6)
"""Seconds after which a switch that is passed is seen changed, whatever rounding does."""


class World:
    """The surroundings of one axis. Inputs are numbered from 1; level 1 is +V, 0 is ground, None is open.

    `home` are the edges of the home switch, `limit_plus` and `limit_minus` the positions of the limit switches;
    `stall_at` is where the rotor cannot pass. None: there is no such thing. `load` is a fraction of the motor's
    torque: from 1 on the rotor does not turn. `pushed` is the sum of all pushes.
    """

    def __init__(self, spec: WorldSpec) -> None:
        self.home = (-inf, spec.home) if isinstance(spec.home, float | int) else spec.home
        self.limit_plus = spec.limit_plus
        self.limit_minus = spec.limit_minus
        self.stall_at = spec.stall_at
        self.load = spec.load
        self.torque = Torque(spec)
        self.pushed = 0.0
        self._locks = spec.locked
        self._edges = self._find_edges()
        self._held = False
        self._schedule = sorted(
            [(at, n, level) for at, n, level in spec.inputs] + [(at, 0, counts) for at, counts in spec.analog],
            key=lambda change: change[0],
        )
        self._done = 0
        self._since = 0.0
        self._levels: dict[int, int] = {}
        self._by_hand: dict[int, int] = {}

    # Inputs and the analog input (number 0 in the schedule).

    def powered_up(self, now: float) -> None:
        """Start the schedule again from `now`. What `/sim` has set stays until the schedule changes it."""
        self._since, self._done = now, 0
        self._levels = dict(self._by_hand)
        self._catch_up(now)

    def level(self, n: int, now: float) -> int | None:
        """The level of input `n`: 1, 0, or None if it is open."""
        return self.driven(now).get(n) if n else None

    def driven(self, now: float) -> Mapping[int, int]:
        """The levels of the inputs that are not open, by number; number 0 is the analog input, in counts."""
        self._catch_up(now)
        return self._levels

    def analog(self, now: float) -> int:
        """Counts on the analog input; 0 until it is set."""
        return self.driven(now).get(0, 0)

    def next_change(self, now: float) -> float:
        """Time of the next scheduled change after `now`; infinite if there is none."""
        self._catch_up(now)
        return self._since + self._schedule[self._done][0] if self._done < len(self._schedule) else inf

    def set_input(self, n: int, level: int | None, now: float) -> None:
        """Set the level of input `n` from now on; None leaves it open. Number 0 is the analog input, in counts."""
        self._catch_up(now)
        for levels in (self._levels, self._by_hand):
            if level is None:
                levels.pop(n, None)
            else:
                levels[n] = level

    def _catch_up(self, now: float) -> None:
        while self._done < len(self._schedule) and self._since + self._schedule[self._done][0] <= now:
            _, n, level = self._schedule[self._done]
            self._levels[n] = level
            self._by_hand.pop(n, None)
            self._done += 1

    # The rotor.

    def push(self, steps: float, now: float) -> None:
        """Turn the rotor from outside; the drive reads `pushed` and sees it in its encoder."""
        self._catch_up(now)
        self.pushed += steps

    def learn(self, switch: str, place: float | None, way: float = 0.0) -> None:
        """Have `home`, `limit_plus` or `limit_minus` close here for a shaft that turns this way; None: have none."""
        if switch == "home":
            self.home = None if place is None else (place, inf) if way > 0 else (-inf, place)
        else:
            setattr(self, switch, place)
        self._edges = self._find_edges()

    def _find_edges(self) -> tuple[float, ...]:
        edges = (*(self.home or ()), self.limit_plus, self.limit_minus)
        return tuple(edge for edge in edges if edge is not None and abs(edge) < inf)

    def hold(self, held: bool) -> None:
        self._held = held

    def locked(self, now: float) -> bool:
        """Whether the rotor cannot turn: held by `/sim` or by the schedule, or loaded beyond the motor's torque."""
        if self._held or self.load >= 1:
            return True
        return bool(self._locks) and any(low <= now - self._since < high for low, high in self._locks)

    def next_lock(self, now: float) -> float:
        """The next time after `now` at which the schedule holds or releases the rotor; infinite: never."""
        if not self._locks:
            return inf
        times = (self._since + time for lock in self._locks for time in lock)
        return min((time for time in times if time > now), default=inf)

    def switches(self, position: float) -> tuple[bool, bool, bool]:
        """Home, limit plus, limit minus: which are closed.

        Home is closed between its edges, with a single edge below it; plus from `limit_plus` on, minus up to its edge.
        """
        home, plus, minus = self.home, self.limit_plus, self.limit_minus
        return (
            home is not None and home[0] <= position <= home[1],
            plus is not None and position >= plus,
            minus is not None and position <= minus,
        )

    def next_switch(self, profile: Profile, after: float, offset: float = 0.0) -> float:
        """Find the first time after `after` at which a switch differs from its state at `after`; infinite: never.

        At that time `switches` shows the change. `offset` makes the profile's positions physical.
        """
        return min((self._passing(profile, edge - offset, after, offset) for edge in self._edges), default=inf)

    def _passing(self, profile: Profile, mark: float, after: float, offset: float) -> float:
        """Find when passing one mark has changed a switch visibly."""
        t = profile.crossing(mark, after)
        before = self.switches(profile.position(after) + offset) if t < inf else None
        while t < inf:
            for jump in AFTER:
                if t + jump > after and self.switches(profile.position(t + jump) + offset) != before:
                    return t + jump
            t = profile.crossing(mark, max(t + 1e-6, nextafter(t, inf)))
        return inf


# A shaft that a motor without feedback turns: what the commanded steps move, and what the shaft runs into.
#
# The motor commands steps (a `Profile`); the shaft follows in proportion, or is at rest: without current, at a wall,
# held fast, or stalled until the command is at rest or turns back. Steps that it misses are lost, as nothing measures
# it. Each stretch is the command's own profile in another scale, so walls and switches are found by formulas. A new
# stretch begins where the profile or the scale changes.


class Shaft:
    """One shaft. The motor reports every new profile with `follow` and calls `settle` at events."""

    def __init__(self, world: World, turn: float = REVOLUTION) -> None:
        """`turn`: motor steps of a turn."""
        self.world = world
        self.powered = False
        self.current = 1.0
        """Of the full one. `settle` takes it in."""
        self._turn = turn
        self._stalled = 0.0
        """The direction in which a motion asked for more torque than there is; 0: it does not."""
        self.scale = 1.0
        """Motor steps that a commanded step turns while nothing holds the shaft; signed. `settle` takes it in."""
        self.factor = 0.0
        """Motor steps that a commanded step turns now; 0 while the shaft is at rest."""
        self.path = halt(0.0, 0.0)
        """The motion of the shaft, up to an offset."""
        self._command = self.path
        self.offset = 0.0
        """Motor steps between `path` and the position."""
        self._pushed = world.pushed
        self._wall = 0.0 if world.stall_at is None else copysign(1.0, world.stall_at)

    def position(self, t: float) -> float:
        """Physical motor steps."""
        return self.path.position(t) + self.offset

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, plus, minus: which switches are closed."""
        return self.world.switches(self.position(t))

    def follow(self, command: Profile, t: float, rounded: float = 0.0) -> None:
        """Follow another profile from now on. `rounded`: commanded steps by which it begins further on."""
        place = self.position(t) + self.factor * rounded
        self._stalled = self._stalled if self._command.moving(t) else 0.0
        self._command = command
        self._begin(self._coupling(place, t), place, t)
        if self.world.torque.limited:
            self.settle(t)

    def settle(self, t: float) -> None:
        """Take in what has changed at this time: pushes, walls, locks, current, scale."""
        place, wall, command = self.position(t) + self.world.pushed - self._pushed, self.world.stall_at, self._command
        if wall is not None and (wall - place) * self._wall < 0:
            place = wall
        if self._stalled and (not command.moving(t) or command.direction(t) != self._stalled):
            self._stalled = 0.0
        elif self.factor and not self._stalled and self._fails_at(t) <= t + TOLERANCE:
            self._stalled = command.direction(t)
        factor = self._coupling(place, t)
        if factor != self.factor or self.world.pushed != self._pushed:
            self._pushed = self.world.pushed
            self._begin(factor, place, t)

    def events(self, after: float) -> Iterator[float]:
        """Times at which a switch changes, or the shaft stops or continues by itself."""
        yield self.world.next_lock(after)
        if after >= self._command.end:
            return
        wall = self.world.stall_at
        if self._stalled:
            yield min(self._command.turning(-self._stalled, after), self._command.end)
        elif self.factor:
            yield self._fails_at(after)
        if self.factor:
            yield self.world.next_switch(self.path, after, self.offset)
        if wall is not None:
            if self.factor:
                yield self.path.crossing(wall - self.offset, after, self._wall)
            else:
                yield self._command.turning(-self._wall * self._sense, after)

    @property
    def _sense(self) -> float:
        return copysign(1.0, self.scale)

    def used(self, t: float) -> float:
        """The part of the motor's torque that the shaft needs; without a motor its load."""
        torque = self.world.torque
        return abs(torque.used(self.path, t, self.current, self._turn)) if torque.limited else self.world.load

    def _fails_at(self, after: float) -> float:
        return self.world.torque.fails_at(self.path, after, self.current, self._turn)

    def _coupling(self, place: float, t: float) -> float:
        """Motor steps that a commanded step turns at a place."""
        if not self.powered or self._stalled or self.world.locked(t):
            return 0.0
        stall_at = self.world.stall_at
        at_wall = stall_at is not None and (stall_at - place) * self._wall <= TOUCH
        pushing = self._command.moving(t) and self._command.direction(t) * self._sense == self._wall
        return 0.0 if at_wall and pushing else self.scale

    def _begin(self, factor: float, place: float, t: float) -> None:
        self.factor = factor
        self.path = self._command.scaled(factor) if factor else halt(t, 0.0)
        self.offset = place - self.path.position(t)
