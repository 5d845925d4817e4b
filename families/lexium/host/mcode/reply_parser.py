"""The lines and signs of an MCode drive's reply, and the outcome that they prove (`ReplyParser` has the theory)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from multidrop.dialects.codec import Decoded, End, Kind, Reply, Request
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.framing import (
    ADDRESS_PROMPT,
    SIGN_ON,
    UNPRINTED,
    Piece,
    after_echo,
    checksum,
    pieces,
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

    def __init__(self, request: Request, echo: int, sealed: int, frame: bytes) -> None:
        self.request, self.echo, self.sealed, self.frame = request, echo, sealed, frame
        self.signs_off = sealed > 0 and echo != 2
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
        plain = unsealed(data) if self.sealed else stripped(data)
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
        if self.echo == 3 and not self.repeated and (size := self.repetition(plain)):
            self.repeated, data = True, plain[size:]
            if not data:
                return
        found = unsealed(data) if self.sealed else stripped(data)
        if found is None:
            self.damaged = f"checksum of {printable(data)!r} is wrong"
            self.collided.append(printable(data))
            return
        self._sort(printable(found))

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
        if self.sealed:
            return next((len(each) for each in whole if data.startswith(each)), 0)
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
        return self.sealed != 1 or self.echo == 2 or self.signed_off

    @property
    def signed_off(self) -> bool:
        return self.acks + self.naks > 0

    @property
    def repetition_missing(self) -> bool:
        """Whether the repetition of the request (EM=3) is still missing."""
        return self.echo == 3 and not self.repeated

    def complete(self) -> bool:
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
        return bytes([checksum(frame)]) if self.sealed else b""


# The parser of an MCode drive's reply: it finds the reply in the bytes that follow a request.
#
# Theory of operation. A reply depends on three settings: the echo mode EM, party mode PY and the checksum mode CK
# (MCode reference 7.1, tables 7.1 to 7.4; rulings in docs/rulings.md). The reliable part is:
#
#     EM=0   the request's characters as they arrive, CRLF (ACK or NAK with checksum), printed lines, a prompt
#     EM=1   CRLF (ACK or NAK with checksum), printed lines; the CRLF is absent while a program runs
#     EM=2   printed lines, nothing else
#     EM=3   the request again, CRLF (its checksum and ACK or NAK with checksum), printed lines
#
# The prompt is `>`, or `?` while the error flag is set, or in program mode the next address and two spaces. A running
# program prints at any time, so other lines may stand anywhere in between; they become strays. With checksum every
# printed line ends in its own check byte. With CK=1 the reply follows the ACK; earlier lines belong to others. Each
# call parses the whole buffer again, so bytes may arrive one by one or all at once.
#
# The parser is strict about signs that let the host repeat a command or count it as done. A NAK counts only if it is
# the whole reply and nothing follows it: a flipped bit turns a printed 5 into NAK, and then the ACK still follows. A
# `?` may be the first character of a program's print, so it counts only if nothing follows it. Where a program prints
# without a pause, a NAK or a prompt counts after some more lines. Such a NAK does not allow a repetition
# (`Reply.detail`), and such a `>` does not acknowledge, so the host reads EF. While an error is set some units reply
# NAK to everything and then print the value: that is a reply (`Reply.flagged`).


PROMPTS = (b">", b"?")
WAITED = 2
"""Whole lines of a running program that replace a quiet time."""


class ReplyParser:
    """One pass over a reply, until it is complete."""

    def __init__(self, request: Request, echo: int, sealed: int, frame: bytes, buffer: bytes) -> None:
        self.request, self.echo, self.sealed, self.frame, self.buffer = request, echo, sealed, frame, buffer
        self.got = ReplyLines(request, echo, sealed, frame)
        self.began = False
        self.rest = b""
        self.rest_at = len(buffer)
        self.candidate: tuple[bytes, int, int, str] | None = None
        """A prompt that may begin a print: its text and position, the number of strays and the damage before it."""
        self.after = 0
        """Whole lines received since a NAK, such a prompt or the reply: anything that follows it would have arrived."""

    def whole(self) -> Decoded | None:
        start = 0
        if self.echo == 0 and self.request.kind is not Kind.QUIET:
            found = after_echo(self.frame, self.got.check_byte(self.frame), self.buffer)
            if found is None:
                return None
            start, between = found
            for line in between.splitlines():
                if line := line.lstrip(b">"):
                    self.got.add_earlier(line)
        self.began = True
        for piece in pieces(self.buffer, start, self.sealed != 0):
            if (done := self._take(piece)) is not None:
                return done
        return None

    def _take(self, piece: Piece) -> Decoded | None:
        if piece.what == "nak":
            self.got.naks += 1
        elif piece.what == "ack":
            self.got.acks += 1
        elif piece.what == "glued":
            self.got.add_glued(piece)
        elif piece.what == "rest":
            self.rest, self.rest_at = piece.shown, piece.start
            return self._at_prompt(self.rest, piece.start) if self._surely_prompt(self.rest) else None
        elif (prompt := self._prompt_before(piece)) is not None:
            return self._at_prompt(prompt, piece.start)
        else:
            self.after += bool(self.got.naks or self.candidate or self.got.answered)
            self.got.add_line(piece.data)
            if self.after == WAITED:
                # Accept a doubtful sign after other lines, with nothing against it, as after a quiet time.
                if self.request.kind in ENDLESS:
                    return None
                if self.echo == 0:
                    return self._at_candidate()
                if self.got.naks:
                    return self.got.decoded(self._after_nak(), piece.end)
                if self.got.answered and self.sealed == 2:  # with CK=1 the ACK still follows
                    return self.got.decoded(End.DONE, piece.end)
                return None
        return self.got.decoded(End.DONE, piece.end) if self.got.complete() else None

    # Prompts (EM=0)

    @property
    def _at_end(self) -> bool:
        if self.echo != 0 or self.request.kind in (Kind.SETTING, Kind.QUIET):
            return False
        return (
            self.got.blanks > 0 or self.got.signed_off or self.sealed == 2
        )  # with CK=2 a running program leaves no sign

    def _surely_prompt(self, rest: bytes) -> bool:
        """Whether the unfinished rest is certainly a prompt: the first character of a print looks the same."""
        kind = self.request.kind
        if not self._at_end:
            return False
        if kind is Kind.PROGRAM and ADDRESS_PROMPT.fullmatch(rest):
            return True
        if rest not in PROMPTS:
            return False
        if kind is Kind.PRINT:  # before the reply either character may be the first of a print
            return self.got.answered and not (rest == b">" and self._refused_before)
        if rest == b">":
            return not self._refused_before
        return self.got.answered or self.got.signed_off

    @property
    def _refused_before(self) -> bool:
        """Whether a possible `?` prompt precedes: then a `>` may be the first character of a print."""
        return self.candidate is not None and self.candidate[0] == b"?"

    def _prompt_before(self, piece: Piece) -> bytes | None:
        """Return the prompt at the head of a line whose rest is not a print: the name at the end of a move."""
        kind, data = self.request.kind, piece.shown
        if not self._at_end or (kind is Kind.PRINT and not self.got.answered):
            return None
        if kind is Kind.PROGRAM and (found := ADDRESS_PROMPT.match(data)):
            return found.group()
        if data[:1] not in PROMPTS:
            return None
        if data[:1] == b">" and len(data) == 2:
            return b">"
        if self.sealed and (unsealed(data) is not None or unsealed(data[1:]) is None):
            return None  # its check byte shows a print, or a damaged line
        self.candidate = self.candidate or (data[:1], piece.start, len(self.got.strays), self.got.damaged)
        return None

    def _at_prompt(self, prompt: bytes, start: int) -> Decoded:
        end = self._after_nak() if self.got.naks else End.DONE
        printed = self.got.answered or (self.request.kind is Kind.LIST and self.got.lines)
        if prompt == b"?" and not printed and not self.got.acks and end is End.DONE:
            end = End.REFUSED  # after an ACK the error is an earlier one
        elif end is End.DONE and self.sealed and not self.got.acks:
            # With a checksum a prompt does not prove execution, since it also follows a NAK.
            if self.request.kind is Kind.COMMAND and self.sealed == 2:
                end = End.SILENT  # a program may be running
            elif self.request.kind in (Kind.COMMAND, Kind.PROGRAM):
                end, self.got.damaged = End.DAMAGED, self.got.damaged or "neither ACK nor NAK came"
        return self.got.decoded(end, start + len(prompt), printable(prompt))

    def _at_candidate(self) -> Decoded | None:
        """Accept a prompt that lines follow. A `>` may begin a print, so it does not acknowledge."""
        if self.candidate is None:
            return None
        prompt, start, before, self.got.damaged = self.candidate
        del self.got.strays[before:]
        found = self._at_prompt(prompt, start)
        return found if prompt == b"?" else self._unacknowledged(found)

    def _unacknowledged(self, found: Decoded) -> Decoded:
        return replace(found, reply=replace(found.reply, prompt="", acknowledged=self.got.acks > 0))

    def _after_nak(self) -> End:
        """Decide a reply with NAK: NAK only if it is the whole reply, not before the requested value."""
        got = self.got
        if got.answered and self.request.kind is Kind.PRINT:
            return End.DONE
        other_signs = got.acks or got.mixed or got.damaged or got.answered or got.repetition_missing
        if got.naks == 1 and not other_signs and not (self.rest and self.echo != 0):
            if self.after > 0 and self.echo != 0:
                got.damaged = "prints follow the NAK"
            return End.NAK
        got.damaged = got.damaged or "NAK among other characters"
        return End.DAMAGED

    # Quiet

    def on_quiet(self) -> Decoded | None:
        """Return the outcome after a quiet time; None: wait for the timeout."""
        if (done := self.whole()) is not None:
            return done
        got, kind, used = self.got, self.request.kind, len(self.buffer)
        if kind in ENDLESS:
            # End a list, a setting or a collection when the wire is quiet.
            if self.echo == 3 and kind is Kind.LIST and not got.repeated:
                return None
            prompt = printable(self.rest) if self.echo == 0 and self._is_prompt(self.rest) else ""
            listing = kind is Kind.LIST and classify.word_of(self.request.text)[0] == "L"
            if prompt not in ("", ">", "?") and (got.lines or listing):
                prompt = ""  # the address of a listed line, whose rest is late
            unended = self.echo == 0 or bool(self.rest and not self.request.text.endswith(";"))
            if kind is Kind.LIST and not prompt and unended:  # its prompt is missing, or the end of a line
                return None
            stored = self.request.rows is not None and ADDRESS_PROMPT.fullmatch(self.rest)  # the prompt of program mode
            if self.rest and not prompt and not stored:
                got.add_line(self.rest)
            end = End.REFUSED if prompt == "?" and not got.lines and not got.acks else End.DONE
            if got.naks:
                end = End.NAK if kind is Kind.QUIET else self._after_nak()
            elif end is End.DONE and not self.buffer:
                end = End.SILENT
            return got.decoded(end, used, prompt)
        if self.echo == 0:
            return self._settled_prompt(used) if self.began else None
        if kind is Kind.PRINT:
            # Decide with EM 1 to 3: a reply without ACK, without a line end, damaged, or none.
            if not got.answered and self.rest and (not self.request.expect or self.request.text.endswith(";")):
                got.add_unended(self.rest)
            if got.naks:
                return got.decoded(self._after_nak(), used)
            if not got.answered and got.blanks and self.echo in (2, 3) and not self.request.expect:
                got.answer("")
            if got.answered:
                return got.decoded(End.DONE, used)
            if got.damaged:
                return got.decoded(End.DAMAGED, used)
            if got.blanks or got.acks or got.repeated:
                heard = " ".join((*got.collided, *got.glued))
                got.damaged = f"heard {heard[:48]!r}" if got.collided else ""
                return got.decoded(End.DAMAGED if got.collided else End.SILENT, used)
            return None
        if got.naks:
            return got.decoded(self._after_nak(), used)
        if self.rest and self.echo != 3:
            used = self.rest_at  # half a line of another drive or a program, still to be completed
        return got.decoded(End.SILENT, used) if got.silence_is_success(self.rest) else None

    @staticmethod
    def _is_prompt(rest: bytes) -> bool:
        return rest in PROMPTS or ADDRESS_PROMPT.fullmatch(rest) is not None

    def _settled_prompt(self, used: int) -> Decoded | None:
        """Decide with EM=0 between a prompt, a print that looks like one, and a print without a line end."""
        if self._is_prompt(self.rest):
            found = self._at_prompt(self.rest, used - len(self.rest))
            return self._unacknowledged(found) if self._refused_before else found
        if self.request.kind is Kind.PRINT and self.rest[-1:] in PROMPTS and not self.got.naks:
            self.got.add_unended(self.rest[:-1])
            return self.got.decoded(End.DONE, used, printable(self.rest[-1:]))
        return self._at_candidate()
