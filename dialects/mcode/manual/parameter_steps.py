"""The steps of a plan so far, and the settings that a drive has after them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dialects.mcode.manual import parameter_rules as rules
from dialects.mcode.manual import parameters as manual
from dialects.mcode.manual.parameter_checks import FINEST, PAIRS
from dialects.mcode.manual.parameter_rules import CLOCKS, TORQUE
from dialects.mcode.manual.parameters import COUNTED
from dialects.parameters import Change, Value, same


class Steps:
    """Steps towards a goal. `now` has the drive's values after them; None for an unknown value."""

    def __init__(self, product: str, present: Mapping[str, Value], goal: dict[str, Value]) -> None:
        self.product, self.goal = product, goal
        self.now: dict[str, Value | None] = {**present}
        self.changes: list[Change] = []

    def differs(self, name: str) -> bool:
        """Whether the drive's value is not the goal's."""
        return name in self.goal and not same(self.goal[name], self.now.get(name))

    def reach(self, *names: str) -> None:
        """Send the goal's values of these settings where they differ."""
        for name in names:
            if self.differs(name):
                self.send(name, self.goal[name])

    def send(self, name: str, value: Value, temporary: bool = False) -> None:
        """Add a step, and follow what it does to other settings."""
        new = name not in self.now and rules.row_of(name, self.product) is None
        before, counted = self.now.get(name), self.counting
        self.changes.append(Change(name, before, value, rules.line(name, value, new), temporary))
        self.now[name] = value
        if name == "MS":
            self.forget(COUNTED - {"MS"})
        if self.counting != counted:
            self._exchange()
        if name == "AS" and before == TORQUE:
            self.forget(["CB"])  # torque mode shows another
        if name == "DE" and not value and self.now.get("AS") in (1, 2):
            self.now["MU"] = None
        if name in PAIRS and isinstance(value, tuple):
            self._pair(name, value, before)

    @property
    def counting(self) -> bool:
        """Whether the unit of motion is the encoder count after these steps."""
        return manual.counting(self.now)

    def number(self, name: str) -> float | None:
        """A value as a number; None where it is not known."""
        value = self.now.get(name)
        return value if isinstance(value, (int, float)) else None

    def forget(self, names: Iterable[str]) -> None:
        """Make values unknown."""
        for name in names:
            if name in self.now:
                self.now[name] = None

    def keep(self, names: Iterable[str]) -> bool:
        """Make settings part of the goal, at their present values. Whether all of them are known."""
        held = [(name, self.now.get(name)) for name in names if name in self.now and name not in self.goal]
        self.goal.update({name: value for name, value in held if value is not None})
        return all(value is not None for _, value in held)

    def _exchange(self) -> None:
        """Follow a change of the unit of motion: the other values come into force."""
        locked = manual.locks_resolution(self.product)
        self.forget(COUNTED if locked else COUNTED - {"MS"})
        if locked and self.counting:
            self.now["MS"] = FINEST

    def _pair(self, name: str, value: tuple[object, ...], before: Value | None) -> None:
        """Follow the other point of a clock: both have one type."""
        other = self.now.get(PAIRS[name])
        if not isinstance(other, tuple):
            return
        if name.startswith("S"):
            self.now[PAIRS[name]] = self.now[name]
        elif value[0] in CLOCKS:
            self.now[PAIRS[name]] = (int(str(value[0])), *other[1:])
        elif isinstance(before, tuple) and other[0] in CLOCKS:
            self.now[PAIRS[name]] = (0, *other[1:])
