"""The controllers on the USB of a machine: their names, which one a URL means, and why one cannot be opened."""

from __future__ import annotations

import re
import sys
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.transports import Unreachable
from multidrop.transports import controllers as here
from multidrop.transports.controllers import RULE, UNREAD, Found, all_ports, chosen, controllers, refusal
from multidrop.transports.performax import IN, OUT, PRODUCT, VENDOR, Control
from tests.support.cases import for_each

SEVERAL = [Found("2ED00", "1-1"), Found("2ED00", "1-1.4"), Found("2ED07", "2-3")]


@for_each(
    ("target", "place"),
    [("2ED07", "2-3"), ("2ED00@1-1", "1-1"), ("2ED00@1-1.4", "1-1.4"), ("0", "1-1"), ("1", "1-1.4"), ("2", "2-3")],
)
def test_a_url_means_one_controller(target: str, place: str) -> None:
    assert chosen(SEVERAL, target).place == place
    assert chosen(SEVERAL[2:], "").url == "usb:2ED07@2-3"


@for_each(
    ("target", "why"),
    [
        ("", ": 3 controllers; name one of usb:2ED00@1-1, usb:2ED00@1-1.4, usb:2ED07@2-3"),
        ("2ED00", ": 2 controllers; name one of usb:2ED00@1-1, usb:2ED00@1-1.4"),
        ("2ED01", " is not there; controllers on USB: usb:2ED00@1-1"),
        ("2ED07@1-1", " is not there"),  # another one in its place
        ("2ED07@2-4", " is not there"),  # it is plugged into another socket
        ("3", " is not there"),
    ],
)
def test_a_url_that_means_none_or_several_is_refused(target: str, why: str) -> None:
    with pytest.raises(Unreachable, match=re.escape(f"usb:{target}{why}")):
        chosen(SEVERAL, target)


def test_a_number_that_cannot_be_read_names_the_remedy() -> None:
    found = [Found(UNREAD, "1-1")]
    with pytest.raises(Unreachable, match="not there; controllers on USB: usb:unread@1-1; where a number cannot be"):
        chosen(found, "2ED00")
    assert chosen(found, "unread@1-1") is chosen(found, "") is found[0]


@for_each(
    ("platform", "code", "why"),
    [
        ("linux", -3, f"no permission; copy {RULE} to /etc/udev/rules.d and plug it in again"),
        ("win32", -12, "no access (libusb error -12); the maker's driver holds it"),
        ("darwin", -3, "no permission; another program or driver holds it"),
        ("linux", -4, "unplugged, or without power"),
        ("linux", -6, "another connection has it"),
    ],
)
def test_a_refusal_says_what_is_needed(platform: str, code: int, why: str) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(here, "sys", SimpleNamespace(platform=platform))
        assert refusal(code, SEVERAL[0]).startswith(why)


def test_the_rule_of_udev_is_beside_the_program() -> None:
    assert 'SUBSYSTEM=="usb", ATTR{idVendor}=="1589", ATTR{idProduct}=="a101", TAG+="uaccess"' in RULE.read_text()


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
def test_the_holder_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "holder", lambda path: f"minicom ({path})")
    assert refusal(-6, Found("2ED00", "1-1", "/dev/bus/usb/001/002")) == "minicom (/dev/bus/usb/001/002) has it"


def test_ports_are_listed_with_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "list_ports", list)
    monkeypatch.setattr(here, "list_controllers", lambda: [SEVERAL[2], Found(UNREAD, "1-1")])
    assert [(each.device, each.description[:20]) for each in all_ports()] == [
        ("usb:2ED07@2-3", "Performax controller"),
        ("usb:unread@1-1", ("the maker's driver holds it" if sys.platform == "win32" else f"copy {RULE}")[:20]),
    ]

    def missing() -> list[Found]:
        raise Unreachable("usb: needs libusb")

    monkeypatch.setattr(here, "list_controllers", missing)
    assert all_ports() == []


class Fault(Exception):
    """An error of libusb."""


USB1: Any = SimpleNamespace(USBError=Fault, USBErrorTimeout=Fault)


class Device:
    """A device as the library shows it; `number` is in its descriptor, `dn` what it replies to DN."""

    def __init__(self, bus: int, ports: list[int], number: str | None, dn: str = "", vendor: int = VENDOR) -> None:
        self.bus, self.ports, self.number, self.dn, self.vendor = bus, ports, number, dn, vendor
        self.log: list[object] = []
        self.replies = [b"stale\0"]

    def getVendorID(self) -> int:  # noqa: N802
        return self.vendor

    def getProductID(self) -> int:  # noqa: N802
        return PRODUCT

    def getBusNumber(self) -> int:  # noqa: N802
        return self.bus

    def getPortNumberList(self) -> list[int]:  # noqa: N802
        return self.ports

    def getDeviceAddress(self) -> int:  # noqa: N802
        return 4

    def getSerialNumber(self) -> str | None:  # noqa: N802
        if self.number == "forbidden":
            raise Fault
        return self.number

    def open(self) -> Device:
        return self

    def claimInterface(self, number: int) -> None:  # noqa: N802
        if not self.dn:
            raise Fault  # another program has it
        assert number == 0

    def controlWrite(self, *request: object) -> None:  # noqa: N802
        self.log.append(request[2])

    def bulkWrite(self, endpoint: int, data: bytes, timeout: int) -> None:  # noqa: N802
        assert endpoint == OUT and timeout <= 1000
        self.log.append(data)
        self.replies.append(self.dn.encode().ljust(64, b"\0"))

    def bulkRead(self, endpoint: int, size: int, timeout: int) -> bytes:  # noqa: N802
        assert (endpoint, size) == (IN, 64) and timeout <= 1000
        if not self.replies:
            raise Fault
        return self.replies.pop(0)

    def close(self) -> None:
        self.log.append("closed")


def test_the_number_is_in_the_descriptor_or_asked_for() -> None:
    silent = Device(1, [2], None)
    asked = Device(1, [1], "", dn="2ED03")
    devices = [
        Device(2, [3, 10], "2ED01"),
        Device(2, [3, 9], "forbidden"),
        asked,
        silent,
        Device(1, [9], "x", vendor=1),
    ]
    context: Any = SimpleNamespace(getDeviceIterator=lambda skip_on_error: iter(devices))
    assert [each.url for each in controllers(USB1, context)] == [
        "usb:2ED03@1-1", "usb:unread@1-2", "usb:unread@2-3.9", "usb:2ED01@2-3.10"]  # fmt: skip
    assert asked.log == [Control.OPEN, Control.FLUSH, b"DN\0", Control.CLOSE, "closed"]
    assert silent.log == ["closed"]
