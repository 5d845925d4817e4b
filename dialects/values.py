"""What a family reads of its drives for a person: conditions, values to poll, a snapshot; and the controls of an axis.

A reading has no side effect: it starts and clears nothing, and asks no word that the product refuses. Conditions beyond
position and velocity are read in parts, each a short conversation: a typed line for a drive waits for one part at most.
A part that is `slow` reads settings, which change only when a line was sent. Every move among the controls is bounded:
it ends by itself. A line of a control holds `{by}` for a distance and `{to}` for a position.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Generic, TypeVar

from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.parameters import Readings, Value
from multidrop.dialects.state import DriveState

UNREAD = -1
"""An error is set, and to read its number would clear it."""
Facts = Mapping[str, Value]
"""What parts have read, by name."""


@dataclass(frozen=True)
class Lamp:
    """One input or output: its name on the drive, its function in one word, and whether it is active."""

    name: str
    function: str = ""
    on: bool | None = None
    """None: the drive does not report it."""
    output: bool = False


@dataclass(frozen=True)
class Pace:
    """The profile of a move: units/s and units/s2."""

    initial: float
    maximum: float
    acceleration: float
    deceleration: float


@dataclass(frozen=True)
class Conditions:
    """The conditions of one axis of a drive."""

    axis: str = ""
    lamps: tuple[Lamp, ...] = ()
    error: int = 0
    """The number of the error that is set; 0: none; UNREAD: its number is not known."""
    error_text: str = ""
    program: str = ""
    """The label of the program that runs, or `running`; empty: none runs."""
    runs: bool | None = None
    """Whether a program runs in the drive that can move it; None: this axis, or the family, does not report it."""
    line: str = ""
    """The place of the running program; empty where the drive does not report it."""
    target: int | None = None
    """The end of the move that is under way, where it is known."""
    limits: tuple[int, int] | None = None
    """The travel between software limits."""
    disabled: str = ""
    """The reason for which the output stage is off, `DE=0`; empty: it is on, or that is not known."""
    released: str = ""
    """The reason for which no current holds the motor at rest, although it can move: `HC=0`."""
    run_current: int | None = None
    hold_current: int | None = None
    more: tuple[tuple[str, str], ...] = ()
    """Names and values of what only this family has."""
    unit: str = "steps"
    pace: Pace | None = None
    modes: str = ""
    """How the drive is set to reply, as short as a person knows it: `EM1 CK1`."""

    @property
    def no_current(self) -> str:
        """The reason for which nothing holds the load at rest; empty: there is current, or that is not known."""
        return self.disabled or self.released


S = TypeVar("S", bound=DriveState)


@dataclass(frozen=True)
class Part(Generic[S]):
    """One short conversation that reads some facts, at the priority of polls. Raises Refused or NoAnswer."""

    name: str
    read: Callable[[S], Procedure[Facts]]
    slow: bool = False


@dataclass(frozen=True)
class Reader(Generic[S]):
    """Reads the conditions of the drives of a family."""

    parts: Callable[[S, Facts], Sequence[Part[S]]]
    """The parts to read of a drive, where these facts are known; none where its mode forbids it."""
    fold: Callable[[S, Facts], tuple[Conditions, ...]]
    """The conditions of each axis, from what the parts have read."""


@dataclass(frozen=True)
class PolledValues(Generic[S]):
    """Values by their words. No reading clears or starts anything in the drive."""

    check: Callable[[S, str], str]
    """Return the word as the drive spells it; nothing is sent. Raises Diagnostic for a word that must not be polled."""
    first: Callable[[S, str], Procedure[float]]
    """Read a value for a person, and make sure that the drive has it. Raises Refused, NoAnswer or Stopped."""
    again: Callable[[S, str, Priority], Procedure[float]]
    """Read a value that was read before. Raises NoAnswer or Stopped, and Refused where the drive lost the value."""
    own: Callable[[S, str], bool] = lambda state, word: True
    """Whether a checked word belongs to the language; any other would be a name that a person gave."""


def printed_number(who: str, word: str, text: str) -> float:
    """Convert a printed value. Raises ValueError with one line for a person where it is not one number."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{who}: {word} is not a number: {text.strip() or 'nothing'}") from None


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


BY, TO, HOME_MINUS, HOME_PLUS = "by", "to", "home-", "home+"
STOP, ENABLE, DISABLE = "stop", "enable", "disable"
NAMES = (BY, TO, HOME_MINUS, HOME_PLUS, STOP, ENABLE, DISABLE)
LOW, HIGH = -(2**31), 2**31 - 1
"""The range of positions of every family."""


@dataclass(frozen=True)
class Control:
    """One control. `about`: what it does, where its lines do not say it."""

    lines: tuple[str, ...] = ()
    about: str = ""
    absent: str = ""
    """The reason for which the family has no such control; it has no lines then."""

    def filled(self, by: int = 0, to: int = 0) -> tuple[str, ...]:
        return tuple(line.format(by=by, to=to) for line in self.lines)

    def shown(self, by: str = "", to: str = "") -> str:
        return ", ".join(line.format(by=by, to=to) for line in self.lines)


Controls = Mapping[str, Control]
"""Controls by name; every name of `NAMES` is there."""
