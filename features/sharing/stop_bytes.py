"""The stops in the bytes of a client, for the languages that may be on a line; and what makes a begun line harmless.

A line whose URL names no language may have any language that is text. Their stops differ, and none is a command of
another one. Where messages carry their length, a single byte has no meaning: only a whole message can be a stop.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from multidrop.base.errors import Diagnostic
from multidrop.dialects import StopPiece
from multidrop.dialects.families import DEFAULT, FAMILIES, dialects
from multidrop.drives.half_line import CR, LF, LONGEST_KEPT_TEXT

ENDS = b"\r\n"
KEYS = rb"[\x03\x1b]"
"""Ctrl+C and ESC, which stop on every line of text."""
CERTAIN = 1.0
"""Bytes that the drives send so many seconds after a stop, or later, show that the stop has left."""
NOTICED = 10.0
"""Seconds within which a loss is noticed, also that of a host: what was written before has left."""
STOP_PIECE_QUIET = 0.1
"""Seconds between pieces of a stop that is owed: replies do not collide."""
_FORMS = 16
"""The forms of a stop that are kept."""
_ADDRESS_OR_CHECKSUM = re.compile(r"^@\d\d|[\x80-\xff]+$")
_TEXT = bytes(range(0x20, 0x7F)) + b"\t" + ENDS


@dataclass(frozen=True)
class StopBytes:
    """The bytes of the stops of a line, and those that make a half-sent line harmless."""

    pattern: re.Pattern[bytes]
    framed: bool
    invalidate: bytes = b""
    ends: bytes = b""
    """The bytes that may end a line; empty where messages carry their length."""
    moves: Callable[[bytes], bool] = lambda line: False
    """Whether a line, or the beginning of one once something ends it, may start a motion or a program."""
    half_sent: bytes = b""
    """The stop of this side without a byte that ends a line."""
    own: tuple[StopPiece, ...] = ()
    """The stop of this side, piece by piece: in the language of the family, or the default one, in every form."""

    def found(self, data: bytes) -> tuple[bytes, bytes, bytes]:
        """Divide what came in one read: what is before the first stop, the stops, and what follows the last one.

        Bytes between two stops belong to neither, and are left out.
        """
        if self.framed:
            return (b"", data, b"") if self.pattern.fullmatch(data) else (data, b"", b"")
        matches = [*self.pattern.finditer(data)]
        if not matches:
            return data, b"", b""
        return data[: matches[0].start()], b"".join(match[0] for match in matches), data[matches[-1].end() :]

    def keyed(self, data: bytes) -> bool:
        """Whether bytes hold a stop that is a key, which ends no line."""
        return not self.framed and _keys(self.found(data)[1])

    def whole(self, data: bytes) -> tuple[bytes, bytes]:
        """Divide bytes: whole lines or messages, and what the next read may make one of."""
        size = len(self.own[0].data)
        at = len(data) // size * size if self.framed else max(data.rfind(b"\r"), data.rfind(b"\n")) + 1
        return (data, b"") if len(data) - at > LONGEST_KEPT_TEXT else (data[:at], data[at:])

    @property
    def size(self) -> int:
        """The bytes of a message that carries its length; 0: lines of text."""
        return len(self.own[0].data) if self.framed else 0

    def harmless(self, waits: bool) -> bytes:
        """What makes the drives drop a begun line. `waits`: commands may wait in it, so the drives are stopped, too."""
        if LF not in self.ends:
            return self.invalidate
        dropped = self.invalidate.rstrip(ENDS) + ENDS
        return self.half_sent + dropped + self.own[0].data if waits else dropped

    def ends_line(self, stop: bytes) -> bool:
        """Whether the text of a begun line is gone after this stop. A key alone may be another one than ES selects."""
        return self.invalidate[:-1] in stop or (self.ends == b"\r" and stop.endswith(b"\r"))

    def binary(self, data: bytes) -> bool:
        """Whether a read holds a byte that no language of text has: then no byte of the writer's is a stop."""
        return not self.framed and bool(self.pattern.sub(b"", data).translate(None, _TEXT))

    def mended(self, stop: bytes) -> bytes:
        """The stop after a line was cut in two: no byte of it may end that line before it is harmless."""
        if not self.invalidate:
            return stop
        return (stop.translate(None, ENDS) if _keys(stop) else b"") + self.invalidate + stop


