"""What comes from a drive, cut into lines, ACKs and NAKs; echoes found in it; lines that nobody asked for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from os.path import commonprefix

from dialects.mcode.host.checksum import unsealed

ACK, NAK, CR, LF = b"\x06", b"\x15", b"\r", b"\n"
ADDRESS_PROMPT = re.compile(rb"\d{1,9}  ")
SIGN_ON = re.compile(r"Copyright\W*\d{4}.*(Schneider|Intelligent Motion)")
"""What a drive says after power-up or a reset, unless it is in party mode (3.4.4)."""
_ENDS = {False: re.compile(rb"\n"), True: re.compile(rb"[\n\x06\x15]")}
_WHAT = {LF: "line", ACK: "ack", NAK: "nak"}


@dataclass(frozen=True)
class Piece:
    """A stretch of an answer: a line without its CRLF, an ACK or NAK, text right before one, or the unfinished rest."""

    what: str
    data: bytes
    start: int
    end: int

    @property
    def shown(self) -> bytes:
        """The same without the CRs that a print may hold."""
        return self.data.replace(CR, b"")


def pieces(buffer: bytes, start: int, acknowledged: bool) -> list[Piece]:
    """The buffer from `start` as lines, ACKs and NAKs (only where there are any), and the rest."""
    found: list[Piece] = []
    begin = start
    for match in _ENDS[acknowledged].finditer(buffer, start):
        text, end = buffer[begin : match.start()], match.end()
        what = _WHAT[match.group()]
        if what == "line":
            found.append(Piece("line", text.removesuffix(CR), begin, end))
        else:
            if text.strip(CR):
                found.append(Piece("glued", text, begin, match.start()))
            found.append(Piece(what, b"", match.start(), end))
        begin = end
    if buffer[begin:].strip(CR):
        found.append(Piece("rest", buffer[begin:], begin, len(buffer)))
    return found


def after_echo(frame: bytes, check: bytes, buffer: bytes) -> tuple[int, bytes] | None:
    """Where the echo of a frame ends and what stood between its characters; None while it is not whole.

    Between them, and in front of the check byte, only whole lines may stand, a running program's prints; anything else
    is a damaged echo, and must not be completed from the characters of the answer. A print may begin with the very
    character that is to come. The check byte may be missing.
    """
    sealed = _echoed(frame + check, buffer) if check else None
    return sealed or _echoed(frame, buffer, (b"", CR, ACK, NAK))


def _echoed(frame: bytes, buffer: bytes, follows: tuple[bytes, ...] = ()) -> tuple[int, bytes] | None:
    """`follows`: what may come behind an echo that prints stood in; empty: anything."""
    seen: set[tuple[int, int]] = set()
    todo = [(0, 0, b"")]
    if buffer[:1] in (b">", b"?"):  # the end of what came before
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
    """Bytes from the wire as text; latin-1, as the sign-on's copyright sign is."""
    return data.replace(CR, b"").decode("latin-1")


def unasked(buffer: bytes, echo: int, checksum: int) -> tuple[tuple[str, ...], int]:
    """Whole lines that came while nothing was asked, without prompts, and how many bytes they took."""
    used, lines = 0, []
    for piece in pieces(buffer, 0, checksum != 0):
        prompt = echo == 0 and piece.shown[:1] in (b">", b"?")
        if piece.what == "rest" and not (prompt and len(piece.shown) == 1):
            break
        used, data = piece.end, piece.data
        if checksum and (plain := unsealed(data)) is not None:
            data = plain
        text = printable(data)
        text = text[1:] if prompt else text
        if text:
            lines.append(text)
    return tuple(lines), used
