"""What a unit takes now of the values that its register allows: limits that rest on its other settings.

A register's range is the widest. The drive refuses more (exception 03), and a person must see its own limit. Pure
functions of the settings that were read. (MCode reference 5.1.1, 5.1.6, 5.1.18, 5.1.55, 5.1.82, 5.1.85, 5.1.86,
5.1.117, 5.1.120, 5.1.139, 5.1.140, 7.3.7; docs/rulings/modbus.md.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.families.lexium.manual.parameter_plan import LEAST_WITH_HMT, LONGEST_DELAY, PER_MICROSTEP
from multidrop.families.lexium.manual.parameters import TORQUE, counting
from multidrop.families.lexium.manual.table import words

NEWEST = "LMDCE"
"""The product with every register."""
Now = Mapping[str, int]
"""Values of registers by name."""
Spans = Sequence[tuple[int, int]]
"""Pairs of lowest and highest value."""


@dataclass(frozen=True)
class Limit:
    """The limit of one name: the registers that it rests on, and the values that are taken."""

    rests_on: tuple[str, ...]
    spans: Callable[[Now], Spans]


UNIT = ("EE", "AS")
"""The settings that the unit of motion rests on: steps or counts."""


def _high(name: str, now: Now) -> int:
    """The highest value that MCode has for a name, in the unit of motion as it is now."""
    return int(words(NEWEST)[name].bounds(encoder=counting(now))[1] or 0)


def _fastest(name: str, now: Now) -> int:
    return _high(name, now) if counting(now) else min(_high(name, now), now["MS"] * PER_MICROSTEP)


def _lowest(name: str) -> int:
    return REGISTERS[name].spans[0][0]


def _resolution(now: Now) -> Spans:
    if counting(now):
        return [(now["MS"], now["MS"])]
    return [span for span in REGISTERS["MS"].spans if not now["AS"] or span[0] >= LEAST_WITH_HMT]


def _ramp(name: str) -> Limit:
    return Limit(UNIT, lambda now: [(_lowest(name), _high(name, now))])


def _slew(now: Now) -> Spans:
    return [(-_fastest("SL", now), _fastest("SL", now))]


LIMITS: Mapping[str, Limit] = {
    "A": _ramp("A"),
    "D": _ramp("D"),
    "VI": Limit(("VM", "MS", *UNIT), lambda now: [(1, min(now["VM"] - 1, _fastest("VI", now)))]),
    "VM": Limit(("VI", "MS", *UNIT), lambda now: [(now["VI"] + 1, _fastest("VM", now))]),
    "SL": Limit(("MS", *UNIT), _slew),
    "MF": Limit(("VM", *UNIT), lambda now: [] if counting(now) else [(_lowest("MF"), now["VM"])]),
    "MS": Limit(("MS", *UNIT), _resolution),
    "AS": Limit(("MS",), lambda now: [(0, 0)] if now["MS"] < LEAST_WITH_HMT else []),
    "CB": Limit(("AS",), lambda now: [(0, 0)] if now["AS"] == TORQUE else []),
    "HT": Limit(("MT",), lambda now: [(0, 0), (2, LONGEST_DELAY - now["MT"])]),
    "MT": Limit(("HT",), lambda now: [(0, LONGEST_DELAY - now["HT"])]),
    **dict.fromkeys(("ST", "ER"), Limit((), lambda now: [(0, 0)])),
    "TA": Limit((), lambda now: [(0, 31)]),
}
"""The limits by name. Other names take what their register's range says."""


def rests_on(name: str) -> tuple[str, ...]:
    """The registers that must be read to know the limit of a name."""
    return LIMITS[name].rests_on if name in LIMITS else ()


def own(name: str, value: int, now: Now) -> str:
    """Say what a unit takes that refused a value in its register's range; empty where that is not known.

    `now`: the registers of `rests_on` that could be read. A range that contains the value is never named.
    """
    limit = LIMITS.get(name)
    if limit is None or any(word not in now for word in limit.rests_on):
        return ""
    spans = limit.spans(now)
    if not spans or any(low <= value <= high for low, high in spans):
        return ""
    valid = ", ".join(f"{low} to {high}" if high > low else str(low) for low, high in spans if high >= low)
    why = ", ".join(f"{word}={now[word]}" for word in limit.rests_on)
    return f"{valid} now" + (f" ({why})" if why else "")
