"""The controllers on the USB of this machine, found through libusb (the extra `usb`).

A controller is known by its device number and by the socket that it is plugged into: after it was unplugged, another
one in its place is not taken for it.
"""

from __future__ import annotations

import contextlib
import ctypes
import re
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from multidrop.features.usb import interface
from multidrop.transports import Unreachable
from multidrop.transports.port_users import holder
from multidrop.transports.serial_ports import PortInfo, natural

RULE = Path(__file__).with_name("60-multidrop-usb.rules")
"""The rule of udev that gives the users of this machine access."""
UNREAD = "unread"
"""In place of a device number that cannot be read."""
_ACCESS, _NO_DEVICE, _BUSY, _TIMED_OUT, _STALL = -3, -4, -6, -7, -9
"""libusb's errors."""
STATUS = {_NO_DEVICE: interface.GONE, _TIMED_OUT: interface.TIMEOUT, _STALL: interface.STALLED}
OTHER = -5
"""The status of any other error."""
ASKING = 100
"""Milliseconds in which a controller takes or sends a packet while it is looked for."""


@dataclass(frozen=True)
class FoundController:
    """A controller on this machine. `place`: the bus and the sockets from its root on, as `1-1.4`."""

    number: str
    """The device number, as `2ED01`, or `UNREAD`."""
    place: str
    path: str = ""
    """The device's file on Linux."""
    device: Any = None

    @property
    def url(self) -> str:
        return f"usb:{self.number}@{self.place}"


def library() -> ModuleType:
    """The library. Raises Unreachable where it is not installed."""
    try:
        import usb1

        carried = find_spec("libusb_package")  # not imported: its own search takes longer than the rest
        if carried is not None and carried.origin is not None:
            ending = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
            with contextlib.suppress(OSError):  # else the system's library
                usb1.loadLibrary(ctypes.CDLL(str(Path(carried.origin).with_name(f"libusb-1.0.{ending}"))))
        usb1.loadLibrary()
    except (ImportError, OSError, AttributeError):
        raise Unreachable("usb: needs libusb: pip install 'multidrop[usb]'") from None
    return sys.modules["usb1"]


def controllers(usb1: ModuleType, context: Any) -> list[FoundController]:
    controllers_there = []
    for device in context.getDeviceIterator(skip_on_error=True):
        if (device.getVendorID(), device.getProductID()) == (interface.VENDOR, interface.PRODUCT):
            bus, ports = device.getBusNumber(), ".".join(map(str, device.getPortNumberList())) or "0"
            path = f"/dev/bus/usb/{bus:03}/{device.getDeviceAddress():03}"
            try:
                number = device.getSerialNumber() or _asked(usb1, device)
            except usb1.USBError:
                number = UNREAD
            controllers_there.append(FoundController(number, f"{bus}-{ports}", path, device))
    return sorted(controllers_there, key=lambda each: natural(each.place))


def _asked(usb1: ModuleType, device: Any) -> str:
    """Ask a controller whose descriptor has no number for it. Raises USBError where a program has it."""
    handle = device.open()
    try:
        handle.claimInterface(0)
        for value in (interface.UsbControl.OPEN, interface.UsbControl.FLUSH):
            handle.controlWrite(interface.REQUEST_TYPE, interface.REQUEST, value, 0, b"", ASKING)
        with contextlib.suppress(usb1.USBErrorTimeout):
            handle.bulkRead(interface.IN, interface.PACKET, ASKING)  # what an earlier session has left
        handle.bulkWrite(interface.OUT, b"DN\0", ASKING)
        reply = bytes(handle.bulkRead(interface.IN, interface.PACKET, ASKING)).partition(b"\0")[0].decode("latin-1")
        handle.controlWrite(interface.REQUEST_TYPE, interface.REQUEST, interface.UsbControl.CLOSE, 0, b"", ASKING)
        return reply if re.fullmatch(r"\w+", reply, re.ASCII) else UNREAD
    finally:
        handle.close()


def list_controllers() -> list[FoundController]:
    """The controllers of this machine. Raises Unreachable where the library is not installed."""
    usb1 = library()
    try:
        with usb1.USBContext() as context:
            return [
                FoundController(controller.number, controller.place, controller.path)
                for controller in controllers(usb1, context)
            ]
    except usb1.USBError:
        return []  # a machine without USB


def ports() -> list[PortInfo]:
    """The controllers of this machine as ports; none where the library is not installed."""
    try:
        plugged = list_controllers()
    except Unreachable:
        plugged = []
    return [
        PortInfo(controller.url, description=permission() if controller.number == UNREAD else interface.MODULE.module)
        for controller in plugged
    ]


def chosen(found: list[FoundController], target: str) -> FoundController:
    """The controller that a URL names by its target. Raises Unreachable."""
    number, _, place = target.partition("@")
    listed = ", ".join(controller.url for controller in found) or "none"
    if any(controller.number == UNREAD for controller in found):
        listed += f"; where a number cannot be read: {permission()}"
    if re.fullmatch(r"\d{1,3}", target):
        matching = found[int(target) :][:1]
    else:
        matching = [
            controller for controller in found if number in ("", controller.number) and place in ("", controller.place)
        ]
    if not matching:
        raise Unreachable(f"usb:{target} is not there; controllers on USB: {listed}")
    if len(matching) > 1:
        raise Unreachable(f"usb:{target}: {len(matching)} controllers; name one of {listed}")
    return matching[0]


def permission() -> str:
    """The remedy where this machine's user may not use a device."""
    if sys.platform == "win32":
        return "the maker's driver holds it; multidrop reaches it with the WinUSB driver in place of that only"
    if sys.platform == "darwin":
        return "another program or driver holds it; end that program"
    return f"copy {RULE} to /etc/udev/rules.d and plug it in again"


def refusal(code: int, found: FoundController) -> str:
    """The reason why a controller could not be opened, from libusb's error."""
    if code == _BUSY:
        return f"{holder(found.path) or 'another connection'} has it"
    if code == _NO_DEVICE:
        return "unplugged, or without power"
    what = "no permission" if code == _ACCESS else f"no access (libusb error {code})"
    return f"{what}; {permission()}"
