"""The replies of an MCode drive: their parts in each echo mode, with checksums, and when they are sent.

Replies have echo mode, ACK and NAK, checksums, prompts, prints. Tables 7.1 to 7.4 of the MCode manual follow one rule.
A reply consists of a *head*, the printed lines, and in EM=0 a prompt. The head acknowledges the line: CR LF without
checksum, and ACK or NAK in its place with checksum. EM=3 puts the received command before the head; EM=2 has no head.
An MDrivePlus with EM=0 gives a LF right behind the CR back between the head and what is printed. The head comes at
once, the rest two bytes later, which is less than the 1 to 5 ms that a command takes at 9600 baud.
Without checksum one byte from 0x80 on before the terminator is taken for the check byte of a client that always sends
one.
"""

from __future__ import annotations

from typing import NamedTuple

from multidrop.families.lexium.manual.errors import ErrorNumber
from multidrop.families.lexium.simulator.device import MCodeDevice
from multidrop.families.lexium.simulator.state.errors import TRANSMIT_BUFFER
from multidrop.simulator.wire import BITS_A_BYTE, Transmission

CRLF = b"\r\n"
ACK, NAK = b"\x06", b"\x15"
LINE_BUFFER = 64
HELD_BYTE_TIMES = 2
"""Bytes whose time the rest of a reply is held for a LF behind the CR, on a drive that gives it back first."""


class Mode(NamedTuple):
    """The communication settings of one line and of the reply to it."""

    echo: int
    party: bool
    checksum: int
    name: str


class ReceivedLine:
    """A line that is being received: its settings, its addressee, and its text.

    `mine`: it is for this drive. `replies`: this drive replies to it. `entered`: a carriage return ends it.
    """

    def __init__(self, mode: Mode, name: bytes = b"", mine: bool = True, replies: bool = True) -> None:
        self.mode, self.name, self.mine, self.replies = mode, name, mine, replies
        self.entered = False
        self.text = bytearray()


class LineOutcome(NamedTuple):
    """The outcome of a line. `busy`: a program ran when it came; `flagged`: an old error causes NAK."""

    lines: tuple[str, ...] = ()
    tail: str = ""
    good: bool = True
    damaged: bool = False
    busy: bool = False
    flagged: bool = False


def checksum(text: bytes) -> int:
    """Compute the byte that makes the low seven bits of the sum zero; bit 7 is set, so it ends no line (7.1.2)."""
    return (128 - sum(text) % 128) % 128 | 0x80


def split(line: ReceivedLine) -> tuple[bytes, bool]:
    """Split off the checksum; return the command, and whether the checksum is right (with CK=0 it may be absent)."""
    text = bytes(line.text)
    if not line.mode.checksum:
        return text[: len(text) - (text[-1:] >= b"\x80")], True
    if not text or text[-1] < 0x80:
        return text, False
    return text[:-1], (sum(line.name) + sum(text)) % 128 == 0


def compose(mode: Mode, text: bytes, outcome: LineOutcome, prompt: str) -> bytes:
    """Compose the whole reply to one line of this text, without the characters that EM=0 has echoed before."""
    out = bytearray()
    for line in outcome.lines:
        raw = line.encode("latin-1", "replace")
        out += raw
        if mode.checksum:
            out.append(checksum(raw))
        out += CRLF
    data = bytes(out) + outcome.tail.encode("latin-1", "replace")
    if mode.echo == 2:
        return data
    if not mode.checksum:
        # With a program running a print is not preceded by CR LF; a command keeps its only sign of acceptance.
        absent = mode.echo == 1 and outcome.busy and bool(outcome.lines or outcome.tail)
        answer = data if absent else CRLF + data
    elif outcome.damaged or outcome.flagged or not outcome.good:
        answer = NAK + data
    else:
        answer = data if mode.checksum == 2 and outcome.busy else ACK + data
    if mode.echo == 3:
        return text + answer
    return answer + prompt.encode() if mode.echo == 0 else answer


