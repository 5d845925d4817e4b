"""The output bridges: whether the motor is under current (manual 5.1.29, 5.1.127, 8.2)."""

from __future__ import annotations

from collections.abc import Mapping

from multidrop.dialects.mcode.manual.errors import ErrorNumber as E
from multidrop.simulator.lexium.state.errors import Fault
from multidrop.simulator.lexium.state.expressions import Value


class Bridges:
    """The bridges of one drive. `powered`: the drive has power at all. `supply`: +V is there.

    `locked`: a locked rotor has switched the bridges off, until CF. `count_when_disabled`: with DE=0 the product counts
    moves, and does not refuse them.
    """

    def __init__(self, values: Mapping[str, Value], count_when_disabled: bool) -> None:
        self._values, self.count_when_disabled = values, count_when_disabled
        self.powered = self.supply = True
        self.locked = False

    @property
    def enabled(self) -> bool:
        """DE."""
        return bool(self._values["DE"])

    @property
    def driving(self) -> bool:
        """Whether they can turn the motor: enabled, supplied, and not switched off by a locked rotor."""
        return bool(self._values["DE"]) and self.supply and not self.locked

    def check(self) -> None:
        """Check that a motion may be commanded at all. Raises Fault (94, 96)."""
        if self.locked or not (self.enabled or self.count_when_disabled):
            raise Fault(E.DRIVE_DISABLED)
        if not self.supply:
            raise Fault(E.NO_MOTOR_VOLTAGE)
