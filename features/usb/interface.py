"""The USB interface of the controllers: its numbers, as in the maker's driver for Linux."""

from __future__ import annotations

from enum import IntEnum

from multidrop.dialects.usb import usb_module

MODULE = usb_module()
VENDOR, PRODUCT = MODULE.vendor, MODULE.product
OUT, IN = 0x02, 0x82
"""The bulk endpoints."""
PACKET = 64
"""Bytes of a packet, each way."""
REQUEST_TYPE, REQUEST = 0x40, 0x02
"""A vendor request to the device; its value is a `UsbControl`."""
CANCELLED, STALLED, GONE, TIMEOUT = -104, -32, -19, -110
"""Ends of a transfer, in the numbers of Linux, which USB/IP uses on every system."""


class UsbControl(IntEnum):
    """The values of the vendor request."""

    FLUSH = 1
    """Empties the buffers of both sides."""
    OPEN = 2
    CLOSE = 4