class Replier:
    """Carries lines out, and holds what is to be sent, with the times at which it begins.

    `serial=False`: the Ethernet kind, without party mode and checksum. `baud` 0: bytes take no time, no print is lost.
    `queue` is what has not been taken yet.
    """

    def __init__(self, device: MCodeDevice, serial: bool, baud: int) -> None:
        self._device, self._memory, self._serial, self._printer = device, device.memory, serial, device.core.printer
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._busy_until = 0.0
        self._held: Transmission | None = None
        self.queue: list[Transmission] = []
        self._begun = b""

    def mode(self) -> Mode:
        values, name = self._memory.values, self._memory.texts["DN"]
        if not self._serial:
            return Mode(int(values["EM"]), False, 0, name)
        return Mode(int(values["EM"]), bool(values.get("PY")), int(values.get("CK", 0)), name)

    def echo(self, mode: Mode, text: bytes, now: float) -> None:
        """Send received characters back, in EM=0."""
        if mode.echo == 0:
            self.send(now, text)

    def overflow(self, line: ReceivedLine, now: float) -> None:
        """Refuse a line that is too long; the rest of it is dropped."""
        self._device.fail(ErrorNumber.UNKNOWN_VARIABLE, now)
        if line.replies:
            self.send(now, compose(line.mode, bytes(line.text), LineOutcome(good=False), "?"))
        line.mine = False

    def carry_out(self, line: ReceivedLine, now: float) -> None:
        device, memory, mode = self._device, self._memory, line.mode
        command, sound = split(line)
        before, busy = memory.checksum, device.thread.running
        flagged = memory.model.flags_by_nak and memory.error_flag
        if sound and command.strip():
            answer = device.execute(command.decode("latin-1"), now)
            outcome = LineOutcome(answer.lines, answer.tail, not answer.refused, busy=busy, flagged=flagged)
        else:
            if sound and line.entered:
                device.enter(now)
            outcome = LineOutcome(damaged=not sound, busy=busy, flagged=flagged)
        if self._serial and memory.checksum != before:
            mode = mode._replace(checksum=memory.checksum)
        if line.replies:
            prompt = self.prompt(outcome) if mode.echo == 0 else ""
            reply = compose(mode, bytes(line.text), outcome, prompt)
            held = memory.model.echoes_before_value and mode.echo == 0 and not (mode.party or mode.checksum)
            if held and reply.startswith(CRLF):
                self.send(now, CRLF)
                self._held = Transmission(now + HELD_BYTE_TIMES * self._byte_time, reply[len(CRLF) :])
            else:
                self.send(now, reply)

    def line_feed(self, mode: Mode, now: float) -> None:
        """Give a LF back that is part of no line, in EM=0; before a reply whose rest is held."""
        held, self._held = self._held, None
        self.echo(mode, b"\n", now)
        if held is not None:
            self.send(now, held.data)

    def release(self, now: float) -> None:
        """Send the rest of a reply that was held for a LF, once it is time."""
        if self._held is not None and self._held.at <= now:
            self.send(self._held.at, b"")

    @property
    def deadline(self) -> float | None:
        return None if self._held is None else self._held.at

    def collect(self, now: float) -> None:
        """Send what the device has printed by itself; a print is lost, and an error, where the buffer is full."""
        if not self._printer.printed:
            return
        mode, lost = self.mode(), False
        for at, text in self._printer.take():
            if self._busy_until - at > TRANSMIT_BUFFER * self._byte_time > 0:
                lost = True
            else:
                self.send(at, self._sealed(text, mode.checksum), overheard=mode.party)
        if lost:
            self._device.fail(ErrorNumber.TRANSMIT_BUFFER_FULL, now)

    def escaped(self, now: float) -> None:
        echo = self._memory.echo_mode
        if echo == 0:
            self.send(now, b"#" + CRLF + self.prompt().encode())
        elif echo != 2:
            self.send(now, CRLF)

    def send(self, at: float, data: bytes, *, overheard: bool = False) -> None:
        """Send bytes, and before them the rest of a reply that was held."""
        held, self._held = self._held, None
        for transmission in (
            *([held._replace(at=min(held.at, at))] if held else ()),
            Transmission(at, data, overheard),
        ):
            if transmission.data:
                self.queue.append(transmission)
                self._busy_until = max(self._busy_until, transmission.at) + len(transmission.data) * self._byte_time

    def take(self, now: float) -> list[Transmission]:
        self.release(now)
        queue, self.queue = self.queue, []
        return queue

    def _sealed(self, text: str, checksummed: int) -> bytes:
        """Encode an unsolicited print, with a checksum before each CR LF; one may begin a line and another end it."""
        raw = text.encode("latin-1", "replace")
        if not checksummed:
            self._begun = b""
            return raw
        *ended, rest = raw.split(CRLF)
        out = bytearray()
        for line in ended:
            out += line
            out.append(checksum(self._begun + line))
            out += CRLF
            self._begun = b""
        self._begun += rest
        return bytes(out + rest)

    def prompt(self, outcome: LineOutcome | None = None) -> str:
        """EM=0's prompt; in program mode the address that the next stored line gets, and two spaces."""
        at = self._device.programming
        if at is not None:
            return "?" if outcome and not outcome.good else f"{at}  "
        return "?" if self._memory.error_flag else ">"
