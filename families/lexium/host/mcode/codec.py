"""The codec of MCode for one drive as it is set: frames, replies, and the stop.

Source: MCode reference 5.1.21 (CK), 5.1.33 (DN), 5.1.39 (EM), 5.1.41 (ES), 5.1.105 (PY), 7.1.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import Codec, Decoded, End, Kind, Reply, Request, Started, StopPiece
from multidrop.families.lexium.host import classify
from multidrop.families.lexium.host.mcode import framing
from multidrop.families.lexium.host.mcode.quiet import SHORT, Received
from multidrop.families.lexium.host.mcode.reply_lines import ENDLESS, ReplyLines, divided
from multidrop.families.lexium.host.mcode.reply_parser import ReplyParser
from multidrop.families.lexium.manual.program_file import LONGEST_PROGRAM_LINE, commented, spaced, unsendable
from multidrop.families.lexium.manual.statements import UNNAMED

STOP_PIECE_QUIET = 0.03
"""Seconds of quiet after a line of a stop, so that its reply does not collide with the next line."""


# The commonest reply, read at once: one printed line without checksum, as the host's own questions and polls get it.
#
# `reply_parser` reads the same bytes to the same result, and takes four times as long. A test holds the two together.


ONE_LINE = re.compile(rb"(?:\r\n)?([ -~]+)\r\n")
"""The print of a drive with EM=1 or 2; EM=1 sends a CRLF before it while no program runs."""


def short_reply(request: Request, buffer: bytes) -> Decoded | None:
    """Return the reply of a drive with EM=1 or 2 and CK=0, if it is one line and can only be the requested print."""
    if request.kind is not Kind.PRINT or request.expect is None:
        return None
    match = ONE_LINE.fullmatch(buffer)
    if match is None:
        return None
    line = match[1].decode("ascii")
    if "opyright" in line or re.fullmatch(request.expect, line) is None:  # a sign-on may match, too
        return None
    return Decoded(Reply((line,)), len(buffer))


def only_strays(request: Request, buffer: bytes) -> bool:
    """Whether a drive with EM=1 or 2 and CK=0 has certainly not replied: no line looks like the requested print.

    A program may print a thousand lines meanwhile. A line with a CR inside is left to the parser.
    """
    if request.kind is not Kind.PRINT or not request.expect or buffer.count(b"\r") != buffer.count(b"\r\n"):
        return False
    return _line_of(request.expect).search(buffer) is None


@lru_cache
def _line_of(expect: str) -> re.Pattern[bytes]:
    """A whole line that matches, between others."""
    return re.compile(rb"(?:\A|\n)(?:" + expect.encode("latin-1") + rb")\r?\n")


def without_end(request: Request, buffer: bytes, em: int, checksum: int) -> bool:
    """Whether certainly no reply is whole: each ends in a line, or begins with one or with ACK or NAK.

    Bytes come one by one on a slow line, and the parser begins at the first one each time.
    """
    if b"\n" in buffer or (em == 0 and checksum == 2):  # a running program leaves no sign before that prompt
        return False
    return request.kind is Kind.PRINT or not checksum or not (framing.ACK in buffer or framing.NAK in buffer)


ESCAPE, CONTROL_E = b"\x1b", b"\x05"
EVERY_DRIVE = ("*", "^")
SILENT_KINDS = (Kind.COMMAND, Kind.PROGRAM)
"""Kinds of requests that print no line."""
LIST_PROMPT = re.compile(rb"[\n\x06\x15][>?]|[>?]\Z")
"""A possible prompt after a list; without it a list is not parsed at each read."""
NOBODY = "~"
"""A character that no drive has as its name."""

TO_PARTY = NOBODY.encode() + b"\n\n"
"""Makes party mode effective (5.1.105), and executes half a line in no drive; sent where no drive can be outside of
party mode."""
ANSWER = re.compile(r'(?:[^\s"]"[!-~]"|~\w?\d{0,4}(?:"[!-~]")?|PR [^\r\n]*,(?:DN|"~\w*"))[\x80-\xff]?\Z')
"""The end of a signed print: a name after a value, or a mark (`exchange`); of its repetition."""
STOP_BYTES = re.compile(rb"(?<![ -~])(?:[!-~][\x05\x1b])+\n?|[\x03\x05\x1b]|~{%d}[\r\n]" % (LONGEST_PROGRAM_LINE + 1))
"""Any key that stops, alone or after names, Ctrl+C, which resets, and what makes a half-sent line overflow."""


@dataclass(frozen=True)
class MCode(Codec):
    """The settings of one drive that determine its codec. `escape` is ES, None while it is unknown."""

    em: int = 0
    party: bool = False
    checksum: int = 0
    escape: int | None = None
    family: ClassVar[str] = "mcode"
    broadcasts: ClassVar[bool] = True
    line_ends: ClassVar[bytes] = b"\r\n"
    stop_debris: ClassVar[re.Pattern[str]] = re.compile(r".*#")
    error_routine: ClassVar[bool] = True

    @property
    def shown(self) -> str:
        """The settings, for a person."""
        return f"EM={self.em}, PY={int(self.party)}, CK={self.checksum}, ES={self.escape}"

    def request(self, address: str, text: str, kind: Kind | None = None) -> Request:
        """Build the request for a line of MCode. Raises Inexpressible where no drive can take it."""
        text = spaced(text)
        if why := commented(text):
            raise Inexpressible(f"'{text}': {why}")
        if (at := unsendable(text)) is not None:
            raise Inexpressible(f"{text[at]!r} cannot be sent to a drive: printable ASCII only")
        if self.party and not (len(address) == 1 and "!" <= address <= "~"):
            raise Inexpressible(f"no drive name '{address}'; valid: one letter or digit, or !")
        kind = kind or classify.kind_of(text)
        request = Request(
            address, text, kind, self, expect=classify.NOTHING if kind in SILENT_KINDS else classify.print_form(text)
        )
        size = len(self._frame(request))
        if size > LONGEST_PROGRAM_LINE:
            raise Inexpressible(
                f"the line has {size} characters with name and checksum; a drive takes {LONGEST_PROGRAM_LINE}; "
                "shorten it (nothing was sent)"
            )
        return replace(request, kind=Kind.QUIET, settle=SHORT, expect=None) if address in EVERY_DRIVE else request

    def _body(self, request: Request) -> bytes:
        name = request.address if self.party else ""
        return name.encode("latin-1") + (request.spoken or request.text).encode("latin-1")

    def _frame(self, request: Request) -> bytes:
        body = self._body(request)
        return framing.sealed(body) if self.checksum and body else body

    @property
    def terminator(self) -> bytes:
        """The byte that executes a line: LF in party mode, CR otherwise."""
        return b"\n" if self.party else b"\r"

    def encode(self, request: Request) -> bytes:
        """Return name (party mode), text, check byte (CK), terminator.

        After power-up a drive on a party line ignores everything before the first line feed (5.1.105). Where silence
        counts as success, a line feed precedes each command, with a name that no drive has. `body` is sent unchanged.
        """
        if request.body:
            return request.body
        frame = self._frame(request) + self.terminator
        silent_on_success = self.party and (self.em == 2 or (self.em == 1 and self.checksum == 2))
        if request.kind is Kind.COMMAND and silent_on_success:
            return NOBODY.encode() + self.terminator + frame
        return frame

    def _reading(self, request: Request, buffer: bytes) -> ReplyParser:
        return ReplyParser(request, self.em, self.checksum, self._body(request), buffer)

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        if without_end(request, buffer, self.em, self.checksum):
            return None
        if not self.checksum and self.em in (1, 2):
            if (decoded := short_reply(request, buffer)) is not None:
                return decoded
            if only_strays(request, buffer):
                return None
        if request.kind in ENDLESS and not (self.em == 0 and request.kind is Kind.LIST and LIST_PROMPT.search(buffer)):
            return None
        return self._reading(request, buffer).whole()

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        return self._reading(request, buffer).on_quiet()

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """Return TIMEOUT, or DAMAGED for bytes that cannot be understood; with EM=2 silence refuses a print."""
        if request.kind is Kind.QUIET and (collected := self.on_quiet(request, buffer)) is not None:
            return collected
        if any(byte not in b"\r\n" for byte in buffer):
            shown = buffer.decode("latin-1")
            heard = shown if len(shown) <= 48 else shown[:48] + "..."
            strays, collided = self._meanwhile(request, buffer)
            return Decoded(Reply(end=End.DAMAGED, detail=f"heard {heard!r}", collided=collided), len(buffer), strays)
        silent = self.em == 2 and request.kind is Kind.PRINT
        return Decoded(Reply(end=End.SILENT if silent else End.TIMEOUT), len(buffer))

    def _meanwhile(self, request: Request, buffer: bytes) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Divide what came instead of a print: whole lines of a program, and what is none."""
        if request.kind is not Kind.PRINT or not request.expect:
            return (), ()
        got = ReplyLines(request, self.em, self.checksum, self._body(request))
        for piece in framing.pieces(buffer, 0, self.checksum != 0):
            text = piece.shown.lstrip(b">?") if self.em == 0 else piece.shown
            if piece.what == "line" and text and buffer[piece.end - 2 : piece.end] == b"\r\n":
                got.add_earlier(text)
            elif text:
                got.collided.append(framing.printable(text))
        gathered = [] if request.rows else got.lines
        strays, own = divided(request, gathered + got.strays, whole=False)
        return strays, (*got.collided, *own)

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """Seconds of quiet that end the reply to a request, by the bytes received so far."""
        return Received(request, buffer, self.em, self.checksum).quiet_time()

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        return framing.unasked(buffer, self.em, self.checksum)

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """Return the escape that ES selects, or every form where ES is unknown (5.1.41).

        ES 2 and 3 require the name before the key. The name begins a line in the drives' buffers, and a line feed ends
        it. Where the use of names is unknown, the last keys clear the line that the names began.
        """
        escape = self.escape if sure else None
        if escape in (0, 1):
            return ESCAPE if escape else CONTROL_E
        names = [name.encode("latin-1") for name in addresses if name] or [UNNAMED.encode()]
        end = b"" if half_sent else b"\n"
        if escape is None:
            named = b"".join(name + CONTROL_E + name + ESCAPE + end for name in names)
            return ESCAPE + CONTROL_E + named + ESCAPE + CONTROL_E
        key = CONTROL_E if escape == 2 else ESCAPE
        named = b"".join(name + key for name in names)
        return named + end if self.party else key + named

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[StopPiece]:
        return (StopPiece(self.stop(addresses, sure)),)

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Whether the key stops this drive: any key with ES 0 and 1, the key after its name with 2 and 3 (5.1.41)."""
        escape = self.escape if sure else None
        name = address.encode("latin-1") or UNNAMED.encode()
        keys = {0: CONTROL_E, 1: ESCAPE, 2: name + CONTROL_E, 3: name + ESCAPE}
        return escape is None or keys[escape] in data

    def stops_unknown(self, data: bytes) -> bool:
        return self.party and self.hears_stop(data, NOBODY)

    def starts_motion(self, text: str) -> bool:
        """Whether the tables list the word as one that starts motion; a print starts none, an unknown line may."""
        return classify.starts_motion(text)

    def started(self, text: str) -> Started:
        return classify.started(text)

    def stop_started(self, address: str, started: Started) -> Sequence[StopPiece]:
        """Return the end of the program, then SL 0, in party mode: no drive but the named one reads these lines."""
        if not self.party or not (len(address) == 1 and "!" <= address <= "~") or address in EVERY_DRIVE:
            return ()
        return tuple(StopPiece(self.encode(self.request(address, text)), STOP_PIECE_QUIET) for text in ("E", "SL 0"))

    def repeated(self, sent: bytes, rest: bytes, over: bool) -> bool:
        """Tell an adapter's repetition from a drive's (5.1.39): a drive makes CR LF of a CR.

        In party mode it makes CR LF of a LF, too. Outside of it a LF ends no line, so nothing follows a drive's
        repetition, except that party mode is certain where these line feeds are sent.
        """
        if not sent.endswith(b"\r"):
            return rest != b"" or (over and sent == TO_PARTY)
        return not rest.startswith(b"\n") if rest else over

    def damaged(self, line: str) -> bool:
        return self.checksum > 0 and framing.UNPRINTED.search(line) is not None and not self.restarted(line)

    def answers_host(self, line: str) -> bool:
        """Whether a signature ends the line: the name after a value, or a mark; a check byte may follow."""
        return ANSWER.search(line) is not None

    def answers(self, request: Request, line: str) -> bool:
        return request.signed and request.expect is not None and re.fullmatch(request.expect, line) is not None

    def restarted(self, line: str) -> bool:
        """Whether a line is the sign-on, which a drive in party mode does not send (3.4.4)."""
        return framing.SIGN_ON.match(line) is not None

    def invalidate(self) -> bytes:
        """Return a full buffer of tildes: the half-sent line overflows, which every drive refuses (5.1.102)."""
        return b"~" * (LONGEST_PROGRAM_LINE + 1) + self.terminator
