"""The record of a family of drives: everything that a front end, a bus or a drive must know of it.

Conversations belong here, not to the codec: each takes the `DriveState` of its own family. What a family lacks is None.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

from multidrop.base.comments import unsent
from multidrop.base.errors import Inexpressible
from multidrop.base.files import SourceLine, lines_of_text
from multidrop.base.on_demand import imported, imported_if
from multidrop.dialects.codec import Codec, Priority, Procedure
from multidrop.dialects.state import DriveState, Owed, Remembered

if TYPE_CHECKING:
    from multidrop.dialects.certifying import Certifying
    from multidrop.dialects.debugging import Debugging
    from multidrop.dialects.motions import Motions
    from multidrop.dialects.program_files import Difference, Held
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
S = TypeVar("S", bound=DriveState)


class Language(Protocol):
    """Help on the words that a person types to a drive."""

    def names(self) -> list[str]:
        """The words that have help."""

    def knows(self, word: str) -> bool:
        """Whether a word has help."""

    def describe(self, word: str, product: str = "") -> list[str]:
        """The help on a word of a product, line by line. Raises Diagnostic with similar words."""

    def describe_error(self, code: int, product: str = "") -> list[str]:
        """Meaning and remedy of an error number, line by line. Raises Diagnostic for an unknown number."""

    def complete(self, prefix: str, product: str = "") -> list[tuple[str, str]]:
        """Words of a product that begin with the prefix, each with its meaning."""

    def hint(self, text: str, product: str = "") -> str:
        """One line on the line being typed; empty where there is nothing to say."""

    def typing(self, text: str) -> str:
        """The word at the end of a line that may be completed; empty where none may."""


@dataclass(frozen=True)
class Programs(Generic[S]):
    """Programs in the drives of a family."""

    listing: Callable[[S, str], Printed]
    """List the drive's program from a label or an address; empty: all of it."""
    readable: Callable[[Held], Sequence[str]]
    """List what the drive holds in its most readable form."""
    who: Callable[[S], str]
    """Name a drive for a person."""
    read: Callable[[S, Sequence[SourceLine], Progress], Procedure[Held]]
    """Read what the drive holds, at least where these lines would go."""
    file: Callable[[S, Held, bool], Sequence[str]]
    """Return the lines of a file that reproduces what a drive holds; True: in its stored form."""
    size: Callable[[Sequence[SourceLine]], int]
    """Count the lines of a file that the drive stores."""
    end: Callable[[S], Procedure[bool]]
    """Begin to end running programs and their motion; whether one ran. Raises Refused where it moves without one."""
    download: Callable[[S, Sequence[SourceLine], Held | None, Progress], Procedure[Sequence[SourceLine]]]
    """Send a program file, and verify that the drive took every line. Return the lines sent.

    They are lines that the drive held and that stay (number 0), and the file's. The third: what was just read from the
    drive, so that the host need not read it again.
    """
    differences: Callable[[S, Sequence[SourceLine], Held, Held | None], Sequence[Difference]]
    """Compare the lines of a file with what a drive holds. The last: what it held before the file was sent to it."""
    to_send: Callable[[S, Sequence[SourceLine], Held], Procedure[str]]
    """Return why a file must be sent; empty where the drive holds all of it."""
    start: Callable[[Sequence[SourceLine], str], str]
    """Return the line that executes a program of a file, by its label. Raises Diagnostic for an unknown one."""
    annotated: Callable[[str, Held], Sequence[str]]
    """List what the drive holds with the remarks and the layout of its file; empty where `readable` is better."""
    refreshed: Callable[[str, Held], Sequence[str]] = lines_of_text
    """Return the lines of a file with the present values of variables."""
    executed: Callable[[Sequence[SourceLine]], Sequence[SourceLine]] = lambda lines: ()
    """Return the lines of a file that the drive executes as they come, and does not store."""
    acts: Callable[[str], bool] = lambda line: False
    """Whether one of those lines starts motion or a program; a setting does not."""
    save: str = ""
    """The line that makes a download last; empty: it lasts at once."""
    remark: str = ";"
    """Begins a remark in a file."""
    clearing: str = ""
    """The line that erases all programs; empty: there is none."""
    begins: tuple[str, ...] = ()
    """The words of lines that begin or end a program, or erase it with everything else."""
    names: Callable[[S], Procedure[Held]] | None = None
    """Read labels and variables without the program; None: the drives give none."""
    offered: Callable[[Held, str], Sequence[tuple[str, str]]] = lambda held, line: ()
    """Return the labels and variables that may end a line being typed, each with its meaning."""

    def upload(self, state: S, raw: bool) -> Procedure[Sequence[str]]:
        """Read the drive's program as a file that can be downloaded; `raw`: in its stored form. Raises Refused."""
        held = yield from self.read(state, (), lambda done, total: None)
        held.check_program(self.who(state))
        return self.file(state, held, raw)


