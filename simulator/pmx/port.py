"""The PMX's side of the wire: `@`, two digits, a command and CR; the reply and CR (manual 6.2.3, 6.3).

What is for another number is not answered. Decisions where the manual is silent (facts that a unit may correct):

- An `@` in the middle of a line begins the line again, so a half-sent line of somebody else costs the next one nothing.
- Where it is the only drive of its bus a line without `@` is for it too: TCP gateways are used so.
- NULs and LFs mean nothing (USB frames are padded with NULs), nor does an empty line without an address.
- At another baud rate than the wire's it hears, and says, what that makes of the bits.
- A line has 64 characters at most; what follows up to its CR is lost, and the rest is taken for the command.

Nothing here knows a clock: bytes and times come in, bytes with times go out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from simulator.wire.baud import resample

CR, LF, AT = 0x0D, 0x0A, 0x40
LINE_BUFFER = 64
_NOTHING = frozenset({0, LF})


class Device(Protocol):
    """What a port needs of a controller."""

    @property
    def deadline(self) -> float | None: ...  # noqa: D102
    @property
    def number(self) -> str: ...  # noqa: D102
    @property
    def baud(self) -> int: ...  # noqa: D102
    @property
    def powered(self) -> bool: ...  # noqa: D102
    def advance(self, now: float) -> None: ...  # noqa: D102
    def execute(self, text: str, now: float) -> str: ...  # noqa: D102


class PmxPort:
    """The RS-485 port of one controller.

    `alone`: no other drive is on the wire. `tuned` gives the wire's baud rate, or 0 where any is understood.
    """

    deaf = False

    def __init__(self, device: Device, alone: bool = True, tuned: Callable[[], int] = lambda: 0) -> None:
        self._device = device
        self._tuned = tuned
        self._alone = alone
        self._line = bytearray()
        self._out: list[tuple[float, bytes]] = []
        self._last = 0.0

    @property
    def deadline(self) -> float | None:
        """When the device next does something by itself, s."""
        return self._device.deadline

    def quiet(self, now: float) -> bool:
        """Whether it has said nothing and does nothing by itself up to `now`."""
        due = self._device.deadline
        return not self._out and (due is None or due > now)

    def miss(self, byte: int) -> None:
        """It is never deaf."""

    def receive(self, data: bytes, now: float) -> None:
        """Hear bytes whose last bit came at `now`."""
        if not self._device.powered:
            self._line.clear()
            return
        baud = self._tuned()
        for byte in resample(data, baud, self._device.baud) if baud else data:
            self._hear(byte, now)

    def advance(self, now: float) -> bytes:
        """What it has sent up to `now`, since it was last asked."""
        return b"".join(data for _, data in self.sent(now))

    def sent(self, now: float) -> list[tuple[float, bytes]]:
        """The same with the times at which it began to send."""
        self._device.advance(now)
        out, self._out = self._out, []
        return out

    def told(self) -> list[tuple[float, bytes]]:
        """It speaks only when it is asked."""
        return []

    def overhear(self, data: bytes, now: float) -> None:
        """What other drives say is not for it."""

    def _hear(self, byte: int, now: float) -> None:
        if byte == AT:
            self._line[:] = b"@"
        elif byte == CR:
            line = bytes(self._line)
            self._line.clear()
            self._take(line, now)
        elif byte not in _NOTHING and len(self._line) < LINE_BUFFER:
            self._line.append(byte)

    def _take(self, line: bytes, now: float) -> None:
        if line[:1] == b"@":
            if line[1:3] != self._device.number.encode():
                return
            line = line[3:]
        elif not self._alone or not line:
            return
        reply = self._device.execute(line.decode("latin-1"), now)
        data, baud = reply.encode("latin-1") + b"\r", self._tuned()
        self._out.append((now, resample(data, self._device.baud, baud) if baud else data))
