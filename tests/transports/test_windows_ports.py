"""The serial ports of an imaginary Windows: their names, the calls to pyserial, and what is told of a refusal."""

from __future__ import annotations

import asyncio
import ctypes
import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
import serial

from multidrop.transports import Unreachable, serial_port
from multidrop.transports.port_users import User
from multidrop.transports.serial_port import SerialDevice, open_error, open_serial
from multidrop.transports.serial_ports import PortInfo, com_name, list_ports, present, stable_name, usb_names
from multidrop.transports.threaded import closing
from tests.support.cases import for_each
from tests.support.until import until


@dataclass
class Port:
    """One port as pyserial opens it. A read of more than has arrived waits for its time."""

    name: str
    baudrate: int
    timeout: float
    write_timeout: float
    exclusive: bool
    arrived: bytearray = field(default_factory=bytearray)
    written: bytearray = field(default_factory=bytearray)
    pieces: list[int] = field(default_factory=list)
    out_waiting: int = 0
    waited: float = 0.0
    done: list[str] = field(default_factory=list)
    fails: Exception | None = None
    dtr = rts = break_condition = False

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "baudrate" and value == 7:
            raise ValueError("Not a valid baudrate: 7")
        if name == "baudrate" and value == 8:
            object.__setattr__(self, name, 4800)  # some adapters have set something by then
            raise OSError(22, "refused by the driver")
        object.__setattr__(self, name, value)

    def _do(self, what: str) -> None:
        if self.fails is not None:
            raise self.fails
        self.done.append(what)

    @property
    def in_waiting(self) -> int:
        return len(self.arrived)

    def read(self, size: int) -> bytes:
        if self.fails is not None:
            raise self.fails
        if len(self.arrived) < size:
            self.waited += self.timeout
        data = bytes(self.arrived[:size])
        del self.arrived[:size]
        return data

    def write(self, data: bytes) -> None:
        if self.fails is not None:
            raise self.fails
        self.written += data
        self.pieces.append(len(data))

    def reset_output_buffer(self) -> None:
        self._do("reset output")

    def cancel_read(self) -> None:
        self._do("cancel read")

    def cancel_write(self) -> None:
        self._do("cancel write")

    def close(self) -> None:
        self._do("close")


class Windows:
    """A machine with these ports."""

    def __init__(self) -> None:
        self.ports = {"COM3": usb("COM3", 0x0403, 0x6001, "A5069RR4"), "COM10": usb("COM10")}
        self.others: dict[str, User] = {}
        self.opened: list[Port] = []
        self.marks: list[Any] = []
        self.closed_marks: list[Any] = []
        self.error: Exception | None = None

    def open(self, name: str, baud: int, **given: Any) -> Port:
        if self.error is not None:
            raise self.error
        self.opened.append(Port(name, baud, **given))
        return self.opened[-1]

    def mark(self, name: str) -> Any:
        self.marks.append(name)
        return SimpleNamespace(close=lambda: self.closed_marks.append(name))

    def device(self, name: str, target: Any, size: int) -> int:
        """QueryDosDeviceW."""
        assert size == len(target) >= 300, "a name of Windows with its ending"
        return 20 if name in self.ports else 0


def usb(
    device: str, vid: int | None = None, pid: int | None = None, number: str | None = None, description: Any = "n/a"
) -> SimpleNamespace:
    return SimpleNamespace(device=device, vid=vid, pid=pid, serial_number=number, description=description)


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[Windows]:
    machine = Windows()
    with monkeypatch.context() as patched:
        patched.setattr(serial, "Serial", machine.open)
        patched.setattr("serial.tools.list_ports.comports", lambda: machine.ports.values())
        patched.setattr(serial_port, "holder", machine.others.get)
        patched.setattr(serial_port, "mark", machine.mark, raising=False)
        kernel = SimpleNamespace(QueryDosDeviceW=machine.device)
        patched.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
        patched.setattr("sys.platform", "win32")
        yield machine


# Names


@for_each(
    "given, name",
    [
        ("COM3", "COM3"),
        ("com10", "COM10"),
        (r"\\.\com10", "COM10"),
        (r"\\?\COM7", "COM7"),
        (r"\\.\CNCA0", r"\\.\CNCA0"),
        ("COM", "COM"),
        ("COM3x", "COM3x"),
        ("usb-0403-6001-A5069RR4", "usb-0403-6001-A5069RR4"),
    ],
)
def test_a_com_port_has_one_name_however_it_is_spelled(given: str, name: str) -> None:
    assert com_name(given) == name


