"""The USB side of a simulated controller: its descriptors, requests and packets.

Source: manual 6.1 (64 characters each way; a reply that was not read comes first, 6.1.3) and 7 (DN is the identity).
Class, speed and strings are assumed. It hears its own traffic, never the wire. Bytes come in, bytes go out; no clock.
"""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from multidrop.features.usb.interface import (
    IN,
    MODULE,
    OUT,
    PACKET,
    PRODUCT,
    REQUEST,
    REQUEST_TYPE,
    STALLED,
    VENDOR,
    UsbControl,
)
from multidrop.simulator.family import Device, UsbSide
from multidrop.simulator.floor import Floor

MOST_HELD_REPLIES = 16
"""Replies that the controller holds; older ones are lost."""
DEVICE, CONFIGURATION, STRING = 1, 2, 3
"""Types of descriptors."""
LANGUAGE = 0x0409
_DEVICE = struct.pack("<BBHBBBBHHHBBBB", 18, DEVICE, 0x0110, 0, 0, 0, PACKET, VENDOR, PRODUCT, 0x0100, 1, 2, 3, 1)
_INTERFACE = bytes([9, 4, 0, 0, 2, 0xFF, 0, 0, 0])
_ENDPOINTS = b"".join(struct.pack("<BBBBHB", 7, 5, number, 2, PACKET, 0) for number in (OUT, IN))
_BODY = _INTERFACE + _ENDPOINTS
_CONFIGURATION = struct.pack("<BBHBBBBB", 9, CONFIGURATION, 9 + len(_BODY), 1, 1, 0, 0xC0, 0) + _BODY


@dataclass
class UsbController:
    """One controller as a USB device."""

    device: Device
    pipe: UsbSide
    replies: deque[bytes] = field(default_factory=lambda: deque(maxlen=MOST_HELD_REPLIES))
    """Replies that the host has not read."""
    _configured: int = 1

    @property
    def present(self) -> bool:
        return self.device.powered

    @property
    def closed(self) -> bool:
        """Never: what makes no sense is stalled."""
        return False

    def receive(self, data: bytes, now: float) -> bytes:
        """Take a packet: one command up to its NUL. The reply waits to be read."""
        text, _, _ = data.partition(b"\0")
        if text:
            reply = self.pipe.execute(text.decode("latin-1"), now).encode("latin-1")
            self.replies.append((reply[: PACKET - 1] + b"\0").ljust(PACKET, b"\0"))
        return b""

    def request(self, setup: bytes) -> tuple[int, bytes]:
        kind, request, value, index, length = struct.unpack("<BBHHH", setup)
        if (kind, request) == (REQUEST_TYPE, REQUEST):
            if value == UsbControl.FLUSH:
                self.replies.clear()
            return (0, b"") if value in tuple(UsbControl) else (STALLED, b"")
        match kind, request:
            case 0x80, 6:
                descriptor = self._descriptor(value >> 8, value & 0xFF)
                return (0, descriptor[:length]) if descriptor else (STALLED, b"")
            case 0x80, 8:
                return 0, bytes([self._configured])
            case 0x00, 9 if value in (0, 1):
                self._configured = value
                return 0, b""
            case ((0x80 | 0x81 | 0x82), 0):
                return 0, bytes(2)
            case (0x01, 11) | (0x02, 1) | (0x00, 5):  # interface 0; a halt that ends; an address
                return 0, b""
            case 0x81, 10:
                return 0, b"\0"
        return STALLED, b""

    def _descriptor(self, kind: int, index: int) -> bytes:
        maker, product = MODULE.texts
        texts = {1: maker, 2: product, 3: self.pipe.serial()}
        if kind == DEVICE:
            return _DEVICE
        if kind == CONFIGURATION and index == 0:
            return _CONFIGURATION
        if kind != STRING or (index and index not in texts):
            return b""
        body = texts[index].encode("utf-16-le") if index else struct.pack("<H", LANGUAGE)
        return bytes([2 + len(body), STRING]) + body


_SIDES: WeakKeyDictionary[Floor, dict[str, list[UsbController]]] = WeakKeyDictionary()


def sides(floor: Floor, bus: str) -> list[UsbController]:
    """The USB sides of the controllers of a bus, in their order: the same ones for everyone who asks."""
    buses = _SIDES.setdefault(floor, {})
    if bus not in buses:
        units = [drive.unit for drive in floor.drives if drive.bus == bus]
        buses[bus] = [UsbController(unit.device, unit.on_usb) for unit in units if unit.on_usb is not None]
    return buses[bus]
