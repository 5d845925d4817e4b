"""The controllers on the USB of a machine: their names, which one a URL means, and why one cannot be opened."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.features.usb import controllers as here
from multidrop.features.usb import interface
from multidrop.features.usb.controllers import (
    RULE,
    UNREAD,
    FoundController,
    chosen,
    controllers,
    library,
    list_controllers,
    ports,
    refusal,
)
from multidrop.features.usb.interface import IN, OUT, PRODUCT, VENDOR, UsbControl
from multidrop.transports import Unreachable
from tests.support.cases import for_each

SEVERAL = [FoundController("2ED00", "1-1"), FoundController("2ED00", "1-1.4"), FoundController("2ED07", "2-3")]


@for_each(
    ("target", "place"),
    [("2ED07", "2-3"), ("2ED00@1-1", "1-1"), ("2ED00@1-1.4", "1-1.4"), ("@1-1", "1-1"),
     ("0", "1-1"), ("1", "1-1.4"), ("002", "2-3")],
)  # fmt: skip
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
        ("999", " is not there"),
        ("0001", " is not there"),  # too long for an index, so it is a device number
    ],
)
def test_a_url_that_means_none_or_several_is_refused(target: str, why: str) -> None:
    with pytest.raises(Unreachable, match="^" + re.escape(f"usb:{target}{why}")) as refused:
        chosen(SEVERAL, target)
    assert "cannot be read" not in str(refused.value)


def test_where_there_is_none_the_refusal_says_so() -> None:
    with pytest.raises(Unreachable, match=r"^usb: is not there; controllers on USB: none$"):
        chosen([], "")


def test_a_number_that_cannot_be_read_names_the_remedy() -> None:
    found = [FoundController(UNREAD, "1-1")]
    with pytest.raises(Unreachable, match="not there; controllers on USB: usb:unread@1-1; where a number cannot be"):
        chosen(found, "2ED00")
    assert chosen(found, "unread@1-1") is chosen(found, "") is found[0]
    with pytest.raises(
        Unreachable, match=r"not there; .*usb:2ED00@1-1, usb:unread@1-1; where a number cannot be read: "
    ):
        chosen([SEVERAL[0], *found], "2ED07")


@for_each(
    ("platform", "code", "why"),
    [
        ("linux", -3, f"no permission; copy {RULE} to /etc/udev/rules.d and plug it in again"),
        ("win32", -12, "no access (libusb error -12); the maker's driver holds it"),
        ("darwin", -3, "no permission; another program or driver holds it; end that program"),
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
    assert (
        refusal(-6, FoundController("2ED00", "1-1", "/dev/bus/usb/001/002")) == "minicom (/dev/bus/usb/001/002) has it"
    )


def test_the_numbers_are_those_of_the_makers_driver_and_the_ends_those_of_linux() -> None:
    assert (VENDOR, PRODUCT) == (0x1589, 0xA101)
    assert (OUT, IN, interface.PACKET) == (0x02, 0x82, 64)
    assert (interface.REQUEST_TYPE, interface.REQUEST) == (0x40, 0x02)
    assert {each.name: int(each) for each in UsbControl} == {"FLUSH": 1, "OPEN": 2, "CLOSE": 4}
    assert (interface.CANCELLED, interface.STALLED, interface.GONE, interface.TIMEOUT) == (-104, -32, -19, -110)
    assert (here.STATUS, here.OTHER) == ({-4: -19, -7: -110, -9: -32}, -5)


def test_ports_are_listed_with_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(here, "list_controllers", lambda: [SEVERAL[2], FoundController(UNREAD, "1-1")])
    assert [(each.device, each.description[:20]) for each in ports()] == [
        ("usb:2ED07@2-3", "Performax controller"),
        ("usb:unread@1-1", ("the maker's driver holds it" if sys.platform == "win32" else f"copy {RULE}")[:20]),
    ]

    def missing() -> list[FoundController]:
        raise Unreachable("usb: needs libusb")

    monkeypatch.setattr(here, "list_controllers", missing)
    assert ports() == []


class Fault(Exception):
    """An error of libusb."""


class Late(Fault):
    """Nothing came in time."""


USB1: Any = SimpleNamespace(USBError=Fault, USBErrorTimeout=Late)


class Device:
    """A device as the library shows it; `number` is in its descriptor, `dn` what it replies to DN."""

    def __init__(
        self, bus: int, ports: list[int], number: str | None, dn: str = "", vendor: int = VENDOR, product: int = PRODUCT
    ) -> None:
        self.bus, self.ports, self.number, self.dn, self.vendor, self.product = bus, ports, number, dn, vendor, product
        self.log: list[object] = []
        self.replies = [b"stale\0"]

    def getVendorID(self) -> int:  # noqa: N802
        return self.vendor

    def getProductID(self) -> int:  # noqa: N802
        return self.product

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
        assert (request[:2], request[3:]) == ((0x40, 0x02), (0, b"", 100))
        self.log.append(request[2])

    def bulkWrite(self, endpoint: int, data: bytes, timeout: int) -> None:  # noqa: N802
        assert (endpoint, timeout) == (OUT, 100)
        self.log.append(data)
        if self.dn != "mute":
            self.replies.append(self.dn.encode("latin-1").ljust(64, b"\0"))

    def bulkRead(self, endpoint: int, size: int, timeout: int) -> bytearray:  # noqa: N802
        assert (endpoint, size, timeout) == (IN, 64, 100)
        if not self.replies:
            raise Late
        return bytearray(self.replies.pop(0))

    def close(self) -> None:
        self.log.append("closed")


def on(*devices: Device) -> Any:
    """The library's context on a machine with these devices."""

    def every(skip_on_error: bool) -> Iterator[Device]:
        assert skip_on_error, "one that cannot be looked at hides no other"
        return iter(devices)

    return SimpleNamespace(getDeviceIterator=every)