def test_a_name_by_serial_number_needs_ids_and_a_number_of_its_own() -> None:
    ports: list[Any] = [
        usb("COM1", 0x0403, 0x6001, "A1"),
        usb("COM2", 0x0403, 0x6001, "TWICE"),
        usb("COM3", 0x0403, 0x6001, "TWICE"),
        usb("COM4", 0x0403, 0x6015, "TWICE"),
        usb("COM5", 0x0403, 0x6001, None),
        usb("COM6", 0x0403, 0x6001, ""),
        usb("COM7", 0x0403, 0x6001, "a b"),
        usb("COM8", None, 0x6001, "A8"),
        usb("COM9", 0x0403, None, "A9"),
        usb("COM10", 0, 0, "A10"),
    ]
    assert usb_names(ports) == {
        "COM1": "usb-0403-6001-A1",
        "COM4": "usb-0403-6015-TWICE",
        "COM10": "usb-0000-0000-A10",
    }


def test_ports_are_listed_in_their_order_with_their_lasting_names(windows: Windows) -> None:
    windows.ports = {
        each.device: each
        for each in (
            usb("COM10", description="Serial"),
            usb("COM9", description=None),
            usb("COM3", 0x0403, 0x6001, "A5069RR4", "USB Serial Port (COM3)"),
        )
    }
    assert list_ports() == [
        PortInfo("COM3", "usb-0403-6001-A5069RR4", "USB Serial Port (COM3)"),
        PortInfo("COM9"),
        PortInfo("COM10", "", "Serial"),
    ]


def test_a_ports_lasting_name_leads_to_where_it_is_plugged_in_now(windows: Windows) -> None:
    assert [stable_name(each) for each in ("COM3", r"\\.\com3", "com10", "COM99")] == [
        "usb-0403-6001-A5069RR4",
        "usb-0403-6001-A5069RR4",
        "COM10",
        "COM99",
    ]
    for name, found in [
        ("usb-0403-6001-A5069RR4", "COM3"),
        ("usb-0403-6001-OTHER", ""),
        ("com10", "com10"),
        (r"\\.\COM3", r"\\.\COM3"),
        ("COM99", ""),
    ]:
        assert present(name) == found


# One port


@for_each(
    "given, name",
    [
        ("com10", "COM10"),
        ("usb-0403-6001-A5069RR4", "COM3"),
        ("COM99", "COM99"),
        ("usb-0403-6001-X", "usb-0403-6001-X"),
    ],
)
def test_a_port_is_opened_for_us_alone_by_its_name_of_now_and_marked(windows: Windows, given: str, name: str) -> None:
    device, port = SerialDevice(given, 19200), windows.opened[-1]
    assert (device.name, port.name, port.baudrate, port.exclusive) == (name, name, 19200, True)
    assert port.timeout < 0.9, "a read that waits ends before a close gives up"
    assert port.write_timeout == 10.0
    assert device.control.baud == 19200
    assert windows.marks[-1] == name and name not in windows.closed_marks
    device.close()
    assert port.done == ["close"] and windows.closed_marks[-1] == name


def test_a_port_of_another_multidrop_is_not_opened_twice(windows: Windows) -> None:
    windows.others["COM10"] = User("multidrop", 77)
    with pytest.raises(Unreachable, match=r"^COM10 is in use by multidrop \(pid 77\); close it there$"):
        SerialDevice("com10", 9600)
    assert windows.opened == []


def test_a_read_takes_all_that_has_arrived_and_waits_for_no_more(windows: Windows) -> None:
    device, port = SerialDevice("COM3", 9600), windows.opened[0]
    for arrived in (b"0", b"51200\r\n"):
        port.arrived += arrived
        assert (device.read(), port.waited) == (arrived, 0.0)
    assert (device.read(), port.waited) == (b"", port.timeout)
    device.write(b"PR P\r\n")
    assert port.written == b"PR P\r\n"


def test_a_stop_empties_the_drivers_queue_and_ends_what_waits(windows: Windows) -> None:
    device, port = SerialDevice("COM3", 9600), windows.opened[0]
    port.out_waiting = 300
    assert device.abort() == 300
    device.cancel()
    assert port.done == ["reset output", "cancel read", "cancel write"]
    port.fails = OSError("gone")
    assert device.abort() == 0
    device.cancel()
    device.close()
    assert windows.closed_marks == ["COM3"]


def test_a_port_that_another_thread_closed_is_a_loss_and_no_defect(windows: Windows) -> None:
    device, port = SerialDevice("COM3", 9600), windows.opened[0]
    port.fails = TypeError("byref() argument must be a ctypes instance")
    for use in (device.read, lambda: device.write(b"PR P\r\n")):
        with pytest.raises(OSError, match="byref"):
            use()


@for_each(
    "error, told",
    [
        (None, "the port is gone (unplugged?); plug it in"),
        (OSError("ClearCommError failed"), "the port is gone (unplugged?); plug it in (ClearCommError failed)"),
        (
            serial.SerialTimeoutException("Write timeout"),
            "it has taken no byte for 10 s (does its adapter hang?); plug it out and in",
        ),
    ],
)
def test_the_loss_of_a_port_is_told_with_its_remedy(windows: Windows, error: OSError | None, told: str) -> None:
    assert SerialDevice("COM3", 9600).explain(error) == told


