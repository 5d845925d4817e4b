"""The presses of a jog key that move: one press is one bounded move, and only while the axis is known to rest.

A terminal sends no key-up, and repeats a held key. A reading that is newer than the last line says that the axis rests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from multidrop.tui.readout import READ, Readout, ReadoutState

REPETITION = 0.2
"""Seconds between two presses below which the second is the repetition of a held key."""
SETTLE = 0.05
"""Seconds after the end of a line before a reading shows what the line has done."""


@dataclass
class Jog:
    """The presses of one page."""

    dropped: int = 0
    """Presses that did not count since the last one that did."""
    why: str = ""
    """The reason of the last drop."""
    _pressed: float = -math.inf
    _busy: float = -math.inf
    """When a line was last seen to run or wait."""

    def look(self, now: float, *, idle: bool) -> None:
        if not idle:
            self._busy = now

    def allows(self, readout: Readout, axis: Readout, state: ReadoutState, now: float, *, idle: bool) -> bool:
        """True if a press at this time counts; one that does not is dropped."""
        self.look(now, idle=idle)
        repeated = now - self._pressed < REPETITION
        self._pressed = now
        self.why = "a key that is held repeats" if repeated else self.obstacle(readout, axis, state, now)
        if self.why:
            self.dropped += 1
            return False
        self.dropped, self._busy = 0, now
        return True

    def obstacle(self, readout: Readout, axis: Readout, state: ReadoutState, now: float) -> str:
        """The reason for which no move may start now; empty: it may."""
        if restless := self.restless(readout, axis, state, now):
            return restless
        if axis.conditions is not None and axis.conditions.disabled:
            return f"no current in the motor ({axis.conditions.disabled})"
        if axis.conditions is not None and axis.conditions.blocked:
            return axis.conditions.blocked
        return "a program runs" if readout.program.name else ""

    def restless(self, readout: Readout, axis: Readout, state: ReadoutState, now: float) -> str:
        """What leaves open whether the axis rests; empty: it rests."""
        if state not in READ or axis.last is None:
            return f"it is {'not read yet' if state is ReadoutState.UNKNOWN else state.word}"
        if state is ReadoutState.MOVING or axis.last.velocity != 0:
            return "it moves"
        if self._busy == now:
            return "a line is on its way"
        if axis.last.at <= max(self._busy + SETTLE, readout.touched) or readout.old(now):
            return "it has not been read at rest since the last line"
        return ""
