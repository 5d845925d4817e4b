"""The contract between a line and what is spoken on it.

A dialect is a frozen value: one drive's language *as that drive is set* (echo mode, party mode, checksum ...).
When a setting changes, the drive gets another value; nothing here has state. A `Request` carries the dialect that
it is to be spoken in, so a line can serve drives that are set differently, and families that differ altogether.

Conversations of several requests are generators (`Procedure`): they yield a Request and are sent its Reply. What they
return is their result; what they raise is for a person. They can be run against a line, a bus or a test alike.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Protocol, TypeVar, runtime_checkable


class Kind(Enum):
    """What answer a request expects, which is all that a line has to know about it."""

    COMMAND = "prints nothing"
    PRINT = "prints one line"
    LIST = "prints lines without an end of their own"
    SETTING = "may change how the drive answers, so it is answered either way"
    PROGRAM = "a line stored in program memory"
    QUIET = "answered by nothing; whatever comes until the wire is quiet is collected"


class Priority(IntEnum):
    """Who goes first on the wire."""

    OPERATOR = 0
    TRANSFER = 1
    POLL = 2


class End(Enum):
    """How a transaction ended."""

    DONE = "done"
    REFUSED = "refused"
    NAK = "NAK"
    SILENT = "silent"
    DAMAGED = "damaged"
    TIMEOUT = "no answer"
    STOPPED = "stopped"


@dataclass(frozen=True)
class Request:
    """One command for one drive. `text` is in the drive's language: no address, checksum or terminator."""

    address: str
    text: str
    kind: Kind
    codec: Codec = field(repr=False)
    priority: Priority = Priority.OPERATOR
    timeout: float | None = None
    """Seconds from the last byte sent to the end of the answer; None: the line's own."""
    settle: float | None = None
    """Seconds of quiet that end a LIST, SETTING or QUIET answer; None: the line's own."""
    expect: str | None = None
    """A regular expression that the printed line matches in full; other lines are somebody else's."""
    gather: bool = False
    """Lines that come before the expected one belong to the answer too (a mark behind a list)."""
    body: bytes = field(default=b"", repr=False)
    """What is sent, where that is no text; `text` tells a person what it means."""
    spoken: str = field(default="", repr=False)
    """What is sent in place of `text`, where the host has something more printed than a person typed."""
    signed: bool = False
    """The expected line ends in the drive's name or a fresh mark: nobody else's is taken for it."""
    tag: int = field(default=0, compare=False)
    """Its number on the wire, another for each; given by the line when it is written. For languages whose answers
    carry one."""

    def numbered(self, tag: int) -> Request:
        """The same with a number; `replace` takes ten times as long, and every request on a wire is numbered."""
        return _with(self, tag=tag)


@dataclass(frozen=True)
class Reply:
    """The answer to one request: what the drive printed, and how it ended."""

    lines: tuple[str, ...] = ()
    end: End = End.DONE
    prompt: str = ""
    """The prompt that ended it, where there was one: `>`, `?`, or an address in program mode."""
    acknowledged: bool = False
    """The drive said that it has executed it: a prompt `>`, or ACK."""
    detail: str = ""
    """What was wrong, for DAMAGED."""
    raw: bytes = b""
    """The bytes that were the answer; filled in by the line."""
    body: bytes = b""
    """What it says, where that is no text."""
    flagged: bool = False
    """The drive answered, and said that its error flag is set: a NAK in front of the answer."""
    doubtful: bool = False
    """An earlier request's answer is outstanding, and this may be it; filled in by the line."""

    @property
    def text(self) -> str:
        """The first printed line, or an empty string."""
        return self.lines[0] if self.lines else ""

    def heard(self, raw: bytes, doubtful: bool) -> Reply:
        """The same with the bytes that it was read from, and whether they may be another's."""
        return _with(self, raw=raw, doubtful=doubtful)


