"""Bytes from a drive, cut into lines, ACKs and NAKs; check bytes; echoes; unsolicited lines."""

from __future__ import annotations

import re
from dataclasses import dataclass
from os.path import commonprefix

ACK, NAK, CR, LF = b"\x06", b"\x15", b"\r", b"\n"
ADDRESS_PROMPT = re.compile(rb"\d{1,9}  ")
SIGN_ON = re.compile(r"Copyright\W*\d{4}.*(Schneider|Intelligent Motion)")
"""The message after power-up or a reset, which a drive in party mode does not send (3.4.4)."""
UNPRINTED = re.compile(r"[^\t\r\x03\x07\x08\x1b -~]")
"""A character that no program prints: two drives sent at once, and the wire made the AND of both."""
_ENDS = {False: re.compile(rb"\n"), True: re.compile(rb"[\n\x06\x15]")}
_WHAT = {LF: "line", ACK: "ack", NAK: "nak"}


@dataclass(frozen=True)
class ReplyPiece:
    """One part of a reply: a line without its CRLF, an ACK or NAK, the text before one, or the unfinished rest."""

    what: str
    data: bytes
    start: int
    end: int

    @property
    def shown(self) -> bytes:
        """The data without the CRs that a print may hold."""
        return self.data.replace(CR, b"")


def pieces(buffer: bytes, start: int, acknowledged: bool) -> list[ReplyPiece]:
    """Cut the buffer from `start` into lines, ACKs and NAKs (if the drive sends them), and the rest."""
    pieces: list[ReplyPiece] = []
    begin = start
    for match in _ENDS[acknowledged].finditer(buffer, start):
        text, end = buffer[begin : match.start()], match.end()
        what = _WHAT[match.group()]
        if what == "line":
            pieces.append(ReplyPiece("line", text.removesuffix(CR), begin, end))
        else:
            if text.strip(CR):
                pieces.append(ReplyPiece("glued", text, begin, match.start()))
            pieces.append(ReplyPiece(what, b"", match.start(), end))
        begin = end
    if buffer[begin:].strip(CR):
        pieces.append(ReplyPiece("rest", buffer[begin:], begin, len(buffer)))
    return pieces


def after_echo(frame: bytes, check: bytes, buffer: bytes) -> tuple[int, bytes] | None:
    """Find the end of a frame's echo and the text between its characters; None while it is incomplete.

    Only whole lines may stand between the characters, and before the check byte: a running program's prints. Anything
    else is a damaged echo, which the characters of the reply must not complete. A print may begin with the very
    character that comes next. The check byte may be missing.
    """
    sealed = _echoed(frame + check, buffer) if check else None
    return sealed or _echoed(frame, buffer, (b"", CR, ACK, NAK))


def _echoed(frame: bytes, buffer: bytes, follows: tuple[bytes, ...] = ()) -> tuple[int, bytes] | None:
    """Match a frame. `follows`: the bytes allowed after an echo that prints interrupted; empty: any."""
    reached = 0
    for character in frame:  # a cheap test that a damaged echo fails: the characters of the frame in their order
        reached = buffer.find(character, reached) + 1
        if not reached:
            return None
    seen: set[tuple[int, int]] = set()
    todo = [(0, 0, b"")]
    if buffer[:1] in (b">", b"?"):  # the end of the previous reply
        todo.append((0, 1, buffer[:1]))
    while todo:
        matched, at, strays = todo.pop()
        if (matched, at) in seen:
            continue
        seen.add((matched, at))
        same = len(commonprefix([frame[matched:], buffer[at:]]))
        if matched + same == len(frame):
            end = at + same
            if not (strays and follows) or buffer[end : end + 1] in follows:
                return end, strays
        elif line := buffer.find(LF, at + same) + 1:
            ends = [line, line + 1] if buffer[line : line + 1] in (b">", b"?") else [line]
            todo += [(matched + kept, to, strays + buffer[at + kept : to]) for kept in range(same + 1) for to in ends]
    return None


def printable(data: bytes) -> str:
    """Decode bytes from the wire; latin-1, for the copyright sign of the sign-on."""
    return data.replace(CR, b"").decode("latin-1")


def unasked(buffer: bytes, echo_mode: int, checksum_mode: int) -> tuple[tuple[str, ...], int]:
    """Whole lines received while no request was open, without prompts, and how many bytes they took."""
    if checksum_mode == 0:
        # Whole lines without checksum, all at once: a program may print a thousand at a time.
        used = buffer.rfind(LF) + 1
        if buffer.isascii():
            lines = printable(buffer[:used]).split("\n")
        else:
            lines = [printable(stripped(line.replace(CR, b""))) for line in buffer[:used].split(LF)]
        if echo_mode == 0:
            lines = [line[1:] if line.startswith((">", "?")) else line for line in lines]
            if buffer[used:].replace(CR, b"") in (b">", b"?"):
                used = len(buffer)
        return tuple(filter(None, lines)), used
    used, lines = 0, []
    for piece in pieces(buffer, 0, checksum_mode != 0):
        prompt = echo_mode == 0 and piece.shown[:1] in (b">", b"?")
        if piece.what == "rest" and not (prompt and len(piece.shown) == 1):
            break
        used, data = piece.end, piece.data
        if (plain := unsealed(data)) is not None:
            data = plain
        text = printable(data)
        text = text[1:] if prompt else text
        if text:
            lines.append(text)
    return tuple(lines), used


# The checksum of MCode frames and printed lines.
#
# Theory of operation. The checksum covers all characters before the terminator, the drive's name (or `*`) included.
# Their sum modulo 128 is negated, so the lower seven bits of frame and checksum add up to 0. Bit 7 is set, so the
# check byte is never a terminator or a printable character. It is sent as a raw byte. (MCode reference 7.1.2, 5.1.21.)


def checksum(data: bytes) -> int:
    """Compute the check byte (0x80 to 0xFF) of a frame. `MR 51200` gives 0xC9."""
    return (-sum(data) & 0x7F) | 0x80


def sealed(data: bytes) -> bytes:
    return data + bytes([checksum(data)])


def stripped(line: bytes) -> bytes:
    """Return a line without its check byte, if it has a right one: another drive of the line may use checksums."""
    return unsealed(line) or line


def unsealed(line: bytes) -> bytes | None:
    """Return a line without its check byte; None where that byte is missing or wrong.

    The sum does not cover bit 7, which no printed character has: a character with bit 7 is an error too.
    """
    if line and line[:-1].isascii() and line[-1] == checksum(line[:-1]):
        return line[:-1]
    return None
