"""USB/IP: the messages, and a client in user space for one device that another computer exports.

Source: `usbip_protocol` in the kernel's documentation. Numbers are big-endian. An operation (list, import) begins a
connection; after an import, the connection carries transfers until it is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from multidrop.features.usb.interface import IN, MODULE, OUT, PACKET, PRODUCT, REQUEST, REQUEST_TYPE, VENDOR, UsbControl
from multidrop.features.usb.pipe import Broken, Done, TransferFailed
from multidrop.transports import Unreachable
from multidrop.transports.sockets import connected, explain, host_port

PORT = 3240
VERSION = 0x0111
REQ_LIST, REP_LIST = 0x8005, 0x0005
REQ_IMPORT, REP_IMPORT = 0x8003, 0x0003
SUBMIT, UNLINK, RET_SUBMIT, RET_UNLINK = 1, 2, 3, 4
OPERATION = struct.Struct(">HHI")
BUS_ID = 32
FULL_SPEED = 2
REFUSALS = {1: "it is not exported", 2: "another program has it", 3: "it has an error", 4: "no such device"}
"""The status of a refused import."""
ANSWER = 3.0
"""Seconds in which a server answers an operation."""
WRITE_RETRY_PAUSE = 0.002
"""Seconds after which what the system did not take is sent."""
_DEVICE = struct.Struct(">256s32sIIIHHHBBBBBB")
_HEADER = struct.Struct(">IIIII28s")
_SUBMITTED = struct.Struct(">Iiiii8s")
_RETURNED = struct.Struct(">iiiii8x")
INTERFACE = bytes([0xFF, 0, 0, 0])
"""The class of the one interface: the vendor's own."""


@dataclass(frozen=True)
class Exported:
    """A device as a server lists it. `bus_id`: what a client asks for, as `1-1`."""

    bus_id: str
    bus: int
    device: int
    vendor: int = VENDOR
    product: int = PRODUCT
    version: int = 0x0100
    interfaces: int = 1

    def pack(self) -> bytes:
        path, bus_id = f"/sys/devices/multidrop/{self.bus_id}".encode(), self.bus_id.encode()
        classes = (0, 0, 0, 1, 1, self.interfaces)  # the interface has the class
        return _DEVICE.pack(
            path, bus_id, self.bus, self.device, FULL_SPEED, self.vendor, self.product, self.version, *classes
        )

    @classmethod
    def read(cls, data: bytes) -> Exported:
        _, bus_id, bus, device, _, vendor, product, version, *_, interfaces = _DEVICE.unpack(data)
        name = bus_id.partition(b"\0")[0].decode("ascii", "replace")
        return cls(name, bus, device, vendor, product, version, interfaces)


RECORD = _DEVICE.size


@dataclass(frozen=True)
class Transfer:
    """A message of an imported device. `endpoint`: with bit 7 for one to the host; 0 for requests."""

    kind: int
    number: int
    endpoint: int = 0
    status: int = 0
    """Of an answer: 0, or a negative errno."""
    length: int = 0
    """Of a request: the bytes that are sent or wanted. Of an answer: those that were."""
    setup: bytes = bytes(8)
    data: bytes = b""
    unlinked: int = 0
    """The transfer that is to be cancelled."""

    def pack(self, device: int = 0) -> bytes:
        direction = self.endpoint >> 7
        if self.kind == SUBMIT:
            rest = _SUBMITTED.pack(0, self.length, 0, 0, 0, self.setup)
        elif self.kind == UNLINK:
            rest = struct.pack(">I24x", self.unlinked)
        else:
            rest = _RETURNED.pack(self.status, self.length, 0, 0, 0)
        return _HEADER.pack(self.kind, self.number, device, direction, self.endpoint & 0x7F, rest) + self.data


class Malformed(ValueError):
    """Bytes that are no message of USB/IP."""


