"""The codec of a PMX controller: device number, command and CR out, a line that ends in CR in, and the stop.

Source: PMX-2ED-SA manual 6.2.3, 7.7, 7.19.2. A unit may be alone on a gateway that takes no number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from multidrop.base.errors import Inexpressible
from multidrop.dialects.codec import Codec, Decoded, End, Kind, Reply, Request, Started, StopPiece
from multidrop.dialects.state import DriveState
from multidrop.families.pmx.manual.table import AXES, MOTIONS, PROGRAMS, axes_of, lookup, reads, starts_motion

LONGEST_COMMAND = 62
"""Characters of a command with its number, and of a reply: the room in a USB packet, with the end."""
FLASH = 5.0
"""Seconds for a write to flash."""
STOP_PIECE_QUIET = 0.03
"""Seconds of quiet after a command of a stop, so that its reply does not collide with the next command."""
FACTORY = "00"
"""The device number of a new unit."""
DONE, VALUE = "OK", "(?![OK]*$).*"
"""The reply to a command that reads nothing, and to one that reads (manual 9). A late one of the other kind is none.
Neither is what is left of several: no value has these letters alone, and none is empty."""
STORED, TOKEN = re.compile(r"SA\d+", re.ASCII), "(?![OK]+$).*"
"""A read of a line of a program, and its reply, which is empty where nothing is stored."""
WRITES_FLASH = re.compile(r"STORE|SA\d+=", re.ASCII)
MARKED = re.compile(r"\?(?:Q(?:\d\d)?\d{3}|~~~)", re.ASCII)
"""The reply to a sync mark (`exchange`), and to what ends a half-sent line before a stop.

