"""The coordinates of a simulated TMCL module: positions for each motor, which a program or a host names by a number.

Coordinate 0 is in RAM only. Global parameter 84 decides for the others: at 0 they are in RAM, and SCO and GCO with
motor 255 copy one of them, or with coordinate 0 all of them, from and to EEPROM; at 1 they are in EEPROM. Ruling where
the manuals are silent: RAM has what EEPROM has at power-up, and 0 as from the factory. (TMCL firmware manuals, SCO,
GCO, CCO, ACO, MVP COORD, "Global parameters".)
"""

from __future__ import annotations

NUMBERS = range(21)
EVERY_MOTOR = 255
"""The motor of SCO and GCO that copies; coordinate 0 stands for all."""


class Coordinates:
    """The coordinates of a module's motors, in RAM and in EEPROM."""

    def __init__(self, motors: int) -> None:
        self._held = [[0] * len(NUMBERS) for _ in range(motors)]
        self._kept = [[0] * len(NUMBERS) for _ in range(motors)]

    def of(self, motor: int, number: int) -> int:
        return self._held[motor][number]

    def set(self, motor: int, number: int, position: int, *, lasting: bool) -> None:
        """Give a coordinate a position; `lasting`: in EEPROM too, which has no coordinate 0."""
        self._held[motor][number] = position
        if lasting and number:
            self._kept[motor][number] = position

    def restore(self, number: int) -> None:
        """Copy a coordinate of every motor from EEPROM; 0: all."""
        for held, kept in zip(self._held, self._kept, strict=True):
            for coordinate in [number] if number else NUMBERS[1:]:
                held[coordinate] = kept[coordinate]

    def keep(self, number: int) -> None:
        """Copy a coordinate of every motor to EEPROM; 0: all."""
        for held, kept in zip(self._held, self._kept, strict=True):
            for coordinate in [number] if number else NUMBERS[1:]:
                kept[coordinate] = held[coordinate]

    def power_up(self) -> None:
        for held in self._held:
            held[0] = 0
        self.restore(0)
