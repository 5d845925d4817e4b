"""What a plot shows, as it is passed on: curves with their samples, lanes of states, and lines of text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from multidrop.shell.roles import DIFFERENCE

UNITS = {"position": "steps", "velocity": "steps/s", DIFFERENCE: "steps"}
"""The quantities of every drive, and the difference from its twin, with their units."""
TWIN = "twin"
"""The part of a path before the quantities of a twin; also its lane of states."""


class PlottedCurve(NamedTuple):
    """One curve: `axis` is empty for a drive with one axis, `word` is `position`, `velocity` or a word of the drive.

    `twin`: of its twin.
    """

    bus: str
    address: str
    axis: str
    word: str
    twin: bool = False
    unit: str = ""
    """The unit of a curve beside that of what the drive counts."""

    @property
    def name(self) -> str:
        """`position`, or `position_mm`, `velocity_mm_per_s`."""
        return f"{self.word}_{self.unit.replace('/', '_per_')}" if self.unit else self.word

    @property
    def shown_unit(self) -> str:
        return self.unit or UNITS.get(self.word, "")

    @property
    def place(self) -> tuple[str, ...]:
        return (*self[:3], *(TWIN,) * self.twin, self.name)

    @property
    def drive(self) -> tuple[str, ...]:
        return tuple(part for part in self[:3] if part)


class StateLane(NamedTuple):
    """One lane of states: a program, an error, an input or an output."""

    bus: str
    address: str
    axis: str
    name: str


@dataclass
class Batch:
    """The samples and texts since the last flush; times are (elapsed, s; wall clock, s since 1970)."""

    curves: dict[PlottedCurve, list[tuple[float, float, float]]] = field(default_factory=dict)
    texts: dict[str, list[tuple[float, float, str, str]]] = field(default_factory=dict)
    gaps: dict[PlottedCurve, list[tuple[float, float]]] = field(default_factory=dict)
    """Times at which a curve ends; the next sample begins it again."""
    states: dict[StateLane, list[tuple[float, float, str]]] = field(default_factory=dict)
    """Changes of state; an empty one is not known."""
    labels: dict[tuple[str, str], str] = field(default_factory=dict)
    """Drives that begin to be plotted, in order, with the names that people gave to them."""

    def __bool__(self) -> bool:
        return bool(self.curves or self.texts or self.gaps or self.states or self.labels)
