"""The shaft of one axis of a PMX, and what the encoder counts.

Pulses turn the shaft by 1, by -1 where the direction's polarity is turned, by less where the motor slips. Positions are
physical motor steps from power-up.
"""

from __future__ import annotations

from math import ceil, floor, inf

from multidrop.simulator.cell.spec import WorldSpec
from multidrop.simulator.shaft import TOUCH, Shaft
from multidrop.simulator.world import World

TURN = 1600.0
"""Motor steps from one index mark to the next: a motor of 1.8 degrees at an eighth of a step (manual 5.1)."""


class Rotor(Shaft):
    """A shaft with an encoder and an index."""

    def __init__(self, world: World, spec: WorldSpec) -> None:
        super().__init__(world)
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

    def at_index(self, t: float) -> bool:
        """Whether the shaft is within half a step of an index mark."""
        place = (self.position(t) - self._index) % TURN
        return min(place, TURN - place) <= 0.5

    def next_index(self, after: float) -> float:
        """The time at which the next index mark is passed; infinite: never."""
        direction = self.path.direction(after)
        if not self.path.moving(after) or not direction:
            return inf
        turns = (self.position(after) - self._index) / TURN
        mark = self._index + TURN * (floor(turns + TOUCH) + 1 if direction > 0 else ceil(turns - TOUCH) - 1)
        found = self.path.crossing(mark - self.offset, after)
        return inf if found is None else found
