"""The inputs and outputs of the MCode products: the types that each takes, and its set-up from the factory.

`points.csv` has a row for each point of a Lexium, of the Motion Module (`module`), of an MDrivePlus (`mdrive`) and of
one with expanded I/O. A point of a Lexium is an input (IS), an output (OS), or both, with the same number. One of an
MDrivePlus is either (S<n>). `hmt` are types of outputs that show something only with hMT. (Lexium: MCode reference 3.4,
5.1.64 to 5.1.66, 5.1.93, 7.2. MDrivePlus: reference of 2012, 3.4.3, 5-63 to 5-67, 7.2.)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from multidrop.base.files import rows
from multidrop.families.lexium.manual.mnemonic import CLOSED_LOOP


class Point(NamedTuple):
    """One input or output. `fresh` is the set-up from the factory; of a point that is both, as an input."""

    inputs: frozenset[int]
    outputs: frozenset[int]
    hmt: frozenset[int]
    fresh: tuple[int, ...]


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, text.split()))


def _groups() -> Mapping[str, Mapping[int, Point]]:
    found: dict[str, dict[int, Point]] = {}
    for row in rows(__file__, "points.csv"):
        inputs, outputs, hmt = (frozenset(_numbers(row[column])) for column in ("inputs", "outputs", "hmt"))
        found.setdefault(row["group"], {})[int(row["point"])] = Point(inputs, outputs, hmt, _numbers(row["fresh"]))
    return found


POINTS = _groups()
"""The points by group and number."""
_LEXIUM, _EXPANDED = POINTS["lexium"], POINTS["expanded"]
_HMT = frozenset().union(*(each.hmt for each in _LEXIUM.values()))
_TYPES: Mapping[str, frozenset[int]] = {
    **{f"IS{n}": each.inputs for n, each in _LEXIUM.items()},
    **{f"OS{n}": each.outputs for n, each in _LEXIUM.items() if each.outputs},
    **{f"S{n}": each.inputs | each.outputs for n, each in _EXPANDED.items()},
}
FRESH: Mapping[str, tuple[int, ...]] = {
    **{f"IS{n}": each.fresh for n, each in _LEXIUM.items()},
    **{f"S{n}": each.fresh for n, each in _EXPANDED.items()},
}
"""The set-up of each point from the factory; an output of a Lexium has another one."""
OUTPUT_TYPES = frozenset().union(*(each.outputs for each in POINTS["mdrive"].values()))
"""The types of the outputs of an MDrivePlus, but for those of a clock."""


def types(name: str, product: str) -> frozenset[int]:
    """The types that a point takes; empty for any other setting."""
    hmt = _HMT if name.startswith("OS") and product in CLOSED_LOOP else frozenset()
    return _TYPES.get(name, frozenset()) | hmt
