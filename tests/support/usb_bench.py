"""Run by Debian's Python with umockdev: USB devices for libusb, whose URBs go to a server of USB/IP. Prints JSON lines.

    LD_PRELOAD=libumockdev-preload.so.0 /usr/bin/python3 usb_bench.py HOST:PORT BUSID ...

umockdev answers the system calls of programs that it is preloaded to; here its answers come from, as the kernel's
driver `usbfs` gives them. Each device is plugged in to a socket with the name of its bus id. A line on standard input
makes a fault: `hold SOCKET ENDPOINT`, `free SOCKET ENDPOINT`, `stall SOCKET ENDPOINT`, `empty SOCKET`, `unplug SOCKET`,
`plug SOCKET`, `forbid SOCKET`, `reply SOCKET FORM` with a form of `FORMS`. Each is confirmed by a line.
"""

from __future__ import annotations

import errno
import itertools
import json
import os
import socket
import struct
import sys
import threading
import warnings
from collections import deque
from dataclasses import dataclass

with warnings.catch_warnings(action="ignore"):  # there is one version
    from gi.repository import GLib, UMockdev

from multidrop.features.usb.usbip import (
    BUS_ID,
    OPERATION,
    RECORD,
    REQ_IMPORT,
    RET_SUBMIT,
    SUBMIT,
    UNLINK,
    Exported,
    Transfer,
    Transfers,
    operation,
)

URB = struct.Struct("=BBxxiIxxxxQiiiiiIQ")
"""Type, endpoint, status, flags, buffer, its length, actual length, frame, packets, errors, signal, context."""
STATUS, ACTUAL, BUFFER = 4, 28, 16
CONTROL, SETUP = 2, 8
GET_CAPABILITIES, CLAIM, RELEASE, DISCONNECT_CLAIM = 0x8004551A, 0x8004550F, 0x80045510, 0x8108551B
SUBMIT_URB, REAP, REAP_NO_DELAY, DISCARD = 0x8038550A, 0x4008550C, 0x4008550D, 0x550B
CLEAR_HALT, SET_CONFIGURATION, GET_DRIVER, GET_SPEED = 0x80045515, 0x80045505, 0x41045508, 0x551F
FULL_SPEED = 2
PAUSE = 2
"""Milliseconds before "none has ended": a file of umockdev is always ready, and libusb would ask without end."""
GUARD = threading.RLock()
"""Held by whatever changes something: system calls come in a thread of umockdev."""
FORMS = {
    "full": lambda data: data,
    "short": lambda data: data[: data.index(0) + 1],
    "bare": lambda data: data[: data.index(0)],
    "dirty": lambda data: data[: data.index(0) + 1].ljust(64, b"#"),
    "long": lambda data: None,
}
"""Replies in blocks as they come, only up to their NUL, without NUL, with anything behind it, and of too many bytes."""


def say(**facts: object) -> None:
    print(json.dumps(facts), flush=True)


@dataclass(eq=False)
class Urb:
    """A transfer of a client, and what umockdev has of it in the client's memory."""

    client: UMockdev.IoctlClient
    memory: UMockdev.IoctlData
    buffer: UMockdev.IoctlData
    request: Transfer
    head: int
    """Bytes of the buffer before the data: a setup packet."""
    address: int


