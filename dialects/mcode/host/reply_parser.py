"""The parser of an MCode drive's reply: it finds the reply in the bytes that follow a request.

Theory of operation. A reply depends on three settings: the echo mode EM, party mode PY and the checksum mode CK (MCode
reference 7.1, tables 7.1 to 7.4; rulings in docs/rulings.md). The reliable part is:

    EM=0   the request's characters as they arrive, CRLF (ACK or NAK with checksum), printed lines, a prompt
    EM=1   CRLF (ACK or NAK with checksum), printed lines; the CRLF is absent while a program runs
    EM=2   printed lines, nothing else
    EM=3   the request again, CRLF (its checksum and ACK or NAK with checksum), printed lines

The prompt is `>`, or `?` while the error flag is set, or in program mode the next address and two spaces. A running
program prints at any time, so other lines may stand anywhere in between; they become strays. With checksum every
printed line ends in its own check byte. With CK=1 the reply follows the ACK; earlier lines belong to others. Each call
parses the whole buffer again, so bytes may arrive one by one or all at once.

The parser is strict about signs that let the host repeat a command or count it as done. A NAK counts only if it is the
whole reply and nothing follows it: a flipped bit turns a printed 5 into NAK, and then the ACK still follows. A `?` may
be the first character of a program's print, so it counts only if nothing follows it. Where a program prints without a
pause, a NAK or a prompt counts after some more lines. Such a NAK does not allow a repetition (`Reply.detail`), and such
a `>` does not acknowledge, so the host reads EF. While an error is set some units reply NAK to everything and then
print the value: that is a reply (`Reply.flagged`).
"""

from __future__ import annotations

import re
from dataclasses import replace

from dialects.codec import Decoded, End, Kind, Reply, Request
from dialects.mcode.host import classify
from dialects.mcode.host.checksum import checksum, unsealed
from dialects.mcode.host.framing import ADDRESS_PROMPT, SIGN_ON, Piece, after_echo, pieces, printable

ENDLESS = {Kind.LIST, Kind.SETTING, Kind.QUIET}
PROMPTS = (b">", b"?")
WAITED = 2
"""Whole lines of a running program that replace a quiet time."""


