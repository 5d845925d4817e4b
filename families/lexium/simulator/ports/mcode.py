"""The drive's side of the wire: how an MCode drive frames, echoes and checks what it receives, and replies.

Theory of operation. A port is a state machine over single bytes. Three of them are no text: ESC, ^E (ES chooses between
them) and ^C act at once, in the middle of a line too. Everything else belongs to a line. The settings (`Mode`) at its
first byte apply to the end of its reply: the reply to `EM=1` has the old echo mode, and a setting that a program makes
meanwhile waits for the next line.

With PY=0 a line ends with CR; a LF is part of no line (EM=0 echoes it). With PY=1 a LF executes. The first character is
the addressee: this drive's name, `*` for all, `^` for those with QD=1; anything else makes the drive deaf. A CR before
the LF has no effect, and between two commands it separates them. Clients of real units send several at once, each with
its name, and one LF after the last (`1VI 1`, CR, `1MA 4`, LF); they are carried out at that LF. Party mode is inert
until one LF has come after PY=1 was set, after power-up and after a reset (5.1.105): until then the port of a Lexium
is deaf, except for ESC, ^E and ^C. On an MDrivePlus the LF that ends the first line is that one, and the line is
carried out.

Decisions where the manual is silent (facts that a unit may correct):

- Backspace and Delete take back the character before them in the line of this drive, and nothing where there is none;
  the name of a line in party mode stays. EM=0 gives back the key as it came.
- A line of only CR is an empty command: it gets a reply and executes nothing. With checksum it lacks one: NAK.
- The reply to a line that changes CK follows the new CK: ACK to `CK=1`, CR LF to `CK=0`.
- A check byte after a key, and a CR after that, belong to the key and are no line.
- The 64 characters of the line buffer are the whole command without its terminator: name and checksum count. The 65th
  is refused at once; the rest up to the terminator is dropped silently.
- EM=3 gives back the command without the device name, with the checksum as it was received.
- ES 2 and 3 need the drive's own name as the byte before the key, anywhere in a line.
- EM=3 replies to ESC like EM=1; EM=2 does not reply. Neither ACK nor a checksum is part of that reply.
- A reply that `*` or `^` silences (DG=1) is silent in everything, prints and NAK included.
- Other drives overhear what a program prints in party mode. They take it for a line if it ends with LF and begins with
  a name: so one drive commands another. They do not overhear replies, nor a print in the middle of a line of the host.
- ESC while single-stepping ends the program like any ESC; space and CR at the begin of a line are the stepping keys.

There is no clock: bytes and times come in, bytes with times go out. Times are seconds, and never go back.

This is the drive's side. It shares nothing with the host's parser of these tables, so that each tests the other.
"""

from __future__ import annotations

import re

from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.ports.replies import CRLF, LINE_BUFFER, Mode, ReceivedLine, Replier
from multidrop.simulator.wire import Transmission

CR, LF, ESC, CTRL_C, CTRL_E = 0x0D, 0x0A, 0x1B, 0x03, 0x05
KEYS = frozenset({CR, LF, ESC, CTRL_C, CTRL_E})
"""Bytes that have a meaning within a line for another drive."""
TYPED = re.compile(rb"([^\x08\x7f]*)([\x08\x7f]?)", re.DOTALL)
"""The characters of a line up to a key that takes back one, and the key."""
PLAIN = re.compile(b"[^\r\n\x1b\x03\x05]+")
"""Text of a line: bytes that are no keys."""
BACKSPACE, DELETE = 0x08, 0x7F
ERASERS = frozenset({BACKSPACE, DELETE})
"""Keys of a terminal that take back the character before."""
ENDS, STOPS = re.compile(rb"[\r\n]"), re.compile(rb"[\x03\x05\x1b]")
ADDRESSES = frozenset({CR, LF, *b"*^"})
"""Bytes that begin a line in party mode, except for names."""
KEY_ALONE, KEY_WITH_CHECK = "alone", "with its check byte"
"""The bytes received so far of a key that acts at once: a check byte and a CR after it belong to it."""
DEAF = ReceivedLine(Mode(echo=0, party=True, checksum=0, name=""), mine=False)
"""A line for another drive, in party mode: nothing of it is kept."""
STEP_KEYS = {0x20: " ", CR: "\r"}
MOST_WAITING = 64
"""Commands that wait in party mode for the LF after the last; one more is like a character too many in a line."""