@dataclass(frozen=True)
class Registers(Generic[S]):
    """Registers and outputs that a drive has beside its words; each conversation returns lines to print."""

    read: Callable[[S, int, int | None], Printed]
    """Raw registers from an address; None: as many as the value there has."""
    write: Callable[[S, int, Sequence[int]], Printed]
    """One value into all its registers, or several words into one register each."""
    lines: Callable[[int, Sequence[int]], tuple[str, ...]]
    """The typed lines that do the same as that write, as far as words have its registers."""
    read_coil: Callable[[S, int], Printed]
    """The state of an output, from 1."""
    write_coil: Callable[[S, int, bool], Printed]
    """Switch an output, from 1."""
    device: Callable[[S], Printed]
    """The drive's device identification."""


@dataclass(frozen=True)
class Guards(Generic[S]):
    """The lines of a family that a person must agree to before they are sent."""

    names: Mapping[str, str]
    """The name of each guard, as the configuration has it, and what its lines do."""
    find: Callable[[S, str], Guard | None]
    """The guard of a typed line for a drive; None: the line needs no agreement."""
    word_of: Callable[[str], str]
    """The word of a typed line by which the configuration guards others."""
    only_ends: Callable[[str], bool]
    """Whether a line is a command of motion that can only end it: a velocity of 0."""
    only_reads: Callable[[str], bool]
    """Whether a line only asks for a value, and asking changes nothing; False where that is not certain."""


@dataclass(frozen=True)
class Protection:
    """A protection of drives with a network port, which only a person can disable."""

    text: Callable[[str], str]
    """What may keep a drive of a product silent, or have it refuse every value; no product: not known which."""
    word: Callable[[str], str]
    """The word to which a line gives a value; empty: it gives none."""
    besides: str = ""
    """Another cause of silence, which is named before it."""


