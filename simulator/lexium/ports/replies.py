"""The replies of a drive: echo mode, ACK and NAK, checksums and prompts as one pure function.

Tables 7.1 to 7.4 of the MCode manual follow one rule. A reply consists of a *head*, the printed lines, and in EM=0 a
prompt. The head acknowledges the line: CR LF without checksum, and ACK or NAK in its place with checksum. EM=3 puts the
received command before the head; EM=2 has no head. Without checksum one byte from 0x80 on before the terminator is
taken for the check byte of a client that always sends one.

This is the drive's side. It shares nothing with the host's parser of these tables, so that each tests the other.
"""

from __future__ import annotations

from typing import NamedTuple

CRLF = b"\r\n"
ACK, NAK = b"\x06", b"\x15"


class Mode(NamedTuple):
    """The communication settings of one line and of the reply to it."""

    echo: int
    party: bool
    checksum: int
    name: str


class Typed(NamedTuple):
    """A received line: the name (or `*`, `^`) before it, the command, the checksum after it."""

    name: bytes = b""
    command: bytes = b""
    checksum: bytes = b""


def checksum(text: bytes) -> int:
    """Compute the byte that makes the low seven bits of the sum zero; bit 7 is set, so it ends no line (7.1.2)."""
    return (128 - sum(text) % 128) % 128 | 0x80


def split(mode: Mode, name: bytes, text: bytes) -> tuple[Typed, bool]:
    """Split a received line; say whether its checksum is there and right (with CK=0 it need be neither)."""
    if not mode.checksum:
        end = len(text) - (text[-1:] >= b"\x80")
        return Typed(name, text[:end], text[end:]), True
    if not text or text[-1] < 0x80:
        return Typed(name, text), False
    return Typed(name, text[:-1], text[-1:]), (sum(name) + sum(text)) % 128 == 0


def printed(mode: Mode, lines: tuple[str, ...]) -> bytes:
    """Encode printed lines: each with its own checksum if there is one, each terminated by CR LF."""
    out = bytearray()
    for line in lines:
        raw = line.encode("latin-1", "replace")
        out += raw
        if mode.checksum:
            out.append(checksum(raw))
        out += CRLF
    return bytes(out)


class Outcome(NamedTuple):
    """The outcome of a line. `busy`: a program ran when it came; `flagged`: an old error causes NAK."""

    lines: tuple[str, ...] = ()
    tail: str = ""
    good: bool = True
    damaged: bool = False
    busy: bool = False
    flagged: bool = False


def compose(mode: Mode, typed: Typed, outcome: Outcome, prompt: str) -> bytes:
    """Compose the whole reply to one line, without the characters that EM=0 has echoed before."""
    data = printed(mode, outcome.lines) + outcome.tail.encode("latin-1", "replace")
    if mode.echo == 2:
        return data
    answer = _head(mode, outcome) + data
    if mode.echo == 3:
        return typed.command + typed.checksum + answer
    return answer + prompt.encode() if mode.echo == 0 else answer


def _head(mode: Mode, outcome: Outcome) -> bytes:
    """Choose CR LF, ACK or NAK; nothing where a running program leaves it out."""
    if not mode.checksum:
        # With a program running a print is not preceded by CR LF; a command keeps its only sign of acceptance.
        absent = mode.echo == 1 and outcome.busy and bool(outcome.lines or outcome.tail)
        return b"" if absent else CRLF
    if outcome.damaged or outcome.flagged or not outcome.good:
        return NAK
    return b"" if mode.checksum == 2 and outcome.busy else ACK


class PrintSeal:
    """Puts checksums into unsolicited prints, which come in pieces: one may begin a line and another end it."""

    def __init__(self) -> None:
        self._begun = b""

    def seal(self, text: str, checksummed: bool) -> bytes:
        """Encode a piece, with a checksum before each CR LF if prints carry one."""
        raw = text.encode("latin-1", "replace")
        if not checksummed:
            self._begun = b""
            return raw
        *ended, rest = raw.split(CRLF)
        out = bytearray()
        for line in ended:
            out += line
            out.append(checksum(self._begun + line))
            out += CRLF
            self._begun = b""
        self._begun += rest
        return bytes(out + rest)
