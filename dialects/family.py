"""The class of a family of drives: everything that a front end, a bus or a drive must know of one.

An instance is of one drive, and knows its state; the class is the family. Conversations belong here, not to the codec.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from multidrop.base.comments import unsent
from multidrop.base.errors import Inexpressible
from multidrop.base.files import SourceLine, lines_of_text
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.language import Language
from multidrop.dialects.program_files import Difference, Held, first_difference
from multidrop.dialects.state import DriveState, OfDrive, Owed, Remembered, who

if TYPE_CHECKING:
    from multidrop.dialects.certifying import Certifying
    from multidrop.dialects.debugging import Debugging
    from multidrop.dialects.motions import Motions
    from multidrop.dialects.scanning import Scan
    from multidrop.dialects.units import Units
    from multidrop.dialects.values import Values


EVERYONE = "*"
"""The name of the guard on lines that can start motion of every drive on a line."""
ADDRESSES = ("*", "^")
"""The addresses that mean every drive of a line."""


class Guard(NamedTuple):
    """One guarded line: the name of its guard in the configuration, and what the line does, for a person."""

    name: str
    what: str


def to_all(line: str) -> Guard:
    return Guard(EVERYONE, f"'{line}' can start every drive of the line")


@dataclass(frozen=True)
class Hints:
    """What the user states of the drives on a line; what is None or empty is found out."""

    family: str = ""
    drives: tuple[str, ...] = ()
    party: bool | None = None
    checksum: int | None = None
    em: int | None = None
    addressed: bool = True
    cut: str = ""
    """The line that our last use of the port may have sent by half; the drives' buffers still hold that half."""
    owed: tuple[Owed, ...] = ()
    """Drives whose settings our last use of the port has not restored."""
    remembered: tuple[Remembered, ...] = ()
    """Drives that replied when the port was last used."""
    tried: tuple[str, ...] = ()
    """Names from the command line, to be looked for where `drives` states none."""
    lazy: bool = False
    """Each line that follows names one drive: a drive may be found out when the first line for it comes."""
    first_mark: int = 0
    """The number after which sync marks begin, so that they differ from those of our last use of the port."""


@dataclass(frozen=True)
class Motion:
    """Position and velocity of one axis, signed: steps and steps/s (counts with EE=1)."""

    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """What is wrong with the axis, in words; empty: nothing, as far as this reading shows."""
    program: bool | None = None
    """Whether a program runs in the drive; None: not read together with the motion."""


@dataclass(frozen=True)
class Referencing:
    """A line that gives an axis a reference: by a homing, which takes its time, or by setting the position."""

    axis: str
    """As in `Motion.axis`."""
    homing: bool


Printed = Procedure[tuple[str, ...]]
"""A conversation that returns lines to print."""
Progress = Callable[[int, int], None]
"""Called with lines done and lines in all."""


class Programs(OfDrive, ABC):
    """The programs in a drive, and the files that they come from."""

    save: ClassVar[str] = ""
    """The line that makes a download last; empty: it lasts at once."""
    remark: ClassVar[str] = ";"
    """Begins a remark in a file."""
    clearing: ClassVar[str] = ""
    """The line that erases all programs; empty: there is none."""
    keeper: ClassVar[str] = "drive"
    """What holds the programs, for a person."""
    begins: ClassVar[tuple[str, ...]] = ()
    """The words of lines that begin or end a program, or erase it with everything else."""

    @abstractmethod
    def listing(self, place: str) -> Printed:
        """List the drive's program from a label or an address; empty: all of it."""

    @abstractmethod
    def readable(self, held: Held) -> Sequence[str]:
        """List what the drive holds in its most readable form."""

    @abstractmethod
    def read(self, lines: Sequence[SourceLine], progress: Progress) -> Procedure[Held]:
        """Read what the drive holds, at least where these lines would go."""

    @abstractmethod
    def file(self, held: Held, raw: bool) -> Sequence[str]:
        """Return the lines of a file that reproduces what a drive holds; `raw`: in its stored form."""

    @abstractmethod
    def size(self, lines: Sequence[SourceLine]) -> int:
        """Count the lines of a file that the drive stores."""

    @abstractmethod
    def end(self) -> Procedure[bool]:
        """Begin to end running programs and their motion; whether one ran. Raises Refused if it moves without one."""

    @abstractmethod
    def download(
        self, lines: Sequence[SourceLine], held: Held | None, progress: Progress
    ) -> Procedure[Sequence[SourceLine]]:
        """Send a program file, and verify that the drive took every line. Return the lines sent.

        They are lines that the drive held and that stay (number 0), and the file's. `held`: what was just read from the
        drive, so that the host need not read it again.
        """

    @abstractmethod
    def differences(self, lines: Sequence[SourceLine], held: Held, before: Held | None) -> Sequence[Difference]:
        """Compare the lines of a file with what a drive holds. `before`: what it held before the file was sent."""

    def to_send(self, lines: Sequence[SourceLine], held: Held) -> Procedure[str]:
        """Return why a file must be sent; empty where the drive holds all of it, by default all of its lines."""
        return first_difference(self.differences(lines, held, None), self.keeper)
        yield  # a conversation

    @abstractmethod
    def start(self, lines: Sequence[SourceLine], label: str) -> str:
        """Return the line that executes a program of a file, by its label. Raises Diagnostic for an unknown one."""

    def annotated(self, text: str, held: Held) -> Sequence[str]:
        """List what the drive holds with the remarks and the layout of its file; empty where `readable` is better."""
        return ()

    def refreshed(self, text: str, held: Held) -> Sequence[str]:
        """Return the lines of a file with the present values of variables."""
        return lines_of_text(text, held)

    def executed(self, lines: Sequence[SourceLine]) -> Sequence[SourceLine]:
        """Return the lines of a file that the drive executes as they come, and does not store."""
        return ()

    def acts(self, line: str) -> bool:
        """Whether one of those lines starts motion or a program; a setting does not."""
        return False

    def names(self) -> Procedure[Held]:
        """Read labels and variables without the program; a family that offers none has none to read."""
        return Held()
        yield  # a conversation

    def offered(self, held: Held, line: str) -> Sequence[tuple[str, str]]:
        """Return the labels and variables that may end a line being typed, each with its meaning."""
        return ()

    def upload(self, raw: bool) -> Procedure[Sequence[str]]:
        """Read the drive's program as a file that can be downloaded; `raw`: in its stored form. Raises Refused."""
        held = yield from self.read((), lambda done, total: None)
        held.check_program(who(self.state))
        return self.file(held, raw)


