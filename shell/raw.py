r"""The bytes of a line, with times, as text and in hex; in raw mode a person's own bytes go out.

Received bytes are shown a line at a time. A piece without an end is shown once nothing follows it for a while.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic, Stopped
from multidrop.dialects import Priority
from multidrop.drives.events import Ended, Sent, Traffic
from multidrop.drives.half_line import HalfLine
from multidrop.shell.events import Bytes

if TYPE_CHECKING:
    from datetime import datetime

    from multidrop.drives.bus import Bus
    from multidrop.drives.events import BusEvent
    from multidrop.transports import PortControl

ROW_PAUSE = 0.05
"""The quiet time after which a piece without an end is shown, s."""
TERMINATORS = {"cr": b"\r", "lf": b"\n", "crlf": b"\r\n", "none": b""}
"""What follows a typed text, by its name."""
_LOWEST = "NUL SOH STX ETX EOT ENQ ACK BEL BS TAB LF VT FF CR SO SI"
CONTROLS = {name: bytes([code]) for code, name in enumerate(_LOWEST.split()) if name != "FF"}
CONTROLS |= {"XON": b"\x11", "XOFF": b"\x13", "NAK": b"\x15", "ESC": b"\x1b", "DEL": b"\x7f"}
"""Control bytes by name. FF is the byte 0xFF, so a form feed has no name."""
_NAMED = {0x0D: "\\r", 0x0A: "\\n", 0x09: "\\t"}
_SHOWN = tuple(chr(byte) if 0x20 <= byte <= 0x7E else _NAMED.get(byte, f"\\x{byte:02x}") for byte in range(0x100))
_END = re.compile(rb"\r\n|\n|\r(?=[^\n])", re.DOTALL)
"""The end of a line; a CR may be followed by a LF that is still on its way."""
_ITEM = re.compile(r'"([^"]*)"|(\S+)')


class ByteForm(Enum):
    """How bytes are shown; the most of them in a row, and the most cells of their text."""

    TEXT = ("text", 64, 256)
    HEX = ("hex", 24, 96)
    BOTH = ("both", 12, 24)
    """With their time both columns fit in 80 cells."""

    def rows(self, data: bytes) -> Iterator[str]:
        _, most, cells = self.value
        for piece in parts_of(data, most, cells) if data else ():
            if self is ByteForm.BOTH:
                yield f"{text_of(piece):<{cells}} {hex_of(piece)}"
            else:
                yield text_of(piece) if self is ByteForm.TEXT else hex_of(piece)


def parts_of(data: bytes, most: int, cells: int) -> Iterator[bytes]:
    """Divide bytes into rows of at most `most` bytes, and of at most `cells` of text."""
    part = b""
    for byte in data:
        longer = part + bytes([byte])
        if part and (len(longer) > most or len(text_of(longer)) > cells):
            yield part
            longer = bytes([byte])
        part = longer
    yield part


def text_of(data: bytes) -> str:
    r"""Bytes as text: printable ASCII as it is, anything else written out (`\r`, `\x06`)."""
    return "".join(map(_SHOWN.__getitem__, data))


def hex_of(data: bytes) -> str:
    return data.hex(" ").upper()


class ByteView:
    """Shows the bytes of a bus. `publish` takes what is sent and received; `wall` is the clock for the time of day."""

    watched = False
    """The drives of the bus are talked to."""

    def __init__(self, bus: Bus, publish: Callable[[Bytes], None], wall: Callable[[float], datetime]) -> None:
        self.bus = bus
        self.form = ByteForm.BOTH
        self.last = bus.now()
        """The time of the last byte, sent or received, s."""
        self._publish, self._wall = publish, wall
        self._piece = b""
        self._piece_at = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._leave: Callable[[], None] = lambda: None

    def open(self) -> None:
        self._leave = self.bus.watch(self._take)

    def close(self) -> None:
        self._leave()
        self._flush()

    # Receiving

    def _take(self, event: BusEvent) -> None:
        if not isinstance(event, Traffic):
            return
        self.last = event.at
        if event.outgoing:
            self._flush()
            self._show(event.at, True, [event.data])
            return
        if not self._piece:
            self._piece_at = event.at
        self._piece += event.data
        # Show whole lines, and set the time at which the rest is shown.
        ends = [match.end() for match in _END.finditer(self._piece)]
        lines = [self._piece[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]
        if lines:
            self._show(self._piece_at, False, lines)
            self._piece, self._piece_at = self._piece[ends[-1] :], event.at
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if len(self._piece) >= self.form.value[1]:
            self._flush()
        elif self._piece:
            self._timer = asyncio.get_running_loop().call_later(ROW_PAUSE, self._flush)

    def _flush(self) -> None:
        piece, self._piece = self._piece, b""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if piece:
            self._show(self._piece_at, False, [piece])

    def _show(self, at: float, outgoing: bool, lines: Sequence[bytes]) -> None:
        clock = f"{self._wall(at):%H:%M:%S.%f}"[:-3]
        rows = tuple(row for line in lines for row in self.form.rows(line))
        self._publish(Bytes(at, self.bus.name, outgoing, clock, rows, watched=self.watched))


class Watched(ByteView):
    """The bytes of a bus whose drives are talked to, without those of our polls."""

    watched = True
    _polls = False
    """A poll is in flight."""

    def _take(self, event: BusEvent) -> None:
        if isinstance(event, Sent):
            self._polls = event.request.priority is Priority.POLL
        elif isinstance(event, Ended):
            self._polls = False
        elif not self._polls:
            super()._take(event)


class RawLine(ByteView):
    """One bus in raw mode."""

    def __init__(self, bus: Bus, publish: Callable[[Bytes], None], wall: Callable[[float], datetime]) -> None:
        super().__init__(bus, publish, wall)
        self.everyone = bus.at("*")
        """Everything on the line: what automation has sent to."""
        self.end = TERMINATORS["cr"]
        """The bytes after a typed text."""
        codec = bus.roster.family.codec
        self.half = HalfLine(b"" if codec.framed else codec.line_ends)
        """What the drives may hold of a person's line."""
        self.waiting = ""
        """The text that was sent last."""

    def _take(self, event: BusEvent) -> None:
        super()._take(event)
        if isinstance(event, Traffic) and not event.outgoing:
            self.half.replied(event.data)
        elif isinstance(event, Traffic) and event.stop:
            self.half.cleared()

    # Sending

    def send(self, data: bytes) -> None:
        """Write bytes, once. Raises Stopped where a stop went first, TransportLost where the port is lost."""
        if not self.bus.link.write_raw(data):
            raise Stopped(f"{self.bus.name}: a stop went first; '{text_of(data)}' was not sent")
        self.waiting = text_of(data)
        for drive in self.bus.all_drives:
            drive.motions.runs()  # nothing was read of the text, which may end any motion
        self.half.written(data, self.bus.now())

    def encoded(self, text: str) -> bytes:
        """The bytes of a typed text, with the terminator. Raises Diagnostic for a character of several bytes."""
        wrong = next((character for character in text if ord(character) > 0xFF), "")
        if wrong:
            raise Diagnostic(
                f"{wrong!r} has more than one byte; nothing was sent", self.bus.name, "/bytes sends any byte"
            )
        return text.encode("latin-1") + self.end

    # Settings of the port

    def control(self) -> PortControl:
        """The settings of the port. Raises Diagnostic where it is not a serial port."""
        transport = self.bus.link.transport
        if transport.control is None:
            hint = "valid on a serial port, on rfc2217:// and on ssh:// with multidrop there"
            raise Diagnostic("has no baud rate, DTR, RTS or break", transport.name, hint)
        return transport.control


def parse_bytes(items: str) -> bytes:
    """Parse bytes: `0D 0A`, `1b5B`, a control byte by name or as `^C`, a text in quotation marks. Raises Diagnostic."""
    return b"".join(_item(match[1], match[2]) for match in _ITEM.finditer(items))


def _item(quoted: str | None, word: str | None) -> bytes:
    if word is None:
        text = quoted or ""
        if any(ord(character) > 0xFF for character in text):
            raise Diagnostic(f'"{text}" has a character of more than one byte', "/bytes", "give its bytes in hex")
        return text.encode("latin-1")
    name = word.upper()
    if name in CONTROLS:
        return CONTROLS[name]
    if re.fullmatch(r"\^[@-_?]", name):
        return bytes([ord(name[1]) ^ 0x40])
    digits = name.removeprefix("0X")
    if re.fullmatch(r"([0-9A-F]{2})+", digits):
        return bytes.fromhex(digits)
    raise Diagnostic(f"no byte {word}", "/bytes", 'valid: 0D, 1B5B, ESC, CR, ^C, "text"')
