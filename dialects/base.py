"""The contract between a line and what is spoken on it.

A dialect is a frozen value: one drive's language *as that drive is set* (echo mode, party mode, checksum ...).
When a setting changes, the drive gets another value; nothing here has state. A `Request` carries the dialect that
it is to be spoken in, so a line can serve drives that are set differently, and families that differ altogether.

Conversations of several requests are generators (`Talk`): they yield a Request and are sent its Reply. What they
return is their result; what they raise is for a person. They can be run against a line, a bus or a test alike.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, Protocol, TypeVar


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
    dialect: Dialect = field(repr=False)
    priority: Priority = Priority.OPERATOR
    timeout: float | None = None
    """Seconds from the last byte sent to the end of the answer; None: the line's own."""
    settle: float | None = None
    """Seconds of quiet that end a LIST, SETTING or QUIET answer; None: the line's own."""
    expect: str | None = None
    """A regular expression that the printed line matches in full; other lines are somebody else's."""


@dataclass(frozen=True)
class Reply:
    """The answer to one request: what the drive printed, and how it ended."""

    lines: tuple[str, ...] = ()
    end: End = End.DONE
    prompt: str = ""
    """The prompt that ended it, where there was one: `>`, `?`, or an address in program mode."""
    detail: str = ""
    """What was wrong, for DAMAGED."""
    raw: bytes = b""

    @property
    def text(self) -> str:
        """The first printed line, or an empty string."""
        return self.lines[0] if self.lines else ""


@dataclass(frozen=True)
class Decoded:
    """A whole answer found at the head of a buffer."""

    reply: Reply
    used: int
    strays: tuple[str, ...] = ()
    """Lines in between that are not the answer: a running program's prints."""


T = TypeVar("T")
Talk = Generator[Request, Reply, T]
"""A conversation: yields requests, is sent replies, returns its result."""


class Dialect(Protocol):
    """One drive's language as that drive is set."""

    @property
    def family(self) -> str:
        """`mcode`, `pmx`."""

    def request(self, address: str, text: str) -> Request:
        """The request for a line that a person typed. Raises Diagnostic for one that cannot be sent."""

    def encode(self, request: Request) -> bytes:
        """The whole frame: address, text, checksum, terminator."""

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The answer in what has come since the request was written, or None while it is not whole."""

    def settled(self, request: Request, buffer: bytes) -> Decoded | None:
        """The answer after a quiet time, for requests that have no end of their own; None: wait on."""

    def idle(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Lines that come while nothing is asked, and how many bytes they took."""

    def stop(self, addresses: Sequence[str]) -> bytes:
        """The bytes that stop motion and program of these drives at once, whatever the line buffer holds."""

    def spoil(self) -> bytes:
        """Bytes that make sure that a half-sent line is refused and not executed."""


Values = Mapping[str, Any]
