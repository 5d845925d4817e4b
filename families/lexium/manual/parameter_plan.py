"""Checks of a drive's settings that belong together, before anything is sent.

(MCode reference 3.4.2, 5.1.6, 5.1.38, 5.1.55, 5.1.64 to 5.1.66, 5.1.78, 5.1.85, 5.1.93, 5.1.140, 7.3.7; of 2012:
3.4.3, 5-63 to 5-67.)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from itertools import combinations
from math import ceil

from multidrop.base.errors import Diagnostic
from multidrop.dialects.values import (
    Change,
    Readings,
    Value,
    number,
    same,
)
from multidrop.families.lexium.manual import groups
from multidrop.families.lexium.manual import parameters as manual
from multidrop.families.lexium.manual.mnemonic import EXPANDED, MDRIVE_PLUS, Alone, Retention
from multidrop.families.lexium.manual.parameters import CLOCKS, SHARED, TORQUE, writable
from multidrop.families.lexium.manual.point_types import OUTPUT_TYPES, types
from multidrop.families.lexium.manual.table import lookup

IN_UNITS = frozenset(
    each
    for word in groups.those(lambda row: row.unit_encoder != "" and row.kept is Retention.SAVED)
    for each in ([f"{word}{n}" for n in groups.LISTS[word]] if word in groups.LISTS else [word])
)
"""Settings in the unit of motion: steps or encoder counts."""
FINEST = 256
"""The finest MS: it allows every velocity."""
PER_MICROSTEP = 10000
"""The highest velocity of a Lexium for each microstep of MS, steps/s."""
LEAST_WITH_HMT = 10
LONGEST_DELAY = 65535
PAIRS = {"IS3": "IS4", "IS4": "IS3", "S7": "S8", "S8": "S7"}
"""The two points of a clock."""


def impossible(name: str, value: Value, now: Mapping[str, Value | None], labels: Collection[str]) -> str:
    """The reason for which a drive in this state cannot get a value; empty: it can."""
    if name == "TS" and value == 0:
        return "0 cannot be sent; FD restores it"
    if name in ("CB", "MU") and now.get("AS") == TORQUE:
        return "torque mode (AS=3) fixes it"
    if not writable(value):
        return "a line cannot hold its digits"
    if name not in groups.TRIPS or (value == 0 and name in groups.REMOVABLE):
        return ""
    if value == 0:
        return "a drive cannot forget a trip; FD does"
    targets = value[1:2] if isinstance(value, tuple) else (value,)
    missing = [target for target in targets if isinstance(target, str) and target.upper() not in labels]
    return f"the program in the drive has no label {missing[0]}; download it first" if missing else ""


def dependents(now: Mapping[str, Value], wanted: Mapping[str, Value], withheld: Collection[str]) -> dict[str, str]:
    """More settings to leave alone, since others that they need are left alone; each with the reason."""
    goal = {name: value for name, value in wanted.items() if name not in withheld}
    final = {**now, **goal}
    changed = {name: value for name, value in goal.items() if not same(value, now.get(name))}
    dependent: dict[str, str] = {}
    if changed.get("AS") and 0 in (now.get("DE"), final.get("DE")):
        dependent["AS"] = "hMT needs DE=1"
    if "AS" in withheld and final.get("AS") and number(final.get("MS")) < LEAST_WITH_HMT:
        dependent["MS"] = f"hMT (AS) needs {LEAST_WITH_HMT} or more"
    if "MS" in withheld:
        dependent |= dict.fromkeys(IN_UNITS, "it is in microsteps, and MS is left alone")
    if manual.counting(final) or manual.counting(now):
        dependent |= dict.fromkeys(("MF", "TS"), "it can be set in steps only (EE=0)")
    if changed.get("FL") and _kind(final.get("IS3")) not in CLOCKS:
        dependent["FL"] = "inputs 3 and 4 are no clock"
    dependent = {**dependent, **_without_points(now, changed, withheld)}
    if manual.counting(final) != manual.counting({**now, **wanted}):
        dependent |= dict.fromkeys(IN_UNITS | {"MS"}, "it is in the other unit of motion (EE, AS)")
    if manual.counting(now) and not manual.counting(final) and "MS" not in goal:
        dependent["VM"] = "the MS that comes into force is not known, and the file has none"
    return {name: reason for name, reason in dependent.items() if name in goal}


def _without_points(
    now: Mapping[str, Value], changed: Mapping[str, Value], withheld: Collection[str]
) -> dict[str, str]:
    """Points whose type another point still has, and the other point of a clock that is left alone."""
    withdrawn: dict[str, str] = {}
    for name, value in changed.items():
        kind, held = _kind(value), [_kind(now[each]) for each in withheld if each in now and group(each) == group(name)]
        if kind is not None and kind not in SHARED and kind in held:
            withdrawn[name] = f"another point has type {kind} and is left alone"
        if PAIRS.get(name) in withheld and CLOCKS & {kind, _kind(now.get(name))}:
            withdrawn[name] = f"a clock takes two points, and {PAIRS[name]} is left alone"
    return withdrawn


def _kind(value: Value | None) -> object:
    return value[0] if isinstance(value, tuple) else None


def check_together(product: str, final: Mapping[str, Value], counts: bool, goal: Collection[str]) -> None:
    """Check the settings that the drive will have; `goal` has those that are to change. Raises Diagnostic."""

    def concerns(*names: str) -> bool:
        return any(name in goal for name in names) and all(name in final for name in names)

    if concerns("VI", "VM") and number(final["VI"]) >= number(final["VM"]):
        raise Diagnostic(f"VI = {final['VI']} and VM = {final['VM']}: VI must be below VM")
    if concerns("HT", "MT") and number(final["HT"]) + number(final["MT"]) > LONGEST_DELAY:
        raise Diagnostic(f"HT = {final['HT']} and MT = {final['MT']}: together at most {LONGEST_DELAY}")
    if product not in MDRIVE_PLUS and not counts and concerns("VM", "MS"):
        fastest = number(final["MS"]) * PER_MICROSTEP
        if number(final["VM"]) > fastest:
            raise Diagnostic(f"VM = {final['VM']}: with MS = {final['MS']} at most {fastest:g}")
    _check_resolution(product, final, counts, goal)
    low, high = final.get("LS0"), final.get("LS1")
    for name in ("LS0", "LS1"):
        value = final.get(name)
        if name in goal and not (isinstance(value, tuple) and len(value) == 2 and value[1] in (0, 1)):
            raise Diagnostic(f"{name} = {value}: takes a position and 0 or 1")
    if ("LS0" in goal or "LS1" in goal) and crossed(low, high):
        raise Diagnostic(f"LS0 = {low} and LS1 = {high}: the minus limit must be below the plus limit")
    points = {name: value for name, value in final.items() if types(name, product) and isinstance(value, tuple)}
    for name, value in points.items():
        if name in goal:
            valid = types(name, product)
            if value[0] not in valid:
                raise Diagnostic(
                    f"{name} = {list(value)}: type {value[0]}; valid: {', '.join(map(str, sorted(valid)))}"
                )
            sources = product in EXPANDED or value[0] not in OUTPUT_TYPES
            if any(each not in (0, 1) for each in value[1:]) or (len(value) > 2 and value[2] and not sources):
                raise Diagnostic(
                    f"{name} = {list(value)}: fields after the type must be 0 or 1, as the product has them"
                )
            other = points.get(PAIRS.get(name, ""))
            follows = name.startswith("S") and PAIRS.get(name) not in goal
            if other is not None and not follows and CLOCKS & {value[0], other[0]} and value[0] != other[0]:
                raise Diagnostic(f"{name} and {PAIRS[name]}: a clock takes both, with one type")
    for (one, first), (two, second) in combinations(points.items(), 2):
        grouped = group(one) == group(two) and first[0] == second[0]
        if grouped and first[0] not in SHARED and (one in goal or two in goal):
            raise Diagnostic(f"{one} and {two}: only one of them can have type {first[0]}")


def _check_resolution(product: str, final: Mapping[str, Value], counts: bool, goal: Collection[str]) -> None:
    ratio = ("MS", "SA", "EL", "EE", "AS")
    if not any(name in goal for name in ratio) or "MS" not in final:
        return
    resolution = number(final["MS"])
    if final.get("AS") and resolution < LEAST_WITH_HMT:
        raise Diagnostic(f"MS = {final['MS']}: at least {LEAST_WITH_HMT} with hMT (AS = {final['AS']})")
    if counts and manual.locks_resolution(product) and "MS" in goal and resolution != FINEST:
        raise Diagnostic(f"MS = {final['MS']}: EE = 1 locks it at {FINEST}")
    if product == "LMM" and final.get("EE") and resolution * round(360 / number(final["SA"])) < 8 * number(final["EL"]):
        raise Diagnostic(f"MS = {final['MS']}: too coarse for EL = {final['EL']} with SA = {final['SA']}")


def crossed(low: Value | None, high: Value | None) -> bool:
    """Whether two enabled software limits leave no way between them."""
    if not (isinstance(low, tuple) and isinstance(high, tuple)):
        return False
    return bool(low[1] and high[1]) and number(low[0]) >= number(high[0])


def group(name: str) -> str:
    """The points among which a type may be unique; the analog input and the index mark are alone."""
    letters = name.rstrip("0123456789")
    return name if name in ("IS5", "IS6", "S5") else letters


# The order of the steps from a drive's present settings to the wanted ones, in which it refuses none.
#
# Theory of operation. A change of MS scales A, D, VI and VM; a change of the unit of motion (EE, AS) exchanges them.
# So their values are unknown from there on, and all that are wanted are sent again. Each group of settings with a rule
# has a function that orders it: the first group decides the unit, the next the resolution, then the velocities. Where
# no order of single steps leads to the goal, a setting takes a temporary value. Settings that can turn the motor are
# last. (MCode reference 3.4.2, 5.1.6, 5.1.36, 5.1.38, 5.1.64, 5.1.78, 5.1.82, 5.1.85, 5.1.86, 5.1.131, 5.1.139,
# 5.1.140.)


# The steps of a plan so far, and the settings that a drive has after them.


class PlannedSteps:
    """Steps towards a goal. `now` has the drive's values after them; None for an unknown value."""

    def __init__(self, product: str, present: Mapping[str, Value], goal: dict[str, Value]) -> None:
        self.product, self.goal = product, goal
        self.now: dict[str, Value | None] = {**present}
        self.changes: list[Change] = []

    def differs(self, name: str) -> bool:
        return name in self.goal and not same(self.goal[name], self.now.get(name))

    def reach(self, *names: str) -> None:
        """Send the goal's values of these settings where they differ."""
        for name in names:
            if self.differs(name):
                self.send(name, self.goal[name])

    def send(self, name: str, value: Value, temporary: bool = False) -> None:
        new = name not in self.now and manual.row_of(name, self.product) is None
        before, counted = self.now.get(name), self.counting
        self.changes.append(Change(name, before, value, manual.line(name, value, new), temporary))
        self.now[name] = value
        if name == "MS":
            self.forget(groups.BANKED)
        if self.counting != counted:
            # Follow a change of the unit of motion: the other values come into force.
            locked = manual.locks_resolution(self.product)
            self.forget(groups.COUNTED if locked else groups.BANKED)
            if locked and self.counting:
                self.now["MS"] = FINEST
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
        value = self.now.get(name)
        return value if isinstance(value, (int, float)) else None

    def forget(self, names: Iterable[str]) -> None:
        for name in names:
            if name in self.now:
                self.now[name] = None

    def keep(self, names: Iterable[str]) -> bool:
        """Make settings part of the goal, at their present values. Whether all of them are known."""
        held = [(name, self.now.get(name)) for name in names if name in self.now and name not in self.goal]
        self.goal.update({name: value for name, value in held if value is not None})
        return all(value is not None for _, value in held)

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


