"""The controller's lines: device number, command and CR out, a line that ends in CR in, and how to stop.

Source: PMX-2ED-SA manual 6.2.3, 7.7, 7.19.2. A unit may be alone behind a gateway that wants no number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from dialects.codec import Decoded, End, Kind, Reply, Request
from dialects.errors import Inexpressible
from dialects.pmx.manual.table import lookup, starts_motion

LONGEST = 62
"""Characters of a command with its number: what a packet of the same controller's USB holds with its end."""
FLASH = 5.0
"""Seconds that writing to flash may take."""
GAP = 0.03
"""Seconds of quiet behind a command of a stop: its answer must not run into the next one."""
FACTORY = "00"
"""The device number of a new unit."""
WRITES_FLASH = re.compile(r"STORE|SA\d+=", re.ASCII)
MARKED = re.compile(r"\?Q(\d\d)?\d{3}", re.ASCII)
"""The answer to a mark (`asking`)."""
NO_TEXT = b"\n\0"
"""What some gateways and drivers add."""


@dataclass(frozen=True)
class Pmx:
    """One controller, or one of several on a line. `addressed`: its number stands in front of each command."""

    addressed: bool = True
    family: ClassVar[str] = "pmx"
    framed: ClassVar[bool] = False
    numbered: ClassVar[bool] = False
    broadcasts: ClassVar[bool] = False
    stop_gap: ClassVar[float | None] = GAP
    stop_sign: ClassVar[str] = ""

    def request(self, address: str, text: str) -> Request:
        """The request for a command, as typed: case matters. Inexpressible where it cannot be sent."""
        text = text.strip()
        if wrong := [c for c in text if not " " <= c <= "~"]:
            raise Inexpressible(f"{wrong[0]!r} cannot be sent to a controller: printable ASCII only")
        if not text:
            raise Inexpressible("an empty command has no answer; nothing was sent")
        if self.addressed and not (len(address) == 2 and address.isascii() and address.isdigit()):
            raise Inexpressible(f"'{address}' is no device number: they are 00 to 99")
        size = len(address) + len(text) + 1
        if size > LONGEST:
            raise Inexpressible(f"the command has {size} characters with its number, {LONGEST} are sent at most")
        row = lookup(text)
        reads = row is not None and "R" in row.access and "=" not in text
        timeout = FLASH if WRITES_FLASH.match(text) else None
        return Request(address, text, Kind.PRINT if reads else Kind.COMMAND, self, timeout=timeout)

    def encode(self, request: Request) -> bytes:
        """`@`, number, command, CR; without a number the command and CR."""
        return self._command(request.address, request.text)

    def _command(self, address: str, text: str) -> bytes:
        head = f"@{address}" if self.addressed else ""
        return f"{head}{text}\r".encode("latin-1")

    def decode(self, request: Request, buffer: bytes) -> Decoded | None:
        """The first line that can be the answer; one that begins with `@` is a command, somebody's or our own."""
        strays: list[str] = []
        at = 0
        while (end := buffer.find(b"\r", at)) >= 0:
            text, at = _text(buffer[at:end]), end + 1
            if text.startswith("@") or not _fits(request, text):
                strays.append(text)
                continue
            if request.gather:
                return Decoded(Reply((*strays, text), acknowledged=True), at)
            return Decoded(_reply(text), at, tuple(strays))
        return None

    def on_quiet(self, request: Request, buffer: bytes) -> Decoded | None:
        """Nothing: every answer ends in CR."""
        return None

    def on_timeout(self, request: Request, buffer: bytes) -> Decoded:
        """TIMEOUT, or DAMAGED where something came that is no answer to it."""
        if not buffer.strip(NO_TEXT):
            return Decoded(Reply(end=End.TIMEOUT), len(buffer))
        shown = buffer.strip(NO_TEXT).decode("latin-1")
        own = self.encode(request).decode("latin-1")
        detail = f"heard {shown[:48] + '...' if len(shown) > 48 else shown!r}"
        if shown == own:
            detail = "our own bytes came back and nothing else; echo=local is for adapters that repeat them"
        return Decoded(Reply(end=End.DAMAGED, detail=detail), len(buffer))

    def quiet_time(self, request: Request, buffer: bytes) -> float:
        """No quiet time ends anything."""
        return 0.0

    def parse_unsolicited(self, buffer: bytes) -> tuple[tuple[str, ...], int]:
        """Late answers; `OK`, which a stop is answered by, says nothing to anybody."""
        whole = buffer[: buffer.rfind(b"\r") + 1]
        rest = buffer[len(whole) :]
        used = len(whole) + len(rest) - len(rest.lstrip(NO_TEXT))
        lines = (_text(piece) for piece in whole.split(b"\r"))
        return tuple(line for line in lines if line not in ("", "OK")), used

    def stop(self, addresses: Sequence[str], sure: bool = True, half_sent: bool = False) -> bytes:
        """ABORT for the first; the others follow piece by piece, or their answers would run into it (7.7).

        With no number known, the factory's and none at all: a unit on a line does not answer a command without one.
        """
        if half_sent:
            return b""  # nothing of it works before the line that stands in the buffer has ended
        names = self._names(addresses)
        if not names:
            return b"ABORT\r" + Pmx()._command(FACTORY, "ABORT")
        return self._command(names[0], "ABORT")

    def stop_again(self, addresses: Sequence[str], sure: bool = True) -> Sequence[bytes]:
        """ABORT for every one, then each one's programs end, and ABORT again: one may have begun a move meanwhile."""
        names = self._names(addresses) or [FACTORY]
        pieces = [(name, "ABORT") for name in (*names[1:], names[0])]
        pieces += [(name, text) for name in names for text in ("SR0=0", "SR1=0", "ABORT")]
        return [self._command(name, text) for name, text in pieces]

    def _names(self, addresses: Sequence[str]) -> list[str]:
        return [name for name in addresses if name] if self.addressed else [""]

    def hears_stop(self, data: bytes, address: str, sure: bool = True) -> bool:
        """Only a stop with its own number; every one where no numbers are used."""
        return not self.addressed or self._command(address, "")[:-1] in data

    def starts_motion(self, text: str) -> bool:
        """As the table says; a read starts nothing, a command that is not known may start anything."""
        return starts_motion(text)

    def restarted(self, line: str) -> bool:
        """Never said: nothing is printed after power-up."""
        return False

    def invalidate(self) -> bytes:
        """Makes the half-sent line one that there is not; should a unit read it all the same, ABORT is right behind."""
        return b"~~~\r"


def _text(piece: bytes) -> str:
    """A line from the wire, without what some gateways and drivers add."""
    return piece.translate(None, NO_TEXT).decode("latin-1")


def _fits(request: Request, text: str) -> bool:
    """Whether a line can be the answer: what is expected, or a refusal of something that was sent; no late mark."""
    if MARKED.fullmatch(text) and text != f"?{request.text}":
        return False
    if request.expect is None or (text.startswith("?") and not request.gather):
        return True
    return re.fullmatch(request.expect, text) is not None


def _reply(text: str) -> Reply:
    if any(not " " <= c <= "~" for c in text):
        return Reply(end=End.DAMAGED, detail=f"heard {text[:48]!r}")
    if text.startswith("?"):
        return Reply((text,), End.REFUSED)
    return Reply((text,), acknowledged=True)
