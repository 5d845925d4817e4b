"""Performax controllers on the USB of this machine, through libusb (the extra `usb`).

A transfer can be cancelled at once, so a stop waits for none. One thread takes what libusb reports, and hands it to the
event loop. A controller is known by its device number and by the socket that it is plugged into: after it was
unplugged, another one in its place is not taken for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import re
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from multidrop.transports import Unreachable
from multidrop.transports.performax import (
    CANCELLED,
    GONE,
    IN,
    OUT,
    PACKET,
    PRODUCT,
    REQUEST,
    REQUEST_TYPE,
    STALLED,
    TIMEOUT,
    VENDOR,
    Control,
)
from multidrop.transports.pipe import in_thread
from multidrop.transports.serial_ports import PortInfo, holder, list_ports, natural
from multidrop.transports.usb import Broken, Done, TransferFailed, UsbPipe, open_usb

RULE = Path(__file__).with_name("60-multidrop-usb.rules")
"""The rule of udev that gives the users of this machine access."""
UNREAD = "unread"
"""In place of a device number that cannot be read."""
_ACCESS, _NO_DEVICE, _BUSY, _TIMED_OUT, _STALL = -3, -4, -6, -7, -9
"""libusb's errors."""
_STATUS = {_NO_DEVICE: GONE, _TIMED_OUT: TIMEOUT, _STALL: STALLED}
_OTHER = -5
"""The status of any other error."""
_ASKING = 100
"""Milliseconds in which a controller takes or sends a packet while it is looked for."""


@dataclass(frozen=True)
class Found:
    """A controller on this machine. `place`: the bus and the sockets from its root on, as `1-1.4`."""

    number: str
    """The device number, as `2ED01`, or `UNREAD`."""
    place: str
    path: str = ""
    """The device's file on Linux."""
    device: Any = None

    @property
    def url(self) -> str:
        """The URL of this one."""
        return f"usb:{self.number}@{self.place}"


def library() -> ModuleType:
    """The library. Raises Unreachable where it is not installed."""
    try:
        import usb1

        with contextlib.suppress(ImportError, OSError):  # else the system's library
            from libusb_package import get_library_path

            usb1.loadLibrary(ctypes.CDLL(str(get_library_path())))
        usb1.loadLibrary()
    except (ImportError, OSError, AttributeError):
        raise Unreachable("usb: needs libusb: pip install 'multidrop[usb]'") from None
    return sys.modules["usb1"]


def controllers(usb1: ModuleType, context: Any) -> list[Found]:
    """The controllers in the order of their places."""
    found = []
    for device in context.getDeviceIterator(skip_on_error=True):
        if (device.getVendorID(), device.getProductID()) == (VENDOR, PRODUCT):
            bus, ports = device.getBusNumber(), ".".join(map(str, device.getPortNumberList())) or "0"
            path = f"/dev/bus/usb/{bus:03}/{device.getDeviceAddress():03}"
            try:
                number = device.getSerialNumber() or _asked(usb1, device)
            except usb1.USBError:
                number = UNREAD
            found.append(Found(number, f"{bus}-{ports}", path, device))
    return sorted(found, key=lambda each: natural(each.place))


def _asked(usb1: ModuleType, device: Any) -> str:
    """Ask a controller whose descriptor has no number for it. Raises USBError where a program has it."""
    handle = device.open()
    try:
        handle.claimInterface(0)
        for value in (Control.OPEN, Control.FLUSH):
            handle.controlWrite(REQUEST_TYPE, REQUEST, value, 0, b"", _ASKING)
        with contextlib.suppress(usb1.USBErrorTimeout):
            handle.bulkRead(IN, PACKET, _ASKING)  # what an earlier session has left
        handle.bulkWrite(OUT, b"DN\0", _ASKING)
        reply = bytes(handle.bulkRead(IN, PACKET, _ASKING)).partition(b"\0")[0].decode("latin-1")
        handle.controlWrite(REQUEST_TYPE, REQUEST, Control.CLOSE, 0, b"", _ASKING)
        return reply if re.fullmatch(r"\w+", reply, re.ASCII) else UNREAD
    finally:
        handle.close()


def list_controllers() -> list[Found]:
    """The controllers of this machine. Raises Unreachable where the library is not installed."""
    usb1 = library()
    try:
        with usb1.USBContext() as context:
            return [Found(each.number, each.place, each.path) for each in controllers(usb1, context)]
    except usb1.USBError:
        return []  # a machine without USB


def all_ports() -> list[PortInfo]:
    """The serial ports of this machine, and its controllers on USB where the library is installed."""
    try:
        found = list_controllers()
    except Unreachable:
        found = []
    usb = [
        PortInfo(each.url, description=permission() if each.number == UNREAD else "Performax controller")
        for each in found
    ]
    return list_ports() + usb


def chosen(found: list[Found], target: str) -> Found:
    """The controller that a URL names by its target. Raises Unreachable."""
    number, _, place = target.partition("@")
    listed = ", ".join(each.url for each in found) or "none"
    if any(each.number == UNREAD for each in found):
        listed += f"; where a number cannot be read: {permission()}"
    if re.fullmatch(r"\d{1,3}", target):
        matching = found[int(target) :][:1]
    else:
        matching = [each for each in found if number in ("", each.number) and place in ("", each.place)]
    if not matching:
        raise Unreachable(f"usb:{target}: not there; controllers on USB: {listed}")
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


