"""The wire's view of a drive: requests, replies, and the codec that turns them into bytes and back.

A codec is a frozen value: one drive's language *as that drive is set* (echo mode, party mode, checksum ...). When a
setting changes, the drive gets another codec; a codec has no state. A `Request` carries the codec that encodes it, so
a line can serve drives that are set differently, and drives of different families.

A conversation of several requests is a generator (`Procedure`): it yields a Request and is sent its Reply. It returns
its result and raises what a person must read. A line, a bus or a test can run it.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum
from typing import ClassVar, NamedTuple, TypeVar


class Kind(Enum):
    """The reply that a request expects: all that a line must know about a request."""

    COMMAND = "prints nothing"
    PRINT = "prints one line"
    LIST = "prints lines without an end of their own"
    SETTING = "may change how the drive replies, so both forms of the reply are accepted"
    PROGRAM = "a line stored in program memory"
    QUIET = "has no reply; everything received until the wire is quiet is collected"


class Priority(IntEnum):
    """The order of requests on the wire; the lowest goes first."""

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
    TIMEOUT = "no reply"
    STOPPED = "stopped"


T = TypeVar("T")


@dataclass(frozen=True)
class Request:
    """One command for one drive. `text` is in the drive's language: no address, checksum or terminator."""

    address: str
    text: str
    kind: Kind
    codec: Codec = field(repr=False)
    priority: Priority = Priority.OPERATOR
    timeout: float | None = None
    """Seconds from the last byte sent to the end of the reply; None: the line's default."""
    settle: float | None = None
    """Seconds of quiet that end a LIST, SETTING or QUIET reply; None: the line's default."""
    expect: str | None = None
    """A regular expression that the printed line matches in full; other lines belong to another drive or program."""
    gather: bool = False
    """Lines before the expected one belong to the reply too (a mark after a list)."""
    rows: str | None = None
    """A regular expression of the lines that are gathered, the others are a program's; None: all are."""
    body: bytes = field(default=b"", repr=False)
    """The bytes to send where the request is binary; `text` then describes it to a person."""
    spoken: str = field(default="", repr=False)
    """The text to send in place of `text`, where the host appends items to a person's print."""
    signed: bool = False
    """The expected line ends in the drive's name or a fresh mark: no other drive's line can match."""
    tag: int = field(default=0, compare=False)
    """Its number on the wire, unique to each request, set by the line when it writes; for `numbered` codecs."""

    @property
    def is_poll(self) -> bool:
        """The host asks by itself, at the lowest priority."""
        return self.priority is Priority.POLL


@dataclass(frozen=True)
class Reply:
    """The reply to one request: what the drive printed, and how the transaction ended."""

    lines: tuple[str, ...] = ()
    end: End = End.DONE
    prompt: str = ""
    """The prompt that ended it, if any: `>`, `?`, or an address in program mode."""
    acknowledged: bool = False
    """The drive confirmed execution: a prompt `>`, or ACK."""
    detail: str = ""
    """The damage, for DAMAGED; what came in place of the reply, for TIMEOUT."""
    raw: bytes = b""
    """The bytes of the reply; set by the line."""
    took: float = 0.0
    """The time from the last byte of the request to the end of its reply, s; set by the line."""
    at: float = 0.0
    """When it ended, s; set by the line."""
    body: bytes = b""
    """The reply's content where it is binary."""
    flagged: bool = False
    """The drive replied and signalled that its error flag is set: a NAK before the reply."""
    surplus: bool = False
    """More than one ACK or NAK came: one of them answers an earlier request."""
    doubtful: bool = False
    """The reply to an earlier request is outstanding, and this may be it; set by the line."""
    collided: tuple[str, ...] = ()
    """What was received meanwhile and is neither the reply nor a whole line: a print may be lost in it."""

    @property
    def text(self) -> str:
        """The first printed line, or an empty string."""
        return self.lines[0] if self.lines else ""


@dataclass(frozen=True)
class Decoded:
    """A complete reply at the head of a buffer."""

    reply: Reply
    used: int
    strays: tuple[str, ...] = ()
    """Lines in between that are not part of the reply: a running program's prints."""


def copy_with(frozen: T, **changes: object) -> T:
    """Return a copy of a request or a reply with other fields. `replace` takes ten times as long."""
    made = object.__new__(type(frozen))
    made.__dict__.update(frozen.__dict__, **changes)
    return made


Procedure = Generator[Request, Reply, T]
"""A conversation: yields requests, is sent replies, returns its result."""


def at_priority(procedure: Procedure[T], priority: Priority) -> Procedure[T]:
    """Run a conversation with all its requests at another priority."""
    try:
        request = next(procedure)
        while True:
            try:
                reply = yield replace(request, priority=priority)
            except GeneratorExit:
                procedure.close()
                raise
            except BaseException as error:
                request = procedure.throw(error)
            else:
                request = procedure.send(reply)
    except StopIteration as end:
        result: T = end.value
        return result


class StopPiece(NamedTuple):
    """Bytes of a stop, and the seconds of quiet on the line before they are written."""

    data: bytes
    quiet: float = 0.1


