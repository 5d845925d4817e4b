"""The serial port of a simulated TMCL module.

It takes nine bytes and sends nine bytes. A request for another address gets no reply. Framing is by count; the
module drops an unfinished message after a pause. Ruling: the pause is 0.5 s; the manuals give none.
"""

from __future__ import annotations

from struct import Struct

from multidrop.dialects.tmcl.manual.commands import Call, Command, Global, Status
from multidrop.dialects.tmcl.manual.modules import BAUDS
from multidrop.simulator.tmcl.module import TmclModule
from multidrop.simulator.wire import Port, Transmission

LENGTH = 9
PAUSE = 0.5
"""Seconds of silence after which an unfinished message is dropped."""
REQUEST = Struct(">BBBBi")
REPLY = Struct(">BBBBi")


class TmclPort(Port):
    """The serial port of one module. `any_baud`: the wire has no baud rate that the module can be set to."""

    def __init__(self, device: TmclModule, *, any_baud: bool = True) -> None:
        self._device = device
        self._any_baud = any_baud
        self._message = bytearray()
        self._heard_at = 0.0
        self._out: list[Transmission] = []

    @property
    def baud(self) -> int:
        return 0 if self._any_baud else BAUDS.get(self._device[Global.BAUD], 0)

    @property
    def deadline(self) -> float | None:
        times = (self._device.deadline, *(each.at for each in self._out))
        return min((at for at in times if at is not None), default=None)

    def receive(self, data: bytes, now: float) -> None:
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
        self._device.advance(now)
        for at, motors in self._device.notices():
            self._say(at, self._frame(Status.TARGET_REACHED, Command.NOTIFY, motors))
        due = [each for each in self._out if each.at <= now]
        self._out = [each for each in self._out if each.at > now]
        return due

    def _take(self, message: bytes, now: float) -> None:
        address, command, kind, motor, value = REQUEST.unpack(message[:-1])
        own = self._device[Global.ADDRESS]
        if address != own and not self._device.any_address:
            return
        self._device.advance(now)
        host = self._device[Global.HOST_ADDRESS]
        if sum(message[:-1]) % 256 != message[-1]:
            self._say(now, self._frame(Status.WRONG_CHECKSUM, command, 0))
            return
        answer = self._device.execute(Call(command, kind, motor, value), now)
        if answer is None:
            return
        if answer.text:
            self._say(now, bytes([host]) + answer.text.encode("ascii"))
        elif answer.line is not None:
            line = answer.line
            self._say(now, self._frame(line.type, line.motor, line.value, line.command, host))
        else:
            self._say(now, self._frame(answer.status, command, answer.value, own, host))

    def _frame(
        self, status: int, command: int, value: int, address: int | None = None, host: int | None = None
    ) -> bytes:
        """One reply; it names the address that the module had when the request came."""
        host = self._device[Global.HOST_ADDRESS] if host is None else host
        address = self._device[Global.ADDRESS] if address is None else address
        body = REPLY.pack(host, address, status, command, value)
        return body + bytes([sum(body) % 256])

    def _say(self, at: float, data: bytes) -> None:
        self._out.append(Transmission(at + self._device[Global.PAUSE] / 1000, data))