def refusal(code: int, found: Found) -> str:
    """The reason why a controller could not be opened, from libusb's error."""
    if code == _BUSY:
        return f"{holder(found.path) or 'another connection'} has it"
    if code == _NO_DEVICE:
        return "unplugged, or without power"
    what = "no permission" if code == _ACCESS else f"no access (libusb error {code})"
    return f"{what}; {permission()}"


async def open_libusb(target: str) -> UsbPipe:
    """Open the controller that a target names. Raises Unreachable."""
    carrier = await in_thread(lambda: LibusbCarrier(target), lambda late: late.close())
    return await open_usb(carrier)


class LibusbCarrier:
    """The transfers of one controller. Making one finds and claims it, which may block. Raises Unreachable."""

    delay = 0.0

    def __init__(self, target: str) -> None:
        self._usb1 = usb1 = library()
        with contextlib.ExitStack() as stack:
            try:
                self._context = stack.enter_context(usb1.USBContext())
                found = chosen(controllers(usb1, self._context), target)
            except usb1.USBError as error:
                raise Unreachable(f"usb:{target}: {error}") from error
            try:
                self._handle = found.device.open()
                self._handle.claimInterface(0)
            except usb1.USBError as error:
                raise Unreachable(f"{found.url}: {refusal(error.value, found)}") from error
            self._opened = stack.pop_all()
        self.name = found.url
        self._guard = threading.Lock()
        self._transfers: dict[int, Any] = {}
        """Transfers that have not ended, by number."""
        self._spare: list[Any] = []
        self._last = 0
        self._ending = False
        self._thread: threading.Thread | None = None

    def start(self, done: Done, broken: Broken) -> None:
        self._loop = asyncio.get_running_loop()
        self._done, self._broken = done, broken
        self._thread = threading.Thread(target=self._watch, name=f"{self.name} events", daemon=True)
        self._thread.start()

    def control(self, value: Control) -> int:
        return self._begin("setControl", REQUEST_TYPE, REQUEST, value, 0, b"")

    def send(self, data: bytes) -> int:
        return self._begin("setBulk", OUT, data)

    def receive(self) -> int:
        return self._begin("setBulk", IN, PACKET)

    def _begin(self, kind: str, *arguments: object) -> int:
        with self._guard:
            if self._ending:
                raise TransferFailed(GONE)
            self._last += 1
            number = self._last
            transfer = self._spare.pop() if self._spare else self._handle.getTransfer()
            self._transfers[number] = transfer
        getattr(transfer, kind)(*arguments, callback=self._ended, user_data=number)
        try:
            transfer.submit()
        except self._usb1.USBError as error:
            with self._guard:
                del self._transfers[number]
            raise TransferFailed(_STATUS.get(error.value, _OTHER)) from error
        return number

    def cancel(self, number: int) -> None:
        with self._guard:
            transfer = self._transfers.get(number)
        if transfer is not None:
            with contextlib.suppress(self._usb1.USBError):  # it has just ended
                transfer.cancel()

    def halt(self) -> None:
        with self._guard:
            self._ending = True
            waiting = [*self._transfers]
        for number in waiting:
            self.cancel(number)

    def close(self) -> None:
        self.halt()
        if self._thread is not None:
            self._thread.join(1.0)
        with contextlib.suppress(self._usb1.USBError):
            self._handle.controlWrite(REQUEST_TYPE, REQUEST, Control.CLOSE, 0, b"", _ASKING)
        self._handle.close()
        self._opened.close()

    # In the thread of libusb's events

    def _watch(self) -> None:
        """Take events until the device is closed and every transfer has ended."""
        while not self._ending or self._transfers:
            try:
                self._context.handleEventsTimeout(0.1)
            except self._usb1.USBErrorInterrupted:
                continue
            except self._usb1.USBError as error:
                self._post(self._broken, TransferFailed(_STATUS.get(error.value, _OTHER)))
                return

    def _ended(self, transfer: Any) -> None:
        usb1, number = self._usb1, transfer.getUserData()
        ends = {
            usb1.TRANSFER_COMPLETED: 0,
            usb1.TRANSFER_CANCELLED: CANCELLED,
            usb1.TRANSFER_STALL: STALLED,
            usb1.TRANSFER_NO_DEVICE: GONE,
            usb1.TRANSFER_TIMED_OUT: TIMEOUT,
        }
        status = ends.get(transfer.getStatus(), _OTHER)
        incoming = transfer.getEndpoint() == IN and status == 0
        data = bytes(transfer.getBuffer()[: transfer.getActualLength()]) if incoming else b""
        with self._guard:
            self._transfers.pop(number, None)
            self._spare.append(transfer)
            ending = self._ending
        if not ending:
            self._post(self._done, number, status, data)

    def _post(self, call: Any, *arguments: object) -> None:
        try:
            self._loop.call_soon_threadsafe(call, *arguments)
        except RuntimeError:
            self._ending = True  # the loop has ended