class Transfers:
    """Reads the messages of one side.

    `asked`: what a client waits for, by number, and the most bytes that each answer may bring it.
    """

    def __init__(self, answers: bool) -> None:
        self._answers = answers
        self._buffer = bytearray()
        self.asked: dict[int, int] = {}

    def feed(self, data: bytes) -> Iterator[Transfer]:
        """Take bytes; yield whole messages. Raises Malformed."""
        self._buffer += data
        while (transfer := self._one()) is not None:
            yield transfer

    def _one(self) -> Transfer | None:
        if len(self._buffer) < _HEADER.size:
            return None
        kind, number, _, direction, endpoint, rest = _HEADER.unpack_from(self._buffer)
        valid = (RET_SUBMIT, RET_UNLINK) if self._answers else (SUBMIT, UNLINK)
        if kind not in valid or endpoint > 15 or direction > 1:
            raise Malformed(f"no message of USB/IP: kind {kind}, endpoint {endpoint}")
        status = length = unlinked = 0
        setup, size = bytes(8), 0
        if kind == SUBMIT:
            _, length, _, packets, _, setup = _SUBMITTED.unpack(rest)
            size = 0 if direction else length
            if not 0 <= length <= 1 << 20 or packets not in (0, -1):
                raise Malformed(f"a transfer of {length} bytes in {packets} packets")
        elif kind == UNLINK:
            (unlinked,) = struct.unpack_from(">I", rest)
        else:
            status, length, *_ = _RETURNED.unpack(rest)
            if number not in self.asked:
                raise Malformed(f"the server answers transfer {number}, which was not asked for")
            most = self.asked.get(number, 0)
            size = length if most and kind == RET_SUBMIT else 0
            if not 0 <= size <= most:
                raise Malformed(f"the server answers {length} bytes where {most} were asked for")
        if len(self._buffer) < _HEADER.size + size:
            return None
        data = bytes(self._buffer[_HEADER.size : _HEADER.size + size])
        del self._buffer[: _HEADER.size + size]
        self.asked.pop(number, None)
        return Transfer(kind, number, endpoint | direction << 7, status, length, setup, data, unlinked)


def operation(code: int, status: int = 0, rest: bytes = b"") -> bytes:
    return OPERATION.pack(VERSION, code, status) + rest


def setup(value: UsbControl) -> bytes:
    """The setup packet of a vendor request."""
    return struct.pack("<BBHHH", REQUEST_TYPE, REQUEST, value, 0, 0)


async def imported(host: str, port: int, bus_id: str, within: float | None = None) -> UsbipCarrier:
    """Import a device. Raises Unreachable, also for one that is no controller."""
    name = f"usbip://{host_port(host, port)}/{bus_id}"
    made, clock = await connected(name, host, port, given=within), asyncio.get_running_loop().time
    begun = clock()
    try:
        async with asyncio.timeout(ANSWER):
            device = Exported.read(await _asked(name, made, bus_id))
        if (device.vendor, device.product) != (VENDOR, PRODUCT):
            what = f"{device.vendor:04x}:{device.product:04x}"
            raise Unreachable(f"{name}: {what} is no {MODULE.module} ({VENDOR:04x}:{PRODUCT:04x})")
    except BaseException as error:
        made.close()
        if isinstance(error, TimeoutError):
            raise Unreachable(f"{name}: the server did not answer within {ANSWER:g} s") from None
        if isinstance(error, OSError):
            raise Unreachable(f"{name}: {explain(error)}") from error
        raise
    return UsbipCarrier(name, made, device.bus << 16 | device.device, clock() - begun)


async def _asked(name: str, made: socket.socket, bus_id: str) -> bytes:
    """Ask for a device; return its record."""
    loop = asyncio.get_running_loop()

    async def exactly(size: int) -> bytes:
        data = b""
        while len(data) < size:
            if not (more := await loop.sock_recv(made, size - len(data))):
                raise Unreachable(f"{name}: the server closed the connection; is it a server of USB/IP?")
            data += more
        return data

    await loop.sock_sendall(made, operation(REQ_IMPORT, rest=bus_id.encode().ljust(BUS_ID, b"\0")))
    _, code, status = OPERATION.unpack(await exactly(OPERATION.size))
    if code != REP_IMPORT:
        raise Unreachable(f"{name}: the server does not speak USB/IP")
    if status:
        raise Unreachable(f"{name}: {REFUSALS.get(status, f'refused with status {status}')}")
    return await exactly(RECORD)