MDRIVE_COUNTS = 2048
"""Encoder counts in a turn of an MDrivePlus with its own encoder; EE=1 needs a VI of one count or more (error 90)."""
STEPS_PER_TURN = 200
"""Full steps."""


def steps(
    product: str,
    present: Readings,
    wanted: Mapping[str, Value],
    withheld: Mapping[str, str],
    impossible: dict[str, str],
) -> list[Change]:
    """Order the steps, and add to `impossible`. Raises Diagnostic for values that the drive refuses."""
    goal = _goal(product, present, wanted, withheld, impossible)
    made = PlannedSteps(product, present.values, goal)
    for order in (_leave_counts, _speeds, _resolution, _enter_counts, _velocities, _pairs, _points):
        order(made)
    made.reach(*(name for name in goal if name not in groups.RESTORED_LAST))
    made.reach(*groups.RESTORED_LAST)
    return made.changes


def _goal(
    product: str,
    present: Readings,
    wanted: Mapping[str, Value],
    withheld: Mapping[str, str],
    impossible: dict[str, str],
) -> dict[str, Value]:
    """The values to reach: those that may be written, in the unit of motion that the drive will have."""
    now = present.values
    while more := dependents(now, wanted, {**withheld, **impossible}):
        impossible |= more
    goal = {name: value for name, value in wanted.items() if name not in withheld and name not in impossible}
    counts = manual.counting({**now, **goal})
    changed = {name: value for name, value in goal.items() if not same(value, now.get(name))}
    goal |= {name: manual.checked(name, value, product, counts, present.labels) for name, value in changed.items()}
    # Settings that are not wanted keep their values: but MS scales some, and a change of the unit hides them.
    kept: Mapping[str, Value] = {name: value for name, value in now.items() if name not in groups.COUNTED}
    if counts == manual.counting(now):
        ratio = number(goal.get("MS", now.get("MS"))) / (number(now.get("MS")) or 1)
        scaled = {name: round(number(value) * ratio) for name, value in now.items() if name in groups.BANKED}
        kept = {**now, **scaled}
    check_together(product, {**kept, **goal}, counts, changed)
    return goal


