"""The lines and signs of an MCode drive's reply, and the outcome that they prove (`reply_parser` has the theory)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from multidrop.dialects.codec import Decoded, End, Kind, Reply, Request
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.framing import (
    SIGN_ON,
    UNPRINTED,
    ReplyPiece,
    checksum,
    printable,
    stripped,
    unsealed,
)

SIGNED = re.compile(r'["~]')
"""The sign of a signature: the quotation marks of a drive's name, or the host's own mark."""
NAME = re.compile(r'"([!-~])"')
"""A drive's name, as it prints it."""
ENDLESS = {Kind.LIST, Kind.SETTING, Kind.QUIET}
"""Kinds whose reply has no end of its own."""


def divided(request: Request, strays: Sequence[str], whole: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Divide lines that are not the reply into programs' prints and pieces of the reply that a print ran into.

    `whole`: the reply was received, so there are no pieces: a line that looks like it is a print all the same.
    """
    if request.kind is not Kind.PRINT or not request.expect or whole:
        return tuple(strays), ()
    own = [line for line in strays if _is_piece(request, line)]
    return tuple(line for line in strays if line not in own), tuple(own)


def _is_piece(request: Request, line: str) -> bool:
    """Whether a line may be the destroyed reply, or a part of it. One with another drive's name is none."""
    if request.text in line or re.fullmatch(request.expect or "", line):
        return True
    named = NAME.search(line)
    return request.signed and SIGNED.search(line) is not None and (named is None or named[1] == request.address)


class ReplyLines:
    """What a drive with these settings has sent since a request: printed lines, strays, ACKs and NAKs."""

    def __init__(self, request: Request, echo_mode: int, checksum_mode: int, frame: bytes) -> None:
        self.request, self.echo_mode, self.checksum_mode, self.frame = request, echo_mode, checksum_mode, frame
        self.signs_off = checksum_mode > 0 and echo_mode != 2
        """The drive sends ACK or NAK with its reply."""
        self.lines: list[str] = []
        self.strays: list[str] = []
        self.collided: list[str] = []
        self.glued: list[str] = []
        """Text without an end before an ACK or NAK: a print that ends in a semicolon, or a piece of a destroyed one."""
        self.damaged = ""
        self.acks = self.naks = self.blanks = 0
        self.answered = self.repeated = self.mixed = self.restarted = False

    # Collecting

    def add_earlier(self, data: bytes) -> None:
        """Add a line from before the reply: part of it where the request gathers it, otherwise a stray."""
        plain = unsealed(data) if self.checksum_mode else stripped(data)
        if plain is None:
            self.collided.append(printable(data))
        else:
            self._add_stray(printable(plain))

    def _add_stray(self, line: str) -> None:
        request = self.request
        if UNPRINTED.search(line):
            self.collided.append(line)
        elif request.gather and not self.answered and (request.rows is None or re.fullmatch(request.rows, line)):
            self.lines.append(line)
        else:
            self.strays.append(line)

    def add_glued(self, piece: ReplyPiece) -> None:
        """Sort text before an ACK or NAK: EM=3's repetition of the request, or an incomplete line."""
        if self.echo_mode == 3 and not self.repeated and self.repetition(piece.shown) == len(piece.shown):
            self.repeated = True
            return
        self.mixed = True
        if self.request.kind is Kind.QUIET:
            self.lines.append(printable(piece.data))
        else:
            self.glued.append(printable(piece.data))

    def add_line(self, data: bytes) -> None:
        """Sort a line without its line end: blank, sign-on, EM=3's repetition, or printed text."""
        plain = data.replace(b"\r", b"")
        if not plain:
            self.blanks += 1
            if self.request.kind is Kind.PRINT and self.blanks == 2 and not self.request.expect:
                self.answer("")
            return
        before, _, rest = data.rpartition(b"\r")
        own = self.request.kind is Kind.PRINT and r"\r" not in self.request.text
        if own and before.strip(b"\r") and rest:  # the line feed of an earlier, unrelated line was lost
            self.add_earlier(before)
            data = rest
        plain = data.replace(b"\r", b"")
        line = printable(data).lstrip(">?")  # a prompt may precede it
        if SIGN_ON.match(line) and "opyright" not in self.request.text:
            self.restarted = True
            self.strays.append(line)
            return
        if self.echo_mode == 3 and not self.repeated and (size := self.repetition(plain)):
            self.repeated, data = True, plain[size:]
            if not data:
                return
        unsealed_text = unsealed(data) if self.checksum_mode else stripped(data)
        if unsealed_text is None:
            self.damaged = f"checksum of {printable(data)!r} is wrong"
            self.collided.append(printable(data))
            return
        self._sort(printable(unsealed_text))

    def add_unended(self, data: bytes) -> None:
        """Add a print that ends in a semicolon: it has neither line end nor check byte."""
        if self.request.text.endswith(";"):
            self._sort(printable(data))
        else:
            self.add_line(data)

    def repetition(self, data: bytes) -> int:
        """Length of the request that EM=3 repeats at the head of a line; 0 for any other text.

        The repetition has a name and a check byte, or lacks them. Where neither ACK nor CRLF separates them (CK=2 while
        a program runs), printed text follows on the same line.
        """
        text = (self.request.spoken or self.request.text).encode("latin-1")
        whole = [words + self.check_byte(frame) for words in (self.frame, text) for frame in (self.frame, text)]
        if self.checksum_mode:
            return next((len(line) for line in whole if data.startswith(line)), 0)
        return len(data) if data in whole else 0

    def _sort(self, line: str) -> None:
        kind, expect = self.request.kind, self.request.expect
        matches = re.fullmatch(expect, line) is not None if expect is not None else not self.naks
        if kind is Kind.LIST and not self.announced:
            self.strays.append(line)
        elif kind in ENDLESS:
            self.lines.append(line)
            self.answered = self.answered or (expect is not None and matches)
        elif kind is not Kind.PRINT or self.answered or self.repetition_missing or not matches or not self.announced:
            self._add_stray(line)
        else:
            self.answer(line)

    def answer(self, line: str) -> None:
        self.lines.append(line)
        self.answered = True

    # The outcome

    @property
    def announced(self) -> bool:
        """Whether the reply can have begun: with CK=1 it follows ACK or NAK."""
        return self.checksum_mode != 1 or self.echo_mode == 2 or self.signed_off

    @property
    def signed_off(self) -> bool:
        return self.acks + self.naks > 0

    @property
    def repetition_missing(self) -> bool:
        """Whether the repetition of the request (EM=3) is still missing."""
        return self.echo_mode == 3 and not self.repeated

    def complete(self) -> bool:
        kind = self.request.kind
        if kind in ENDLESS or self.echo_mode == 0:
            return False
        if kind is Kind.PRINT:
            return self.answered and (self.signed_off or not self.signs_off)
        if self.naks or self.repetition_missing:
            return False
        if self.signs_off:
            return self.acks > 0
        return {1: self.blanks > 0, 3: True}.get(self.echo_mode, False)

    def silence_is_success(self, rest: bytes) -> bool:
        """Whether a drive with these settings may execute a command without any sign, while its program runs."""
        if self.echo_mode == 3:
            return self.checksum_mode == 2 and (self.repeated or 0 < len(rest) == self.repetition(rest))
        return self.echo_mode == 2 or self.checksum_mode != 1

    def decoded(self, end: End, used: int, prompt: str = "") -> Decoded:
        """Return the reply as collected, with its end after a last check."""
        kind = self.request.kind
        if end is not End.NAK and kind is not Kind.QUIET:
            end = self._doubted(end)
        done = end is End.DONE and (prompt not in ("", "?") or (kind is Kind.QUIET and self.answered))
        flagged = self.answered and self.naks > 0
        acknowledged, surplus = done or self.acks > 0, self.acks + self.naks > 1
        (self.collided if self.collided else self.strays).extend(self.glued)
        if kind is Kind.QUIET:
            self._divide_collected()
        strays, pieces = divided(self.request, self.strays, end is End.DONE or not self.request.signed)
        reply = Reply(
            tuple(self.lines),
            end,
            prompt,
            acknowledged,
            self.damaged,
            flagged=flagged,
            surplus=surplus,
            collided=tuple(piece for piece in (*self.collided, *pieces) if piece.strip(">?")),  # a prompt is no print
        )
        return Decoded(reply, used, strays)

    def _divide_collected(self) -> None:
        """Set apart the prints in a collection that gathers certain rows only; their check bytes may be unexpected."""
        request = self.request
        if request.rows is None:
            self.collided.clear()
            return
        collected, self.lines = self.lines, []
        for line in collected:
            data = line.lstrip(">?\x06\x15").encode("latin-1")
            plain = printable(stripped(data))
            if re.fullmatch(request.expect or "", plain) or request.text in plain:
                self.lines.append(line)
            else:
                self._add_stray(plain)

    def _doubted(self, end: End) -> End:
        """Return DAMAGED where the reply may not be what it seems to be."""
        kind = self.request.kind
        if self.restarted and kind is not Kind.SETTING:
            self.damaged = "the drive was restarted"
            return End.DAMAGED
        if end is not End.DONE:
            return end
        # A damaged line may belong to the reply; one with its expected print is complete without it.
        doubtful = not (self.answered and self.request.expect) if kind is Kind.PRINT else kind in ENDLESS
        if self.damaged and doubtful:
            return End.DAMAGED
        missing = kind is Kind.PRINT and not self.answered
        if missing and not classify.may_be_blank(self.request.text, self.request.expect):
            self.damaged = "nothing was printed that was asked for"
            return End.DAMAGED
        return end

    def check_byte(self, frame: bytes) -> bytes:
        """The check byte of a frame; empty where the drive uses none."""
        return bytes([checksum(frame)]) if self.checksum_mode else b""
