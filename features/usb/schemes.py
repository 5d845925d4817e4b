"""The URLs `usb:` and `usbip://`, which lead to one controller each. Imports nothing that takes time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from multidrop.base.errors import Diagnostic
from multidrop.dialects.usb import usb_module
from multidrop.shell.connect.scheme import Connection, Open, Scheme, last_part

if TYPE_CHECKING:
    from multidrop.shell.connect.reconnect import Reopen
    from multidrop.transports import Transport
    from multidrop.transports.serial_ports import PortInfo

MODULE = usb_module()
TARGET = r"(?:[!-?A-~]+(?:@\d+-\d+(?:\.\d+)*)?)?"
"""A controller on USB: its device number with the socket that it is plugged into, or its place in the list."""
ALL = "usb:"
"""What is typed for a search of every controller."""


class OnUsb(Scheme):
    """A way to one controller."""

    direct, direct_on = MODULE.dialect, "on USB"
    alone = True


class Usb(OnUsb):
    """A controller on the USB of this machine."""

    name, prefix, example = "usb", "usb:", "usb:2ED01"
    meaning = f"{MODULE.title} on USB, by its device number; usb: alone is the only one"
    after = "ssh"

    def parse(self, base: Connection, body: str) -> Connection:
        if not re.fullmatch(TARGET, body):
            hint = "as in usb:2ED01, usb:2ED01@1-1.4 or usb:0"
            raise Diagnostic(f"no controller on USB {body}", base.text, hint)
        return replace(base, target=body)

    def port_name(self, connection: Connection) -> str:
        return f"usb:{connection.target}"

    def shown(self, connection: Connection, bus: str = "") -> str:
        return f"usb:{connection.target}"

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.features.usb.libusb import open_libusb

        return await open_libusb(connection.target)

    def again(self, connection: Connection, open_: Open, took: float) -> Reopen:
        """Open the controller of the same number at the same socket: another one there is not taken for it."""

        async def again(old: Transport) -> Transport:
            await old.close()
            return await open_(replace(connection, target=old.name.removeprefix("usb:")))

        return again

    def ports(self) -> list[PortInfo]:
        from multidrop.features.usb.controllers import ports

        return ports()

    def searched(self, text: str) -> Sequence[str]:
        """Search each controller in turn for `usb:`."""
        if text != ALL:
            return [text]
        from multidrop.features.usb.controllers import list_controllers

        return [controller.url for controller in list_controllers()] or [text]


class Usbip(OnUsb):
    """A controller on the USB of another machine, or of a simulated one."""

    name, prefix, example = "usbip", "usbip://", "usbip://HOST:3240/BUSID"
    meaning = f"{MODULE.title} on the USB of another machine"
    port = 3240
    after = "usb"

    def parse(self, base: Connection, body: str) -> Connection:
        where, slash, bus_id = body.removeprefix("//").rpartition("/")
        if not slash or not re.fullmatch(r"\d+-\d+(\.\d+)*", bus_id):
            raise Diagnostic("usbip: needs //HOST[:PORT]/BUSID", base.text, "as in usbip://10.0.0.5/1-1")
        return replace(super().parse(base, f"//{where}"), target=bus_id)

    def short(self, connection: Connection) -> str:
        return f"{connection.host}-{last_part(connection.target)}"

    def shown(self, connection: Connection, bus: str = "") -> str:
        return f"{super().shown(connection)}/{connection.target}"

    async def open(self, connection: Connection, baud: int, within: float | None = None) -> Transport:
        from multidrop.features.usb.pipe import open_usb
        from multidrop.features.usb.usbip import imported

        carrier = await imported(connection.host, connection.port, connection.target, within)
        opened = await open_usb(carrier)
        opened.identity = await carrier.number()
        return opened