def test_the_settings_of_a_port_change_and_after_a_refusal_are_as_before(windows: Windows) -> None:
    control, port = SerialDevice("COM3", 9600).control, windows.opened[0]
    control.set_dtr(True)
    assert (port.dtr, port.rts, port.break_condition) == (True, False, False)
    control.set_rts(True)
    assert (port.dtr, port.rts, port.break_condition) == (True, True, False)
    control.set_dtr(False)
    control.set_break(True)
    assert (port.dtr, port.rts, port.break_condition) == (False, True, True)
    control.set_baud(19200)
    assert (port.baudrate, control.baud) == (19200, 19200)
    for refused, told in ((7, "Not a valid baudrate"), (8, "refused by the driver")):
        with pytest.raises(OSError, match=told):
            control.set_baud(refused)
        assert (port.baudrate, control.baud) == (19200, 19200)


async def test_an_open_port_passes_bytes_on_through_threads_and_is_free_after_its_close(windows: Windows) -> None:
    transport, data = await open_serial("com3"), bytearray()
    port = windows.opened[0]
    assert (transport.name, port.name, port.baudrate) == ("COM3", "COM3", 9600)
    assert transport.control is not None and transport.control.baud == 9600
    port.arrived += b"51200\r\n"
    transport.start(data.extend, lambda loss: None)
    transport.write(b"x" * 1000)
    await until(lambda: data == b"51200\r\n" and len(port.written) == 1000)
    assert port.pieces == [256, 256, 256, 232], "no more than one of them cannot be taken back"
    await transport.close()
    await until(lambda: "COM3" not in closing)
    assert windows.closed_marks == ["COM3"]


async def test_a_port_whose_driver_does_not_return_from_its_close_is_not_opened_again(windows: Windows) -> None:
    closing.add("COM10")
    try:
        with pytest.raises(Unreachable, match="^com10 is still being closed: its driver does not return; unplug it"):
            await open_serial("com10")
        await (await open_serial("COM3")).close()
    finally:
        closing.discard("COM10")
    await until(lambda: not closing)


async def test_an_opening_that_is_cancelled_closes_the_port_that_it_gets(windows: Windows) -> None:
    opening = asyncio.create_task(open_serial("COM3"))
    await asyncio.sleep(0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    await until(lambda: windows.opened and windows.opened[0].done == ["close"])


# Refusals

ERROR = "could not open port 'COM3': OSError(0, 'In some language', None, {})"


@for_each(
    "numbers, told",
    [
        ((2, 3, 433, 1167), "no port COM3; plug it in, or see `multidrop ports`"),
        ((5, 32), "COM3 is in use by another program; close it there"),
        ((22, 31, 1117), "COM3 does not work (its driver says so); plug it out and in"),
        ((121,), "COM3 does not answer: the device at its other end is off, or out of reach (Bluetooth)"),
        ((87,), "COM3 is not a serial port, or refuses a setting; see `multidrop ports`"),
        ((99,), f"COM3 could not be opened: {ERROR.format(99)}"),
    ],
)
async def test_an_error_number_of_windows_is_told_with_its_remedy(
    windows: Windows, numbers: tuple[int, ...], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "taker", lambda: "")
    for number in numbers:
        windows.error = serial.SerialException(ERROR.format(number))
        with pytest.raises(Unreachable) as caught:
            await open_serial("COM3")
        assert str(caught.value) == told


async def test_a_rate_that_the_port_has_not_is_told_as_that(windows: Windows) -> None:
    windows.error = ValueError("Not a valid baudrate: 9601")
    with pytest.raises(Unreachable) as caught:
        await open_serial("COM3", 9601)
    assert str(caught.value) == "COM3: cannot be set to 9601 baud (Not a valid baudrate: 9601)"


def test_an_error_without_a_number_of_windows_is_told_as_it_is(windows: Windows) -> None:
    assert str(open_error("COM3", OSError(13, "Permission denied"))) == "COM3 could not be opened: Permission denied"


@for_each(
    "name, has, lacks", [("serial_port", "SerialDevice", "SerialEndpoint"), ("sockets", "SocketDevice", "output_queue")]
)
def test_nothing_of_posix_is_asked_for_where_it_is_not(name: str, has: str, lacks: str) -> None:
    found = importlib.import_module(f"multidrop.transports.{name}").__file__
    assert found is not None
    spec = importlib.util.spec_from_file_location(f"{name}_on_windows", found)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patched:
        for each in ("fcntl", "termios", "grp", "pwd"):
            patched.setitem(sys.modules, each, None)
        patched.setattr("multidrop.transports.port_users.mark", None, raising=False)
        patched.setattr("sys.platform", "win32")
        spec.loader.exec_module(module)
    assert has in vars(module) and lacks not in vars(module)