def test_the_number_is_in_the_descriptor_or_asked_for() -> None:
    silent = Device(1, [2], None)
    asked = Device(1, [1], "", dn="2ED03")
    others = Device(1, [9], "x", vendor=1), Device(1, [8], "x", product=1)
    found = controllers(USB1, on(Device(2, [3, 10], "2ED01"), Device(12, [], "forbidden"), asked, silent, *others))
    assert [each.url for each in found] == ["usb:2ED03@1-1", "usb:unread@1-2", "usb:2ED01@2-3.10", "usb:unread@12-0"]
    assert [each.path for each in found][1:3] == ["/dev/bus/usb/001/004", "/dev/bus/usb/002/004"]
    assert found[0].device is asked
    assert asked.log == [UsbControl.OPEN, UsbControl.FLUSH, b"DN\0", UsbControl.CLOSE, "closed"]
    assert silent.log == ["closed"]


@for_each(
    ("dn", "left", "number"),
    [
        ("2ED03", [], "2ED03"),  # an earlier session has left nothing
        ("2ED03\0and what was in the block before", [b"stale\0"], "2ED03"),
        ("?DN", [], UNREAD),
        ("2ED\xe9", [], UNREAD),
        ("\0", [], UNREAD),
        ("mute", [], UNREAD),
    ],
)
def test_what_is_no_number_counts_as_unread(dn: str, left: list[bytes], number: str) -> None:
    device = Device(1, [1], None, dn=dn)
    device.replies = left[:]
    [found] = controllers(USB1, on(device))
    assert found.number == number and device.log[-1] == "closed" and device.log.count(b"DN\0") == 1


def test_a_machine_is_looked_at_anew_for_its_list_and_may_have_no_usb(monkeypatch: pytest.MonkeyPatch) -> None:
    fails: list[Fault] = []

    @contextlib.contextmanager
    def context() -> Iterator[Any]:
        if fails:
            raise fails.pop()
        yield on(Device(1, [1], "2ED01"), Device(1, [2], "2ED02"))

    monkeypatch.setattr(here, "library", lambda: SimpleNamespace(USBContext=context, USBError=Fault))
    listed = [
        FoundController("2ED01", "1-1", "/dev/bus/usb/001/004"),
        FoundController("2ED02", "1-2", "/dev/bus/usb/001/004"),
    ]
    assert list_controllers() == listed, "without the library's devices, whose context has ended"
    fails.append(Fault())
    assert list_controllers() == []


class Library:
    """The Python side of libusb, and what it was told to load."""

    def __init__(self) -> None:
        self.loaded: list[object] = []
        self.problem: Exception | None = None

    def loadLibrary(self, *library: object) -> None:  # noqa: N802
        if self.problem is not None:
            raise self.problem
        self.loaded.append(library)


@pytest.fixture
def usb1(monkeypatch: pytest.MonkeyPatch) -> Library:
    """An installed library, with a libusb beside it in a package."""
    made = Library()
    monkeypatch.setitem(sys.modules, "usb1", made)
    monkeypatch.setattr(here, "find_spec", lambda name: SimpleNamespace(origin=f"/lib/{name}/__init__.py"))
    monkeypatch.setattr(here, "ctypes", SimpleNamespace(CDLL=lambda path: f"loaded {Path(path).as_posix()}"))
    return made


@pytest.mark.parametrize(("platform", "ending"), [("win32", "dll"), ("darwin", "dylib"), ("linux", "so")])
def test_the_libusb_of_the_package_is_loaded_first(
    usb1: Library, monkeypatch: pytest.MonkeyPatch, platform: str, ending: str
) -> None:
    monkeypatch.setattr(here, "sys", SimpleNamespace(platform=platform, modules=sys.modules))
    found: object = library()
    assert found is usb1
    assert usb1.loaded == [(f"loaded /lib/libusb_package/libusb-1.0.{ending}",), ()]


def test_without_a_fitting_package_it_is_the_libusb_of_the_system(
    usb1: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unfit(path: str) -> None:
        raise OSError("wrong ELF class")

    monkeypatch.setattr(here, "ctypes", SimpleNamespace(CDLL=unfit))
    library()
    for carried in (None, SimpleNamespace(origin=None)):
        monkeypatch.setattr(here, "find_spec", lambda name, carried=carried: carried)
        library()
    assert usb1.loaded == [()] * 3


@pytest.mark.parametrize("problem", [OSError("no libusb"), AttributeError("an old libusb"), ImportError("half of it")])
def test_without_a_libusb_the_refusal_names_the_extra(usb1: Library, problem: Exception) -> None:
    usb1.problem = problem
    with pytest.raises(Unreachable, match=r"^usb: needs libusb: pip install 'multidrop\[usb\]'$"):
        library()


def test_without_the_library_the_refusal_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "usb1", None)
    with pytest.raises(Unreachable, match=r"^usb: needs libusb: pip install"):
        library()
