"""Controllers of a bus on USB, exported over USB/IP: a computer that attaches one sees it as plugged in.

USB/IP has no login and no encryption. One client has a device at a time. Messages that make no sense end the connection
of their client, and nothing else.
"""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from typing import cast
from urllib.parse import urlsplit

from multidrop.features.usb.device import UsbController, sides
from multidrop.features.usb.interface import CANCELLED, IN, OUT, PACKET, STALLED
from multidrop.features.usb.usbip import (
    BUS_ID,
    INTERFACE,
    OPERATION,
    PORT,
    REP_IMPORT,
    REP_LIST,
    REQ_IMPORT,
    REQ_LIST,
    RET_SUBMIT,
    RET_UNLINK,
    SUBMIT,
    VERSION,
    Exported,
    Malformed,
    Transfer,
    Transfers,
    operation,
)
from multidrop.simulator.cell.spec import Endpoint
from multidrop.simulator.serving.running import Listener, RunningFloor

BUSY, ABSENT = 2, 4
"""The status of a refused import."""
BACKLOG = 1 << 16
"""Bytes that a client may leave unread before it is disconnected."""
WAITING = 256
"""Transfers that may wait for a reply."""


@dataclass
class Plugged:
    """A controller, and the client that has it."""

    exported: Exported
    controller: UsbController
    client: UsbipClient | None = None
    waiting: deque[Transfer] = field(default_factory=deque)
    """Transfers to the host that wait for a reply."""


async def export(floor: RunningFloor, bus: str, endpoint: Endpoint, stack: AsyncExitStack) -> list[str]:
    """Export the controllers of a bus, until the stack closes that; return the URL of each. Raises OSError."""
    server = UsbipServer(floor, bus)
    stack.push_async_callback(server.close)
    port = await server.open(endpoint.host, endpoint.port)
    host = f"[{endpoint.host}]" if ":" in endpoint.host else endpoint.host
    return [f"usbip://{host}:{port}/{bus_id}" for bus_id in server.devices]


def attaching(endpoint: str) -> str:
    """The command that plugs in an endpoint of USB/IP."""
    place = urlsplit(endpoint)
    port = f"--tcp-port {place.port} " if place.port != PORT else ""
    command = f"usbip {port}attach -r {place.hostname} -b {place.path[1:]}"
    return f"{command}   (as root, on Linux; on Windows with usbip-win2) plugs it in"


class UsbipServer(Listener):
    """Exports the controllers of a bus, in their order, as `1-1`, `1-2` and so on."""

    def __init__(self, floor: RunningFloor, bus: str) -> None:
        self.floor, self.bus = floor, bus
        self.devices = {
            f"1-{number}": Plugged(Exported(f"1-{number}", 1, number + 1), controller)
            for number, controller in enumerate(sides(floor.floor, bus), 1)
        }
        self.clients: set[UsbipClient] = set()
        self._server: asyncio.Server | None = None
        self._detach = floor.attach(bus, self)

    async def open(self, host: str, port: int) -> int:
        """Listen; return the port. Raises OSError."""
        self._server = await self.floor.loop.create_server(lambda: UsbipClient(self), host, port)
        return int(self._server.sockets[0].getsockname()[1])

    async def close(self) -> None:
        self._detach()
        if self._server is not None:
            self._server.close()
        self.unplugged()
        if self._server is not None:
            await self._server.wait_closed()

    def present(self, plugged: Plugged) -> bool:
        """Whether a computer sees the controller: it has power and its cable is plugged in."""
        return plugged.controller.present and not self.floor.floor.wires[self.bus].hung_up

    def unplugged(self) -> None:
        for client in tuple(self.clients):
            client.end()

    def commanded(self) -> None:
        """Disconnect the clients of controllers that have lost power."""
        for plugged in self.devices.values():
            if plugged.client is not None and not self.present(plugged):
                plugged.client.end()


class UsbipClient(asyncio.Protocol):
    """One client: an operation, then the transfers of the device that it imported."""

    def __init__(self, server: UsbipServer) -> None:
        self._server = server
        self._buffer = b""
        self._messages = Transfers(answers=False)
        self._plugged: Plugged | None = None
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._server.clients.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.clients.discard(self)
        self._transport = None
        if self._plugged is not None:
            self._plugged.client = None
            self._plugged.waiting.clear()

    def end(self) -> None:
        if self._transport is not None:
            self._transport.close()

    def data_received(self, data: bytes) -> None:
        try:
            if self._plugged is None:
                self._buffer += data
                data = self._operate()
            if self._plugged is not None and data:
                for transfer in self._messages.feed(data):
                    self._take(self._plugged, transfer)
        except Malformed as error:
            self._server.floor.notify(f"{self._server.bus}: a client of usbip:// was disconnected: {error}")
            self.end()

    # Operations

    def _operate(self) -> bytes:
        """Carry out an operation that has come whole; return what follows an import. Raises Malformed."""
        if len(self._buffer) < OPERATION.size:
            return b""
        _, code, _ = OPERATION.unpack_from(self._buffer)
        if code == REQ_LIST:
            devices = [device for device in self._server.devices.values() if self._server.present(device)]
            records = b"".join(device.exported.pack() + INTERFACE for device in devices)
            self._send(operation(REP_LIST, 0, len(devices).to_bytes(4) + records))
            self.end()
        elif code == REQ_IMPORT:
            if len(self._buffer) >= OPERATION.size + BUS_ID:
                return self._import()
        else:
            raise Malformed(f"no operation {code:#06x} of version {VERSION:#06x}")
        return b""

    def _import(self) -> bytes:
        name, rest = self._buffer[OPERATION.size :][:BUS_ID], self._buffer[OPERATION.size + BUS_ID :]
        plugged = self._server.devices.get(name.partition(b"\0")[0].decode("ascii", "replace"))
        there = plugged is not None and self._server.present(plugged)
        if plugged is None or not there or plugged.client is not None:
            self._send(operation(REP_IMPORT, BUSY if there else ABSENT))
            self.end()
            return b""
        plugged.client, self._plugged = self, plugged
        self._send(operation(REP_IMPORT, 0, plugged.exported.pack()))
        return rest

    # Transfers

    def _take(self, plugged: Plugged, each: Transfer) -> None:
        if not self._server.present(plugged):
            self._server.commanded()
            return
        controller = plugged.controller
        if each.kind != SUBMIT:
            waiting = [one for one in plugged.waiting if one.number == each.unlinked]
            for one in waiting:
                plugged.waiting.remove(one)
            self._send(Transfer(RET_UNLINK, each.number, status=CANCELLED if waiting else 0).pack())
        elif each.endpoint & 0x7F == 0:
            status, data = controller.request(each.setup)
            self._answer(each, status, data if each.endpoint & 0x80 else b"")
        elif each.endpoint == OUT and len(each.data) <= PACKET:
            self._answer(each, 0, b"", len(each.data))
            self._server.floor.exchange(self._server.bus, controller, each.data)
        elif each.endpoint == IN and len(plugged.waiting) < WAITING:
            plugged.waiting.append(each)
        else:
            self._answer(each, STALLED, b"")
        while plugged.waiting and controller.replies:
            one = plugged.waiting.popleft()
            self._answer(one, 0, controller.replies.popleft()[: one.length])
        self._server.commanded()

    def _answer(self, request: Transfer, status: int, data: bytes, taken: int = 0) -> None:
        length = len(data) or taken
        self._send(Transfer(RET_SUBMIT, request.number, request.endpoint, status, length, data=data).pack())

    def _send(self, data: bytes) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > BACKLOG:
            self._transport.abort()
        else:
            self._transport.write(data)