class UsbipCarrier:
    """The transfers of one imported device. `delay`: the time to its server and back, s."""

    def __init__(self, name: str, made: socket.socket, device: int, delay: float) -> None:
        self.name, self.delay = name, delay
        self._socket, self._device = made, device
        self._loop = asyncio.get_running_loop()
        self._guard = threading.Lock()
        """Held while a message begins to leave."""
        self._unsent = bytearray()
        self._last = 0
        self._cancelled: dict[int, int] = {}
        """The transfers that are being cancelled, by the number of the request."""
        self._described: dict[int, asyncio.Future[bytes]] = {}
        """Descriptors that are waited for."""
        self._messages = Transfers(answers=True)
        self._reading: asyncio.Task[None] | None = None

    def start(self, done: Done, broken: Broken) -> None:
        self._done, self._broken = done, broken
        self._reading = self._loop.create_task(self._read())

    def control(self, value: UsbControl) -> int:
        return self._submit(0, setup=setup(value))

    async def number(self) -> str:
        """The device number: the serial number of its descriptor; empty where the device tells none in time."""
        try:
            async with asyncio.timeout(ANSWER):
                device = await self._descriptor(0x0100, 0)
                text = await self._descriptor(0x0300 | device[16], 0x0409) if len(device) > 16 and device[16] else b""
        except (TimeoutError, OSError):
            return ""
        return text[2:].decode("utf-16-le", "replace")

    async def _descriptor(self, value: int, language: int) -> bytes:
        """A descriptor by type and index; empty where the device has none."""
        number = self._submit(0x80, setup=struct.pack("<BBHHH", 0x80, 6, value, language, PACKET))
        future: asyncio.Future[bytes] = self._loop.create_future()
        self._described[number] = future
        return await future

    def send(self, data: bytes) -> int:
        return self._submit(OUT, data=data)

    def receive(self) -> int:
        return self._submit(IN)

    def cancel(self, number: int) -> None:
        with self._guard, contextlib.suppress(OSError):
            self._last += 1
            self._cancelled[self._last] = number
            self._messages.asked[self._last] = 0
            self._write(Transfer(UNLINK, self._last, unlinked=number))

    def halt(self) -> None:
        if self._reading is not None:
            self._reading.cancel()

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self.control(UsbControl.CLOSE)
        self._socket.close()

    def _submit(self, endpoint: int, setup: bytes = bytes(8), data: bytes = b"") -> int:
        with self._guard:
            self._last += 1
            length = PACKET if endpoint & 0x80 else len(data)
            self._messages.asked[self._last] = length if endpoint & 0x80 else 0
            self._write(Transfer(SUBMIT, self._last, endpoint, length=length, setup=setup, data=data))
            return self._last

    def _write(self, message: Transfer) -> None:
        """Send a message whole; what the system does not take now follows in the loop. Raises OSError."""
        waiting = bool(self._unsent)
        self._unsent += message.pack(self._device)
        if not waiting:
            self._push()
            if self._unsent:
                self._loop.call_soon_threadsafe(self._send_rest)

    def _push(self) -> None:
        with contextlib.suppress(BlockingIOError, InterruptedError):
            del self._unsent[: self._socket.send(self._unsent)]

    def _send_rest(self) -> None:
        with self._guard, contextlib.suppress(OSError):  # the reader reports a break
            self._push()
            if self._unsent:
                self._loop.call_later(WRITE_RETRY_PAUSE, self._send_rest)

    async def _read(self) -> None:
        try:
            while data := await self._loop.sock_recv(self._socket, 4096):
                for transfer in self._messages.feed(data):
                    if (described := self._described.pop(transfer.number, None)) is not None:
                        if not described.done():
                            described.set_result(transfer.data if transfer.status == 0 else b"")
                    elif transfer.kind == RET_SUBMIT:
                        self._done(transfer.number, transfer.status, transfer.data)
                    elif (
                        number := self._cancelled.pop(transfer.number, 0)
                    ) and transfer.status:  # 0: it had ended before
                        self._messages.asked.pop(number, None)
                        self._done(number, transfer.status, b"")
                await asyncio.sleep(0)  # a server that sends without a pause does not hold up the loop
            self._broken(None)
        except Malformed as error:
            self._broken(TransferFailed(-errno.EPROTO, str(error)))
        except OSError as error:
            self._broken(error)
