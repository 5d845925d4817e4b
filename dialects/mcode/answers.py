"""Finding a drive's answer in the bytes that follow a request.

Theory of operation. What an MCode drive sends back depends on three settings: the echo mode EM, party mode PY and
the checksum mode CK (MCode reference 7.1, tables 7.1 to 7.4; rulings on them stand in docs/mcode-wire.md). Reduced
to what can be relied on:

    EM=0   the request's characters as they arrive, CRLF (ACK or NAK with checksum), printed lines, a prompt
    EM=1   CRLF (ACK or NAK with checksum), printed lines; the CRLF is absent while a program runs
    EM=2   printed lines, nothing else
    EM=3   the request again, CRLF (its checksum and ACK or NAK with checksum), printed lines

The prompt is `>`, or `?` while the error flag is set, or in program mode the next address and two spaces. A running
program prints whenever it likes, so lines that are not the answer may stand anywhere in between; they are handed on
as strays. With checksum every printed line ends in its own check byte. Each function looks at the whole buffer
anew, so that bytes may come one by one or all at once.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from os.path import commonprefix

from dialects.base import Decoded, End, Kind, Reply, Request
from dialects.mcode.checksum import unsealed

ACK, NAK, CR, LF = 0x06, 0x15, 0x0D, 0x0A
ADDRESS_PROMPT = re.compile(rb"\d+  ")
ENDLESS = {Kind.LIST, Kind.SETTING, Kind.QUIET}


@dataclass(frozen=True)
class Piece:
    """A stretch of an answer: a line without its CRLF, an ACK or NAK, or the unfinished rest."""

    what: str
    data: bytes
    start: int
    end: int


def pieces(buffer: bytes, start: int, acknowledged: bool) -> list[Piece]:
    """The buffer from `start` as lines, ACKs and NAKs (only where there are any), and the rest."""
    found: list[Piece] = []
    begin, text = start, bytearray()
    for at in range(start, len(buffer)):
        byte = buffer[at]
        if acknowledged and byte in (ACK, NAK):
            if text:
                found.append(Piece("glued", bytes(text), begin, at))
            found.append(Piece("ack" if byte == ACK else "nak", b"", at, at + 1))
        elif byte == LF:
            found.append(Piece("line", bytes(text), begin, at + 1))
        else:
            if byte != CR:
                text.append(byte)
            continue
        begin, text = at + 1, bytearray()
    if text:
        found.append(Piece("rest", bytes(text), begin, len(buffer)))
    return found


def after_echo(frame: bytes, check: bytes, buffer: bytes) -> tuple[int, bytes] | None:
    """Where the echo of a frame ends and what stood between its characters; None while it is not whole.

    Between them only whole lines may stand, a running program's prints; anything else is a damaged echo, and must not
    be completed from the characters of the answer. A print may begin with the very character that is to come.
    """
    seen: set[tuple[int, int]] = set()
    todo = [(0, 0, b"")]
    while todo:
        matched, at, strays = todo.pop()
        if (matched, at) in seen:
            continue
        seen.add((matched, at))
        same = len(commonprefix([frame[matched:], buffer[at:]]))
        if matched + same == len(frame):
            end = at + same
            end += bool(check) and buffer[end : end + 1] == check
            if not strays or buffer[end : end + 1] in (b"", b"\r", bytes([ACK]), bytes([NAK])):
                return end, strays
        elif line := buffer.find(b"\n", at + same) + 1:
            ends = [line, line + 1] if buffer[line : line + 1] in (b">", b"?") else [line]
            todo += [(matched + kept, to, strays + buffer[at + kept : to]) for kept in range(same + 1) for to in ends]
    return None


def printable(data: bytes) -> str:
    """Bytes from the wire as text; latin-1, as the sign-on's copyright sign is."""
    return data.decode("latin-1")


