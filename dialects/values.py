"""Settings, conditions and other values of drives, and a snapshot; what a family says of these.

A reading has no side effect: it starts and clears nothing, and asks no word that the product refuses. A plan of changes
is computed from the present values, so that the drive refuses none of its steps. Conditions beyond position and
velocity are read in parts, each a short conversation: a typed line for a drive waits for one part at most. A part that
is `slow` reads settings, which change only when a line was sent.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose
from types import MappingProxyType
from typing import ClassVar

from multidrop.base.errors import Diagnostic, Inexpressible, Refused
from multidrop.base.text import real
from multidrop.dialects.by_hand import ByHand
from multidrop.dialects.codec import Priority, Procedure
from multidrop.dialects.controls import NAMES, UNKNOWN, Control, Controls, Homing, homings_by_mode
from multidrop.dialects.state import OfDrive, who

# Settings, and the steps that change them

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
        return {reading.name: reading.value for reading in self.readings}

    @property
    def defaults(self) -> dict[str, Value]:
        return {reading.name: reading.default for reading in self.readings if reading.default is not None}


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


def read_each(
    names: Sequence[str], read: Callable[[str], Procedure[Reading]], progress: Progress, unread: Pairs = ()
) -> Procedure[Readings]:
    """Read settings one by one; a refused one is listed as unread. Raises NoAnswer."""
    readings, refused = [], [*unread]
    for done, name in enumerate(names):
        progress(done, len(names))
        try:
            readings.append((yield from read(name)))
        except Refused as refusal:
            refused.append((name, str(refusal)))
    progress(len(names), len(names))
    return Readings(tuple(readings), tuple(refused))


class Parameters(OfDrive):
    """The settings of a drive. By default it has none that can be read."""

    language: ClassVar[str] = ""
    """The language whose names the settings bear; two families may share it."""
    saving: ClassVar[str] = "S"
    """The word that saves, for a message."""
    later: ClassVar[frozenset[str]] = frozenset()
    """Settings that act once they are saved and the drive is switched off and on."""

    def read(self, progress: Progress) -> Procedure[Readings]:
        """Read every setting."""
        raise Inexpressible(f"{who(self.state)}: no settings of such drives are known; nothing was sent")
        yield  # a conversation

    def plan(self, present: Readings, wanted: Mapping[str, Value], permission: Permission) -> Plan:
        """Plan the steps from the present to the wanted values. Raises Diagnostic for a value that it refuses."""
        now = present.values
        given = {self.spelled(name): value for name, value in wanted.items()}
        changed = {name: value for name, value in given.items() if not same(value, now.get(name))}
        cannot = {name: why for name, value in changed.items() if (why := self.impossible(name, value, present))}
        named = {self.spelled(name) for name in permission.named}
        withheld: dict[str, str] = {}
        for name, value in changed.items():
            if name in cannot or name in named or (permission.communication and self.communicates(name)):
                continue
            if why := COMMUNICATION if self.communicates(name) else self.risk(name, value, now):
                withheld[name] = why
        steps = self.steps(present, given, withheld, cannot)
        rescaled = [step.name for step in steps if self.rescales(step.name)]
        return Plan(tuple(steps), tuple(withheld.items()), tuple(cannot.items()), reference_lost(steps, rescaled))

    def spelled(self, name: str) -> str:
        """A name that a person wrote, as the drive has it."""
        return name.upper()

    def impossible(self, name: str, value: Value, present: Readings) -> str:
        """The reason for which the drive cannot get a value now; empty: it can."""
        return ""

    def communicates(self, name: str) -> bool:
        """Whether it is a setting of communication, which waits for a person's word."""
        return False

    def risk(self, name: str, value: Value, now: Mapping[str, Value]) -> str:
        """Another reason for which a setting waits for a person's word; empty: there is none."""
        return ""

    def rescales(self, name: str) -> bool:
        """Whether positions count another distance or direction after it changed."""
        return False

    def steps(
        self, present: Readings, wanted: Mapping[str, Value], withheld: Mapping[str, str], cannot: dict[str, str]
    ) -> Sequence[Change]:
        """Order the steps so that the drive refuses none. Raises Diagnostic for a value that it refuses.

        `wanted`: all values, as `spelled`. `withheld` and `cannot`: the settings that are left alone, each with the
        reason; a family may add to `cannot`.
        """
        return ()

    def ready(self) -> Procedure[str]:
        """Return the reason for which settings must not be changed now: it moves, a program runs; empty: none."""
        return ""
        yield

    def save(self) -> Procedure[object]:
        """Keep the settings over power-off."""
        raise Inexpressible(f"{who(self.state)}: such drives keep no settings, as far as is known; nothing was sent")
        yield

    def conflict(self, plan: Plan, others: Collection[str]) -> str:
        """The reason for which a plan cannot be carried out beside drives at these addresses; empty: there is none."""
        return ""


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
    return tuple(pair for pair in pairs if not same(pair[1], pair[2]))