# The unit of motion


def _leave_counts(steps: PlannedSteps) -> None:
    """Leave encoder counts, then torque mode or hMT. hMT takes EE=1 away from the unit of motion: EE=0 for a while."""
    if steps.goal.get("EE") == 0:
        steps.reach("EE")
    if steps.counting and steps.goal.get("AS"):
        steps.keep(["EE"])
        steps.send("EE", 0, temporary=True)
    if steps.goal.get("AS") == 0 or steps.now.get("AS") == TORQUE:
        steps.reach("AS")


def _enter_counts(steps: PlannedSteps) -> None:
    """Enter encoder counts, with a VI of at least one count. With hMT EE changes no unit, and follows AS."""
    if not steps.differs("EE") or steps.goal.get("AS", steps.now.get("AS")):
        return
    slowest, resolution = steps.number("VI"), steps.number("MS")
    if steps.product in MDRIVE_PLUS and resolution is not None:
        lines = steps.number("EL")  # of a unit with expanded I/O
        least = ceil(resolution * STEPS_PER_TURN / (4 * lines if lines else MDRIVE_COUNTS))
        if slowest is None or slowest < least:
            fastest = steps.number("VM")
            if fastest is None or fastest <= least:
                steps.send("VM", least + 1, temporary=True)
            steps.send("VI", least, temporary=True)
    steps.reach("EE")