A longer line with it is two replies: the end of the first was lost."""
NO_TEXT = b"\n\0"
"""Bytes that some gateways and drivers add."""

STOP_BYTES = re.compile(rb"(?:@\d\d)?(?:ABORT|SR[01]=0)\r|~~~\r")
"""The commands of a stop, and the end of a half-sent one."""


@dataclass(frozen=True)
class Pmx(Codec):
    """One controller, alone or on a line. `addressed`: its number precedes each command."""

    addressed: bool = True
    family: ClassVar[str] = "pmx"
    stop_replies: ClassVar[bool] = True
    spares: ClassVar[bool] = True

    def request(self, address: str, text: str) -> Request:
        """Build the request for a command, as typed: case matters. Raises Inexpressible where it cannot be sent."""
        text = text.strip(" \t")
        if wrong := [c for c in text if not " " <= c <= "~"]:
            raise Inexpressible(f"{wrong[0]!r} cannot be sent to a controller: printable ASCII only")
        if not text:
            raise Inexpressible("an empty command has no reply; nothing was sent")
        if self.addressed and not (len(address) == 2 and address.isascii() and address.isdigit()):
            raise Inexpressible(f"no device number '{address}'; valid: 00 to 99")
        size = len(address) + len(text) + 1
        if size > LONGEST_COMMAND:
            raise Inexpressible(
                f"the command has {size} characters with its number, {LONGEST_COMMAND} are sent at most"
            )
        timeout = FLASH if WRITES_FLASH.match(text) else None
        value = TOKEN if STORED.fullmatch(text) else VALUE
        kind, expect = (Kind.PRINT, value) if reads(text) else (Kind.COMMAND, DONE if lookup(text) else None)
        return Request(address, text, kind, self, timeout=timeout, expect=expect)

    def encode(self, request: Request) -> bytes:
        return self._command(request.address, request.text)

    def _command(self, address: str, text: str) -> bytes:
        head = f"@{address}" if self.addressed else ""
        return f"{head}{text}\r".encode("latin-1")

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """Find the first line that can be the reply; a line that begins with `@` is a command."""
        strays: list[str] = []
        at = 0
        while (end := buffer.find(b"\r", at)) >= 0:
            text, at = _text(buffer[at:end]), end + 1
            if text.startswith("@") or not _fits(request, text):
                strays.append(text)
                continue
            if request.gather:
                return Decoded(Reply((*strays, text), acknowledged=True), at)
            wrong = len(text) > LONGEST_COMMAND or any(not " " <= c <= "~" for c in text)
            if wrong or (MARKED.search(text) and text != f"?{request.text}"):
                reply = Reply(end=End.DAMAGED, detail=f"heard {text[:48]!r}")
            elif text.startswith("?"):
                reply = Reply((text,), End.REFUSED)
            else:
                reply = Reply((text,), acknowledged=True)
            return Decoded(reply, at, tuple(strays))
        return None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        if (collected := self.on_quiet(request, buffer)) is not None:
            return collected
        if not buffer.strip(NO_TEXT):
            return Decoded(Reply(end=End.TIMEOUT), len(buffer))
        shown = buffer.strip(NO_TEXT).decode("latin-1")
        own = self.encode(request).decode("latin-1")
        detail = f"heard {shown[:48] + '...' if len(shown) > 48 else shown!r}"
        if shown == own:
            detail = "our own bytes came back and nothing else; echo=local is for adapters that repeat them"
        return Decoded(Reply(end=End.DAMAGED, detail=detail), len(buffer))

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Late replies, without `OK`, the reply to a stop."""
        whole = buffer[: buffer.rfind(b"\r") + 1]
        rest = buffer[len(whole) :]
        used = len(whole) + len(rest) - len(rest.lstrip(NO_TEXT))
        lines = (_text(piece) for piece in whole.split(b"\r"))
        return tuple(line for line in lines if line not in ("", "OK")), used

    def printed(self, line: str) -> bool:
        """Never: no command of a program prints, and a controller reports nothing by itself (manual 7.19, 9)."""
        return False

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """Return ABORT for the first controller; `stop_again` has the others, whose replies would collide (7.7).

        Without a known number, use the factory's and none: a unit on a line ignores a command without a number.
        """
        if half_sent:
            return b""  # no command works before the half-sent line has ended
        names = self._names(addresses)
        if not names:
            return b"ABORT\r" + Pmx()._command(FACTORY, "ABORT")
        return self._command(names[0], "ABORT")

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[StopPiece]:
        """Return ABORT for each controller, the end of its programs, and ABORT again: a program may have started a
        move.
        """
        names = self._names(addresses) or [FACTORY]
        pieces = [(name, "ABORT") for name in (*names[1:], names[0])]
        pieces += [(name, text) for name in names for text in ("SR0=0", "SR1=0", "ABORT")]
        return [StopPiece(self._command(name, text), STOP_PIECE_QUIET) for name, text in pieces]

    def _names(self, addresses: Sequence[str]) -> list[str]:
        return [name for name in addresses if name] if self.addressed else [""]

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Whether the stop bears this number; always where no numbers are used."""
        return not self.addressed or self._command(address, "")[:-1] in data

    def starts_motion(self, text: str) -> bool:
        """Whether the table lists the command as one that starts motion; a read starts none, an unknown command may."""
        return starts_motion(text)

    def started(self, text: str) -> Started:
        row = lookup(text)
        if row is None:
            return Started()
        program = row.name in PROGRAMS
        return Started(axes_of(text), program, lasts=not program and row.name not in MOTIONS)

    def stop_started(self, address: str, started: Started) -> Sequence[StopPiece]:
        """Return ABORT for each axis that was started; with a program the usual stop."""
        if started.program:
            return (StopPiece(self.stop([address]), STOP_PIECE_QUIET), *self.stop_again([address])[1:])
        axes = [axis for axis in AXES if started.axes is None or axis.lower() in started.axes]
        return tuple(StopPiece(self._command(address, f"ABORT{axis}"), STOP_PIECE_QUIET) for axis in axes)

    def invalidate(self) -> bytes:
        """Return the end of a command that no unit knows; should a unit read it otherwise, ABORT follows at once."""
        return b"~~~\r"


def _text(piece: bytes) -> str:
    return piece.translate(None, NO_TEXT).decode("latin-1")


def _fits(request: Request, text: str) -> bool:
    """Whether a line can be the reply: the expected text, or a refusal; never the reply to an earlier mark."""
    if MARKED.fullmatch(text) and text != f"?{request.text}":
        return False
    if request.expect is None or (text.startswith("?") and not request.gather):
        return True
    return re.fullmatch(request.expect, text) is not None


@dataclass(eq=False)
class PmxState(DriveState):
    """One PMX controller."""

    unnamed = "the controller"

    codec: Pmx
