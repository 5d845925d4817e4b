"""Changes of what a motor step and an encoder count are: EE, AS, MS, SA, EL, RD, and setting a counter.

The rotor stays where it is whatever its steps become. Manual 5.1.16, 5.1.38, 5.1.85, 5.1.110, 7.3.7.
"""

from __future__ import annotations

from collections.abc import Callable

from multidrop.simulator.lexium.motion.axis import Axis
from multidrop.simulator.lexium.motion.counters import Counters
from multidrop.simulator.lexium.motion.units import Units
from multidrop.simulator.lexium.state.memory import Memory


class Scale:
    """The scale of one axis."""

    def __init__(self, memory: Memory, units: Units, axis: Axis, counters: Counters) -> None:
        self._memory, self._units, self._axis, self._counters = memory, units, axis, counters

    def set_counter(self, name: str, value: int, t: float) -> None:
        """Make a counter read `value` now."""
        self._counters.set(name, value, t)
        if name == self._counters.source:
            self._axis.backlash.forget()

    def switch(self, word: str, value: int, t: float) -> None:
        """Change EE or AS, and with them perhaps the unit of commands."""
        if value == self._memory.values[word]:
            return
        unit = self._units.scale
        self.change(lambda: self._memory.switch(word, value), t)
        self._axis.backlash.convert(unit / self._units.scale)
        self._axis.align(t)

    def change(self, change: Callable[[], None], t: float) -> None:
        """Change what a step and a count are: the encoder goes on counting where it is."""
        self._counters.hold_counts(t)
        change()
        self.orient(t)

    def orient(self, t: float) -> None:
        """Let the rotor stay where it is after MS, SA or RD may have changed."""
        self._axis.rotor.orient(t, self._units.steps_per_turn, bool(self._memory.values.get("RD")))
