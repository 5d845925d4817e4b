"""The units of motion: motor steps in a turn, in an encoder count, in the unit that commands are in."""

from __future__ import annotations

from multidrop.simulator.lexium.state.memory import Memory

STATOR_BOUNDS = (1.1, 1.3, 1.5, 1.7)
"""Full steps between rotor and stator, by CB (manual 5.1.18)."""


class Units:
    """Motor steps. With EE=1 commands are in encoder counts (manual 3.4.2)."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    @property
    def scale(self) -> float:
        """Motor steps in the unit that commands are in."""
        return self.steps_per_count if self._memory.counting else 1.0

    @property
    def steps_per_turn(self) -> float:
        """Motor steps in a turn."""
        values = self._memory.values
        return values["MS"] * round(360 / values.get("SA", 1.8))

    @property
    def steps_per_count(self) -> float:
        """Motor steps in one encoder count."""
        return self.steps_per_turn / (self._memory.values.get("EL", self._memory.model.encoder_lines) * 4)

    @property
    def bound(self) -> float:
        """CB: the greatest distance between rotor and stator, steps."""
        return STATOR_BOUNDS[int(self._memory.values.get("CB", 1))] * self._memory.values["MS"]
