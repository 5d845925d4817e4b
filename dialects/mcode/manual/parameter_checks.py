"""Checks of a drive's settings that belong together, before anything is sent.

(MCode reference 3.4.2, 5.1.6, 5.1.38, 5.1.55, 5.1.64 to 5.1.66, 5.1.78, 5.1.85, 5.1.93, 5.1.140, 7.3.7; of 2012:
3.4.3, 5-63 to 5-67.)
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import combinations

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.mcode.manual import parameters as manual
from multidrop.dialects.mcode.manual.mnemonic import CLOSED_LOOP, EXPANDED, MDRIVE_PLUS
from multidrop.dialects.mcode.manual.parameter_rules import CLOCKS, SHARED, TORQUE, writable
from multidrop.dialects.mcode.manual.parameters import COUNTED, TRIPS
from multidrop.dialects.parameters import Value, number, same

IN_UNITS = COUNTED - {"MS"} | {"BL", "LS0", "LS1", "TP", "TR"}
"""Settings in the unit of motion: steps or encoder counts."""
FINEST = 256
"""The finest MS: it allows every velocity."""
PER_MICROSTEP = 10000
"""The highest velocity of a Lexium for each microstep of MS, steps/s."""
LEAST_WITH_HMT = 10
LONGEST_DELAY = 65535
REMOVABLE = frozenset({"TA", "TC", "TM"})
"""Trips that 0 removes."""
_INPUT, _OUTPUT = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 11}), frozenset({16, 17, 18, 19, 20, 23})
_CLOCK, _HMT = frozenset({13, 14, 15}), frozenset({21, 24, 25})
_LEXIUM_TYPES = {
    "IS1": _INPUT | {12},
    "IS2": _INPUT,
    "IS3": _INPUT | _CLOCK,
    "IS4": _INPUT | _CLOCK,
    "IS5": frozenset({9, 10}),
    "IS6": frozenset({0}),
    "OS1": _OUTPUT | {26, 29},
    "OS2": _OUTPUT | {27, 29},
    "OS3": _OUTPUT | {28, 29},
}
_MDRIVE_TYPES = {
    **{f"S{n}": _INPUT | _OUTPUT for n in (1, 2, 3, 4, 9, 10, 11, 12)},
    "S5": frozenset({9, 10}),
    "S7": frozenset({33, 34, 35, 49, 50, 51}),
    "S8": frozenset({33, 34, 35, 49, 50, 51}),
    "S13": frozenset({60, 61}),
}
PAIRS = {"IS3": "IS4", "IS4": "IS3", "S7": "S8", "S8": "S7"}
"""The two points of a clock."""


def types(name: str, product: str) -> frozenset[int]:
    """The types that a point takes; empty for any other setting."""
    if name.startswith("OS") and product in CLOSED_LOOP:
        return _LEXIUM_TYPES.get(name, frozenset()) | _HMT
    return _LEXIUM_TYPES.get(name) or _MDRIVE_TYPES.get(name, frozenset())


def impossible(name: str, value: Value, now: Mapping[str, Value | None], labels: Collection[str]) -> str:
    """The reason for which a drive in this state cannot get a value; empty: it can."""
    if name == "TS" and value == 0:
        return "0 cannot be sent; FD restores it"
    if name in ("CB", "MU") and now.get("AS") == TORQUE:
        return "torque mode (AS=3) fixes it"
    if not writable(value):
        return "a line cannot hold its digits"
    return _impossible_trip(name, value, labels) if name in TRIPS else ""


def _impossible_trip(name: str, value: Value, labels: Collection[str]) -> str:
    if value == 0:
        return "" if name in REMOVABLE else "a drive cannot forget a trip; FD does"
    targets = value[1:2] if isinstance(value, tuple) else (value,)
    missing = [each for each in targets if isinstance(each, str) and each.upper() not in labels]
    return f"the program in the drive has no label {missing[0]}; download it first" if missing else ""


def dependents(now: Mapping[str, Value], wanted: Mapping[str, Value], withheld: Collection[str]) -> dict[str, str]:
    """More settings to leave alone, since others that they need are left alone; each with the reason."""
    goal = {name: value for name, value in wanted.items() if name not in withheld}
    final = {**now, **goal}
    changed = {name: value for name, value in goal.items() if not same(value, now.get(name))}
    found = {**_without_motion(now, final, changed, withheld), **_without_points(now, changed, withheld)}
    if manual.counting(final) != manual.counting({**now, **wanted}):
        found |= dict.fromkeys(IN_UNITS | {"MS"}, "it is in the other unit of motion (EE, AS)")
    if manual.counting(now) and not manual.counting(final) and "MS" not in goal:
        found["VM"] = "the MS that comes into force is not known, and the file has none"
    return {name: reason for name, reason in found.items() if name in goal}


def _without_motion(
    now: Mapping[str, Value], final: Mapping[str, Value], changed: Mapping[str, Value], withheld: Collection[str]
) -> dict[str, str]:
    found: dict[str, str] = {}
    if changed.get("AS") and 0 in (now.get("DE"), final.get("DE")):
        found["AS"] = "hMT needs DE=1"
    if "AS" in withheld and final.get("AS") and number(final.get("MS")) < LEAST_WITH_HMT:
        found["MS"] = f"hMT (AS) needs {LEAST_WITH_HMT} or more"
    if "MS" in withheld:
        found |= dict.fromkeys(IN_UNITS, "it is in microsteps, and MS is left alone")
    if manual.counting(final) or manual.counting(now):
        found |= dict.fromkeys(("MF", "TS"), "it can be set in steps only (EE=0)")
    if changed.get("FL") and _kind(final.get("IS3")) not in CLOCKS:
        found["FL"] = "inputs 3 and 4 are no clock"
    return found


def _without_points(
    now: Mapping[str, Value], changed: Mapping[str, Value], withheld: Collection[str]
) -> dict[str, str]:
    """Points whose type another point still has, and the other point of a clock that is left alone."""
    found: dict[str, str] = {}
    for name, value in changed.items():
        kind, held = _kind(value), [_kind(now[each]) for each in withheld if each in now and group(each) == group(name)]
        if kind is not None and kind not in SHARED and kind in held:
            found[name] = f"another point has type {kind} and is left alone"
        if PAIRS.get(name) in withheld and CLOCKS & {kind, _kind(now.get(name))}:
            found[name] = f"a clock takes two points, and {PAIRS[name]} is left alone"
    return found


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
    _check_limits(final, goal)
    _check_points(product, final, goal)


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


def _check_limits(final: Mapping[str, Value], goal: Collection[str]) -> None:
    low, high = final.get("LS0"), final.get("LS1")
    for name in ("LS0", "LS1"):
        value = final.get(name)
        if name in goal and not (isinstance(value, tuple) and len(value) == 2 and value[1] in (0, 1)):
            raise Diagnostic(f"{name} = {value}: takes a position and 0 or 1")
    if ("LS0" in goal or "LS1" in goal) and crossed(low, high):
        raise Diagnostic(f"LS0 = {low} and LS1 = {high}: the minus limit must be below the plus limit")


def crossed(low: Value | None, high: Value | None) -> bool:
    """Whether two enabled software limits leave no way between them."""
    if not (isinstance(low, tuple) and isinstance(high, tuple)):
        return False
    return bool(low[1] and high[1]) and number(low[0]) >= number(high[0])


def _check_points(product: str, final: Mapping[str, Value], goal: Collection[str]) -> None:
    points = {name: value for name, value in final.items() if types(name, product) and isinstance(value, tuple)}
    for name, value in points.items():
        if name in goal:
            _check_point(name, value, product)
            other = points.get(PAIRS.get(name, ""))
            follows = name.startswith("S") and PAIRS.get(name) not in goal
            if other is not None and not follows and CLOCKS & {value[0], other[0]} and value[0] != other[0]:
                raise Diagnostic(f"{name} and {PAIRS[name]}: a clock takes both, with one type")
    for (one, first), (two, second) in combinations(points.items(), 2):
        grouped = group(one) == group(two) and first[0] == second[0]
        if grouped and first[0] not in SHARED and (one in goal or two in goal):
            raise Diagnostic(f"{one} and {two}: only one of them can have type {first[0]}")


def _check_point(name: str, value: tuple[object, ...], product: str) -> None:
    valid = types(name, product)
    if value[0] not in valid:
        raise Diagnostic(f"{name} = {list(value)}: type {value[0]}; valid: {', '.join(map(str, sorted(valid)))}")
    sources = product in EXPANDED or value[0] not in _OUTPUT
    if any(each not in (0, 1) for each in value[1:]) or (len(value) > 2 and value[2] and not sources):
        raise Diagnostic(f"{name} = {list(value)}: fields after the type must be 0 or 1, as the product has them")


def group(name: str) -> str:
    """The points among which a type may be unique; the analog input and the index mark are alone."""
    letters = name.rstrip("0123456789")
    return name if name in ("IS5", "IS6", "S5") else letters
