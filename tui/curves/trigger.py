"""A trigger as an oscilloscope has it: the picture stands around the moment at which a curve crosses a level.

    OFF        arm: ARMED
    ARMED      cross: TRIGGERED
    TRIGGERED  fill: HELD, once all of the picture is past
    HELD       cross: TRIGGERED, unless it was a single shot

`arm` and `disarm` are possible in every state. Samples come in, states come out: nothing here knows a clock.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from math import inf
from typing import NamedTuple

from multidrop.tui.curves.samples import FIRST_INTERVAL, SHORTEST_GAP, TraceQuantity


class TriggerState(Enum):
    """The state of a trigger, by the word that is shown."""

    OFF = "off"
    ARMED = "armed"
    TRIGGERED = "triggered"
    HELD = "held"


class TriggerSetting(NamedTuple):
    """The condition: a level in the drive's numbers, the direction, and the share of the picture before it."""

    quantity: TraceQuantity
    level: float
    rising: bool
    before: float


class Trigger:
    """The state, and the time of the last crossing that counted."""

    def __init__(self) -> None:
        self.state = TriggerState.OFF
        self.setting: TriggerSetting | None = None
        self.single = False
        self.at = 0.0
        """The time of the crossing; of TRIGGERED and HELD."""
        self._last_at, self._last_value, self._interval = -inf, 0.0, FIRST_INTERVAL

    def arm(self, setting: TriggerSetting, single: bool) -> None:
        """Wait for the next crossing, whatever was before."""
        self.setting, self.single, self.state = setting, single, TriggerState.ARMED
        self._last_at, self._interval = -inf, FIRST_INTERVAL

    def disarm(self) -> None:
        self.state = TriggerState.OFF

    @property
    def stands(self) -> bool:
        """True if it holds a picture."""
        return self.state in (TriggerState.TRIGGERED, TriggerState.HELD)

    def end(self, span: float) -> float:
        """The right edge of the picture, of this length."""
        assert self.setting is not None
        return self.at + (1 - self.setting.before) * span

    def take(self, samples: Iterable[tuple[float, float]], span: float, now: float) -> None:
        """Take in the next samples, and the time; `span` is the length of the picture."""
        for at, value in samples if self.state is not TriggerState.OFF else ():
            self._fill(at, span)
            crossing = self._crossing(at, value)
            waits = self.state is TriggerState.ARMED or (self.state is TriggerState.HELD and not self.single)
            if crossing is not None and waits:
                self.state, self.at = TriggerState.TRIGGERED, crossing
            if 0 < at - self._last_at < inf:
                self._interval = min(at - self._last_at, FIRST_INTERVAL)
            self._last_at, self._last_value = at, value
        self._fill(now, span)

    def _fill(self, now: float, span: float) -> None:
        if self.state is TriggerState.TRIGGERED and now >= self.end(span):
            self.state = TriggerState.HELD

    def _crossing(self, at: float, value: float) -> float | None:
        """The time at which the line to this sample reaches the level; None if it does not, or comes after a gap."""
        assert self.setting is not None
        _, level, rising, _ = self.setting
        before = self._last_value
        if at - self._last_at > max(SHORTEST_GAP, 3 * self._interval):
            return None
        if not (before < level <= value if rising else before > level >= value):
            return None
        return self._last_at + (at - self._last_at) * (level - before) / (value - before)
