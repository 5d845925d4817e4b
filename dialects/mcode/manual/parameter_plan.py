"""The order of the steps from a drive's present settings to the wanted ones, in which it refuses none.

Theory of operation. A change of MS scales A, D, VI and VM; a change of the unit of motion (EE, AS) exchanges them. So
their values are unknown from there on, and all that are wanted are sent again. Each group of settings with a rule has a
function that orders it: the first group decides the unit, the next the resolution, then the velocities. Where no order
of single steps leads to the goal, a setting takes a temporary value. Settings that can turn the motor are last.
(MCode reference 3.4.2, 5.1.6, 5.1.36, 5.1.38, 5.1.64, 5.1.78, 5.1.82, 5.1.85, 5.1.86, 5.1.131, 5.1.139, 5.1.140.)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import ceil

from multidrop.dialects.mcode.manual import parameter_checks as checks
from multidrop.dialects.mcode.manual import parameter_rules as rules
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual.mnemonic import MDRIVE_PLUS
from multidrop.dialects.mcode.manual.parameter_checks import FINEST, PAIRS, PER_MICROSTEP
from multidrop.dialects.mcode.manual.parameter_rules import CLOCKS, SHARED, TORQUE
from multidrop.dialects.mcode.manual.parameters import COUNTED, WIRE
from multidrop.dialects.parameters import Change, Permission, Plan, Readings, Value, number, reference_lost, same

# The steps of a plan so far, and the settings that a drive has after them.


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


LAST = ("DE", "CB", "MU", "TD", "TQ", "JE", "FL", "CM", "PM", "AS", "EE")
"""Settings that can turn the motor, and those that DE or hMT restrict, in this order."""
WIRE_ORDER = ("CE", "ES", "DG", "QD", "LK", "EM", "DN", "CK", "PY", "BD")
SCALE = frozenset({"MS", "EE", "AS", "SA", "EL", "RD"})
"""Settings that decide what a unit of position is."""
MDRIVE_COUNTS = 2048
"""Encoder counts in a turn of an MDrivePlus; EE=1 needs a VI of one count or more (error 90)."""
STEPS_PER_TURN = 200
"""Full steps."""


def plan(product: str, present: Readings, wanted: Mapping[str, Value], allowed: Permission) -> Plan:
    """Plan the steps. Raises Diagnostic for values that the drive refuses."""
    given = {name.upper(): value for name, value in wanted.items()}
    changed = {name: value for name, value in given.items() if not same(value, present.values.get(name))}
    impossible = _impossible(changed, present)
    withheld = _withheld({name: changed[name] for name in changed if name not in impossible}, present, allowed)
    goal = _goal(product, present, given, withheld, impossible)
    steps = Steps(product, present.values, goal)
    for order in (_leave_counts, _speeds, _resolution, _enter_counts, _velocities, _software_limits, _delays, _points):
        order(steps)
    steps.reach(*(name for name in goal if name not in (*LAST, *WIRE_ORDER)))
    steps.reach(*LAST, *WIRE_ORDER)
    remarks = reference_lost(steps.changes, SCALE)
    return Plan(tuple(steps.changes), tuple(withheld.items()), tuple(impossible.items()), remarks)


def _impossible(changed: Mapping[str, Value], present: Readings) -> dict[str, str]:
    now: Mapping[str, Value | None] = {**present.values}
    found = {name: checks.impossible(name, value, now, present.labels) for name, value in changed.items()}
    return {name: reason for name, reason in found.items() if reason}


def _withheld(changed: Mapping[str, Value], present: Readings, allowed: Permission) -> dict[str, str]:
    """The settings that a person has to name, with the reasons."""
    now: Mapping[str, Value | None] = {**present.values}
    found = {name: rules.risk(name, value, now) for name, value in changed.items() if name not in allowed.named}
    return {name: reason for name, reason in found.items() if reason and not (name in WIRE and allowed.communication)}


def _goal(
    product: str,
    present: Readings,
    wanted: Mapping[str, Value],
    withheld: Mapping[str, str],
    impossible: dict[str, str],
) -> dict[str, Value]:
    """The values to reach: those that may be written, in the unit of motion that the drive will have."""
    now = present.values
    while more := checks.dependents(now, wanted, {**withheld, **impossible}):
        impossible |= more
    goal = {name: value for name, value in wanted.items() if name not in withheld and name not in impossible}
    counts = manual.counting({**now, **goal})
    changed = {name: value for name, value in goal.items() if not same(value, now.get(name))}
    goal |= {name: rules.checked(name, value, product, counts, present.labels) for name, value in changed.items()}
    checks.check_together(product, {**_carried_over(now, goal, counts), **goal}, counts, changed)
    return goal


def _carried_over(now: Mapping[str, Value], goal: Mapping[str, Value], counts: bool) -> dict[str, Value]:
    """The values of settings that are not wanted: MS scales some, and a change of the unit hides them."""
    if counts != manual.counting(now):
        return {name: value for name, value in now.items() if name not in COUNTED}
    ratio = number(goal.get("MS", now.get("MS"))) / (number(now.get("MS")) or 1)
    return {name: round(number(value) * ratio) if name in COUNTED - {"MS"} else value for name, value in now.items()}


# The unit of motion


def _leave_counts(steps: Steps) -> None:
    """Leave encoder counts, then torque mode or hMT. hMT takes EE=1 away from the unit of motion: EE=0 for a while."""
    if steps.goal.get("EE") == 0:
        steps.reach("EE")
    if steps.counting and steps.goal.get("AS"):
        steps.keep(["EE"])
        steps.send("EE", 0, temporary=True)
    if steps.goal.get("AS") == 0 or steps.now.get("AS") == rules.TORQUE:
        steps.reach("AS")


def _enter_counts(steps: Steps) -> None:
    """Enter encoder counts, with a VI of at least one count. With hMT EE changes no unit, and follows AS."""
    if not steps.differs("EE") or steps.goal.get("AS", steps.now.get("AS")):
        return
    slowest, resolution = steps.number("VI"), steps.number("MS")
    if steps.product in MDRIVE_PLUS and resolution is not None:
        least = ceil(resolution * STEPS_PER_TURN / MDRIVE_COUNTS)
        if slowest is None or slowest < least:
            fastest = steps.number("VM")
            if fastest is None or fastest <= least:
                steps.send("VM", least + 1, temporary=True)
            steps.send("VI", least, temporary=True)
    steps.reach("EE")


# Resolution and velocities


def _speeds(steps: Steps) -> None:
    """Reach MF, which VM bounds, and TS, which MS bounds, while VM and MS are high enough."""
    if steps.differs("TS"):
        _allow(steps, number(steps.goal["TS"]))
        steps.reach("TS")
    if steps.differs("MF"):
        needed, fastest = int(number(steps.goal["MF"])), steps.number("VM")
        if fastest is None or fastest < needed:
            steps.keep(COUNTED)
            _allow(steps, needed)
            slowest = steps.number("VI")
            if slowest is None or slowest >= needed:
                steps.send("VI", 1, temporary=True)
            steps.send("VM", needed, temporary=True)
        steps.reach("MF")


def _allow(steps: Steps, speed: float) -> None:
    """Make MS fine enough for a velocity in steps."""
    resolution = steps.number("MS")
    if steps.product not in MDRIVE_PLUS and (resolution is None or resolution * PER_MICROSTEP < speed):
        steps.keep(COUNTED)
        steps.send("MS", FINEST, temporary=True)


def _resolution(steps: Steps) -> None:
    """Reach MS, SA and EL. While the motor counts, those that make microsteps finer for the encoder go first."""
    if manual.counting({**steps.now, **steps.goal}) and manual.locks_resolution(steps.product):
        return
    names = [name for name in ("MS", "SA", "EL") if steps.differs(name)]
    finer = [name for name in names if _finer(steps, name)]
    steps.reach(*finer, *names)


def _finer(steps: Steps, name: str) -> bool:
    """Whether a step makes microsteps finer for the encoder."""
    goal, now = number(steps.goal[name]), steps.number(name)
    return now is None or (goal > now) == (name == "MS")


def _velocities(steps: Steps) -> None:
    """Reach A and D, then VI and VM, of which VI is below VM after each step."""
    steps.reach("A", "D")
    if steps.differs("VI") and steps.differs("VM"):
        slowest, fastest = steps.number("VI"), number(steps.goal["VM"])
        if slowest is None:
            steps.send("VI", 1, temporary=True)
        if slowest is not None and slowest >= fastest:
            steps.reach("VI")
    steps.reach("VM", "VI")


# Pairs and points


def _software_limits(steps: Steps) -> None:
    """Reach LS, of which the minus limit is below the plus limit while both are enabled."""
    crosses = checks.crossed(steps.goal.get("LS0"), steps.now.get("LS1"))
    steps.reach(*(("LS1", "LS0") if crosses else ("LS0", "LS1")))


def _delays(steps: Steps) -> None:
    """Reach HT and MT, the one that falls first: their sum has a bound."""
    falling = [
        name for name in ("HT", "MT") if steps.differs(name) and number(steps.goal[name]) < (steps.number(name) or 0)
    ]
    steps.reach(*falling, "HT", "MT")


def _points(steps: Steps) -> None:
    """Reach the set-ups of points. A type that another point still has is released first."""
    names = [name for name in steps.goal if checks.types(name, steps.product) and steps.differs(name)]
    for name in names:
        held = steps.now.get(name)
        if isinstance(held, tuple) and held[0] not in SHARED and _claimed(steps, name, held[0], names):
            free = 16 if name.startswith("OS") else 0
            steps.send(name, (free, *held[1:]), temporary=True)
    for name in names:
        steps.reach(name, checks.PAIRS.get(name, name))


def _claimed(steps: Steps, name: str, kind: object, names: list[str]) -> bool:
    """Whether another point is to have a type."""
    others = [each for each in names if each != name and checks.group(each) == checks.group(name)]
    return any(isinstance(goal := steps.goal[each], tuple) and goal[0] == kind for each in others)
