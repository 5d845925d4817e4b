"""The parameters of TMCL modules, one record for each row of `parameters.csv`, and the groups that code asks for.

The table has the axis parameters (`axis`), those that modules which count in units of their chip have otherwise
(`chip`), the global ones of bank 0 (`global`), and those that one module has otherwise (its number). A row has a cell
for every fact of a `TmclParameter`, where the columns are explained; `-` is none. An empty cell is an error, so that a
new parameter answers every question. (TMCL firmware manuals, "Axis parameters", "Global parameters".)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from multidrop.base.files import rows
from multidrop.dialects.units import Takes

INT32 = range(-(2**31), 2**31)
NONE = "-"
UNKNOWN = "?"
_FLAGS = {"yes": True, "no": False}


class Starts(StrEnum):
    """What setting an axis parameter can start."""

    NOTHING = "-"
    MOTION = "motion"
    """One motion, at once."""
    LATER = "later"
    """A motion also later, once the motor was at rest: it changes what a target is compared with, or how fast."""


@dataclass(frozen=True)
class TmclParameter:
    """One parameter. `limits`: the values that can be set, in order; empty for one that is only read."""

    title: str
    limits: Sequence[int] = range(0)
    unit: str = ""
    fresh: int = 0
    live: bool = False
    """It shows a state of the moment: it is no setting, and nothing restores it."""
    known: bool = True
    """More than its number and its name is public; `?` in `valid`, and any value of 32 bits is taken."""
    starts: Starts = Starts.NOTHING
    quantity: Takes | None = None
    """What its value measures in the unit of motion."""
    scale: int = 0
    """Its turn among the parameters that give a microstep, a velocity or an acceleration its size, when these are read;
    0: it is none."""
    ramp: bool = False
    """It changes a motion that runs."""
    restored: int = 0
    """Its turn when settings are restored: below 0 before those with 0, which have any order."""
    wire: bool = False
    """It belongs to communication."""
    clears: bool = False
    """Reading it clears it."""
    risk: str = ""
    """Why a value other than 0 is restored only if a person agrees."""

    @property
    def writable(self) -> bool:
        return len(self.limits) > 0

    @property
    def setting(self) -> bool:
        return self.writable and not self.live

    @property
    def valid(self) -> str:
        """The values that can be set, in words."""
        if not self.known:
            return "range not known"
        if isinstance(self.limits, range):
            return f"{self.limits[0]} to {self.limits[-1]}"
        ends = [n for n in self.limits if n - 1 not in self.limits or n + 1 not in self.limits]
        return ", ".join(f"{low} to {high}" for low, high in zip(ends[::2], ends[1::2], strict=True))


def _limits(text: str) -> Sequence[int]:
    if text == NONE:
        return range(0)
    if text == UNKNOWN:
        return INT32
    ends = (part.split("..") for part in text.split())
    ranges = [range(int(low), int(high) + 1) for low, high in ends]
    return ranges[0] if len(ranges) == 1 else tuple(n for span in ranges for n in span)


def _text(text: str) -> str:
    return "" if text == NONE else text


def record(row: Mapping[str, str]) -> TmclParameter:
    """Make the record of a row. Raises ValueError for a wrong cell."""
    if empty := [column for column, text in row.items() if not text]:
        raise ValueError(f"the row of {row['group']} {row['number']} says nothing of: {', '.join(empty)}")
    return TmclParameter(
        title=row["title"],
        limits=_limits(row["valid"]),
        unit=_text(row["unit"]),
        fresh=int(row["fresh"]),
        live=_FLAGS[row["live"]],
        known=row["valid"] != UNKNOWN,
        starts=Starts(row["starts"]),
        quantity=None if row["quantity"] == NONE else Takes[row["quantity"].upper()],
        scale=0 if row["scale"] == NONE else int(row["scale"]),
        ramp=_FLAGS[row["ramp"]],
        restored=0 if row["restored"] in (NONE, "any") else int(row["restored"]),
        wire=_FLAGS[row["wire"]],
        clears=_FLAGS[row["clears"]],
        risk=_text(row["risk"]),
    )


def _groups() -> Mapping[str, Mapping[int, TmclParameter]]:
    found: dict[str, dict[int, TmclParameter]] = {}
    for row in rows(__file__, "parameters.csv"):
        found.setdefault(row["group"], {})[int(row["number"])] = record(row)
    return found


GROUPS = _groups()
"""The parameters by group and number: `axis`, `chip`, `global`, and the name of a module for those that only it has."""
AXIS: Mapping[int, TmclParameter] = {**GROUPS["chip"], **GROUPS["axis"]}
"""A row for each axis parameter of any module."""


def row_of(number: int, of_module: bool) -> TmclParameter | None:
    """The row of an axis parameter, or of a global one `of_module`; of a module without a row, too. None: no such."""
    return (GROUPS["global"] if of_module else AXIS).get(number)


def those(fact: Callable[[TmclParameter], bool]) -> frozenset[int]:
    """The axis parameters for which a fact holds."""
    return frozenset(number for number, row in AXIS.items() if fact(row))


TARGETS = those(lambda row: row.starts is Starts.MOTION)
"""Axis parameters that start one motion when they are set: target position and velocity."""
STARTING = those(lambda row: row.starts is not Starts.NOTHING)
"""Axis parameters that can start a motion when they are set.

Besides the targets: the actual position, where the target differs from it; the velocity, where a move waits at 0.
"""
CLEARED_BY_READING = those(lambda row: row.clears)
MEASURED: Mapping[int, Takes] = {number: row.quantity for number, row in AXIS.items() if row.quantity is not None}
"""Axis parameters whose value is a quantity in the unit of motion."""
SCALES = tuple(sorted(those(lambda row: row.scale > 0), key=lambda number: AXIS[number].scale))
"""Axis parameters that give a microstep, a velocity or an acceleration its size, as they are read one by one."""
RAMPS = those(lambda row: row.ramp)
"""Axis parameters that change a motion that runs."""
