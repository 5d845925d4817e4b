"""The stops in the bytes of a client, for the languages that may be on a line.

A line whose URL names no language may have any language that is text. Their stops differ, and none is a command of
another one. Where messages carry their length, a single byte has no meaning: only a whole message can be a stop.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dialects import Diagnostic, StopPiece
from dialects.families import DEFAULT, FAMILIES, TABLE

KEYS = rb"[\x03\x1b]"
"""Ctrl+C and ESC, which stop on every line of text."""
_ENDS = b"\r\n"
_TEXT = bytes(range(0x20, 0x7F)) + b"\t" + _ENDS


@dataclass(frozen=True)
class StopBytes:
    """The bytes of the stops of a line, and those that make a half-sent line harmless."""

    pattern: re.Pattern[bytes]
    framed: bool
    invalidate: bytes = b""
    moves: Callable[[bytes], bool] = lambda line: False
    """Whether the beginning of a line, once something ends it, may start a motion or a program."""

    def found(self, data: bytes) -> tuple[bytes, bytes, bytes]:
        """Divide what came in one read: what is before the first stop, the stops, and what follows the last one.

        Bytes between two stops belong to neither, and are left out.
        """
        if self.framed:
            return (b"", data, b"") if self.pattern.fullmatch(data) else (data, b"", b"")
        matches = [*self.pattern.finditer(data)]
        if not matches:
            return data, b"", b""
        return data[: matches[0].start()], b"".join(each[0] for each in matches), data[matches[-1].end() :]

    def binary(self, data: bytes) -> bool:
        """Whether a read holds a byte that no language of text has: then no byte of the writer's is a stop."""
        return not self.framed and bool(self.pattern.sub(b"", data).translate(None, _TEXT))

    def mended(self, stop: bytes) -> bytes:
        """The stop after a line was cut in two: no byte of it may end that line before it is harmless."""
        if not self.invalidate:
            return stop
        keys = any(byte < 0x20 and byte not in _ENDS for byte in stop)
        return (stop.translate(None, _ENDS) if keys else b"") + self.invalidate + stop


def stop_bytes(family: str) -> StopBytes:
    """The stops of a family's lines; empty: of any language that is text. Raises Diagnostic."""
    names = [family] if family else [name for name, row in TABLE.items() if not row.scheme]
    shared = [each for name in names if (each := FAMILIES[name]).stop_bytes is not None]
    if not shared:
        valid = "an Ethernet drive takes several clients itself"
        raise Diagnostic(f"a line of {family} cannot be shared", hint=valid)
    framed = bool(family) and shared[0].codec.framed
    found = [each.stop_bytes.pattern for each in shared if each.stop_bytes and each.codec.framed == framed]
    if framed:
        return StopBytes(re.compile(b"(?:" + found[0] + b")+", re.DOTALL), True)
    pattern = re.compile(b"|".join([*found, KEYS]))
    codec, language = FAMILIES[family or DEFAULT].codec, FAMILIES[family or DEFAULT].language

    def moves(line: bytes) -> bool:
        text = line.decode("latin-1")
        words = re.findall("[A-Z]+", text.upper())  # the first letter may be a drive's name
        known = any(language.knows(each) for word in words for each in (word, word[1:]) if each)
        return known and codec.starts_motion(text)

    return StopBytes(pattern, False, codec.invalidate(), moves)


def own_stop(family: str, drives: Sequence[str]) -> tuple[StopPiece, ...]:
    """The stop of this side, piece by piece: in the language of the family, or the default one, in every form."""
    codec = FAMILIES[family or DEFAULT].codec
    return (StopPiece(codec.stop(drives, False), 0.0), *codec.stop_again(drives, False))