@dataclass(frozen=True)
class Decoded:
    """A whole answer found at the head of a buffer."""

    reply: Reply
    used: int
    strays: tuple[str, ...] = ()
    """Lines in between that are not the answer: a running program's prints."""


T = TypeVar("T")


def _with(frozen: T, **changes: object) -> T:
    """A copy of a frozen value with some fields changed."""
    made = object.__new__(type(frozen))
    made.__dict__.update(frozen.__dict__, **changes)
    return made


Procedure = Generator[Request, Reply, T]
"""A conversation: yields requests, is sent replies, returns its result."""


@dataclass(frozen=True)
class Owed:
    """A drive that was set differently for a while and is to be put back: its echo mode, and how to know it again.

    `serial` is empty where the drive does not tell one.
    """

    em: int
    name: str
    product: str
    version: str
    part: str
    serial: str = ""

    def like(self, state: DriveState) -> bool:
        """Whether it may be this drive, as far as is known without its serial number."""
        own = (self.name, self.product, self.version, self.part)
        return own == (state.name, state.product, state.version, state.part)


@dataclass(eq=False)
class DriveState:
    """What is known of one drive. Conversations read it and write down what they learn."""

    codec: Codec
    address: str = ""
    name: str = ""
    """The name that the drive itself bears, also where it is not used to address it."""
    product: str = ""
    version: str = ""
    part: str = ""
    """The part number it reports."""
    serial: str = ""
    """Its serial number, once that was asked."""
    programming: bool = False
    """In program mode: every line is stored."""
    error: bool = False
    """The drive's error flag is set from before, or may be, so the next refusal must be told from it."""
    running: bool = False
    """A program was started or seen to run: it may set the error flag at any time."""
    signs: bool = False
    """It was seen to print its own name, by which its answers are told from another drive's."""
    reply_pending: bool = False
    """An answer is outstanding that may come late: what is asked next must be told from it."""
    settings_unknown: bool = False
    """How it is set may have changed: that is found out before anything else is asked, and a stop takes every form."""
    candidates: list[tuple[Codec, str]] = field(default_factory=list)
    """Other settings and addresses at which it may answer now, after an answer that did not come."""
    restore: Owed | None = None
    """How it was set before a conversation changed that for a while; None once it is set so again."""
    next_address: int = 0
    """In program mode: the address that the next line goes to."""
    sync_marks: int = 0
    """Marks printed so far; each is another."""
    notes: list[str] = field(default_factory=list)
    """What was found and a person should know, in the order in which it was found out: warnings."""
    remarks: list[str] = field(default_factory=list)
    """What a line that a person sent has done beside what it says: for who reads along."""


@dataclass(frozen=True)
class Motion:
    """Where one axis is and how fast it moves, signed: steps and steps/s (counts with EE=1)."""

    position: int
    velocity: int
    axis: str = ""
    trouble: str = ""
    """What is wrong with it, in words; empty: nothing, as far as this reading tells."""


@dataclass(frozen=True)
class Hints:
    """What the user says of the drives on a line; what is None or empty is found out."""

    family: str = ""
    drives: tuple[str, ...] = ()
    party: bool | None = None
    checksum: int | None = None
    em: int | None = None
    addressed: bool = True
    cut: str = ""
    """The line that our last use of the port may have sent by half; it stands in a drive's buffer, then."""
    owed: tuple[Owed, ...] = ()
    """Drives that our last use of the port has not put back."""


class SourceLine(Protocol):
    """A line of a program file, comments taken off."""

    @property
    def number(self) -> int:
        """Its line in the file, from 1."""

    @property
    def text(self) -> str:
        """What the drive is sent."""


Progress = Callable[[int, int], None]