class Reading:
    """One pass over an answer: gathers lines, strays and acknowledgement until the answer is whole."""

    def __init__(self, request: Request, echo: int, checksum: int, frame: bytes, buffer: bytes) -> None:
        self.request, self.echo, self.checksum, self.frame, self.buffer = request, echo, checksum, frame, buffer
        self.lines: list[str] = []
        self.strays: list[str] = []
        self.damaged = ""
        self.acknowledged = self.refused = self.answered = self.repeated = False
        self.blanks = 0
        self.rest = b""
        self.began = False

    def whole(self) -> Decoded | None:
        """Read to the end of the answer; None while it is not whole."""
        start = 0
        if self.echo == 0 and self.request.kind is not Kind.QUIET:
            found = after_echo(self.frame, self._check(self.frame), self.buffer)
            if found is None:
                return None
            start, between = found
            self.strays += [printable(line) for line in between.replace(b">", b"").splitlines() if line]
        self.began = True
        for piece in pieces(self.buffer, start, self.checksum != 0):
            if (done := self._take(piece)) is not None:
                return done
        return None

    def _check(self, frame: bytes) -> bytes:
        return bytes([(-sum(frame) & 0x7F) | 0x80]) if self.checksum else b""

    def _take(self, piece: Piece) -> Decoded | None:
        if piece.what == "nak":
            self.refused = True
            return None if self.echo == 0 else self._decoded(End.NAK, piece.end)
        if piece.what == "ack":
            self.acknowledged = True
        elif piece.what == "glued":
            self._glued(piece.data)
        elif (prompt := self._prompt(piece)) is not None:
            return self._at_prompt(prompt, piece)
        elif piece.what == "rest":
            self.rest = piece.data
            return None
        else:
            self._line(piece.data)
        return self._decoded(End.DONE, piece.end) if self._complete() else None

    def _glued(self, data: bytes) -> None:
        """Text right in front of an ACK: EM=3's repetition of the request, or half a stray line."""
        if self.echo == 3 and self._repetition(data) == len(data):
            self.repeated = True
        elif self.request.kind is Kind.QUIET:
            self.lines.append(printable(data))
        else:
            self.strays.append(printable(data))

    def _line(self, data: bytes) -> None:
        if not data:
            self.blanks += 1
            if self.request.kind is Kind.PRINT and self.blanks == 2 and not self.request.expect:
                self._answer("")
            return
        if self.echo == 3 and not self.repeated and (size := self._repetition(data)):
            self.repeated, data = True, data[size:]
            if not data:
                return
        plain = unsealed(data) if self.checksum else data
        if plain is None:
            self.damaged = f"checksum of {printable(data)!r} is wrong"
            return
        self._sort(printable(plain))

    def _repetition(self, data: bytes) -> int:
        """How much at the head of a line is the request that EM=3 gives back; 0 where it is something else.

        It comes with or without its name, and with the check byte it came with. Where neither ACK nor CRLF parts them
        (CK=2 while a program runs) what is printed follows on the same line.
        """
        text = self.request.text.encode("latin-1")
        whole = [words + self._check(frame) for words in (self.frame, text) for frame in (self.frame, text)]
        if self.checksum and (found := [each for each in whole if data.startswith(each)]):
            return len(found[0])
        return len(data) if data in (self.frame, text, *whole) else 0

    def _sort(self, line: str) -> None:
        """Put a printed line where it belongs: the answer, or somebody else's."""
        if self.request.kind in ENDLESS:
            self.lines.append(line)
        elif self.request.kind is not Kind.PRINT or self.answered or (self.echo == 3 and not self.repeated):
            self.strays.append(line)
        elif self.request.expect and not re.fullmatch(self.request.expect, line):
            (self.lines if self.request.gather else self.strays).append(line)
        else:
            self._answer(line)

    def _answer(self, line: str) -> None:
        self.lines.append(line)
        self.answered = True

    def _complete(self) -> bool:
        """Whether an answer without a prompt is at its end."""
        if self.echo == 0 or self.request.kind in ENDLESS:
            return False
        if self.request.kind is Kind.PRINT:
            return self.answered and (self.checksum == 0 or self.acknowledged or self.echo == 2)
        if self.checksum and self.echo != 2:
            return self.acknowledged
        return {1: self.blanks > 0, 3: self.repeated}.get(self.echo, False)

    def _prompt(self, piece: Piece) -> bytes | None:
        """The prompt at the head of a line or of the rest, where one can stand."""
        kind, head = self.request.kind, piece.data[:1]
        if self.echo != 0 or not (self.blanks or self.acknowledged or self.refused):
            return None
        if kind is Kind.PROGRAM and (found := ADDRESS_PROMPT.match(piece.data)):
            return found.group()
        if head not in (b">", b"?") or kind in (Kind.SETTING, Kind.QUIET):
            return None
        if kind is Kind.PRINT and not self.answered and not self.refused:
            sure = head == b"?" and piece.what == "rest" and "?" not in self.request.text
            return head if sure else None
        return head

    def _at_prompt(self, prompt: bytes, piece: Piece) -> Decoded:
        end = End.NAK if self.refused else End.DONE
        printed = self.answered or (self.request.kind is Kind.LIST and self.lines)
        if prompt == b"?" and not printed and not self.acknowledged and end is End.DONE:
            end = End.REFUSED  # where an ACK came the error stands from before
        if prompt != b"?" and end is End.DONE:
            self.acknowledged = True
        return self._decoded(end, piece.start + len(prompt), printable(prompt))

    def _decoded(self, end: End, used: int, prompt: str = "") -> Decoded:
        if self.damaged and end is End.DONE and (self.request.kind in ENDLESS or not self.answered):
            wanted = self.request.kind in ENDLESS or self.request.kind is Kind.PRINT
            end = End.DAMAGED if wanted else end
        elif end is End.DONE and self._unprinted():
            end, self.damaged = End.DAMAGED, "nothing was printed that was asked for"
        reply = Reply(tuple(self.lines), end, prompt, self.acknowledged, self.damaged)
        return Decoded(reply, used, tuple(self.strays))

    def _unprinted(self) -> bool:
        """Whether it is a print without its line; only one that ends in `;` may come to nothing at all."""
        return self.request.kind is Kind.PRINT and not self.answered and not self.request.text.endswith(";")

    def settled(self) -> Decoded | None:
        """What it amounts to when nothing more has come for a while; None: wait for the timeout."""
        if (done := self.whole()) is not None:
            return done
        kind, used = self.request.kind, len(self.buffer)
        if kind in ENDLESS:
            return self._settled_list(used)
        if self.echo == 0:
            return self._settled_prompt(used) if self.began else None
        if kind is Kind.PRINT:
            return self._settled_print(used)
        silent_is_success = self.echo == 2 or (self.echo == 1 and self.checksum != 1)
        if self.echo == 3 and self.checksum == 2:
            silent_is_success = bool(self.rest) and self._repetition(self.rest) == len(self.rest)
        return self._decoded(End.SILENT, used) if silent_is_success else None

    def _settled_list(self, used: int) -> Decoded:
        """A list, a setting or a collection is over when it is quiet."""
        prompt = printable(self.rest) if self.echo == 0 else ""
        if self.rest and not (self.echo == 0 and self._is_prompt(self.rest)):
            self._line(self.rest)
        end = End.NAK if self.refused else End.REFUSED if prompt == "?" and not self.lines else End.DONE
        if end is End.DONE and not self.buffer:
            end = End.SILENT
        return self._decoded(end, used, prompt)

    @staticmethod
    def _is_prompt(rest: bytes) -> bool:
        return rest in (b">", b"?") or ADDRESS_PROMPT.fullmatch(rest) is not None

    def _settled_prompt(self, used: int) -> Decoded | None:
        """EM=0: a prompt that might have been the print itself, or a print without a line end."""
        if self._is_prompt(self.rest):
            return self._at_prompt(self.rest, Piece("rest", self.rest, used - len(self.rest), used))
        if self.request.kind is Kind.PRINT and self.rest[-1:] in (b">", b"?"):
            self._line(self.rest[:-1])
            return self._decoded(End.DONE, used, printable(self.rest[-1:]))
        return None

    def _settled_print(self, used: int) -> Decoded | None:
        """EM 1 to 3: an answer whose ACK is missing, one without a line end, a damaged one, or none."""
        if not self.answered and self.rest and not self.request.expect:
            self._line(self.rest)
        if self.answered:
            return self._decoded(End.DONE, used)
        if self.damaged:
            return self._decoded(End.DAMAGED, used)
        if self.blanks or self.acknowledged or self.repeated:
            return self._decoded(End.SILENT, used)
        return None


def unasked(buffer: bytes, echo: int, checksum: int) -> tuple[tuple[str, ...], int]:
    """Whole lines that came while nothing was asked, without prompts, and how many bytes they took."""
    used, lines = 0, []
    for piece in pieces(buffer, 0, checksum != 0):
        if piece.what == "rest":
            break
        used, data = piece.end, piece.data
        if checksum and (plain := unsealed(data)) is not None:
            data = plain
        if echo == 0 and data[:1] in (b">", b"?"):
            data = data[1:]
        if data:
            lines.append(printable(data))
    return tuple(lines), used
