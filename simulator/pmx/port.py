"""The PMX's side of the wire: `@`, two digits, a command and CR; the reply and CR (manual 6.2.3, 6.3).

It does not reply to lines for another address. Decisions where the manual is silent (facts that a unit may correct):

- An `@` in the middle of a line begins the line again, so a half-sent line does not cost the next one.
- The only drive of a bus also takes lines without `@`: TCP gateways are used so.
- NULs and LFs mean nothing (USB frames are padded with NULs), nor does an empty line without an address.
- At another baud rate than the wire's, the wire garbles what it receives and sends.
- A line has 64 characters at most; what follows up to its CR is lost, and the 64 are taken for the command.

There is no clock: bytes and times come in, bytes with times go out.
"""

from __future__ import annotations

from typing import Protocol

from multidrop.simulator.wire.wire import Transmission

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

    `alone`: no other drive is on the wire. `any_baud`: the wire has no baud rate that the controller can be set to.
    """

    def __init__(self, device: Device, *, alone: bool = True, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._alone = alone
        self._line = bytearray()
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        """See `wire.Port`."""
        return 0 if self._any_baud else self._device.baud

    @property
    def deadline(self) -> float | None:
        """Time of the device's next event, s."""
        return self._device.deadline

    def quiet(self, now: float) -> bool:
        """See `wire.Port`."""
        due = self._device.deadline
        return not self._out and (due is None or due > now)

    def hears(self, byte: int) -> bool:
        """It receives every byte."""
        return True

    def completes(self, data: bytes) -> bool:
        """See `wire.Port`: CR."""
        return CR in data

    def urgent(self, data: bytes) -> bool:
        """Return False: the language has no keys."""
        return False

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes whose last bit arrived at `now`."""
        if not self._device.powered:
            self._line.clear()
            return
        for byte in data:
            self._hear(byte, now)

    def advance(self, now: float) -> bytes:
        """Give what it has sent up to `now`, since it was last asked."""
        return b"".join(each.data for each in self.sent(now))

    def sent(self, now: float) -> list[Transmission]:
        """Give the same as transmissions."""
        self._device.advance(now)
        out, self._out = self._out, []
        return out

    def overhear(self, data: bytes, now: float) -> None:
        """It takes nothing from other drives."""

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
        self._out.append(Transmission(now, reply.encode("latin-1") + b"\r"))