class Codec(Protocol):
    """One drive's language as that drive is set."""

    @property
    def family(self) -> str:
        """`mcode`, `pmx`, `modbus`."""

    @property
    def language(self) -> str:
        """What a person types to it, which decides help and completion: `mcode`, `pmx`."""

    @property
    def framed(self) -> bool:
        """Messages have a length of their own, so neither direction of the stream may ever be cut within one."""

    @property
    def numbered(self) -> bool:
        """Answers carry their request's number, so that a late one is never taken for another's."""

    @property
    def broadcasts(self) -> bool:
        """One command can go to every drive of the line at once; where not, each is told in turn."""

    @property
    def stop_gap(self) -> float | None:
        """Seconds of quiet behind each piece of a stop, whose answer must not run into the next; None: unanswered."""

    @property
    def stop_sign(self) -> str:
        """What ends the line with which a drive answers a stop; empty: no such line comes."""

    def encode(self, request: Request) -> bytes:
        """The whole frame: address, text, checksum, terminator."""

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The answer in what has come since the request was written, or None while it is not whole."""

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """The answer after a quiet time, where it has no end of its own; None: wait on for the timeout."""

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """What to say when time is up: TIMEOUT, or DAMAGED where something came."""

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """Seconds of quiet after which `settled` is asked."""

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Lines that come while nothing is asked, and how many bytes they took."""

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """The bytes that stop motion and program of these drives at once.

        Not `sure`: how they are set may have changed. `half_sent`: no byte of it may end the line that stands in a
        drive's buffer.
        """

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[bytes]:
        """The same once more, in pieces that are written with quiet between them."""

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Whether the bytes of other drives' stop stop the drive at this address, too. Not `sure`: as for `stop`."""

    def starts_motion(self, text: str) -> bool:
        """Whether a typed line can start motion or a program: a command that does, or one that is not known."""

    def restarted(self, line: str) -> bool:
        """Whether a line that nobody asked for is what a drive says after power-up or a reset."""

    def invalidate(self) -> bytes:
        """Bytes that make sure that a half-sent line is refused and not executed; empty: none are needed."""

    def perform(self, state: DriveState, text: str) -> Procedure[tuple[str, ...]]:
        """What a person typed, with everything that makes sure what came of it. Returns printed lines."""

    def listing(self, state: DriveState, start: str) -> Procedure[tuple[str, ...]]:
        """The drive's program from `start` (a label, an address, or empty) as it lists it."""

    def download(self, state: DriveState, lines: Sequence[SourceLine], progress: Progress) -> Procedure[None]:
        """Send a program file line by line."""

    def motion(self, state: DriveState, priority: Priority) -> Procedure[tuple[Motion, ...]]:
        """Position and velocity of every axis, in as few bytes as the language allows."""

    def busy(self, state: DriveState) -> Procedure[bool]:
        """Whether a program runs."""

    def moving(self, state: DriveState) -> Procedure[bool]:
        """Whether the drive says that it moves."""


@runtime_checkable
class Stated(Protocol):
    """What a dialect offers besides where a drive tells its state as numbers that take a table to read."""

    def status(self, state: DriveState) -> Procedure[tuple[str, ...]]:
        """The drive's state in words, a line for each part of it."""


@runtime_checkable
class Registered(Protocol):
    """What a dialect offers besides where its drives have registers and outputs of their own; lines to be printed."""

    def read_registers(self, state: DriveState, address: int, count: int | None) -> Procedure[tuple[str, ...]]:
        """Raw registers; None: as many as the value there has."""

    def write_registers(self, state: DriveState, address: int, values: Sequence[int]) -> Procedure[tuple[str, ...]]:
        """A value into as many registers as it has there, or several words into one each."""

    def read_coil(self, state: DriveState, number: int) -> Procedure[tuple[str, ...]]:
        """The state of an output, from 1."""

    def write_coil(self, state: DriveState, number: int, on: bool) -> Procedure[tuple[str, ...]]:
        """Switch an output, from 1."""

    def device(self, state: DriveState) -> Procedure[tuple[str, ...]]:
        """What the drive says of itself."""
