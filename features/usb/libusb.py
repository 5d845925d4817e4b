"""The transfers of a controller on the USB of this machine, through libusb (the extra `usb`).

A transfer can be cancelled at once, so a stop waits for none. One thread takes what libusb reports, and hands it to the
event loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from typing import Any

from multidrop.features.usb import interface
from multidrop.features.usb.controllers import ASKING, OTHER, STATUS, chosen, controllers, library, refusal
from multidrop.features.usb.pipe import Broken, Done, TransferFailed, UsbPipe, open_usb
from multidrop.transports import Unreachable
from multidrop.transports.pipe import in_thread


async def open_libusb(target: str) -> UsbPipe:
    """Open the controller that a target names. Raises Unreachable."""
    carrier = await in_thread(lambda: LibusbCarrier(target), lambda late: late.close())
    return await open_usb(carrier)


class LibusbCarrier:
    """The transfers of one controller. Making one finds and claims it, which may block. Raises Unreachable."""

    delay: float = 0.0

    def __init__(self, target: str) -> None:
        self._usb1 = usb1 = library()
        with contextlib.ExitStack() as stack:
            try:
                self._context = stack.enter_context(usb1.USBContext())
                controller = chosen(controllers(usb1, self._context), target)
            except usb1.USBError as error:
                raise Unreachable(f"usb:{target}: {error}") from error
            try:
                self._handle = controller.device.open()
                self._handle.claimInterface(0)
            except usb1.USBError as error:
                raise Unreachable(f"{controller.url}: {refusal(error.value, controller)}") from error
            self._opened = stack.pop_all()
        self.name = controller.url
        self._guard = threading.Lock()
        self._transfers: dict[int, Any] = {}
        """Transfers that have not ended, by number."""
        self._spare: list[Any] = []
        self._stalled: set[int] = set()
        """Endpoints that the controller has halted; closing ends that."""
        self._last = 0
        self._ending = False
        self._thread: threading.Thread | None = None

    def start(self, done: Done, broken: Broken) -> None:
        self._loop = asyncio.get_running_loop()
        self._done, self._broken = done, broken
        self._thread = threading.Thread(target=self._watch, name=f"{self.name} events", daemon=True)
        self._thread.start()

    def control(self, value: interface.UsbControl) -> int:
        return self._begin("setControl", interface.REQUEST_TYPE, interface.REQUEST, value, 0, b"")

    def send(self, data: bytes) -> int:
        return self._begin("setBulk", interface.OUT, data)

    def receive(self) -> int:
        return self._begin("setBulk", interface.IN, interface.PACKET)

    def _begin(self, kind: str, *arguments: object) -> int:
        with self._guard:
            if self._ending:
                raise TransferFailed(interface.GONE)
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
            raise TransferFailed(STATUS.get(error.value, OTHER)) from error
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
            for endpoint in self._stalled:
                self._handle.clearHalt(endpoint)
            self._handle.controlWrite(
                interface.REQUEST_TYPE, interface.REQUEST, interface.UsbControl.CLOSE, 0, b"", ASKING
            )
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
                self._post(self._broken, TransferFailed(STATUS.get(error.value, OTHER)))
                return

    def _ended(self, transfer: Any) -> None:
        usb1, number = self._usb1, transfer.getUserData()
        ends = {
            usb1.TRANSFER_COMPLETED: 0,
            usb1.TRANSFER_CANCELLED: interface.CANCELLED,
            usb1.TRANSFER_STALL: interface.STALLED,
            usb1.TRANSFER_NO_DEVICE: interface.GONE,
            usb1.TRANSFER_TIMED_OUT: interface.TIMEOUT,
        }
        status = ends.get(transfer.getStatus(), OTHER)
        if status == interface.STALLED:
            self._stalled |= {transfer.getEndpoint()} & {interface.IN, interface.OUT}
        incoming = transfer.getEndpoint() == interface.IN and status == 0
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
