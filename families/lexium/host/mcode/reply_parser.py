"""The parser of an MCode drive's reply: it finds the reply in the bytes that follow a request."""

from __future__ import annotations

from dataclasses import replace

from multidrop.dialects.codec import Decoded, End, Kind, Request
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode.framing import (
    ADDRESS_PROMPT,
    ReplyPiece,
    after_echo,
    pieces,
    printable,
    unsealed,
)
from multidrop.families.lexium.host.mcode.reply_lines import ENDLESS, ReplyLines

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
LINES_FOR_QUIET = 2
"""Whole lines of a running program that are accepted instead of a quiet time, which may never come."""


class ReplyParser:
    """One pass over a reply, until it is complete."""

    def __init__(self, request: Request, echo_mode: int, checksum_mode: int, frame: bytes, buffer: bytes) -> None:
        self.request, self.frame, self.buffer = request, frame, buffer
        self.echo_mode, self.checksum_mode = echo_mode, checksum_mode
        self.got = ReplyLines(request, echo_mode, checksum_mode, frame)
        self.began = False
        self.rest = b""
        self.rest_at = len(buffer)
        self.candidate: tuple[bytes, int, int, str] | None = None
        """A prompt that may begin a print: its text and position, the number of strays and the damage before it."""
        self.lines_since_sign = 0
        """Whole lines received since a NAK, such a prompt or the reply: anything that follows it would have arrived."""

    def whole(self) -> Decoded | None:
        start = 0
        if self.echo_mode == 0 and self.request.kind is not Kind.QUIET:
            rest = after_echo(self.frame, self.got.check_byte(self.frame), self.buffer)
            if rest is None:
                return None
            start, between = rest
            for line in between.splitlines():
                if line := line.lstrip(b">"):
                    self.got.add_earlier(line)
        self.began = True
        for piece in pieces(self.buffer, start, self.checksum_mode != 0):
            if (done := self._take(piece)) is not None:
                return done
        return None

    def _take(self, piece: ReplyPiece) -> Decoded | None:
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
            self.lines_since_sign += bool(self.got.naks or self.candidate or self.got.answered)
            self.got.add_line(piece.data)
            if self.lines_since_sign == LINES_FOR_QUIET:
                # Accept a doubtful sign after other lines, with nothing against it, as after a quiet time.
                if self.request.kind in ENDLESS:
                    return None
                if self.echo_mode == 0:
                    return self._at_candidate()
                if self.got.naks:
                    return self.got.decoded(self._after_nak(), piece.end)
                if self.got.answered and self.checksum_mode == 2:  # with CK=1 the ACK still follows
                    return self.got.decoded(End.DONE, piece.end)
                return None
        return self.got.decoded(End.DONE, piece.end) if self.got.complete() else None

    # Prompts (EM=0)

    @property
    def _at_end(self) -> bool:
        if self.echo_mode != 0 or self.request.kind in (Kind.SETTING, Kind.QUIET):
            return False
        return (
            self.got.blanks > 0 or self.got.signed_off or self.checksum_mode == 2
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

    def _prompt_before(self, piece: ReplyPiece) -> bytes | None:
        """Return the prompt at the head of a line whose rest is not a print: the name at the end of a move."""
        kind, data = self.request.kind, piece.shown
        if not self._at_end or (kind is Kind.PRINT and not self.got.answered):
            return None
        if kind is Kind.PROGRAM and (match := ADDRESS_PROMPT.match(data)):
            return match.group()
        if data[:1] not in PROMPTS:
            return None
        if data[:1] == b">" and len(data) == 2:
            return b">"
        if self.checksum_mode and (unsealed(data) is not None or unsealed(data[1:]) is None):
            return None  # its check byte shows a print, or a damaged line
        self.candidate = self.candidate or (data[:1], piece.start, len(self.got.strays), self.got.damaged)
        return None

    def _at_prompt(self, prompt: bytes, start: int) -> Decoded:
        end = self._after_nak() if self.got.naks else End.DONE
        printed = self.got.answered or (self.request.kind is Kind.LIST and self.got.lines)
        if prompt == b"?" and not printed and not self.got.acks and end is End.DONE:
            end = End.REFUSED  # after an ACK the error is an earlier one
        elif end is End.DONE and self.checksum_mode and not self.got.acks:
            # With a checksum a prompt does not prove execution, since it also follows a NAK.
            if self.request.kind is Kind.COMMAND and self.checksum_mode == 2:
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
        decoded = self._at_prompt(prompt, start)
        return decoded if prompt == b"?" else self._unacknowledged(decoded)

    def _unacknowledged(self, found: Decoded) -> Decoded:
        return replace(found, reply=replace(found.reply, prompt="", acknowledged=self.got.acks > 0))

    def _after_nak(self) -> End:
        """Decide a reply with NAK: NAK only if it is the whole reply, not before the requested value."""
        got = self.got
        if got.answered and self.request.kind is Kind.PRINT:
            return End.DONE
        other_signs = got.acks or got.mixed or got.damaged or got.answered or got.repetition_missing
        if got.naks == 1 and not other_signs and not (self.rest and self.echo_mode != 0):
            if self.lines_since_sign > 0 and self.echo_mode != 0:
                got.damaged = "prints follow the NAK"
            return End.NAK
        got.damaged = got.damaged or "NAK among other characters"
        return End.DAMAGED

    # Quiet

    def on_quiet(self) -> Decoded | None:
        """Return the outcome after a quiet time; None: wait for the timeout."""
        if (done := self.whole()) is not None:
            return done
        kind = self.request.kind
        if kind is Kind.LIST:
            return self._quiet_list()
        if kind in ENDLESS:
            return self._ended_by_quiet(self._quiet_prompt())
        if self.echo_mode == 0:
            return self._settled_prompt(len(self.buffer)) if self.began else None
        return self._quiet_print() if kind is Kind.PRINT else self._quiet_command()

    def _quiet_prompt(self) -> str:
        """The prompt that came last with EM=0; empty: none, or the address of a listed line, whose rest is late."""
        if self.echo_mode != 0 or not self._is_prompt(self.rest):
            return ""
        listing = self.request.kind is Kind.LIST and classify.word_of(self.request.text)[0] == "L"
        return "" if self.rest not in PROMPTS and (self.got.lines or listing) else printable(self.rest)

    def _quiet_list(self) -> Decoded | None:
        """Decide a list: its prompt ends it with EM=0, a quiet wire after a whole line otherwise."""
        if self.echo_mode == 3 and not self.got.repeated:
            return None
        prompt = self._quiet_prompt()
        unended = self.echo_mode == 0 or bool(self.rest and not self.request.text.endswith(";"))
        if not prompt and unended:  # its prompt is missing, or the end of a line
            return None
        return self._ended_by_quiet(prompt)

    def _ended_by_quiet(self, prompt: str) -> Decoded:
        """End a list, a setting or a collection where the wire is quiet."""
        got = self.got
        stored = self.request.rows is not None and ADDRESS_PROMPT.fullmatch(self.rest)  # the prompt of program mode
        if self.rest and not prompt and not stored:
            got.add_line(self.rest)
        end = End.REFUSED if prompt == "?" and not got.lines and not got.acks else End.DONE
        if got.naks:
            end = End.NAK if self.request.kind is Kind.QUIET else self._after_nak()
        elif end is End.DONE and not self.buffer:
            end = End.SILENT
        return got.decoded(end, len(self.buffer), prompt)

    def _quiet_print(self) -> Decoded | None:
        """Decide a print with EM 1 to 3: a reply without ACK, without a line end, damaged, or none."""
        got, request, used = self.got, self.request, len(self.buffer)
        if not got.answered and self.rest and (not request.expect or request.text.endswith(";")):
            got.add_unended(self.rest)
        if got.naks:
            return got.decoded(self._after_nak(), used)
        if not got.answered and got.blanks and self.echo_mode in (2, 3) and not request.expect:
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

    def _quiet_command(self) -> Decoded | None:
        """Decide a command with EM 1 to 3, which prints nothing: a NAK, or silence where that means success."""
        used = len(self.buffer)
        if self.got.naks:
            return self.got.decoded(self._after_nak(), used)
        if self.rest and self.echo_mode != 3:
            used = self.rest_at  # half a line of another drive or a program, still to be completed
        return self.got.decoded(End.SILENT, used) if self.got.silence_is_success(self.rest) else None

    @staticmethod
    def _is_prompt(rest: bytes) -> bool:
        return rest in PROMPTS or ADDRESS_PROMPT.fullmatch(rest) is not None

    def _settled_prompt(self, used: int) -> Decoded | None:
        """Decide with EM=0 between a prompt, a print that looks like one, and a print without a line end."""
        if self._is_prompt(self.rest):
            decoded = self._at_prompt(self.rest, used - len(self.rest))
            return self._unacknowledged(decoded) if self._refused_before else decoded
        if self.request.kind is Kind.PRINT and self.rest[-1:] in PROMPTS and not self.got.naks:
            self.got.add_unended(self.rest[:-1])
            return self.got.decoded(End.DONE, used, printable(self.rest[-1:]))
        return self._at_candidate()
