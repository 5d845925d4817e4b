"""The lines and signs of an MCode drive's reply, and the outcome that they prove (`reply_parser` has the theory)."""

from __future__ import annotations

import re
from collections.abc import Sequence

from multidrop.dialects.codec import Decoded, End, Kind, Reply, Request
from multidrop.dialects.mcode.host import classify
from multidrop.dialects.mcode.host.checksum import checksum, stripped, unsealed
from multidrop.dialects.mcode.host.framing import SIGN_ON, UNPRINTED, Piece, printable

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

    def __init__(self, request: Request, echo: int, sealed: int, frame: bytes) -> None:
        self.request, self.echo, self.sealed, self.frame = request, echo, sealed, frame
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
        plain = unsealed(data) if self.sealed else stripped(data)
        if plain is None:
            self.collided.append(printable(data))
        else:
            self._add_stray(printable(plain))

    def _add_stray(self, line: str) -> None:
        """Add a line that is not the expected one."""
        request = self.request
        if UNPRINTED.search(line):
            self.collided.append(line)
        elif request.gather and not self.answered and (request.rows is None or re.fullmatch(request.rows, line)):
            self.lines.append(line)
        else:
            self.strays.append(line)

    def add_glued(self, piece: Piece) -> None:
        """Sort text before an ACK or NAK: EM=3's repetition of the request, or an incomplete line."""
        if self.echo == 3 and not self.repeated and self.repetition(piece.shown) == len(piece.shown):
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
        data = self._after_lost_end(data)
        plain = data.replace(b"\r", b"")
        line = printable(data).lstrip(">?")  # a prompt may precede it
        if SIGN_ON.match(line) and "opyright" not in self.request.text:
            self.restarted = True
            self.strays.append(line)
            return
        if self.echo == 3 and not self.repeated and (size := self.repetition(plain)):
            self.repeated, data = True, plain[size:]
            if not data:
                return
        self._sealed_line(data)

    def add_unended(self, data: bytes) -> None:
        """Add a print that ends in a semicolon: it has neither line end nor check byte."""
        if self.request.text.endswith(";"):
            self._sort(printable(data))
        else:
            self.add_line(data)

    def _after_lost_end(self, data: bytes) -> bytes:
        """Return the part of a line after a CR: the line feed of an earlier, unrelated line was lost."""
        before, _, rest = data.rpartition(b"\r")
        own = self.request.kind is Kind.PRINT and r"\r" not in self.request.text
        if not (own and before.strip(b"\r") and rest):
            return data
        self.add_earlier(before)
        return rest

    def _sealed_line(self, data: bytes) -> None:
        found = unsealed(data) if self.sealed else stripped(data)
        if found is None:
            self.damaged = f"checksum of {printable(data)!r} is wrong"
            self.collided.append(printable(data))
            return
        self._sort(printable(found))

    def repetition(self, data: bytes) -> int:
        """Length of the request that EM=3 repeats at the head of a line; 0 for any other text.

        The repetition has a name and a check byte, or lacks them. Where neither ACK nor CRLF separates them (CK=2 while
        a program runs), printed text follows on the same line.
        """
        text = (self.request.spoken or self.request.text).encode("latin-1")
        whole = [words + self.check_byte(frame) for words in (self.frame, text) for frame in (self.frame, text)]
        if self.sealed:
            return next((len(each) for each in whole if data.startswith(each)), 0)
        return len(data) if data in whole else 0

    def _sort(self, line: str) -> None:
        """Sort a printed line: part of the reply, or a stray."""
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
        """Add the line that the request asks for."""
        self.lines.append(line)
        self.answered = True

    # The outcome

    @property
    def announced(self) -> bool:
        """Whether the reply can have begun: with CK=1 it follows ACK or NAK."""
        return self.sealed != 1 or self.echo == 2 or self.signed_off

    @property
    def signs_off(self) -> bool:
        """Whether the drive sends ACK or NAK with its reply."""
        return self.sealed > 0 and self.echo != 2

    @property
    def signed_off(self) -> bool:
        """Whether ACK or NAK was received."""
        return self.acks + self.naks > 0

    @property
    def repetition_missing(self) -> bool:
        """Whether the repetition of the request (EM=3) is still missing."""
        return self.echo == 3 and not self.repeated

    def complete(self) -> bool:
        """Whether a reply without a prompt is complete."""
        kind = self.request.kind
        if kind in ENDLESS or self.echo == 0:
            return False
        if kind is Kind.PRINT:
            return self.answered and (self.signed_off or not self.signs_off)
        if self.naks or self.repetition_missing:
            return False
        if self.signs_off:
            return self.acks > 0
        return {1: self.blanks > 0, 3: True}.get(self.echo, False)

    def silence_is_success(self, rest: bytes) -> bool:
        """Whether a drive with these settings may execute a command without any sign, while its program runs."""
        if self.echo == 3:
            return self.sealed == 2 and (self.repeated or 0 < len(rest) == self.repetition(rest))
        return self.echo == 2 or self.sealed != 1

    def without_ack(self) -> End:
        """Decide a prompt without ACK: with a checksum it does not prove execution, since it also follows a NAK."""
        if self.request.kind is Kind.COMMAND and self.sealed == 2:
            return End.SILENT  # a program may be running
        if self.request.kind in (Kind.COMMAND, Kind.PROGRAM):
            self.damaged = self.damaged or "neither ACK nor NAK came"
            return End.DAMAGED
        return End.DONE

    def after_nak(self, unfinished: bool, followed: bool) -> End:
        """Decide a reply with NAK: NAK only if it is the whole reply, not before the requested value.

        `unfinished`: half a line follows it; `followed`: whole lines do.
        """
        if self.answered and self.request.kind is Kind.PRINT:
            return End.DONE
        if self._nak_is_all(unfinished):
            if followed and self.echo != 0:
                self.damaged = "prints follow the NAK"
            return End.NAK
        self.damaged = self.damaged or "NAK among other characters"
        return End.DAMAGED

    def _nak_is_all(self, unfinished: bool) -> bool:
        """Whether one NAK is the whole reply."""
        other_signs = self.acks or self.mixed or self.damaged or self.answered or self.repetition_missing
        return self.naks == 1 and not other_signs and not (unfinished and self.echo != 0)

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
            collided=tuple(each for each in (*self.collided, *pieces) if each.strip(">?")),  # a prompt is no print
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
        if self.damaged and self._damage_counts:
            return End.DAMAGED
        missing = self.request.kind is Kind.PRINT and not self.answered
        if missing and not classify.may_be_blank(self.request.text, self.request.expect):
            self.damaged = "nothing was printed that was asked for"
            return End.DAMAGED
        return end

    @property
    def _damage_counts(self) -> bool:
        """Whether a damaged line can belong to the reply; a reply with its expected print is complete without it."""
        if self.request.kind is Kind.PRINT:
            return not (self.answered and self.request.expect)
        return self.request.kind in ENDLESS

    def check_byte(self, frame: bytes) -> bytes:
        """The check byte of a frame; empty where the drive uses none."""
        return bytes([checksum(frame)]) if self.sealed else b""
