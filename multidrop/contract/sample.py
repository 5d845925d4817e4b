"""What the suite must know of a family: a line of each kind in its language, and what the drive says to it.

A field that is None stands for something that the family does not have. The suite then tests that multidrop says so in
one line, and sends nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Read(NamedTuple):
    """A line that reads, and what it prints on a drive as the cell has it."""

    line: str
    printed: str


class Wrong(NamedTuple):
    """A line that does not work, and what multidrop says of it: a regular expression for all of its one line."""

    line: str
    said: str


class Written(NamedTuple):
    """A line that sets a value without moving anything, the line that reads it, and what is printed before and after.

    `api`: the name and the value by which a program writes it; None: no line assigns such values.
    """

    line: str
    read: str
    before: str
    after: str
    api: tuple[str, int] | None = None


class Moved(NamedTuple):
    """A line that moves the first axis to a place, without a limit in the way."""

    line: str
    place: int


class Absent(NamedTuple):
    """An address that no drive of the line has, and how the message begins that says so (a regular expression)."""

    address: str
    said: str


class Scaled(NamedTuple):
    """A scale, what `/units` prints of it, and a line with a quantity: the place that it moves to.

    `quantity`: that place, with its unit.
    """

    scale: str
    said: str
    line: str
    place: int
    quantity: tuple[float, str]


class Setting(NamedTuple):
    """A setting in a file of `/params backup`, a line that gives it another value, and what multidrop prints of it."""

    name: str
    line: str
    differs: str
    """What `/params diff` prints."""
    restored: str
    """What `/params restore` prints, after the name of the drive."""
    saves: bytes | None
    """What the drive is sent to keep its settings, as a part of the bytes; None: it keeps none."""
    defaults: bool = True
    """The value in a new drive is known, and is that of the sample's drive."""


class Program(NamedTuple):
    """A program file that moves the first axis for ever."""

    file: str
    """The name of the file, with its ending."""
    text: str
    label: str
    """What `--run` starts."""
    started: str
    """The line that starts it, as it is reported."""
    stored: int
    """How many lines the drive stores of it."""
    listed: str
    """A line of `/list`."""
    wrong: str
    """A text that is no such program."""
    fault: str
    """What the check says of that, after the name of the file: a regular expression."""


class Homed(NamedTuple):
    """A homing of the first axis: the table of a drive with a home switch, how a program begins it, and its line.

    `direction`: what `home` is given; empty: settings of the drive fix the direction. `setup`: lines for that.
    """

    drive: str
    line: str
    direction: str = "-"
    setup: tuple[str, ...] = ()


class Ran(NamedTuple):
    """The lines that a program sends to run the first axis at a velocity, and to let it rest."""

    velocity: int
    lines: tuple[str, ...]
    ends: tuple[str, ...]


class Error(NamedTuple):
    """What a program is told of the error that a motion into the limit leaves, by `error` and by `read_error`.

    Regular expressions. `read_error` clears it.
    """

    said: str
    reading: str


@dataclass(frozen=True, kw_only=True)
class FamilySample:
    """A family, as the suite tries it.

    Lines are for the first drive; `{}` in what is said stands for how multidrop names that drive.
    """

    family: str
    """The name of the language, as in `dialect=`."""
    drive: str
    """The table `[[bus.drive]]` of a drive in a cell file, without its name; each drive has one like it."""
    addresses: tuple[str, ...]
    """The names of the drives on the line; one empty name for a drive that is alone."""
    product: str
    """What is found out of the drive."""
    name: str
    """How multidrop names the first drive where no other bus is open."""
    keys: str = ""
    """More keys of the URL."""
    setup: tuple[str, ...] = ()
    """Lines that each test begins with, such as a moderate speed. They move nothing."""

    absent: Absent
    reads: Read
    reads_other: Read
    """Another line, if possible with another reply than that of `reads`."""
    writes: Written | None
    refused: Wrong
    """A line that the drive refuses, or that multidrop knows to be refused. It starts nothing."""
    unsent: Wrong | None
    """A line that is not sent, because it is wrong in the language; None: the drive sees every line."""
    broadcasts: bool = True
    """`@* LINE` is carried out by each drive of the line."""

    moves: Moved
    far: str
    """A line that moves the first axis away for a long time, without a limit in the way."""
    far_others: tuple[str, ...] = ()
    """Lines that move its other axes away, for the stop."""
    ends: str | None
    """A line that stops that motion; None: only the stop does."""
    limited: str = ""
    """The table of a drive with a limit switch in the way of `far`."""
    limit: str | None
    """What a wait says of that motion in such a drive, a regular expression; None: how motions end is not known."""
    starts: tuple[str, ...]
    """Lines that can start motion or a program."""
    harmless: tuple[str, ...]
    """Lines that cannot."""
    only_reads: tuple[str, ...] = ()
    """Lines that only ask, as far as the family says so."""
    ended_only: tuple[str, ...] = ()
    """Lines that can only end a motion."""

    stop: bytes
    """What the stop key writes first."""
    stop_all: tuple[bytes, ...] = ()
    """Bytes that are in what follows, for each further drive."""

    word: Read | None
    """A word for plots and for a program, and its value; None: only position and velocity are read."""
    state: str | None
    """The first line of `/status`; None: the drive does not report its state."""
    axis: str = ""
    """The name of the first axis in `/units ADDR.AXIS`; empty: a drive has one."""
    scaled: Scaled | None
    turn: str | None = None
    """The reason for which a scale by the motor's turn cannot be given; None: it can."""
    setting: Setting | None
    program: Program | None
    no_programs: str = "the host loads no programs into drives of this family"
    """What is said where `program` is None."""
    traced: bool = True
    """A program in the drive can be observed."""
    registers: bool = False
    """It has registers beside its words."""
    snapshot: bool = True
    """A snapshot can be made of it."""
    scanned: bool = True
    """A search tries its language."""

    guarded: str | None
    """A line that needs a person's yes; None: there is none."""
    help: Read | None
    """A word of the language, and the first line of its help; None: there is none."""
    completes: Read | None
    """The beginning of a word, and one that completion offers."""
    position: str | None
    """The word for the position of the first axis; None: there is none."""
    runs: Ran | None
    """How a program runs it at a velocity; None: it cannot."""
    homes: Homed | None
    """How a program homes it; None: it cannot."""
    output: str | None
    """The line that switches output 1 on; None: a program cannot."""
    current: str | None
    """The word that tells whether there is current, which a program switches; None: it cannot."""
    no_current: str = "such drives have no line for it"
    """How the reason begins for which it cannot."""
    inputs: frozenset[int | str] | None
    """The inputs that a program reads; None: it reads none."""
    error: Error | None
    """What a program reads of errors; None: there is nothing to read."""
    no_error: str = "such drives report no error by a number"
    """How the reason begins for which there is nothing to read."""

    def to_first(self, line: str) -> str:
        """A line with the address of the first drive; a verb as it is."""
        return f"@{self.addresses[0]} {line}" if self.addresses[0] and line[0] not in "/@" else line

    @property
    def measured(self) -> str:
        """The first axis, as `/units` has it."""
        return self.addresses[0] + (f".{self.axis}" if self.axis else "")