@dataclass(frozen=True)
class Started:
    """What lines can start in a drive; without values: anything."""

    axes: frozenset[str] | None = None
    """The axes, named as in `Motion.axis`; None: any."""
    program: bool = True
    """A program."""
    lasts: bool = True
    """It can move the drive again after the drive was at rest: an input or a joystick does, or a correction."""

    def __or__(self, other: Started) -> Started:
        axes = None if self.axes is None or other.axes is None else self.axes | other.axes
        return Started(axes, self.program or other.program, self.lasts or other.lasts)


class Codec(ABC):
    """One drive's language as that drive is set: bytes out, replies in, and the stop."""

    family: ClassVar[str]
    """The name of its record in `dialects.families.FAMILIES`."""
    framed: ClassVar[bool] = False
    """Messages carry their length, so neither direction of the stream may be cut within a message."""
    numbered: ClassVar[bool] = False
    """Replies carry their request's number, so a late reply is never taken for another request's."""
    broadcasts: ClassVar[bool] = False
    """One command reaches every drive of the line; otherwise the host sends it to each drive in turn."""
    line_ends: ClassVar[bytes] = b"\r"
    """The bytes that may end a line of it, as its drives may be set."""
    stop_replies: ClassVar[bool] = False
    """Drives reply to a stop, so two stops that are written at once have replies that collide."""
    stop_debris: ClassVar[re.Pattern[str] | None] = None
    """Unsolicited lines that a stop leaves and no program prints: replies to it, damaged ones; None: none."""
    spares: ClassVar[bool] = False
    """`stop_started` ends no program that was not started, and stops no other axis."""
    error_routine: ClassVar[bool] = False
    """An error can start a routine in the drive, which may move it."""

    @abstractmethod
    def encode(self, request: Request) -> bytes:
        """Return the whole frame: address, text, checksum, terminator."""

    @abstractmethod
    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """Find the reply in the bytes received since the request was written; None while it is incomplete."""

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """Return the reply after a quiet time, where it has no end of its own; None: wait for the timeout."""
        return Decoded(Reply(), len(buffer)) if request.kind is Kind.QUIET else None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """Return the outcome when time is up: TIMEOUT, or DAMAGED where bytes were received."""
        if not buffer:
            return Decoded(Reply(end=End.TIMEOUT), 0)
        return Decoded(Reply(end=End.DAMAGED, detail=f"heard {buffer[:48].decode('latin-1')!r}"), len(buffer))

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """Seconds of quiet after which the line calls `on_quiet`."""
        return request.settle or 0.0

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Lines received while no request is open, and how many bytes they took."""
        whole = buffer[: max(map(buffer.rfind, (b"\r", b"\n"))) + 1]
        return tuple(filter(None, re.split("[\r\n]+", whole.decode("latin-1")))), len(whole)

    @abstractmethod
    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """The bytes that stop motion and program of these drives at once.

        Not `sure`: their settings may have changed. `half_sent`: no byte may end the line that a drive's buffer holds.
        """

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[StopPiece]:
        """The stop to repeat, in pieces."""
        return [StopPiece(self.stop(addresses, sure))]

    @abstractmethod
    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Whether the bytes of other drives' stop also stop the drive at this address. `sure`: as for `stop`."""

    def stops_unknown(self, data: bytes) -> bool:
        """Whether the bytes of a stop also stop drives of the line that nobody knows."""
        return False

    @abstractmethod
    def starts_motion(self, text: str) -> bool:
        """Whether a typed line can start motion or a program; an unknown command can."""

    def started(self, text: str) -> Started:
        """Return what a line that `starts_motion` can start."""
        return Started()

    def stop_started(self, address: str, started: Started) -> Sequence[StopPiece]:
        """The stop of what was started in one drive, where it reaches less than `stop`; empty: there is none.

        Unlike `stop` it needs a line that works and a drive that reads lines.
        """
        return ()

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        """Whether an adapter, and no drive, has repeated the bytes of a request. `rest`: what came after them.

        `over`: no more comes. A language whose drives repeat nothing needs no more than the bytes.
        """
        return True

    def damaged(self, line: str) -> bool:
        """Whether a checksum shows that an unsolicited line was damaged on the wire."""
        return False

    def printed(self, line: str) -> bool:
        """Whether a drive can send this line without a question: its program prints it, or it reports by itself."""
        return True

    def replied(self, sent: bytes, received: bytes) -> bool | None:
        """Whether what came has the reply to a whole message, as its frames show; None: they do not show it."""
        return None

    def answers_host(self, line: str) -> bool:
        """Whether an unsolicited line is a late reply: only a question of multidrop has this form."""
        return False

    def answers(self, request: Request, line: str) -> bool:
        """Whether an unsolicited line is a late reply to this question, which no program prints."""
        return False

    def restarted(self, line: str) -> bool:
        """Whether an unsolicited line is the drive's message after power-up or a reset."""
        return False

    def stored_stop(self, line: str) -> str:
        """The address of a drive that stored a stop instead of executing it, as a line shows; empty: none."""
        return ""

    def invalidate(self) -> bytes:
        """The bytes that make a drive refuse a half-sent line; empty: none are needed."""
        return b""