class Registers(OfDrive, ABC):
    """Registers and outputs that a drive has beside its words; each conversation returns lines to print."""

    @abstractmethod
    def read(self, address: int, count: int | None) -> Printed:
        """Raw registers from an address; None: as many as the value there has."""

    @abstractmethod
    def write(self, address: int, values: Sequence[int]) -> Printed:
        """One value into all its registers, or several words into one register each."""

    @abstractmethod
    def lines(self, address: int, values: Sequence[int]) -> tuple[str, ...]:
        """The typed lines that do the same as that write, as far as words have its registers."""

    @abstractmethod
    def read_coil(self, number: int) -> Printed:
        """The state of an output, from 1."""

    @abstractmethod
    def write_coil(self, number: int, on: bool) -> Printed:
        """Switch an output, from 1."""

    @abstractmethod
    def device(self) -> Printed:
        """The drive's device identification."""


@dataclass(frozen=True)
class Protection:
    """A protection of drives with a network port, which only a person can disable."""

    text: Callable[[str], str]
    """What may keep a drive of a product silent, or have it refuse every value; no product: not known which."""
    word: Callable[[str], str]
    """The word to which a line gives a value; empty: it gives none."""
    besides: str = ""
    """Another cause of silence, which is named before it."""


class Family(OfDrive, ABC):
    """One drive of a family: everything that a front end, a bus or a drive must know of it, as methods of its class.

    The class itself stands for the family. Every conversation raises Refused, NoAnswer, Stopped or Inexpressible. What
    has a default need not be there: a first family has a codec, `identify`, `perform` and `motion`.
    """

    name: ClassVar[str]
    """Its name in `dialect=`, and in `Codec.family`."""
    codec: ClassVar[Codec]
    """The codec for a drive of which nothing is known; a stop of an unknown line uses it."""
    language: ClassVar[Language] = Language()
    """Help and completion for what a person types to it."""
    rests_in_place: ClassVar[bool] = False
    """At rest the position, too, is the same in both readings: in motion the velocity may read 0."""
    no_programs: ClassVar[str] = "the host loads no programs into drives of this family"
    """The reason to give a person where it offers no `programs`."""
    baud: ClassVar[int] = 9600
    """The default baud of a serial line."""
    repairs: ClassVar[bool] = False
    """Its identification repairs what an interrupted session left (`Hints.cut`, `Hints.owed`)."""
    guards: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """The name of each guard on lines, as the configuration has it, and what its lines do."""
    stop_bytes: ClassVar[re.Pattern[bytes] | None] = None
    """Matches each piece of a stop, however its drives are set; None: several programs cannot share a line of them."""
    protection: ClassVar[Protection | None] = None
    """None: its drives have none."""

    # Of the family

    @classmethod
    def new_state(cls, codec: Codec, address: str) -> DriveState:
        """The state of a drive with this codec of the family, at this address."""
        return DriveState(codec, address)

    @classmethod
    @abstractmethod
    def identify(cls, hints: Hints) -> Procedure[list[DriveState]]:
        """Find the drives on a line and their settings. Raises NoAnswer where none replies."""

    @classmethod
    def prepare(cls) -> None:
        """Do slow work before the first message; safe in any thread."""

    @classmethod
    def scan(cls) -> Scan | None:
        """What finds its drives; None: nothing shows them without harm, so no search tries them."""
        return None

    @classmethod
    def question(cls, word: str) -> str | None:
        """The line that prints the value of a word; None: the word has no value to read."""
        return None

    @classmethod
    def assign(cls, word: str, value: str) -> str | None:
        """The line that gives a word a value; None: its values are not assigned by a word."""
        return None

    @classmethod
    def move(cls, axis: str, distance: int | str) -> tuple[str, ...]:
        """The lines that move an axis by a distance, a quantity too. Axes are as in `Motion.axis`; empty: the first."""
        raise Inexpressible(f"{cls.name}: no line moves by a distance; nothing was sent")

    @classmethod
    def move_to(cls, axis: str, position: int | str) -> tuple[str, ...]:
        """The lines that move an axis to a position."""
        raise Inexpressible(f"{cls.name}: no line moves to a position; nothing was sent")

    @classmethod
    def addressed(cls, text: str, product: str) -> tuple[str, str] | None:
        """A line that is one of the language only after an address at its head: the address, and the rest.

        `product`: of the drive for which it was typed. None: the line has no address.
        """
        return None

    @classmethod
    def vouched(cls, text: str, product: str) -> bool:
        """Whether the tables show nothing for which a drive of a product would refuse a line."""
        return False

    @classmethod
    def word_of(cls, text: str) -> str:
        """The word of a typed line by which the configuration guards others."""
        return text.strip().partition(" ")[0].upper()

    @classmethod
    def only_ends(cls, text: str) -> bool:
        """Whether a line is a command of motion that can only end it: a velocity of 0."""
        return False

    @classmethod
    def only_reads(cls, text: str) -> bool:
        """Whether a line only asks for a value, and asking changes nothing; False where that is not certain."""
        return False

    @classmethod
    def message_moves(cls, messages: bytes) -> bool:
        """Whether messages that carry their length can start a motion or a program."""
        return False

    @classmethod
    def in_frames(cls, data: bytes) -> Sequence[str]:
        """The addresses of its drives whose replies, with their checksums, are in what an unknown line sent."""
        return ()

    # Of a drive

    @abstractmethod
    def perform(self, text: str) -> Printed:
        """Carry out a typed line, and make sure of the outcome."""

    @abstractmethod
    def motion(self, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        """Position and velocity of every axis, in as few bytes as the language allows.

        Where one print has room, it also says whether a program runs; a poll leaves that out.
        """

    def check(self, text: str) -> None:
        """Raise Inexpressible for a line that is wrong in the language; `check_line` asks more."""

    def check_line(self, text: str) -> None:
        """Raise Inexpressible for a typed line that would not be sent whole, or is wrong in the language."""
        if why := unsent(text):
            raise Inexpressible(f"'{text}': {why}; nothing was sent")
        self.check(text)

    def moving(self) -> Procedure[bool]:
        """Whether the drive reports motion. At rest: none in two readings, `drives.drive.LEAST_REST` apart."""
        axes = yield from self.motion(Priority.OPERATOR)
        return any(axis.velocity for axis in axes)

    def busy(self) -> Procedure[bool]:
        """Whether a program runs, which can move the drive. A stop is confirmed by it; if it raises: not known."""
        return False
        yield  # a conversation

    def referencing(self, text: str) -> Referencing | None:
        """Find the axis to which a typed line gives a reference; None: the line gives none."""
        return None

    def homed(self) -> Procedure[bool]:
        """Whether a homing after which the drive is at rest ended well, as far as the drive shows it."""
        return True
        yield

    def status(self) -> Printed:
        """The drive's state in words, one line for each part; a family that offers none reports none."""
        raise Inexpressible(f"{who(self.state)}: such drives do not report their state in words; nothing was sent")
        yield

    def guard(self, text: str) -> Guard | None:
        """The guard of a typed line for the drive; None: the line needs no agreement."""
        return None

    def remember(self) -> Remembered | None:
        """Return the memory of the drive, None where it is not certain, or where that saves nothing."""
        return None

    @property
    def values(self) -> Values:
        """What is read of it, its settings and its controls."""
        from multidrop.dialects.values import Values

        return Values(self.state)

    @property
    def units(self) -> Units:
        """The quantities in its lines."""
        from multidrop.dialects.units import Units

        return Units(self.state)

    @property
    def motions(self) -> Motions:
        """How its motions begin and end. By default nothing is known of a motion but that it has ended."""
        from multidrop.dialects.motions import Motions

        return Motions(self.state)

    @property
    def programs(self) -> Programs | None:
        """Its programs; None: the host loads none into it."""
        return None

    @property
    def debugging(self) -> Debugging | None:
        """Observes its programs; None: they cannot be observed."""
        return None

    @property
    def certifying(self) -> Certifying | None:
        """The questions of a certificate to it; None: there are none."""
        return None

    @property
    def registers(self) -> Registers | None:
        """Its registers; None: it has none beside its words."""
        return None
