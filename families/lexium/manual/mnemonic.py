"""The record of one word of MCode: every fact about it that any part of multidrop uses.

The numbers follow section 5 of the MCode reference. Where its tables contradict each other, one reading was chosen, and
`note` has what would surprise a user. Limits that depend on another variable (VM's on MS, HT's on MT) have their widest
values here, with the rule in `note`.

A fact that only some words have is a field of the record, never a set of words beside the code that needs it. So a row
of the table answers every question, and `groups` has the sets that code asks for.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

INT_LOW, INT_HIGH = -2147483648, 2147483647
FLOAT_HIGH = 1.7976931348623157e308

LEXIUM = frozenset({"LMDOM", "LMDCM", "LMDOE", "LMDCE", "LMM"})
"""Lexium MDrive, open and closed loop (M serial, E Ethernet), and the Lexium Motion Module."""
ETHERNET = re.compile(r"LMD.E")
"""Matches the products with an Ethernet port, unknown ones too."""
CLOSED_LOOP = frozenset({"LMDCM", "LMDCE"})
"""The products with hMT."""
ENCODER = CLOSED_LOOP | {"LMM"}
"""The products with an encoder, or an input for one."""

MDRIVE_PLUS = frozenset({"MDI", "MDIE", "MDIX"})
"""MDrivePlus with Motion Control: the base unit, with an encoder, and the Plus2 with expanded I/O."""
EXPANDED = frozenset({"MDIX"})
MDRIVE_ENCODER = frozenset({"MDIE", "MDIX"})

EVERY = LEXIUM | MDRIVE_PLUS

Number = int | float
Default = int | float | str | None


class AllowedUse(StrEnum):
    """Where a word is allowed."""

    BOTH = "both"
    TYPED = "typed"
    STORED = "stored"
    """In a program only."""
    NEVER = "never"


class PrintedValue(StrEnum):
    """What PR prints for a word."""

    NOTHING = "-"
    ONE = "one"
    """One value."""
    OPTION = "option"
    """One value, which a number after the word selects."""
    SEVERAL = "several"
    """Several values in one line."""
    LINES = "lines"
    """Several lines, without an end of their own."""


class FormKind(StrEnum):
    """What a value consists of."""

    NONE = "-"
    """The word has no value."""
    NUMBER = "number"
    OPTION = "option"
    """A number, and a second one that may be left out."""
    TEXT = "text"
    FIELDS = "fields"
    """Several numbers; `Setup.numbers` has how many, and then the greatest of each where the drive limits them."""
    LIST = "list"
    """A set-up for each number of `Setup.numbers`, the first field of a line that writes one."""
    TRIP = "trip"
    """A condition and the subroutine that it runs; `Setup.numbers` has the bit of TE that enables it."""


class Setup(NamedTuple):
    """The form of a value, with what its kind needs."""

    form: FormKind
    numbers: tuple[int, ...] = ()
    removable: bool = False
    """A trip that 0 removes; others stay until FD."""
    repeated: bool = False
    """A trip with how often it repeats as its last field."""


class Leads(StrEnum):
    """Where a word leads the program. Most of these take a place, a label or an address, among their arguments."""

    ON = "-"
    """To the next line."""
    BRANCH = "branch"
    """To the place, if the condition after it holds."""
    CALL = "call"
    """To the subroutine there and back, if the condition after it holds."""
    ROUTINE = "routine"
    """On; the place is the subroutine that an error or a trip will run."""
    START = "start"
    """It runs the program there."""
    MARK = "mark"
    """On; it only names the place, to list, to erase or to break."""
    RETURN = "return"
    """Behind the call."""
    END = "end"
    """Nowhere: the program ends."""


class NameEffect(StrEnum):
    """What a word does to the name after it."""

    NOTHING = "-"
    STEP = "step"
    """Adds or subtracts 1."""
    INPUT = "input"
    """Takes a number from the line into it."""
    DECLARE = "declare"
    """Declares it as a variable or a label."""


class Retention(StrEnum):
    """How long a value is kept (5.1.45, 5.1.113)."""

    NONE = "-"
    """The word has no value."""
    STATE = "no"
    """Until the next reset: a counter, a reading, an armed trip or a flag. It is no setting, whatever may write it."""
    SAVED = "saved"
    """After S; FD restores the default."""
    UNIT = "unit"
    """After S, and FD keeps it: it belongs to the motor unit."""


class WireSetting(StrEnum):
    """Whether a setting belongs to communication."""

    NO = "-"
    FORM = "form"
    """It changes what lines, replies or the stop look like, at once: the host must know its value to talk at all."""
    LINE = "line"
    """It is another setting of the line."""


class PositionEffect(StrEnum):
    """What writing a word does to positions."""

    NOTHING = "-"
    SETS = "position"
    """Sets the position."""
    COUNTS = "counter"
    """Sets a counter, which may be the one that the position shows."""
    SCALES = "scale"
    """Changes the length or the sign of what a position counts."""


class WordQuantity(StrEnum):
    """What the number of a typed line, or the one that PR prints, measures in the unit of motion."""

    NONE = "-"
    PLACE = "place"
    DISTANCE = "distance"
    SPEED = "speed"
    VELOCITY = "velocity"
    """A speed with a sign."""
    ACCELERATION = "acceleration"


class MotionEffect(StrEnum):
    """What an instruction does to motion."""

    NONE = "-"
    MOVE = "move"
    """Moves to a target."""
    SLEW = "slew"
    """Turns until another command ends that; 0 ends it."""
    HOMING = "homing"
    TEST = "test"
    """Moves the motor to test the drive."""
    PROGRAM = "program"
    """Runs or continues a program, which may move."""
    PAUSE = "pause"
    """Stops a program and its motion, to be resumed."""
    RESUME = "resume"
    END = "end"
    """Ends a program; its motion goes on."""
    RELEASE = "release"
    """Switches the bridges on again after a fault."""


class AtZero(StrEnum):
    """What a word with the value 0 ends."""

    NOTHING = "-"
    MOTION = "stops"
    TORQUE = "releases"
    """Motion or torque; a load may fall."""
    TRIPS = "disarms"


class Alone(StrEnum):
    """What moves the motor by itself while a value is not 0, without a line of ours."""

    NOTHING = "-"
    TRIPS = "trips"
    """Armed trips, which run subroutines."""
    JOG = "jog inputs"
    CLOCK_INPUTS = "clock inputs"
    CLOCK = "clock"
    CORRECTION = "position"
    """The drive goes back to its own position."""


class MotionWait(StrEnum):
    """How a line of a program with this word may wait for the end of a motion."""

    NO = "-"
    HOLDS = "holds"
    """Executing it waits, or ends the motion or the program."""
    WATCHES = "watches"
    """Its value shows the motion."""


class MemoryEffect(StrEnum):
    """What an instruction does to the memory that keeps settings and programs; a drive is slow to reply to each."""

    NOTHING = "-"
    SAVES = "saves"
    RESTORES = "restores"
    """Puts every variable and flag back to its saved value."""
    ERASES = "erases"
    RESETS = "resets"
    """Puts every setting back to its default, and erases programs."""


@dataclass(frozen=True, kw_only=True)
class Mnemonic:
    """One word or operator of the language.

    `low` and `high` bound the values to write (to read, if read only; the first number of an instruction); None where a
    number makes no sense. The `_encoder` bounds hold while EE=1; None: equal to the others. `access` is RW, RO, WO, RC
    (read, and cleared) or `-`. `kind` is variable, flag, instruction, keyword, math or reserved. `products` execute it.
    """

    name: str
    title: str
    meaning: str
    section: str
    syntax: str
    access: str
    kind: str
    low: Number | None
    high: Number | None
    unit: str
    default: Default
    low_encoder: Number | None
    high_encoder: Number | None
    unit_encoder: str
    default_encoder: Number | None
    values: tuple[Number, ...]
    """The only accepted numbers, where not all between low and high are."""
    gap: tuple[Number, ...]
    """Numbers between low and high that are refused."""
    step: int
    """The error of IC and DC on it (section 5.1.29): 0 allowed, 25 read only, 26 a mode or a setting."""
    products: frozenset[str]
    reserved_on: frozenset[str]
    """The products that know the word; on others it is a free name. Known but absent is error 37."""
    zero_on: frozenset[str]
    """The products that lack it and print it as 0."""
    firmware: int
    """The first firmware of a Lexium that has it; 0: any has."""
    large: bool
    """A Lexium of NEMA size 17 lacks it."""
    use: AllowedUse
    joined: bool
    """A name may follow it without a space."""
    leads: Leads
    place: int
    """The position of the place among its arguments, from 0; -1: it takes none."""
    variable: NameEffect
    prints: PrintedValue
    setup: Setup
    kept: Retention
    restored: int | None
    """Its turn when settings are restored: those with 0 in any order, then the others; None: it is no setting."""
    wire: WireSetting
    read_back: int | None
    """The greatest difference between a written number and what PR prints of it, until something else writes it.

    None: a reading does not confirm a number that was written.
    """
    quantity: WordQuantity
    position: PositionEffect
    turn: int
    """Its turn among the settings that give a count its length and its sign, when these are asked for; 0: it is none.
    """
    starts: bool
    """Whether it can start motion or a program when executed at once; for a value, when written."""
    motion: MotionEffect
    turns_at: int | None
    """The value with which it starts, or lets inputs start, motion without a target."""
    at_zero: AtZero
    alone: Alone
    rest: bool
    """It needs a drive at rest: a moving drive refuses it, or it changes what the motion counts."""
    waiting: MotionWait
    sign: bool
    """Its value is the sign of a failure, which a line that writes it clears. Reading it may clear it, too."""
    memory: MemoryEffect
    guard: str
    """What a line does to which a person must agree first, a setting where a value is written; empty: it needs none."""
    harmless: frozenset[int]
    """The values of a guarded setting that need no agreement."""
    note: str

    @property
    def immediate(self) -> bool:
        return self.use in (AllowedUse.BOTH, AllowedUse.TYPED)

    @property
    def program(self) -> bool:
        return self.use in (AllowedUse.BOTH, AllowedUse.STORED)

    @property
    def lines(self) -> bool:
        """Its PR prints several lines, without an end of their own."""
        return self.prints is PrintedValue.LINES

    @property
    def valued(self) -> bool:
        """Whether it holds a value."""
        return self.kind in ("variable", "flag")

    @property
    def trip(self) -> int:
        """The bit of TE that enables this trip; 0: it is none."""
        return self.setup.numbers[0] if self.setup.form is FormKind.TRIP else 0

    @property
    def whole(self) -> bool:
        """Whether its numbers are whole ones."""
        return isinstance(self.low, int) and not isinstance(self.default, (float, str))

    def accepts(self, value: Number, encoder: bool = False) -> bool:
        """Whether the number is in range, whatever other variables are; with EE=1 where `encoder`."""
        if self.values:
            return value in self.values
        low, high = self.bounds(encoder)
        return value not in self.gap and (low is None or value >= low) and (high is None or value <= high)

    def bounds(self, encoder: bool = False) -> tuple[Number | None, Number | None]:
        """The lowest and the highest number, with EE=1 where `encoder`."""
        low = self.low_encoder if encoder and self.low_encoder is not None else self.low
        high = self.high_encoder if encoder and self.high_encoder is not None else self.high
        return low, high