UNREAD = -1
"""An error is set, and it has no number, or to read the number would clear it."""
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

    @property
    def known(self) -> bool:
        """False for one that the drive does not report, and for an analog input without a value."""
        return self.on is not None or self.name == "ai"


@dataclass(frozen=True)
class Pace:
    """The profile of a move: units/s and units/s2."""

    initial: float
    maximum: float
    acceleration: float
    deceleration: float


@dataclass(frozen=True)
class SlotState:
    """The state of one of several programs, by the name of its `by_hand.ProgramSlot`."""

    name: str
    state: str
    line: str = ""
    """Its place, where it runs or waits."""
    runs: bool = False


@dataclass(frozen=True)
class Conditions:
    """The conditions of one axis of a drive."""

    axis: str = ""
    lamps: tuple[Lamp, ...] = ()
    error: int = 0
    """The number of the error that is set; 0: none; UNREAD: its number is not known."""
    error_text: str = ""
    clears: str = ""
    """The line that clears the error, where the axis takes no move before it; empty: it takes moves."""
    cause: str = ""
    """What caused an error without a number, in few words, as far as readings that change nothing show it."""
    program: str = ""
    """The label of the program that runs, or `running`; empty: none runs."""
    runs: bool | None = None
    """Whether a program runs in the drive that can move it; None: this axis, or the family, does not report it."""
    line: str = ""
    """The place of the running program; empty where the drive does not report it."""
    slots: tuple[SlotState, ...] = ()
    """Each program, of a drive that runs several at once."""
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
    commanded: bool = False
    """The position is the one that was commanded: no encoder shows whether the motor followed."""
    unit: str = "steps"
    speed: str = ""
    """The unit of velocities; empty: `unit` a second."""
    pace: Pace | None = None
    modes: str = ""
    """How the drive is set to reply, as short as a person knows it: `EM1 CK1`."""

    @property
    def error_name(self) -> str:
        """`error`, with its number where the family gives a meaning to that: `/help NUMBER` explains it."""
        return "error" if self.error == UNREAD or self.clears else f"error {self.error}"

    @property
    def blocked(self) -> str:
        """The reason for which the axis takes no move, and what ends that; empty: it takes moves."""
        return f"{self.error_text}: {self.clears} clears it" if self.error and self.clears else ""

    @property
    def speed_unit(self) -> str:
        return self.speed or f"{self.unit}/s"

    @property
    def no_current(self) -> str:
        """The reason for which nothing holds the load at rest; empty: there is current, or that is not known."""
        return self.disabled or self.released


@dataclass(frozen=True)
class Part:
    """One short conversation that reads some facts, at the priority of polls. Raises Refused or NoAnswer."""

    name: str
    read: Callable[[], Procedure[Facts]]
    slow: bool = False