@dataclass(frozen=True)
class Family(Generic[S]):
    """One family of drives. Every conversation raises Refused, NoAnswer, Stopped or Inexpressible."""

    name: str
    """Its name in `dialect=`, and in `Codec.family`."""
    codec: Codec
    """The codec for a drive of which nothing is known; a stop of an unknown line uses it."""
    new_state: Callable[[Any, str], S]
    """The state of a drive with this codec of the family, at this address."""
    identify: Callable[[Hints], Procedure[list[S]]]
    """Find the drives on a line and their settings. Raises NoAnswer where none replies."""
    perform: Callable[[S, str], Printed]
    """Carry out a typed line, and make sure of the outcome."""
    check: Callable[[S, str], object]
    """Raise Inexpressible for a line that is wrong in the language; `check_line` asks more."""
    motion: Callable[[S, Priority], Procedure[tuple[Motion, ...]]]
    """Position and velocity of every axis, in as few bytes as the language allows.

    Where one print has room, it also says whether a program runs; a poll leaves that out.
    """
    moving: Callable[[S], Procedure[bool]]
    """Whether the drive reports motion. At rest: none in two readings, `drives.drive.REST` apart."""
    busy: Callable[[S], Procedure[bool]]
    """Whether a program runs, which can move the drive. A stop is confirmed by it; Refused or NoAnswer: not known."""
    referencing: Callable[[S, str], Referencing | None]
    """Find the axis to which a typed line gives a reference; None: the line gives none."""
    homed: Callable[[S], Procedure[bool]]
    """Whether a homing after which the drive is at rest ended well, as far as the drive shows it."""
    language: Language
    """Help and completion for what a person types to it."""
    rests_in_place: bool
    """At rest the position, too, is the same in both readings: in motion the velocity may read 0."""
    question: Callable[[str], str | None]
    """The line that prints the value of a word; None: the word has no value to read."""
    move: Callable[[str, int | str], tuple[str, ...]]
    """The lines that move an axis by a distance, a quantity too. An axis is as in `Motion.axis`; empty: the first."""
    move_to: Callable[[str, int | str], tuple[str, ...]]
    """The lines that move an axis to a position."""
    assign: Callable[[str, str], str | None]
    """The line that gives a word a value; None: its values are not assigned by a word."""
    values_at: str
    """The place of its `Values`, as of the programs below; few commands need these."""
    units_at: str
    """The place of its `Units`."""
    status: Callable[[S], Printed] | None = None
    """The drive's state in words, one line for each part; None: its drives do not report it."""
    programs_at: str = ""
    """The place of its `Programs`; empty: the family has none. So of what follows."""
    no_programs: str = "the host loads no programs into drives of this family"
    """The reason to give a person where `programs` is None."""
    debugging_at: str = ""
    """The place of its `Debugging`."""
    scan_at: str = ""
    """The place of its `Scan`."""
    certifying_at: str = ""
    """The place of its `Certifying`."""
    motions_at: str = "multidrop.dialects.motions:NO_MOTIONS"
    """The place of its `Motions`. By default nothing is known of a motion but that it has ended."""
    registers: Registers[S] | None = None
    baud: int = 9600
    """The default baud of a serial line."""
    repairs: bool = False
    """Its identification repairs what an interrupted session left (`Hints.cut`, `Hints.owed`)."""
    remember: Callable[[S], Remembered | None] | None = None
    """Return the memory of a drive, None where it is not certain. The field is None where that saves nothing."""
    guards: Guards[S] | None = None
    """None: the family has no line that a person must agree to."""
    stop_bytes: re.Pattern[bytes] | None = None
    """Matches each piece of a stop, however its drives are set; None: several programs cannot share a line of them."""
    message_moves: Callable[[bytes], bool] = lambda messages: False
    """Whether messages that carry their length can start a motion or a program."""
    in_frames: Callable[[bytes], Sequence[str]] = lambda data: ()
    """The addresses of its drives whose replies, with their checksums, are in what an unknown line sent."""
    vouched: Callable[[str, str], bool] = lambda text, product: False
    """Whether the tables show nothing for which a drive of a product would refuse a line."""
    protection: Protection | None = None
    """None: its drives have none."""
    addressed: Callable[[str, str], tuple[str, str] | None] = lambda text, product: None
    """A line that is one of the language only after an address at its head, as on the wire: the address, and the rest.

    The second argument is the product of the drive for which it was typed. None: the line has no address.
    """
    prepare: Callable[[], object] | None = None
    """Slow work before the first message, safe in any thread; None: there is none."""

    def check_line(self, state: S, text: str) -> None:
        """Raise Inexpressible for a typed line that would not be sent whole, or is wrong in the language."""
        if why := unsent(text):
            raise Inexpressible(f"'{text}': {why}; nothing was sent")
        self.check(state, text)

    @property
    def programs(self) -> Programs[S] | None:
        found: Programs[S] | None = imported_if(self.programs_at)
        return found

    @property
    def values(self) -> Values[S]:
        found: Values[S] = imported(self.values_at)
        return found

    @property
    def units(self) -> Units[S]:
        found: Units[S] = imported(self.units_at)
        return found

    @property
    def motions(self) -> Motions[S]:
        """How its motions begin and end."""
        found: Motions[S] = imported(self.motions_at)
        return found

    @property
    def debugging(self) -> Debugging[S] | None:
        """Observes the programs of its drives; None: they cannot be observed."""
        found: Debugging[S] | None = imported_if(self.debugging_at)
        return found

    @property
    def certifying(self) -> Certifying[S] | None:
        """The questions of a certificate to its drives; None: there are none."""
        found: Certifying[S] | None = imported_if(self.certifying_at)
        return found

    @property
    def scan(self) -> Scan[S] | None:
        """Finds its drives; None: nothing shows them without harm, so no search tries them."""
        found: Scan[S] | None = imported_if(self.scan_at)
        return found
