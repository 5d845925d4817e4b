"""The drive's side of the wire: how an MCode drive frames, echoes, checks and answers what it hears.

Theory of operation. A port is a machine over single bytes. Three of them are no text: ESC, ^E (ES says which one
counts) and ^C act the moment they come, in the middle of a line too. Everything else belongs to a line, which lives
under the settings (`Mode`) that held when its first byte came. Those stay in force to the end of its answer:
`EM=1` is still answered in the old echo mode, and what a program sets in between waits for the next line.

With PY=0 a line ends with CR; a LF is part of no line (EM=0 echoes it). With PY=1 a LF executes; its first character
decides for whom it is: this drive's name, `*` for all, `^` for those with QD=1, and anything else makes the drive deaf.
A CR before the LF does no harm, and between two commands it separates them: clients of real units send several at once,
each with its name, and one LF behind the last (`1VI 1`, CR, `1MA 4`, LF); they are carried out, and answered, when that
has come. Party mode is inert until one LF has come after PY=1 was set, after power-up and after a reset (5.1.105):
until then the port is deaf as well, except for ESC, ^E and ^C.

Decisions where the manual is silent (facts that a unit may correct):

- A line of just CR is an empty command: answered, not executed. With checksum it is a line without one: NAK.
- A line that changes CK is answered as the new CK wants it: `CK=1` by ACK, `CK=0` by CR LF.
- What a key is followed by, a check byte and a CR behind that, belongs to the key and is no line.
- The 64 characters of the line buffer are all of a command but what ends it: name and checksum count. The 65th is
  answered at once, like a refusal; the rest up to the terminator is dropped silently.
- EM=3 gives back the command without the device name, with the checksum as it was received.
- ES 2 and 3 want the drive's own name as the very byte before the key, wherever in a line that is.
- EM=3 answers ESC like EM=1; EM=2 does not answer it. Neither ACK nor a checksum is part of that answer.
- An answer that `*` or `^` silences (DG=1) is silent in everything, prints and NAK included.
- What a program prints in party mode is heard by the other drives of the line, who take it for a line when it ends
  with LF and begins with a name: so one drive commands another. Answers are not heard by them, nor is a print that
  comes while the host is in the middle of a line.
- ESC while single-stepping ends the program like any ESC; space and CR at the head of a line are the stepping keys.

Nothing here knows a clock: bytes and times come in, bytes with times go out. Times are seconds, and never go back.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Protocol

from simulator.lexium.ports.replies import CRLF, Mode, Outcome, PrintSeal, Typed, compose, split
from simulator.wire.baud import BITS_A_BYTE
from simulator.wire.wire import Transmission

CR, LF, ESC, CTRL_C, CTRL_E = 0x0D, 0x0A, 0x1B, 0x03, 0x05
STEP_KEYS = {0x20: " ", CR: "\r"}
KEYS = frozenset({CR, LF, ESC, CTRL_C, CTRL_E})
"""What means something within a line for another drive."""
PLAIN = re.compile(b"[^\r\n\x1b\x03\x05]+")
"""Text of a line: the bytes that are no keys."""
ENDS, STOPS = re.compile(rb"[\r\n]"), re.compile(rb"[\x03\x05\x1b]")
ADDRESSES = frozenset({CR, LF, *b"*^"})
"""What a line may begin with in party mode, but for a name."""
KEY_HEARD, KEY_CHECKED = "heard", "checked"
"""How far a key with its check byte has come."""
LINE_BUFFER = 64
BUFFER_ERROR = 20
MOST_WAITING = 64
"""Commands that wait in party mode for the LF behind the last; one more is like a character too many in a line."""
TRANSMIT_BUFFER = 256
"""Bytes that wait to be sent when a program's next print is lost (the manual names the error, not the size)."""
BUFFER_FULL = 66


class Answer(Protocol):
    """What a device answers to one line: printed lines, an unended tail, and whether the line was refused."""

    @property
    def lines(self) -> tuple[str, ...]:
        """Printed lines, each to be ended by CR LF."""

    @property
    def tail(self) -> str:
        """What a print without a line end printed last."""

    @property
    def refused(self) -> bool:
        """The line was not accepted; the device's error says why."""