def printed_number(who: str, word: str, text: str) -> float:
    """Convert a printed value. Raises Refused where it is not one number."""
    if (number := real(text)) is None:
        raise Refused(f"{who}: {word} is not a number: {text.strip() or 'nothing'}")
    return number


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


class Actions(OfDrive):
    """What a program asks of a drive of any family, as lines of this one. An axis is as in `Motion.axis`."""

    error: ClassVar[str] = ""
    """The word that reads the number of the error and clears it."""
    no_error: ClassVar[str] = "such drives report no error by a number"
    """The reason for which no error can be read; empty: one can."""

    def homings(self, axis: str) -> Mapping[str, Mapping[str, str]]:
        """The lines that home an axis, by mode (the first is the usual one), then by direction.

        An empty direction: the drive's own settings fix it.
        """
        return {}

    def run(self, axis: str, velocity: int | str) -> tuple[str, ...]:
        """The lines that run at a velocity with a sign; it may be a quantity. Raises Inexpressible."""
        raise Inexpressible(f"{who(self.state)}: no line of such drives runs at a velocity; nothing was sent")

    def output(self, number: int, on: bool) -> str:
        """The line that switches an output. Raises Inexpressible."""
        raise Inexpressible(f"{who(self.state)}: no line of such drives switches an output; nothing was sent")

    def clear(self, axis: str) -> str:
        """The line that clears the error of an axis, where reading does not; empty: reading does."""
        return ""

    def word(self, word: str, axis: str) -> str:
        """A word as the drive has it, for an axis."""
        return word

    def ports(self) -> Mapping[int, str]:
        """The lines that read inputs which no conditions have, by number."""
        return {}


class Values(OfDrive):
    """What is read of a drive for a person, the settings that are changed, and the controls of an axis.

    By default nothing is known but position and velocity.
    """

    @property
    def parameters(self) -> Parameters:
        """Its settings."""
        return Parameters(self.state)

    @property
    def actions(self) -> Actions:
        """What a program asks of it."""
        return Actions(self.state)

    @property
    def by_hand(self) -> ByHand:
        """What a person edits and switches of it besides its settings."""
        return ByHand(self.state)

    def snapshot(self, progress: Progress) -> Procedure[Snapshot]:
        """Read everything of a drive that a cell file needs. Raises Refused, NoAnswer or Inexpressible."""
        raise Inexpressible(f"{who(self.state)}: no settings of such drives are known; nothing was sent")
        yield  # a conversation

    def parts(self, facts: Facts) -> Sequence[Part]:
        """The parts of the conditions to read, where these facts are known; none where the drive's mode forbids it."""
        return ()

    def fold(self, facts: Facts) -> tuple[Conditions, ...]:
        """The conditions of each axis, from what the parts have read."""
        return ()

    def check(self, word: str) -> str:
        """Return a word as the drive spells it; nothing is sent. Raises Diagnostic for one that must not be polled."""
        raise Diagnostic(f"{who(self.state)}: no value {word}", "", "valid: position, velocity")

    def first(self, word: str) -> Procedure[float]:
        """Read the value of a word for a person; verify that the drive has it. Raises Refused, NoAnswer or Stopped."""
        return (yield from self.again(word, Priority.OPERATOR))

    def again(self, word: str, priority: Priority) -> Procedure[float]:
        """Read a value that was read before. Raises NoAnswer or Stopped, and Refused where the drive lost the value."""
        raise Inexpressible(f"{who(self.state)}: no value {word}; nothing was sent")
        yield

    def controls(self, axis: str) -> Controls:
        """The controls of an axis."""
        return {name: Control(absent=UNKNOWN) for name in NAMES}

    def homings(self, axis: str) -> Sequence[Homing]:
        """Every way to home an axis, the usual one first."""
        return homings_by_mode(self.actions.homings(axis))

    def own(self, word: str) -> bool:
        """Whether a checked word belongs to the language; any other would be a name that a person gave."""
        return True