# Resolution and velocities


def _speeds(steps: PlannedSteps) -> None:
    """Reach MF, which VM bounds, and TS, which MS bounds, while VM and MS are high enough."""
    if steps.differs("TS"):
        _allow(steps, number(steps.goal["TS"]))
        steps.reach("TS")
    if steps.differs("MF"):
        needed, fastest = int(number(steps.goal["MF"])), steps.number("VM")
        if fastest is None or fastest < needed:
            steps.keep(groups.COUNTED)
            _allow(steps, needed)
            slowest = steps.number("VI")
            if slowest is None or slowest >= needed:
                steps.send("VI", 1, temporary=True)
            steps.send("VM", needed, temporary=True)
        steps.reach("MF")


def _allow(steps: PlannedSteps, speed: float) -> None:
    """Make MS fine enough for a velocity in steps."""
    resolution = steps.number("MS")
    if steps.product not in MDRIVE_PLUS and (resolution is None or resolution * PER_MICROSTEP < speed):
        steps.keep(groups.COUNTED)
        steps.send("MS", FINEST, temporary=True)


def _resolution(steps: PlannedSteps) -> None:
    """Reach MS, SA and EL. While the motor counts, those that make microsteps finer for the encoder go first."""
    if manual.counting({**steps.now, **steps.goal}) and manual.locks_resolution(steps.product):
        return
    names = [name for name in ("MS", "SA", "EL") if steps.differs(name)]
    finer = []
    for name in names:
        goal, now = number(steps.goal[name]), steps.number(name)
        if now is None or (goal > now) == (name == "MS"):
            finer.append(name)
    steps.reach(*finer, *names)


