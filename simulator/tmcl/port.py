"""The module's side of the wire: nine bytes in, nine bytes out.

A request for another address gets no reply. Framing is by count; the module drops an unfinished message after a pause.
Rulings: the pause is 0.5 s (the manuals give none); every module of a line counts all bytes of the host; while it
replies to nobody it drops nothing. At another baud rate than the wire's it receives what that makes of the bits.
"""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct
from typing import Protocol

from dialects.tmcl.manual.commands import Call, Command
from dialects.tmcl.manual.status import Status
from simulator.tmcl.module import Answer
from simulator.wire.baud import resample

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
    """The serial port of one module. `tuned` gives the wire's baud rate, or 0 where any is understood."""

    deaf = False

    def __init__(self, device: Device, tuned: Callable[[], int] = lambda: 0) -> None:
        self._device = device
        self._tuned = tuned
        self._message = bytearray()
        self._heard_at = 0.0
        self._out: list[tuple[float, bytes]] = []

    @property
    def deadline(self) -> float | None:
        """When it next does something by itself, s."""
        return min(
            (at for at in (self._device.deadline, *(at for at, _ in self._out[:1])) if at is not None), default=None
        )

    def quiet(self, now: float) -> bool:
        """Whether it has nothing to say and does nothing by itself up to `now`."""
        due = self.deadline
        return due is None or due > now

    def miss(self, byte: int) -> None:
        """Do nothing: it is never deaf."""

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes whose last bit came at `now`."""
        if not self._device.powered:
            self._message.clear()
            return
        if now - self._heard_at > PAUSE:
            self._message.clear()
        self._heard_at = now
        baud = self._tuned()
        for byte in resample(data, baud, self._device.baud) if baud else data:
            self._message.append(byte)
            if len(self._message) == LENGTH:
                message = bytes(self._message)
                self._message.clear()
                self._take(message, now)

    def sent(self, now: float) -> list[tuple[float, bytes]]:
        """What it has sent up to `now`, with the times at which it began."""
        self._device.advance(now)
        for at, motors in self._device.notices():
            self._say(at, self._frame(Status.TARGET_REACHED, Command.NOTIFY, motors))
        out = [each for each in self._out if each[0] <= now]
        self._out = [each for each in self._out if each[0] > now]
        return out

    def told(self) -> list[tuple[float, bytes]]:
        """Nothing: no module listens to another one."""
        return []

    def overhear(self, data: bytes, now: float) -> None:
        """Do nothing: what other modules say is not for it."""

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
        baud = self._tuned()
        self._out.append((at + self._device.pause, resample(data, self._device.baud, baud) if baud else data))