class Device(Protocol):
    """What a port needs of a simulated MCode drive."""

    @property
    def deadline(self) -> float | None: ...  # noqa: D102
    def quiet(self, now: float, running: bool) -> bool: ...  # noqa: D102
    @property
    def powered(self) -> bool: ...  # noqa: D102
    @property
    def boots(self) -> int: ...  # noqa: D102
    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def party(self) -> bool: ...  # noqa: D102
    @property
    def checksum(self) -> int: ...  # noqa: D102
    @property
    def echo_mode(self) -> int: ...  # noqa: D102
    @property
    def escape_mode(self) -> int: ...  # noqa: D102
    @property
    def reset_mode(self) -> int: ...  # noqa: D102
    @property
    def quiet_global(self) -> bool: ...  # noqa: D102
    @property
    def queued(self) -> bool: ...  # noqa: D102
    @property
    def error_flag(self) -> bool: ...  # noqa: D102
    @property
    def flags_by_nak(self) -> bool: ...  # noqa: D102
    @property
    def programming(self) -> int | None: ...  # noqa: D102
    @property
    def running(self) -> bool: ...  # noqa: D102
    @property
    def stepping(self) -> bool: ...  # noqa: D102
    def proceed(self, now: float) -> float | None: ...  # noqa: D102
    def execute(self, text: str, now: float) -> Answer: ...  # noqa: D102
    def prints(self) -> Sequence[tuple[float, str]]: ...  # noqa: D102
    def fail(self, code: int, now: float) -> None: ...  # noqa: D102
    def escape(self, now: float) -> None: ...  # noqa: D102
    def reset(self, now: float) -> None: ...  # noqa: D102
    def step(self, key: str, now: float) -> None: ...  # noqa: D102


class _Line:
    """A line that is being received: its settings, for whom it is, and what has come of it."""

    def __init__(self, mode: Mode, name: bytes = b"", mine: bool = True, heard: bool = True) -> None:
        self.mode = mode
        self.name = name
        self.mine = mine
        self.heard = heard
        self.text = bytearray()

    @property
    def room(self) -> int:
        """How many bytes more would fit."""
        return LINE_BUFFER - len(self.name) - len(self.text)


DEAF = _Line(Mode(echo=0, party=True, checksum=0, name=""), mine=False)
"""A line for another drive, in party mode: nothing is kept of it."""


