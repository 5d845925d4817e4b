"""The module's side of the wire: nine bytes in, nine bytes out.

A request for another address gets no reply. Framing is by count; the module drops an unfinished message after a pause.
Ruling: the pause is 0.5 s; the manuals give none.
"""

from __future__ import annotations

from struct import Struct
from typing import Protocol

from multidrop.dialects.tmcl.manual.commands import Call, Command, Status
from multidrop.simulator.tmcl.module import Answer
from multidrop.simulator.wire.wire import Transmission

LENGTH = 9
PAUSE = 0.5
"""Seconds of silence after which an unfinished message is dropped."""
REQUEST = Struct(">BBBBi")
REPLY = Struct(">BBBBi")


class Device(Protocol):
    """What the port needs of a module."""

    @property
    def deadline(self) -> float | None: ...  # noqa: D102
    @property
    def address(self) -> int: ...  # noqa: D102
    @property
    def host_address(self) -> int: ...  # noqa: D102
    @property
    def baud(self) -> int: ...  # noqa: D102
    @property
    def pause(self) -> float: ...  # noqa: D102
    @property
    def powered(self) -> bool: ...  # noqa: D102
    def advance(self, now: float) -> None: ...  # noqa: D102
    def execute(self, call: Call, now: float) -> Answer | None: ...  # noqa: D102
    def notices(self) -> list[tuple[float, int]]: ...  # noqa: D102


class TmclPort:
    """The serial port of one module. `any_baud`: the wire has no baud rate that the module can be set to."""

    def __init__(self, device: Device, *, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._message = bytearray()
        self._heard_at = 0.0
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        """See `wire.Port`."""
        return 0 if self._any_baud else self._device.baud

    @property
    def deadline(self) -> float | None:
        """See `wire.Port`."""
        times = (self._device.deadline, *(each.at for each in self._out))
        return min((at for at in times if at is not None), default=None)

    def quiet(self, now: float) -> bool:
        """See `wire.Port`."""
        due = self.deadline
        return due is None or due > now

    def hears(self, byte: int) -> bool:
        """It receives every byte."""
        return True

    def completes(self, data: bytes) -> bool:
        """Never: its replies are as long as the requests, so they cannot pile up."""
        return False

    def urgent(self, data: bytes) -> bool:
        """Return False: the language has no keys."""
        return False

    def receive(self, data: bytes, now: float) -> None:
        """See `wire.Port`."""
        if not self._device.powered:
            self._message.clear()
            return
        if now - self._heard_at > PAUSE:
            self._message.clear()
        self._heard_at = now
        for byte in data:
            self._message.append(byte)
            if len(self._message) == LENGTH:
                message = bytes(self._message)
                self._message.clear()
                self._take(message, now)

    def sent(self, now: float) -> list[Transmission]:
        """See `wire.Port`."""
        self._device.advance(now)
        for at, motors in self._device.notices():
            self._say(at, self._frame(Status.TARGET_REACHED, Command.NOTIFY, motors))
        due = [each for each in self._out if each.at <= now]
        self._out = [each for each in self._out if each.at > now]
        return due

    def overhear(self, data: bytes, now: float) -> None:
        """It takes nothing from other modules."""

    def _take(self, message: bytes, now: float) -> None:
        address, command, kind, motor, value = REQUEST.unpack(message[:-1])
        if address != self._device.address:
            return
        self._device.advance(now)
        host = self._device.host_address
        if sum(message[:-1]) % 256 != message[-1]:
            self._say(now, self._frame(Status.WRONG_CHECKSUM, command, 0))
            return
        answer = self._device.execute(Call(command, kind, motor, value), now)
        if answer is None:
            return
        if answer.text:
            self._say(now, bytes([host]) + answer.text.encode("ascii"))
        else:
            self._say(now, self._frame(answer.status, command, answer.value, address, host))

    def _frame(
        self, status: int, command: int, value: int, address: int | None = None, host: int | None = None
    ) -> bytes:
        """One reply; it names the address that the request was for, also where that has just been changed."""
        host = self._device.host_address if host is None else host
        address = self._device.address if address is None else address
        body = REPLY.pack(host, address, status, command, value)
        return body + bytes([sum(body) % 256])

    def _say(self, at: float, data: bytes) -> None:
        self._out.append(Transmission(at + self._device.pause, data))
