"""The shaft of one axis of a PMX: what the pulses turn, its obstacles, and what the encoder counts.

Theory of operation. Pulses and shaft are proportional for a stretch of time: by 1, by -1 where the direction's polarity
is turned, by less where the motor slips, by 0 where it has no current, is held fast or is at an obstacle.
Each stretch is the profile of the pulses in another scale, so switches, index marks and stalls are found by formulas. A
new stretch begins where the profile or the factor changes. Positions are physical motor steps from power-up.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, copysign, floor, inf

from simulator.cell.spec import WorldSpec
from simulator.kinematics.profile import Profile, halt
from simulator.world import World

TURN = 1600.0
"""Motor steps from one index mark to the next: a motor of 1.8 degrees at an eighth of a step (manual 5.1)."""
_NEAR = 1e-6


class Rotor:
    """The position of the shaft. It follows every new profile, and is settled at events."""

    def __init__(self, world: World, spec: WorldSpec) -> None:
        self.world = world
        self.counts_a_step = spec.encoder
        self.turned = False
        self.current = False
        self.decoding = 1
        self._slip = spec.slip
        self._index = spec.index
        self._pulses: Profile = halt(0.0, 0.0)
        self._path: Profile = halt(0.0, 0.0)
        self._offset = 0.0
        self._encoder_offset = 0.0
        self._pushed = world.pushed
        self._wall = 0.0 if world.stall_at is None else copysign(1.0, world.stall_at)
        self.factor = 0.0

    def position(self, t: float) -> float:
        """Physical motor steps."""
        return self._path.position(t) + self._offset

    def encoder(self, t: float) -> float:
        """Encoder counts, with fractions."""
        return self.counts_a_step * self.decoding * self.position(t) + self._encoder_offset

    def set_encoder(self, counts: float, t: float) -> None:
        """Set the counter; nothing moves."""
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

    def switches(self, t: float) -> tuple[bool, bool, bool]:
        """Home, limit plus, limit minus: which are closed."""
        return self.world.switches(self.position(t))

    def at_index(self, t: float) -> bool:
        """Whether the shaft is within half a step of an index mark."""
        place = (self.position(t) - self._index) % TURN
        return min(place, TURN - place) <= 0.5

    def next_index(self, after: float) -> float:
        """The time at which the next index mark is passed; infinite: never."""
        direction = self._path.direction(after)
        if not self._path.moving(after) or not direction:
            return inf
        turns = (self.position(after) - self._index) / TURN
        mark = self._index + TURN * (floor(turns + _NEAR) + 1 if direction > 0 else ceil(turns - _NEAR) - 1)
        found = self._path.crossing(mark - self._offset, after)
        return inf if found is None else found

    def follow(self, pulses: Profile, t: float, snap: float = 0.0) -> None:
        """Follow new pulses; `snap` is by how much they were rounded to whole ones."""
        place = self.position(t) + self.factor * snap
        self._pulses = pulses
        self._begin(self._factor(pulses, place, t), place, t)

    def settle(self, t: float) -> None:
        """Apply what has changed at this time: pushes, obstacles, locks, current, polarity."""
        place = self._within(self.position(t) + self.world.pushed - self._pushed)
        factor = self._factor(self._pulses, place, t)
        if factor != self.factor or self.world.pushed != self._pushed:
            self._pushed = self.world.pushed
            self._begin(factor, place, t)

    def events(self, after: float) -> Iterator[float]:
        """Yield the times at which a switch changes, or the shaft stops or continues by itself."""
        world = self.world
        yield world.next_lock(after)
        if not self._pulses.moving(after) and self._pulses.start <= after:
            return
        switch = world.next_switch(self._path, after, self._offset) if self.factor else None
        if switch is not None:
            yield switch
        if world.stall_at is None:
            return
        if self.factor:
            stall = self._path.crossing(world.stall_at - self._offset, after, self._wall)
            if stall is not None:
                yield stall
        else:
            turning = self._pulses.turning(-self._wall * self._sense, after)
            if turning is not None:
                yield turning

    @property
    def _sense(self) -> float:
        return -1.0 if self.turned else 1.0

    def _factor(self, pulses: Profile, place: float, t: float) -> float:
        """The steps of one pulse now."""
        stall_at = self.world.stall_at
        if not self.current or self.world.locked(t):
            return 0.0
        if stall_at is not None and (stall_at - place) * self._wall <= _NEAR:
            direction = pulses.direction(t) if pulses.moving(t) else 0.0
            if direction * self._sense == self._wall:
                return 0.0
        return self._sense * (1 - self._slip)

    def _within(self, place: float) -> float:
        stall_at = self.world.stall_at
        if stall_at is None or (stall_at - place) * self._wall >= 0:
            return place
        return stall_at

    def _begin(self, factor: float, place: float, t: float) -> None:
        self.factor = factor
        self._path = self._pulses.scaled(factor) if factor else halt(t, 0.0)
        self._offset = place - self._path.position(t)