class MCodePort:
    """One way in to an MCode device. `serial=False`: the Ethernet kind, without party mode and checksum.

    `baud` is that of the wire, 0 for one that takes no time: a program that prints faster than it can be sent finds the
    transmitter's buffer full.
    """

    baud = 0
    """It understands any: a cell's drives have the baud rate of their wire."""

    def __init__(self, device: Device, serial: bool = True, baud: int = 0) -> None:
        self._device = device
        self._serial = serial
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._sending_until = 0.0
        self._out: list[Transmission] = []
        self._overheard = bytearray()
        self._seal = PrintSeal()
        self._last = 0.0
        self._powered, self._boots = device.powered, device.boots
        self._running = device.running
        self._forget()

    # -- the mirror of a host's line ----------------------------------------------------------------

    @property
    def deadline(self) -> float | None:
        """When the device next does something by itself, s."""
        return self._device.deadline

    def quiet(self, now: float) -> bool:
        """Whether it has said nothing since it was last asked, and does nothing by itself up to `now`."""
        device = self._device
        same = self._powered and self._boots == device.boots
        return same and not self._out and device.quiet(now, self._running)

    def hears(self, byte: int) -> bool:
        """Within a line for another drive only `KEYS` mean anything; of other bytes only the last one matters."""
        if self._line is not DEAF or byte in KEYS:
            return True
        self._before = byte
        return False

    def completes(self, data: bytes) -> bool:
        """See `wire.Port`: CR and LF."""
        return ENDS.search(data) is not None

    def urgent(self, data: bytes) -> bool:
        """See `wire.Port`: ESC, ^C and ^E."""
        return STOPS.search(data) is not None

    def receive(self, data: bytes, now: float) -> None:
        """Hear bytes whose last bit came at `now`."""
        if not self.quiet(now):
            self._settle(now)
        device, at = self._device, 0
        while at < len(data) and device.powered:
            at = self._hear(data, at, now)
        self._running = device.running
        self._collect()

    def advance(self, now: float) -> bytes:
        """What the drive has sent up to `now`, since it was last asked."""
        return b"".join(each.data for each in self.sent(now))

    def sent(self, now: float) -> list[Transmission]:
        """Give what the drive has begun to send up to `now`; other drives overhear prints in party mode."""
        self._settle(now)
        out, self._out = self._out, []
        return out

    def overhear(self, data: bytes, now: float) -> None:
        """Hear what another drive has printed by itself: in party mode, whole lines, while nobody else is speaking."""
        busy = self._line is not None or self._waiting
        if not self._mode().party or busy or not self._device.powered:
            self._overheard.clear()
            return
        self._overheard += data
        end = self._overheard.rfind(b"\n") + 1
        line = bytes(self._overheard[:end])
        del self._overheard[: max(end, len(self._overheard) - LINE_BUFFER)]
        if line:
            self.receive(line, now)

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
        """See what the device has become by itself, or by a hand: without power, at its program's end."""
        device = self._device
        self._notice_power()
        self._collect()
        if self._running and not device.running and device.echo_mode == 0:
            self._say(at, CRLF + self._prompt().encode())
        self._running = device.running

    def _notice_power(self) -> None:
        """See whether it has gone down or begun anew: by a switch, a reset input, a line."""
        device = self._device
        if (device.powered, device.boots) != (self._powered, self._boots):
            self._powered, self._boots, self._running = device.powered, device.boots, device.running
            self._forget()

    def _collect(self) -> None:
        """Take what the device printed by itself."""
        printed = self._device.prints()
        if not printed:
            return
        mode, full = self._mode(), False
        for at, text in printed:
            if self._sending_until - at > TRANSMIT_BUFFER * self._byte_time > 0:
                full = True
                continue
            data = self._seal.seal(text, bool(mode.checksum))
            self._say(at, data, overheard=mode.party)
        if full:
            self._device.fail(BUFFER_FULL, self._last)

    def _say(self, at: float, data: bytes, *, overheard: bool = False) -> None:
        if data:
            self._out.append(Transmission(at, data, overheard))
            self._sending_until = max(self._sending_until, at) + len(data) * self._byte_time

    def _forget(self) -> None:
        """The state of a port at power-up."""
        self._line: _Line | None = None
        self._waiting: list[_Line] = []
        self._overheard.clear()
        self._active = False
        self._before = 0
        self._key = ""

    # -- bytes --------------------------------------------------------------------------------------

    def _hear(self, data: bytes, at: int, now: float) -> int:
        """Hear one byte, or the text of a line up to the next key; where the next byte is."""
        if self._line is not None and (plain := PLAIN.match(data, at)) is not None:
            self._before = data[plain.end() - 1]
            self._on_text(self._line, plain[0], now)
            return plain.end()
        self._on_byte(data[at], now)
        return at + 1

    def _on_byte(self, byte: int, now: float) -> None:
        before, self._before = self._before, byte
        if self._behind_key(byte):
            return
        if byte in (ESC, CTRL_E):
            self._on_escape(byte, before, now)
        elif byte == CTRL_C:
            self._on_reset(before, now)
        elif self._line is None:
            self._on_first(byte, now)
        else:
            self._on_end_of(self._line, byte, now)

    def _behind_key(self, byte: int) -> bool:
        """Whether a byte belongs to the key in front of it: a check byte, and a CR behind that."""
        check = self._key == KEY_HEARD and byte >= 0x80
        ends = self._key == KEY_CHECKED and byte == CR
        self._key = KEY_CHECKED if check else ""
        return check or ends

    def _on_first(self, byte: int, now: float) -> None:
        device = self._device
        if self._serial and self._active and device.party and byte not in ADDRESSES and chr(byte) != device.name:
            self._line = DEAF
            return
        mode = self._mode()
        if mode.party:
            self._on_address(mode, byte, now)
            return
        self._active = False
        if byte in STEP_KEYS and self._device.stepping:
            self._device.step(STEP_KEYS[byte], now)
        elif byte == LF:
            self._echo(mode, b"\n", now)
        else:
            self._line = _Line(mode)
            if byte == CR:
                self._on_end_of(self._line, byte, now)
            else:
                self._on_text(self._line, bytes([byte]), now)

    def _on_address(self, mode: Mode, byte: int, now: float) -> None:
        """The first byte of a line in party mode says for whom the line is."""
        if byte == LF:
            self._active = True
            self._carry_out(now)
        elif byte == CR:
            return
        elif not self._active:
            self._line = DEAF
        else:
            name = bytes([byte])
            own = name == mode.name.encode("latin-1", "replace")
            group = name == b"*" or (name == b"^" and self._device.queued)
            heard = own or (group and not self._device.quiet_global)
            self._line = _Line(mode, name, mine=own or group, heard=heard)
            if heard:
                self._echo(mode, name, now)

    def _on_text(self, line: _Line, text: bytes, now: float) -> None:
        if not line.mine:
            return
        fits = text[: line.room]
        line.text += fits
        if line.heard:
            self._echo(line.mode, fits, now)
        if len(fits) < len(text):
            self._on_overflow(line, now)

    def _on_end_of(self, line: _Line, byte: int, now: float) -> None:
        """CR or LF within a line."""
        if line.mode.party or byte == CR:
            self._line = None
            if line.mine and len(self._waiting) < MOST_WAITING:
                self._waiting.append(line)
            elif line.mine:
                self._on_overflow(line, now)
            self._active = self._active or byte == LF
            if byte == LF or not line.mode.party:
                self._carry_out(now)
        elif line.mine:
            self._echo(line.mode, b"\n", now)

    def _echo(self, mode: Mode, text: bytes, now: float) -> None:
        if mode.echo == 0:
            self._say(now, text)

    # -- lines --------------------------------------------------------------------------------------

    def _on_overflow(self, line: _Line, now: float) -> None:
        self._device.fail(BUFFER_ERROR, now)
        if line.heard:
            self._say(now, compose(line.mode, Typed(line.name, bytes(line.text)), Outcome(good=False), "?"))
        line.mine = False

    def _carry_out(self, now: float) -> None:
        """Carry out what has come: one command, or in party mode several."""
        waiting, self._waiting = self._waiting, []
        for line in waiting:
            if self._device.powered:
                self._on_end(line, now)

    def _on_end(self, line: _Line, now: float) -> None:
        device, mode = self._device, line.mode
        typed, sound = split(mode, line.name, bytes(line.text))
        before = device.checksum
        outcome = Outcome(damaged=not sound, busy=device.running, flagged=device.error_flag and device.flags_by_nak)
        if sound and typed.command.strip():
            answer = device.execute(typed.command.decode("latin-1"), now)
            outcome = outcome._replace(lines=answer.lines, tail=answer.tail, good=not answer.refused)
        if self._serial and device.checksum != before:
            mode = mode._replace(checksum=device.checksum)
        if line.heard:
            self._say(now, compose(mode, typed, outcome, self._prompt(outcome)))
        self._notice_power()
        self._collect()

    def _prompt(self, outcome: Outcome | None = None) -> str:
        """EM=0's prompt; in program mode the address that the next stored line gets, and two spaces."""
        at = self._device.programming
        if at is not None:
            return "?" if outcome and not outcome.good else f"{at}  "
        return "?" if self._device.error_flag else ">"

    def _mode(self) -> Mode:
        device, serial = self._device, self._serial
        return Mode(
            echo=device.echo_mode,
            party=serial and bool(device.party),
            checksum=device.checksum if serial else 0,
            name=device.name,
        )

    # -- keys ---------------------------------------------------------------------------------------

    def _named(self, before: int) -> bool:
        return bytes([before]) == self._device.name.encode("latin-1", "replace")

    def _on_escape(self, byte: int, before: int, now: float) -> None:
        """ES 0 and 2 take ^E, 1 and 3 take ESC, and 2 and 3 want the name before it (5.1.41)."""
        mode = self._device.escape_mode
        if byte != (ESC if mode % 2 else CTRL_E) or (mode >= 2 and not self._named(before)):
            return
        self._line, self._waiting, self._key = None, [], KEY_HEARD
        self._device.escape(now)
        self._collect()
        echo = self._device.echo_mode
        if echo == 0:
            self._say(now, b"#" + CRLF + self._prompt().encode())
        elif echo != 2:
            self._say(now, CRLF)

    def _on_reset(self, before: int, now: float) -> None:
        """CE 1 always resets; CE 2 in party mode only after the name (5.1.19)."""
        mode = self._device.reset_mode
        if mode == 0 or (mode == 2 and self._mode().party and not self._named(before)):
            return
        self._device.reset(now)
        self._notice_power()
        self._collect()
