"""Lines carried out on a device, and the replies to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from multidrop.dialects.mcode.manual.errors import ErrorNumber
from multidrop.simulator.lexium.ports.received import Line
from multidrop.simulator.lexium.ports.replies import CRLF, Mode, Outcome, Typed, compose, split
from multidrop.simulator.lexium.ports.transmitter import Transmitter

BUFFER_ERROR = ErrorNumber.UNKNOWN_VARIABLE
BUFFER_FULL = ErrorNumber.TRANSMIT_BUFFER_FULL


class Answer(Protocol):
    """The reply of a device to one line: printed lines, an unterminated tail, and whether the line was refused."""

    @property
    def lines(self) -> tuple[str, ...]:
        """Printed lines, to be terminated by CR LF."""

    @property
    def tail(self) -> str:
        """The text of a last print without a line end."""

    @property
    def refused(self) -> bool:
        """Whether the line was refused; the device's error says why."""


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


class Replier:
    """Carries lines out and sends the replies. `serial=False`: the Ethernet kind, without party mode and checksum."""

    def __init__(self, device: Device, serial: bool, transmitter: Transmitter) -> None:
        self._device, self._serial, self._transmitter = device, serial, transmitter

    def mode(self) -> Mode:
        """The settings under which a line begins now."""
        device, serial = self._device, self._serial
        return Mode(
            echo=device.echo_mode,
            party=serial and bool(device.party),
            checksum=device.checksum if serial else 0,
            name=device.name,
        )

    def echo(self, mode: Mode, text: bytes, now: float) -> None:
        """Send received characters back, in EM=0."""
        if mode.echo == 0:
            self._transmitter.send(now, text)

    def overflow(self, line: Line, now: float) -> None:
        """Refuse a line that is too long; the rest of it is dropped."""
        self._device.fail(BUFFER_ERROR, now)
        if line.replies:
            reply = compose(line.mode, Typed(line.name, bytes(line.text)), Outcome(good=False), "?")
            self._transmitter.send(now, reply)
        line.mine = False

    def carry_out(self, line: Line, now: float) -> None:
        """Carry out a complete line, and reply."""
        device, mode = self._device, line.mode
        typed, sound = split(mode, line.name, bytes(line.text))
        before = device.checksum
        busy, flagged = device.running, device.error_flag and device.flags_by_nak
        if sound and typed.command.strip():
            answer = device.execute(typed.command.decode("latin-1"), now)
            outcome = Outcome(answer.lines, answer.tail, not answer.refused, busy=busy, flagged=flagged)
        else:
            outcome = Outcome(damaged=not sound, busy=busy, flagged=flagged)
        if self._serial and device.checksum != before:
            mode = mode._replace(checksum=device.checksum)
        if line.replies:
            prompt = self._prompt(outcome) if mode.echo == 0 else ""
            self._transmitter.send(now, compose(mode, typed, outcome, prompt))

    def collect(self, now: float) -> None:
        """Send what the device has printed by itself."""
        printed = self._device.prints()
        if not printed:
            return
        mode = self.mode()
        if not self._transmitter.send_prints(printed, checksummed=bool(mode.checksum), overheard=mode.party):
            self._device.fail(BUFFER_FULL, now)

    def program_ended(self, now: float) -> None:
        """Send the prompt that follows a program, in EM=0."""
        if self._device.echo_mode == 0:
            self._transmitter.send(now, CRLF + self._prompt().encode())

    def escaped(self, now: float) -> None:
        """Reply to ESC."""
        echo = self._device.echo_mode
        if echo == 0:
            self._transmitter.send(now, b"#" + CRLF + self._prompt().encode())
        elif echo != 2:
            self._transmitter.send(now, CRLF)

    def _prompt(self, outcome: Outcome | None = None) -> str:
        """EM=0's prompt; in program mode the address that the next stored line gets, and two spaces."""
        at = self._device.programming
        if at is not None:
            return "?" if outcome and not outcome.good else f"{at}  "
        return "?" if self._device.error_flag else ">"