def _keys(stop: bytes) -> bool:
    return any(byte < 0x20 and byte not in ENDS for byte in stop)


class OwedStop:
    """The stops that the drives may not have received. Once its port is lost, they are owed."""

    def __init__(self, own: Sequence[StopPiece]) -> None:
        """`own`: the stop of this side."""
        self._own = own
        self._senders: dict[bytes, str] = {}
        """The senders, by the form of their stop; b"" is this side's own."""
        self._at = 0.0
        self.starts = 0
        """The number of writes of clients that can have started a motion or a program."""

    @property
    def names(self) -> list[str]:
        return list(dict.fromkeys(self._senders.values()))

    @property
    def pieces(self) -> list[StopPiece]:
        """All of it, in every form of this side and as the senders sent it."""
        first, *others = self._own
        forms = [StopPiece(sender, STOP_PIECE_QUIET) for sender in self._senders if sender]
        return [first, *forms, *others] if self._senders else []

    def note(self, who: str, stop: bytes, now: float) -> None:
        """Take a stop, in its sender's form as long as these are few."""
        self._senders[stop if len(self._senders) < _FORMS else b""] = who
        self.written(now)

    def written(self, now: float) -> None:
        """Take notice that a piece of them is written: they may have left from now on."""
        self._at = now

    def received(self, now: float) -> None:
        """Take notice of bytes of the drives: a stop well before them has left."""
        if now >= self._at + CERTAIN:
            self._senders.clear()

    def started(self) -> None:
        """Take notice of a command that can start something: no stop before it is repeated against it."""
        self.starts += 1
        self._senders.clear()

    def lost(self, now: float) -> None:
        """Keep the stops shortly before a loss: earlier ones have left."""
        if now >= self._at + NOTICED:
            self._senders.clear()


def stop_bytes(family: str, drives: Sequence[str] = (), party: bool | None = None) -> StopBytes:
    """The stops of a family's lines; empty: of any language that is text. `drives`: those known. Raises Diagnostic.

    `party`: whether the drives use names; None: not known, unless several drives are.
    """
    names = [family] if family else [name for name, row in dialects().items() if not row.scheme]
    shared = [kind for name in names if (kind := FAMILIES[name]).stop_bytes is not None]
    if not shared:
        valid = "an Ethernet drive takes several clients itself"
        raise Diagnostic(f"a line of {family} cannot be shared", hint=valid)
    framed = bool(family) and shared[0].codec.framed
    forms = [each.stop_bytes.pattern for each in shared if each.stop_bytes and each.codec.framed == framed]
    codec, language = FAMILIES[family or DEFAULT].codec, FAMILIES[family or DEFAULT].language
    own = (StopPiece(codec.stop(drives, False), 0.0), *codec.stop_again(drives, False))
    if framed:
        pattern = re.compile(b"(?:" + forms[0] + b")+", re.DOTALL)
        return StopBytes(pattern, True, moves=shared[0].message_moves, own=own)
    pattern = re.compile(b"|".join([*forms, KEYS]))

    def moves(line: bytes) -> bool:
        text = _ADDRESS_OR_CHECKSUM.sub("", line.decode("latin-1"))
        first = re.match("[A-Z]+", text.upper())
        if first is None or not language.knows(first[0]):
            text = text[1:]  # the first letter is a drive's name
        known = any(map(language.knows, re.findall("[A-Z]+", text.upper())))
        return known and codec.starts_motion(text)

    party = True if party is None and len(drives) > 1 else party
    ends = codec.line_ends if party is None or len(codec.line_ends) == 1 else bytes([LF if party else CR])
    return StopBytes(pattern, False, codec.invalidate(), ends, moves, codec.stop(drives, False, half_sent=True), own)
