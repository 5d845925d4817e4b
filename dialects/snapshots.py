"""The record of one drive as it was read: what a cell file needs to be that drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol, TypeVar

from multidrop.dialects.codec import Procedure
from multidrop.dialects.parameters import Progress, Readings
from multidrop.dialects.state import DriveState

S_contra = TypeVar("S_contra", bound=DriveState, contravariant=True)


class TakeSnapshot(Protocol[S_contra]):
    """The conversation that reads a drive."""

    def __call__(self, state: S_contra, progress: Progress, /) -> Procedure[Snapshot]:
        """Read everything of a drive that a cell file needs. Raises Refused or NoAnswer."""


@dataclass(frozen=True)
class Levels:
    """The word that reads all inputs of a drive at once, and the place of each in it."""

    word: str
    bits: tuple[tuple[int, int], ...]
    """For each input its number and its bit."""
    inverted: bool = False
    """A 1 is ground."""

    def of(self, value: int) -> tuple[tuple[int, int], ...]:
        """The level of each input, by number; 1 is +V."""
        return tuple((number, (value >> bit & 1) ^ self.inverted) for number, bit in self.bits)


@dataclass(frozen=True)
class Snapshot:
    """One drive: its identity, its settings, its program, and its state at the moment of reading."""

    kind: str
    """The simulated family that speaks its language."""
    product: str
    part: str = ""
    version: str = ""
    serial: str = ""
    name: str = ""
    """The name that it bears; empty where it has none."""
    party: bool = False
    baud: int = 0
    """The baud rate to which its port is set; 0 where it has none."""
    readings: Readings = Readings()
    program: tuple[tuple[int, str], ...] = ()
    """The lines of its program, each with its address."""
    remarked: tuple[str, ...] = ()
    """The listing with the remarks of the downloaded file that it came from; empty where that is not known."""
    counters: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: MappingProxyType({}))
    """Values for each axis, by the keys of a cell file."""
    inputs: tuple[tuple[int, int], ...] = ()
    """Inputs that were read: number, and level (1 is +V)."""
    levels: Levels | None = None
    """How its inputs are read again; None where the family reads none."""
    active: bool = False
    """It moved, or a program ran, while it was read."""
    analog: tuple[int, ...] = ()
    """Analog inputs, one for each axis."""
    remarks: tuple[str, ...] = ()
    """What a person must know of it: it moves, its program is locked."""