class MCodePort:
    """One way in to an MCode device. `serial=False`: the Ethernet kind, without party mode and checksum.

    `baud` is that of the wire, 0 if bytes take no time: a program that prints faster than the wire finds the
    transmitter's buffer full.
    """

    baud = 0
    """It understands any: the drives of a cell have the baud rate of their wire."""

    def __init__(self, device: MCodeDevice, serial: bool = True, baud: int = 0) -> None:
        self._device, self._memory, self._serial = device, device.memory, serial
        self._replier = Replier(device, serial, baud)
        self._overheard = bytearray()
        self._last = 0.0
        self._thread, self._bridges, self._power = device.thread, device.bridges, device.power_unit
        self._powered, self._boots, self._running = self._bridges.powered, self._power.boots, self._thread.running
        self._forget()

    @property
    def deadline(self) -> float | None:
        device, held = self._device.deadline, self._replier.deadline
        return device if held is None or (device is not None and device < held) else held

    def quiet(self, now: float) -> bool:
        device, held = self._device, self._replier.deadline
        if held is not None and held <= now:
            return False
        same = self._powered and self._boots == self._power.boots
        return same and not self._replier.queue and device.quiet(now, self._running)

    def hears(self, byte: int) -> bool:
        """Within a line for another drive only `KEYS` mean anything; of other bytes only the last one matters."""
        if self._line is not DEAF or byte in KEYS:
            return True
        self._before = byte
        return False

    def completes(self, data: bytes) -> bool:
        return ENDS.search(data) is not None

    def urgent(self, data: bytes) -> bool:
        return STOPS.search(data) is not None

    def receive(self, data: bytes, now: float) -> None:
        if not self.quiet(now):
            self._settle(now)
        at = 0
        while at < len(data) and self._bridges.powered:
            plain = PLAIN.match(data, at) if self._line is not None else None
            if self._line is not None and plain is not None:  # the text of a line up to the next key
                at, self._before = plain.end(), data[plain.end() - 1]
                self._on_text(self._line, plain[0], now)
            else:
                self._on_byte(data[at], now)
                at += 1
        self._running = self._thread.running
        self._replier.collect(self._last)
        self._replier.release(self._last)

    def advance(self, now: float) -> bytes:
        """Return what the drive has sent up to `now`, since it was last asked."""
        return b"".join(transmission.data for transmission in self.sent(now))

    def sent(self, now: float) -> list[Transmission]:
        """Return the same as transmissions; other drives overhear prints in party mode."""
        self._settle(now)
        return self._replier.take(now)

    def overhear(self, data: bytes, now: float) -> None:
        """Take what another drive has printed: in party mode, whole lines, while the host sends no line."""
        receiving = self._line is not None or self._waiting
        if receiving or not self._replier.mode().party or not self._bridges.powered:
            self._overheard.clear()
        else:
            heard = self._overheard
            heard += data
            end = heard.rfind(b"\n") + 1
            lines = bytes(heard[:end])
            del heard[: max(end, len(heard) - LINE_BUFFER)]
            if lines:
                self.receive(lines, now)

    # -- time ---------------------------------------------------------------------------------------

    def _settle(self, now: float) -> None:
        """Let the device live up to `now`, so that what it sends by itself is sent on time and in its modes."""
        device = self._device
        while (due := device.deadline) is not None and due <= now and (at := device.proceed(now)) is not None:
            self._last = max(self._last, at)
            self._notice(self._last)
        self._last = max(self._last, now)
        self._notice(now)

    def _notice(self, at: float) -> None:
        """See what the device has become by itself, or by `/sim`: without power, at its program's end."""
        self._notice_power()
        self._replier.collect(self._last)
        if self._running and not self._thread.running and self._memory.echo_mode == 0:
            self._replier.send(at, CRLF + self._replier.prompt().encode())
        self._running = self._thread.running

    def _notice_power(self) -> None:
        """See whether it has lost power or begun again: by a switch, a reset input, a line."""
        if (self._bridges.powered, self._power.boots) != (self._powered, self._boots):
            self._powered, self._boots, self._running = self._bridges.powered, self._power.boots, self._thread.running
            self._forget()

    def _forget(self) -> None:
        self._line: ReceivedLine | None = None
        self._waiting: list[ReceivedLine] = []
        self._overheard.clear()
        self._active = False
        self._before = 0
        self._key = ""

    # -- bytes --------------------------------------------------------------------------------------

    def _on_byte(self, byte: int, now: float) -> None:
        before, self._before = self._before, byte
        is_check = self._key == KEY_ALONE and byte >= 0x80
        is_end = self._key == KEY_WITH_CHECK and byte == CR
        self._key = KEY_WITH_CHECK if is_check else ""
        if is_check or is_end:
            return
        if byte in (ESC, CTRL_E):
            self._on_escape(byte, before, now)
        elif byte == CTRL_C:
            self._on_reset(before, now)
        elif self._line is None:
            self._on_first(byte, now)
        else:
            self._on_end_of(self._line, byte, now)

    def _on_first(self, byte: int, now: float) -> None:
        device = self._device
        memory = self._memory
        in_party = self._serial and self._active and memory.party
        if byte in ERASERS:  # there is nothing to take back
            if not (mode := self._replier.mode()).party:
                self._replier.echo(mode, bytes([byte]), now)
            return
        if in_party and byte not in ADDRESSES and chr(byte) != memory.name:  # found without the settings of a line
            self._line = DEAF
            return
        mode = self._replier.mode()
        if mode.party:
            self._on_address(mode, byte, now)
            return
        self._active = False
        if byte in STEP_KEYS and self._thread.stepping:
            device.step(STEP_KEYS[byte], now)
        elif byte == LF:
            self._replier.line_feed(mode, now)
        else:
            self._line = ReceivedLine(mode)
            if byte == CR:
                self._on_end_of(self._line, byte, now)
            else:
                self._on_text(self._line, bytes([byte]), now)

    def _on_address(self, mode: Mode, byte: int, now: float) -> None:
        """Take the first byte of a line in party mode: it is the addressee."""
        if byte == LF:
            self._active = True
            self._carry_out(now)
        elif byte == CR:
            return
        elif not (self._active or self._memory.model.wakes_by_line):
            self._line = DEAF
        else:
            name = bytes([byte])
            own = name == mode.name.encode("latin-1", "replace")
            group = name == b"*" or (name == b"^" and bool(self._memory.values.get("QD")))  # 5.1.106
            replies = own or (group and not self._memory.values.get("DG", 1))  # 5.1.31
            self._line = ReceivedLine(mode, name, mine=own or group, replies=replies)
            if replies:
                self._replier.echo(mode, name, now)

    def _on_text(self, line: ReceivedLine, text: bytes, now: float) -> None:
        if not line.mine:
            return
        for plain, key in TYPED.findall(text) if not ERASERS.isdisjoint(text) else ((text, b""),):
            self._on_characters(line, plain, now)
            if key and line.mine:
                del line.text[-1:]
                if line.replies:
                    self._replier.echo(line.mode, key, now)

    def _on_characters(self, line: ReceivedLine, text: bytes, now: float) -> None:
        if not line.mine:
            return
        fits = text[: LINE_BUFFER - len(line.name) - len(line.text)]
        line.text += fits
        if line.replies:
            self._replier.echo(line.mode, fits, now)
        if len(fits) < len(text):
            self._replier.overflow(line, now)

    def _on_end_of(self, line: ReceivedLine, byte: int, now: float) -> None:
        """Take CR or LF within a line."""
        if line.mode.party or byte == CR:
            self._line, line.entered = None, byte == CR
            if line.mine and len(self._waiting) < MOST_WAITING:
                self._waiting.append(line)
            elif line.mine:
                self._replier.overflow(line, now)
            self._active = self._active or byte == LF
            if byte == LF or not line.mode.party:
                self._carry_out(now)
        elif line.mine:
            self._replier.echo(line.mode, b"\n", now)

    def _carry_out(self, now: float) -> None:
        """Carry out what has come: one command, or in party mode several."""
        waiting, self._waiting = self._waiting, []
        for line in waiting:
            if self._bridges.powered:
                self._replier.carry_out(line, now)
                self._notice_power()
                self._replier.collect(self._last)

    # -- keys ---------------------------------------------------------------------------------------

    def _on_escape(self, byte: int, before: int, now: float) -> None:
        """ES 0 and 2 take ^E, 1 and 3 take ESC, and 2 and 3 want the name before it (5.1.41)."""
        mode = self._memory.escape_mode
        if byte != (ESC if mode % 2 else CTRL_E) or (mode >= 2 and not self._named(before)):
            return
        self._line, self._waiting = None, []
        self._key = KEY_ALONE
        self._device.escape(now)
        self._replier.collect(self._last)
        self._replier.escaped(now)

    def _on_reset(self, before: int, now: float) -> None:
        """CE 1 always resets; CE 2 in party mode only after the name (5.1.19)."""
        mode = self._memory.values["CE"]
        if mode == 0 or (mode == 2 and self._replier.mode().party and not self._named(before)):
            return
        self._device.reset(now)
        self._notice_power()
        self._replier.collect(self._last)

    def _named(self, before: int) -> bool:
        return bytes([before]) == self._memory.name.encode("latin-1", "replace")