class ReplyParser:
    """One pass over a reply: it collects lines, strays and signs until the reply is complete."""

    def __init__(self, request: Request, echo: int, sealed: int, frame: bytes, buffer: bytes) -> None:
        self.request, self.echo, self.sealed, self.frame, self.buffer = request, echo, sealed, frame, buffer
        self.lines: list[str] = []
        self.strays: list[str] = []
        self.damaged = ""
        self.acks = self.naks = self.blanks = 0
        self.answered = self.repeated = self.began = self.mixed = self.restarted = False
        self.rest = b""
        self.rest_at = len(buffer)
        self.candidate: tuple[bytes, int, int, str] | None = None
        """A prompt that may begin a print: its text and position, the number of strays and the damage before it."""
        self.after = 0
        """Whole lines received since a NAK, such a prompt or the reply: anything that follows it would have arrived."""

    def whole(self) -> Decoded | None:
        """Parse to the end of the reply; None while it is incomplete."""
        start = 0
        if self.echo == 0 and self.request.kind is not Kind.QUIET:
            found = after_echo(self.frame, self._check(self.frame), self.buffer)
            if found is None:
                return None
            start, between = found
            before = [printable(line) for line in between.replace(b">", b"").splitlines() if line]
            (self.lines if self.request.gather else self.strays).extend(before)
        self.began = True
        for piece in pieces(self.buffer, start, self.sealed != 0):
            if (done := self._take(piece)) is not None:
                return done
        return None

    def _check(self, frame: bytes) -> bytes:
        return bytes([checksum(frame)]) if self.sealed else b""

    def _take(self, piece: Piece) -> Decoded | None:
        if piece.what == "nak":
            self.naks += 1
        elif piece.what == "ack":
            self.acks += 1
        elif piece.what == "glued":
            self._glued(piece)
        elif piece.what == "rest":
            self.rest, self.rest_at = piece.shown, piece.start
            return self._at_prompt(self.rest, piece.start) if self._surely_prompt(self.rest) else None
        elif (prompt := self._prompt_before(piece)) is not None:
            return self._at_prompt(prompt, piece.start)
        else:
            self.after += bool(self.naks or self.candidate or self.answered)
            self._line(piece.data)
            if self.after == WAITED:
                return self._believed(piece.end)
        return self._decoded(End.DONE, piece.end) if self._complete() else None

    def _believed(self, used: int) -> Decoded | None:
        """Accept a doubtful sign after other lines, with nothing against it, as after a quiet time."""
        if self.request.kind in ENDLESS:
            return None
        if self.echo == 0:
            return self._at_candidate()
        if self.naks:
            return self._decoded(self._after_nak(), used)
        if self.answered and self.sealed == 2:  # with CK=1 the ACK still follows
            return self._decoded(End.DONE, used)
        return None

    def _glued(self, piece: Piece) -> None:
        """Sort text before an ACK or NAK: EM=3's repetition of the request, or an incomplete line."""
        if self.echo == 3 and not self.repeated and self._repetition(piece.shown) == len(piece.shown):
            self.repeated = True
            return
        self.mixed = True
        (self.lines if self.request.kind is Kind.QUIET else self.strays).append(printable(piece.data))

    def _line(self, data: bytes) -> None:
        plain = data.replace(b"\r", b"")
        if not plain:
            self.blanks += 1
            if self.request.kind is Kind.PRINT and self.blanks == 2 and not self.request.expect:
                self._answer("")
            return
        data = self._after_lost_end(data)
        plain = data.replace(b"\r", b"")
        told = printable(data).lstrip(">?")  # a prompt may precede it
        if SIGN_ON.match(told) and "opyright" not in self.request.text:
            self.restarted = True
            self.strays.append(told)
            return
        if self.echo == 3 and not self.repeated and (size := self._repetition(plain)):
            self.repeated, data = True, plain[size:]
            if not data:
                return
        self._sealed_line(data)

    def _after_lost_end(self, data: bytes) -> bytes:
        """Return the part of a line after a CR: the line feed of an earlier, unrelated line was lost."""
        before, _, rest = data.rpartition(b"\r")
        own = self.request.kind is Kind.PRINT and r"\r" not in self.request.text
        if not (own and before.strip(b"\r") and rest):
            return data
        (self.lines if self.request.gather else self.strays).append(printable(before))
        return rest

    def _sealed_line(self, data: bytes) -> None:
        found = unsealed(data) if self.sealed else data
        if found is None:
            self.damaged = f"checksum of {printable(data)!r} is wrong"
            return
        self._sort(printable(found))

    def _repetition(self, data: bytes) -> int:
        """Length of the request that EM=3 repeats at the head of a line; 0 for any other text.

        The repetition has a name and a check byte, or lacks them. Where neither ACK nor CRLF separates them (CK=2 while
        a program runs), printed text follows on the same line.
        """
        text = (self.request.spoken or self.request.text).encode("latin-1")
        whole = [words + self._check(frame) for words in (self.frame, text) for frame in (self.frame, text)]
        if self.sealed:
            return next((len(each) for each in whole if data.startswith(each)), 0)
        return len(data) if data in whole else 0

    def _sort(self, line: str) -> None:
        """Sort a printed line: part of the reply, or a stray."""
        kind, expect = self.request.kind, self.request.expect
        matches = re.fullmatch(expect, line) is not None if expect is not None else not self.naks
        if kind is Kind.LIST and not self._announced:
            self.strays.append(line)
        elif kind in ENDLESS:
            self.lines.append(line)
            self.answered = self.answered or (expect is not None and matches)
        elif kind is not Kind.PRINT or self.answered or self._repetition_missing:
            self.strays.append(line)
        elif not matches or not self._announced:
            (self.lines if self.request.gather else self.strays).append(line)
        else:
            self._answer(line)

    @property
    def _announced(self) -> bool:
        """Whether the reply can have begun: with CK=1 it follows ACK or NAK."""
        return self.sealed != 1 or self.echo == 2 or self._signed_off

    def _answer(self, line: str) -> None:
        self.lines.append(line)
        self.answered = True

    def _complete(self) -> bool:
        """Whether a reply without a prompt is complete."""
        kind = self.request.kind
        if kind in ENDLESS or self.echo == 0:
            return False
        if kind is Kind.PRINT:
            return self.answered and (self._signed_off or not self._signs_off)
        if self.naks or self._repetition_missing:
            return False
        if self._signs_off:
            return self.acks > 0
        return {1: self.blanks > 0, 3: True}.get(self.echo, False)

    @property
    def _signs_off(self) -> bool:
        """Whether the drive sends ACK or NAK with its reply."""
        return self.sealed > 0 and self.echo != 2

    @property
    def _signed_off(self) -> bool:
        """Whether ACK or NAK was received."""
        return self.acks + self.naks > 0

    @property
    def _repetition_missing(self) -> bool:
        """Whether the repetition of the request (EM=3) is still missing."""
        return self.echo == 3 and not self.repeated

    # -- prompts (EM=0)

    @property
    def _at_end(self) -> bool:
        """Whether a prompt can come now."""
        if self.echo != 0 or self.request.kind in (Kind.SETTING, Kind.QUIET):
            return False
        return self.blanks > 0 or self._signed_off or self.sealed == 2  # with CK=2 a running program leaves no sign

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
            return self.answered and not (rest == b">" and self._refused_before)
        if rest == b">":
            return not self._refused_before
        return self.answered or self._signed_off

    @property
    def _refused_before(self) -> bool:
        """Whether a possible `?` prompt precedes: then a `>` may be the first character of a print."""
        return self.candidate is not None and self.candidate[0] == b"?"

    def _prompt_before(self, piece: Piece) -> bytes | None:
        """Return the prompt at the head of a line whose rest is no print: the name at the end of a move."""
        kind, data = self.request.kind, piece.shown
        if not self._at_end or (kind is Kind.PRINT and not self.answered):
            return None
        if kind is Kind.PROGRAM and (found := ADDRESS_PROMPT.match(data)):
            return found.group()
        if data[:1] not in PROMPTS:
            return None
        if data[:1] == b">" and len(data) == 2:
            return b">"
        if self.sealed and (unsealed(data) is not None or unsealed(data[1:]) is None):
            return None  # its check byte shows a print, or a damaged line
        self.candidate = self.candidate or (data[:1], piece.start, len(self.strays), self.damaged)
        return None

    def _at_prompt(self, prompt: bytes, start: int) -> Decoded:
        end = self._after_nak() if self.naks else End.DONE
        printed = self.answered or (self.request.kind is Kind.LIST and self.lines)
        if prompt == b"?" and not printed and not self.acks and end is End.DONE:
            end = End.REFUSED  # after an ACK the error is an earlier one
        elif end is End.DONE and self.sealed and not self.acks:
            end = self._unsigned()
        return self._decoded(end, start + len(prompt), printable(prompt))

    def _unsigned(self) -> End:
        """Decide a prompt without ACK: with a checksum it does not prove execution, since it also follows a NAK."""
        if self.request.kind is Kind.COMMAND and self.sealed == 2:
            return End.SILENT  # a program may be running
        if self.request.kind in (Kind.COMMAND, Kind.PROGRAM):
            self.damaged = self.damaged or "neither ACK nor NAK came"
            return End.DAMAGED
        return End.DONE

    # -- the end

    def _after_nak(self) -> End:
        """Decide a reply with NAK: NAK only if it is the whole reply, not before the requested value."""
        if self.answered and self.request.kind is Kind.PRINT:
            return End.DONE
        if self._nak_is_all:
            if self.after and self.echo != 0:
                self.damaged = "prints follow the NAK"
            return End.NAK
        self.damaged = self.damaged or "NAK among other characters"
        return End.DAMAGED

    @property
    def _nak_is_all(self) -> bool:
        """Whether one NAK is the whole reply."""
        other_signs = self.acks or self.mixed or self.damaged or self.answered or self._repetition_missing
        unfinished = self.echo != 0 and self.rest
        return self.naks == 1 and not other_signs and not unfinished

    def _decoded(self, end: End, used: int, prompt: str = "") -> Decoded:
        kind = self.request.kind
        if end is not End.NAK and kind is not Kind.QUIET:
            end = self._doubted(end)
        done = end is End.DONE and (prompt not in ("", "?") or (kind is Kind.QUIET and self.answered))
        flagged = self.answered and self.naks > 0
        reply = Reply(tuple(self.lines), end, prompt, done or self.acks > 0, self.damaged, flagged=flagged)
        return Decoded(reply, used, tuple(self.strays))

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
        if self._print_is_missing:
            self.damaged = "nothing was printed that was asked for"
            return End.DAMAGED
        return end

    @property
    def _damage_counts(self) -> bool:
        """Whether a damaged line can belong to the reply; a reply with its expected print is complete without it."""
        if self.request.kind is Kind.PRINT:
            return not (self.answered and self.request.expect)
        return self.request.kind in ENDLESS

    @property
    def _print_is_missing(self) -> bool:
        may_be_blank = classify.may_be_blank(self.request.text, self.request.expect)
        return self.request.kind is Kind.PRINT and not self.answered and not may_be_blank

    def on_quiet(self) -> Decoded | None:
        """Return the outcome after a quiet time; None: wait for the timeout."""
        if (done := self.whole()) is not None:
            return done
        kind, used = self.request.kind, len(self.buffer)
        if kind in ENDLESS:
            return self._settled_list(used)
        if self.echo == 0:
            return self._settled_prompt(used) if self.began else None
        if kind is Kind.PRINT:
            return self._settled_print(used)
        if self.naks:
            return self._decoded(self._after_nak(), used)
        if self.rest and self.echo != 3:
            used = self.rest_at  # half a line of another drive or a program, still to be completed
        return self._decoded(End.SILENT, used) if self._silence_is_success else None

    @property
    def _silence_is_success(self) -> bool:
        """Whether a drive with these settings may execute a command without any sign, while its program runs."""
        if self.echo == 3:
            return self.sealed == 2 and (self.repeated or self._rest_is_repetition)
        return self.echo == 2 or self.sealed != 1

    @property
    def _rest_is_repetition(self) -> bool:
        return 0 < len(self.rest) == self._repetition(self.rest)

    def _settled_list(self, used: int) -> Decoded | None:
        """End a list, a setting or a collection when the wire is quiet."""
        if self.echo == 3 and self.request.kind is Kind.LIST and not self.repeated:
            return None
        prompt = printable(self.rest) if self.echo == 0 and self._is_prompt(self.rest) else ""
        if self.rest and not prompt:
            self._line(self.rest)
        end = End.REFUSED if prompt == "?" and not self.lines and not self.acks else End.DONE
        if self.naks:
            end = End.NAK if self.request.kind is Kind.QUIET else self._after_nak()
        elif end is End.DONE and not self.buffer:
            end = End.SILENT
        return self._decoded(end, used, prompt)

    @staticmethod
    def _is_prompt(rest: bytes) -> bool:
        return rest in PROMPTS or ADDRESS_PROMPT.fullmatch(rest) is not None

    def _settled_prompt(self, used: int) -> Decoded | None:
        """Decide with EM=0 between a prompt, a print that looks like one, and a print without a line end."""
        if self._is_prompt(self.rest):
            found = self._at_prompt(self.rest, used - len(self.rest))
            return self._unacknowledged(found) if self._refused_before else found
        if self.request.kind is Kind.PRINT and self.rest[-1:] in PROMPTS and not self.naks:
            self._unended(self.rest[:-1])
            return self._decoded(End.DONE, used, printable(self.rest[-1:]))
        return self._at_candidate()

    def _at_candidate(self) -> Decoded | None:
        """Accept a prompt that lines follow. A `>` may begin a print, so it does not acknowledge."""
        if self.candidate is None:
            return None
        prompt, start, before, self.damaged = self.candidate
        del self.strays[before:]
        found = self._at_prompt(prompt, start)
        return found if prompt == b"?" else self._unacknowledged(found)

    def _unacknowledged(self, found: Decoded) -> Decoded:
        return replace(found, reply=replace(found.reply, prompt="", acknowledged=self.acks > 0))

    def _unended(self, data: bytes) -> None:
        """Add a print that ends in a semicolon: it has neither line end nor check byte."""
        if self.request.text.endswith(";"):
            self._sort(printable(data))
        else:
            self._line(data)

    def _settled_print(self, used: int) -> Decoded | None:
        """Decide with EM 1 to 3: a reply without ACK, without a line end, damaged, or none."""
        if not self.answered and self.rest and (not self.request.expect or self.request.text.endswith(";")):
            self._unended(self.rest)
        if self.naks:
            return self._decoded(self._after_nak(), used)
        if not self.answered and self.blanks and self.echo in (2, 3) and not self.request.expect:
            self._answer("")
        if self.answered:
            return self._decoded(End.DONE, used)
        if self.damaged:
            return self._decoded(End.DAMAGED, used)
        if self.blanks or self.acks or self.repeated:
            return self._decoded(End.SILENT, used)
        return None