class Device:
    """A device while it is in a socket: the URBs on their way, those that have ended, and who has claimed it."""

    def __init__(self, bed: UMockdev.Testbed, server: tuple[str, int], bus_id: str, number: int) -> None:
        self.bed, self.server, self.bus_id, self.number = bed, server, bus_id, number
        self.node = f"/dev/bus/usb/001/{number:03}"
        self.path = f"/sys/devices/pci0000:00/0000:00:14.0/usb1/{bus_id}"
        self.handler = UMockdev.IoctlBase.new()
        self.handler.connect("handle-ioctl", self.system_call)
        self.claimed: UMockdev.IoctlClient | None = None
        self.flying: dict[int, Urb] = {}
        self.ended: deque[Urb] = deque()
        self.held: dict[int, list[Urb]] = {}
        self.stalled: set[int] = set()
        self.empty, self.form = 0, "full"
        self.last = 0
        self.messages = Transfers(answers=True)
        self.wire = socket.create_connection(self.server, timeout=10)
        self.wire.sendall(operation(REQ_IMPORT, rest=self.bus_id.encode().ljust(BUS_ID, b"\0")))
        answer = self.exactly(OPERATION.size)
        assert OPERATION.unpack(answer)[2] == 0, answer
        about = Exported.read(self.exactly(RECORD))
        device = self.ask(struct.pack("<BBHHH", 0x80, 6, 0x0100, 0, 18))
        configuration = self.ask(struct.pack("<BBHHH", 0x80, 6, 0x0200, 0, 255))
        self.wire.settimeout(None)
        self.present = True
        self.watch = GLib.io_add_watch(self.wire.fileno(), GLib.IO_IN | GLib.IO_HUP, self.arrived)
        descriptors = (device + configuration).hex().upper()
        self.bed.add_from_string(
            f"P: {self.path.removeprefix('/sys')}\n"
            f"N: {self.node.removeprefix('/dev/')}={descriptors}\n"
            f"E: DEVNAME={self.node}\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: DRIVER=usb\n"
            f"E: BUSNUM=001\nE: DEVNUM={self.number:03}\nE: MAJOR=189\nE: MINOR={self.number - 1}\n"
            f"E: PRODUCT={about.vendor:x}/{about.product:x}/{about.version:x}\nE: TYPE=0/0/0\n"
            f"A: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum={self.number}\\n\nA: bNumConfigurations=1\\n\n"
            f"A: speed=12\\n\nA: idVendor={about.vendor:04x}\\n\nA: idProduct={about.product:04x}\\n\n"
            f"H: descriptors={descriptors}\n\n"
        )
        self.bed.attach_ioctl(self.node, self.handler)

    def unplug(self) -> None:
        """Let every transfer end, and the device vanish."""
        self.present = False
        GLib.source_remove(self.watch)
        self.wire.close()
        for urb in [*self.flying.values(), *(each for held in self.held.values() for each in held)]:
            self.end(urb, -errno.ESHUTDOWN)
        self.flying.clear()
        self.held.clear()
        self.bed.uevent(self.path, "remove")
        self.bed.remove_device(self.path)

    def exactly(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            more = self.wire.recv(size - len(data))
            assert more, "the server has gone"
            data += more
        return data

    def ask(self, setup: bytes) -> bytes:
        """A control transfer of the kernel's own, before any other."""
        self.last += 1
        length = int.from_bytes(setup[6:8], "little")
        self.messages.asked[self.last] = length
        self.wire.sendall(Transfer(SUBMIT, self.last, 0x80, length=length, setup=setup).pack())
        while True:
            for each in self.messages.feed(self.wire.recv(4096)):
                return each.data

    # Transfers

    def submit(self, urb: Urb) -> None:
        """Let a transfer begin."""
        endpoint = urb.request.endpoint
        if endpoint in self.stalled:
            self.end(urb, -errno.EPIPE)
        elif endpoint in self.held:
            self.held[endpoint].append(urb)
        elif endpoint == 0x82 and self.empty:
            self.empty -= 1
            self.end(urb, 0)
        else:
            self.messages.asked[urb.request.number] = urb.request.length if endpoint & 0x80 else 0
            self.flying[urb.request.number] = urb
            self.wire.sendall(urb.request.pack(2))

    def discard(self, address: int) -> int:
        """Cancel a transfer; return an error."""
        for held in self.held.values():
            for urb in [each for each in held if each.address == address]:
                held.remove(urb)
                self.end(urb, -errno.ENOENT)
                return 0
        for number, urb in self.flying.items():
            if urb.address == address:
                self.last += 1
                self.messages.asked[self.last] = 0
                self.wire.sendall(Transfer(UNLINK, self.last, unlinked=number).pack(2))
                while number in self.flying:  # as the kernel waits
                    self.take(self.wire.recv(4096), number, self.last)
                return 0
        return errno.EINVAL

    def arrived(self, *_: object) -> bool:
        with GUARD:
            try:
                data = self.wire.recv(4096, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return True  # `discard` has read it
            if not data:
                self.unplug()
                return False
            self.take(data)
            return True

    def take(self, data: bytes, discarded: int = 0, unlink: int = 0) -> None:
        for each in self.messages.feed(data):
            if each.kind == RET_SUBMIT:
                if (urb := self.flying.pop(each.number, None)) is not None:
                    formed = FORMS[self.form](each.data) if urb.request.endpoint == 0x82 and each.data else each.data
                    if formed is None:
                        self.end(urb, -errno.EOVERFLOW)
                    else:
                        self.end(urb, each.status, formed, each.length)
            elif each.number == unlink and (urb := self.flying.pop(discarded, None)) is not None:
                self.messages.asked.pop(discarded, None)
                self.end(urb, -errno.ENOENT)

    def end(self, urb: Urb, status: int, data: bytes = b"", length: int = 0) -> None:
        if data:
            urb.buffer.update(urb.head, data)
        urb.memory.update(STATUS, struct.pack("=i", status))
        urb.memory.update(ACTUAL, struct.pack("=i", len(data) or length))
        self.ended.append(urb)

    # System calls

    def system_call(self, _: object, client: UMockdev.IoctlClient) -> bool:
        """Answer a call of `ioctl`, in umockdev's thread."""
        request, memory = client.get_request(), client.get_arg()
        with GUARD:
            if request in (REAP, REAP_NO_DELAY):
                if not self.reap(client, memory):
                    GLib.timeout_add(PAUSE, self.reap_late, client, memory)
                return True
            result = self.carry_out(request, client, memory) if self.present else -errno.ENODEV
            client.complete(max(result, -1), max(0, -result))
            return True

    def carry_out(self, request: int, client: UMockdev.IoctlClient, memory: UMockdev.IoctlData) -> int:
        if request == SUBMIT_URB:
            return self.submitted(client, memory)
        if request == DISCARD:
            return -self.discard(int.from_bytes(bytes(memory.retrieve()), sys.byteorder))
        if request in (CLAIM, DISCONNECT_CLAIM):
            if self.claimed not in (None, client) and self.claimed.get_connected():
                return -errno.EBUSY
            self.claimed = client
        elif request == RELEASE:
            self.claimed = None
        elif request == GET_CAPABILITIES:
            memory.resolve(0, 4).update(0, struct.pack("=I", 0))
        elif request == GET_DRIVER:
            return -errno.ENODATA
        elif request == GET_SPEED:
            return FULL_SPEED
        elif request not in (CLEAR_HALT, SET_CONFIGURATION):
            say(unknown=hex(request))
            return -errno.ENOTTY
        return 0

    def submitted(self, client: UMockdev.IoctlClient, memory: UMockdev.IoctlData) -> int:
        block = memory.resolve(0, URB.size)
        kind, endpoint, _, _, _, size, *_ = URB.unpack(bytes(block.retrieve())[: URB.size])
        if endpoint & 0x7F and self.claimed is not client:
            return -errno.EINVAL  # the kernel claims by itself, with a warning in its log
        buffer = block.resolve(BUFFER, size) if size else block
        data = bytes(buffer.retrieve())[:size] if size else b""
        self.last += 1
        if kind == CONTROL:
            way = data[0] & 0x80
            out = b"" if way else data[SETUP:]
            transfer = Transfer(SUBMIT, self.last, way, length=size - SETUP, setup=data[:SETUP], data=out)
        else:
            transfer = Transfer(SUBMIT, self.last, endpoint, length=size, data=b"" if endpoint & 0x80 else data)
        head = SETUP if kind == CONTROL else 0
        self.submit(Urb(client, block, buffer, transfer, head, block.client_addr))
        return 0

    def reap(self, client: UMockdev.IoctlClient, memory: UMockdev.IoctlData) -> bool:
        """Give back a transfer of this client that has ended."""
        for urb in self.ended:
            if urb.client is client:
                self.ended.remove(urb)
                memory.resolve(0, 8).set_ptr(0, urb.memory)
                client.complete(0, 0)
                return True
        return False

    def reap_late(self, client: UMockdev.IoctlClient, memory: UMockdev.IoctlData) -> bool:
        with GUARD:
            if not self.reap(client, memory):
                client.complete(-1, errno.EAGAIN if self.present else errno.ENODEV)
        return False


class Bench:
    """All devices, and the faults that are asked for."""

    def __init__(self, server: tuple[str, int], bus_ids: list[str]) -> None:
        self.bed, self.server, self.numbers = UMockdev.Testbed.new(), server, itertools.count(2)
        self.bed.add_from_string(
            "P: /devices/pci0000:00/0000:00:14.0/usb1\nN: bus/usb/001/001\n"
            "E: DEVNAME=/dev/bus/usb/001/001\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: DRIVER=usb\n"
            "E: BUSNUM=001\nE: DEVNUM=001\nE: MAJOR=189\nE: MINOR=0\nE: PRODUCT=1d6b/2/606\nE: TYPE=9/0/1\n"
            "A: busnum=1\\n\nA: devnum=1\\n\nA: bConfigurationValue=1\\n\nA: speed=480\\n\n"
            "A: idVendor=1d6b\\n\nA: idProduct=0002\\n\n"
            "H: descriptors=12010002090001406b1d020006060302010109021900010100e0000904000001090000000705810304000c\n\n"
        )
        self.devices = {each: self.plugged(each) for each in bus_ids}
        os.chmod(self.bed.get_root_dir(), 0o755)
        self.line = b""
        GLib.io_add_watch(0, GLib.IO_IN | GLib.IO_HUP, self.read)
        say(root=self.bed.get_root_dir())

    def plugged(self, place: str) -> Device:
        """Plug a device in: it has a number that none had before."""
        return Device(self.bed, self.server, place, next(self.numbers))

    def read(self, *_: object) -> bool:
        data = os.read(0, 4096)
        if not data:
            LOOP.quit()
            return False
        *lines, self.line = (self.line + data).split(b"\n")
        for line in lines:
            with GUARD:
                self.carry_out(*line.decode().split())
        return True

    def carry_out(self, word: str, place: str, endpoint: str = "0") -> None:
        device = self.devices[place]
        number = int(endpoint, 16) if endpoint not in FORMS else 0
        match word:
            case "hold":
                device.held[number] = []
            case "free":
                for urb in device.held.pop(number, ()):
                    device.submit(urb)
            case "stall":
                device.stalled.add(number)
                for urb in [each for each in device.flying.values() if each.request.endpoint == number]:
                    device.discard(urb.address)
                    device.ended.pop()
                    device.end(urb, -errno.EPIPE)
            case "reply":
                device.form = endpoint
            case "empty":
                device.empty += 1
            case "unplug":
                device.unplug()
            case "plug":
                self.devices[place] = device = self.plugged(place)
                self.bed.uevent(device.path, "add")
            case "forbid":
                os.chmod(f"{self.bed.get_root_dir()}{device.node}", 0)
        say(done=f"{word} {place}")


LOOP = GLib.MainLoop()
if __name__ == "__main__":
    host, _, port = sys.argv[1].rpartition(":")
    bench = Bench((host, int(port)), sys.argv[2:])
    LOOP.run()
