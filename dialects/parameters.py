"""The record of a drive's parameters: what a drive reports of its settings, and the steps that change them.

A reading has no side effect: it starts and clears nothing, and sends no word that the product refuses. A plan is
computed from the present values, so that the drive refuses none of its steps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import Generic, TypeVar

from multidrop.dialects.codec import Procedure
from multidrop.dialects.errors import Refused
from multidrop.dialects.state import DriveState

Scalar = int | float | str
Value = Scalar | tuple[Scalar, ...]
"""A number, a text, or the fields of a set-up."""
Progress = Callable[[int, int], None]
"""Called with steps done and steps in all."""
Pairs = tuple[tuple[str, str], ...]
"""Names, each with a reason for a person."""

PARAMETERS, IO, VARIABLES = "parameters", "io", "variables"
SECTIONS = (PARAMETERS, IO, VARIABLES)
"""The parts of a drive's settings, and the tables of a file: settings, set-ups of points, user variables."""
TOLERANCE = 1e-6
"""Fractions that differ by less are the same: drives print them with six decimals."""


@dataclass(frozen=True)
class Reading:
    """One setting as the drive reports it. `default` is None where it has none."""

    name: str
    value: Value
    section: str = PARAMETERS
    unit: str = ""
    default: Value | None = None
    fixed: bool = False
    """Identity, communication or read-only: only written when named."""


@dataclass(frozen=True)
class Readings:
    """The settings of one drive. `unread` has what could not be read; `labels` are those of the program in it."""

    readings: tuple[Reading, ...] = ()
    unread: Pairs = ()
    labels: tuple[str, ...] = ()

    @property
    def values(self) -> dict[str, Value]:
        return {each.name: each.value for each in self.readings}

    @property
    def defaults(self) -> dict[str, Value]:
        return {each.name: each.default for each in self.readings if each.default is not None}


@dataclass(frozen=True)
class Change:
    """One step: the line to send, and the setting that it changes. `before` is None where that is not known."""

    name: str
    before: Value | None
    after: Value
    text: str
    temporary: bool = False
    """A later step changes the same setting again."""


@dataclass(frozen=True)
class Permission:
    """What a plan may change beyond ordinary settings: settings by name, and all communication settings."""

    named: frozenset[str] = frozenset()
    communication: bool = False


ORDINARY = Permission()
COMMUNICATION = "it is a communication setting"
"""The reason for which a plan withholds such a setting."""


def reference_lost(changes: Sequence[Change], names: Collection[str]) -> tuple[str, ...]:
    """Say that positions count other distances after steps that change one of these settings."""
    scale = sorted({change.name for change in changes if change.name in names})
    if not scale:
        return ()
    return (f"{', '.join(scale)}: the position counter then counts another distance or direction; home before a move",)


@dataclass(frozen=True)
class Plan:
    """The steps to the wanted values, in order, and the names that they leave alone, with reasons."""

    changes: tuple[Change, ...] = ()
    withheld: Pairs = ()
    """Settings that the permission does not include."""
    impossible: Pairs = ()
    """Settings that the drive cannot take now."""
    remarks: tuple[str, ...] = ()
    """What the steps mean for the next moves, for a person."""

    def __iter__(self) -> Iterator[Change]:
        return iter(self.changes)

    def __len__(self) -> int:
        return len(self.changes)


S = TypeVar("S", bound=DriveState)


def read_each(
    names: Sequence[str], read: Callable[[str], Procedure[Reading]], progress: Progress, unread: Pairs = ()
) -> Procedure[Readings]:
    """Read settings one by one; a refused one is listed as unread. Raises NoAnswer."""
    found, refused = [], [*unread]
    for done, name in enumerate(names):
        progress(done, len(names))
        try:
            found.append((yield from read(name)))
        except Refused as refusal:
            refused.append((name, str(refusal)))
    progress(len(names), len(names))
    return Readings(tuple(found), tuple(refused))


def no_conflict(plan: Plan, others: Collection[str]) -> str:
    """Return no reason: the settings of the family give a drive no address."""
    return ""


@dataclass(frozen=True)
class Parameters(Generic[S]):
    """Parameters of the drives of a family."""

    read: Callable[[S, Progress], Procedure[Readings]]
    """Read every setting."""
    plan: Callable[[S, Readings, Mapping[str, Value], Permission], Plan]
    """Order the steps from the present to the wanted values. Raises Diagnostic for a value that the drive refuses."""
    ready: Callable[[S], Procedure[str]]
    """Return the reason for which settings must not be changed now: it moves, a program runs; empty: there is none."""
    write: Callable[[S, Change], Procedure[object]]
    """Carry out a step, and make sure of it."""
    save: Callable[[S], Procedure[object]]
    """Keep the settings over power-off."""
    language: str
    """The language whose names the settings bear; two families may share it."""
    saving: str = "S"
    """The word that saves, for a message."""
    conflict: Callable[[Plan, Collection[str]], str] = no_conflict
    """The reason for which a plan cannot be carried out beside drives at these addresses; empty: there is none."""
    later: frozenset[str] = frozenset()
    """Settings that act once they are saved and the drive is switched off and on."""


def number(value: Value | None) -> float:
    return value if isinstance(value, (int, float)) else 0


def same(one: Value | None, other: Value | None) -> bool:
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, (int, float)) and isinstance(other, (int, float)):
        fraction = isinstance(one, float) or isinstance(other, float)
        return isclose(one, other, rel_tol=TOLERANCE, abs_tol=TOLERANCE) if fraction else one == other
    return one == other


def differing(
    here: Mapping[str, Value], there: Mapping[str, Value]
) -> tuple[tuple[str, Value | None, Value | None], ...]:
    """The names whose values differ, each with both values; None where one side has none."""
    names = [*here, *(name for name in there if name not in here)]
    pairs = [(name, here.get(name), there.get(name)) for name in names]
    return tuple(each for each in pairs if not same(each[1], each[2]))