def _velocities(steps: PlannedSteps) -> None:
    steps.reach("A", "D")
    if steps.differs("VI") and steps.differs("VM"):
        slowest, fastest = steps.number("VI"), number(steps.goal["VM"])
        if slowest is None:
            steps.send("VI", 1, temporary=True)
        if slowest is not None and slowest >= fastest:
            steps.reach("VI")
    steps.reach("VM", "VI")


# Pairs and points


def _pairs(steps: PlannedSteps) -> None:
    """Reach LS, of which the minus limit is below the plus limit while both are enabled, then HT and MT.

    Of these the one that falls goes first: their sum has a bound.
    """
    crosses = crossed(steps.goal.get("LS0"), steps.now.get("LS1"))
    steps.reach(*(("LS1", "LS0") if crosses else ("LS0", "LS1")))
    differ = [name for name in ("HT", "MT") if steps.differs(name)]
    falling = [name for name in differ if number(steps.goal[name]) < (steps.number(name) or 0)]
    steps.reach(*falling, "HT", "MT")


def _points(steps: PlannedSteps) -> None:
    """Reach the set-ups of points. A type that another point still has is released first."""
    names = [name for name in steps.goal if types(name, steps.product) and steps.differs(name)]
    for name in names:
        held = steps.now.get(name)
        others = [steps.goal[each] for each in names if each != name and group(each) == group(name)]
        kinds = [kind[0] for kind in others if isinstance(kind, tuple)]
        if isinstance(held, tuple) and held[0] not in SHARED and held[0] in kinds:
            free = 16 if name.startswith("OS") else 0
            steps.send(name, (free, *held[1:]), temporary=True)
    for name in names:
        steps.reach(name, PAIRS.get(name, name))


TURNS = {
    Alone.JOG: "inputs of the jog types turn the motor then",
    Alone.CLOCK_INPUTS: "the motor follows the clock inputs then",
    Alone.CLOCK: "the motor follows the clock then",
    Alone.CORRECTION: "the drive then moves back to its position by itself",
}
"""What moves the motor by itself once a flag is set."""


def risk(name: str, value: Value, now: Mapping[str, Value | None]) -> str:
    """The reason for which a setting is only written when a person names it; empty: there is none.

    `now` has the drive's present values.
    """
    torque = now.get("AS") == TORQUE
    if name in groups.UNIT:
        return "it belongs to the motor unit"
    if name == "LK":
        return "only CP or FD opens a lock again" if value else "it opens the program"
    if name == "DE":
        return "it switches the motor's current"
    if name == "AS":
        return "it can turn the motor"
    row = lookup(name)
    if row is not None and row.alone in TURNS and value:
        return TURNS[row.alone]
    if name in ("TD", "TQ", "TS") and torque:
        return "in torque mode (AS=3) it turns the motor"
    if name == "MU" and now.get("AS"):
        return "the drive may make up lost steps at once"
    if name == "EE" and now.get("PM"):
        return TURNS[Alone.CORRECTION]
    if name in groups.TRIPS and isinstance(value, tuple) and any(each and isinstance(each, int) for each in value[1:2]):
        return "it calls an address, which may hold another program's line"
    point = name.startswith(tuple(groups.LISTS)) or manual.POINT.fullmatch(name) is not None
    if not point or name.startswith(("LS", "OS")) or not isinstance(value, tuple):
        return ""
    kind = value[0]
    if kind == manual.GO:
        return "the input starts a program"
    if kind == manual.RESET:
        return "the input restarts the drive"
    if kind in (manual.JOG_PLUS, manual.JOG_MINUS) and now.get("JE"):
        return TURNS[Alone.JOG]
    follows = now.get("FL") or now.get("CM")
    return "the motor follows the clock inputs" if kind in CLOCKS and follows else ""
