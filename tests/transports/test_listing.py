"""The list of serial ports, on an imaginary machine."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.transports.port_users import holder
from multidrop.transports.serial_ports import PortInfo, list_ports, natural, stable_name

if sys.platform == "win32":
    from multidrop.transports.port_users import mark


def listed(device: str, description: str | None) -> SimpleNamespace:
    """A port without USB."""
    return SimpleNamespace(device=device, description=description, vid=None, pid=None, serial_number=None)


def machine(monkeypatch: pytest.MonkeyPatch, root: Path, names: Sequence[str]) -> list[str]:
    (root / "dev").mkdir()
    devices = [root / "dev" / name for name in names]
    for device in devices:
        device.touch()
    found = [listed(str(each), f"adapter {each.name}") for each in devices]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    return [str(device) for device in devices]


def link(root: Path, folder: str, name: str, device: str) -> str:
    (root / folder).mkdir(parents=True, exist_ok=True)
    (root / folder / name).symlink_to(device)
    return str(root / folder / name)


def test_ports_come_in_the_order_of_their_numbers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    machine(monkeypatch, tmp_path, ["ttyUSB10", "ttyUSB9", "ttyACM0"])
    assert [Path(port.device).name for port in list_ports(tmp_path)] == ["ttyACM0", "ttyUSB9", "ttyUSB10"]


@pytest.mark.fork
def test_the_stable_name_is_the_adapters_else_the_sockets(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    first, second, _ = machine(monkeypatch, tmp_path, ["ttyUSB0", "ttyUSB1", "ttyUSB2"])
    by_id = link(tmp_path, "dev/serial/by-id", "usb-FTDI_A10-if00-port0", first)
    link(tmp_path, "dev/serial/by-path", "pci-0000:00:14.0-usb-0:1", first)
    by_path = link(tmp_path, "dev/serial/by-path", "pci-0000:00:14.0-usb-0:2", second)
    assert [port.stable_name for port in list_ports(tmp_path)] == [by_id, by_path, ""]


def test_ports_without_hardware_are_left_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    machine(monkeypatch, tmp_path, ["ttyS0", "ttyS1", "ttyUSB0"])
    for name, kind in (("ttyS0", "4\n"), ("ttyS1", "0\n")):
        (tmp_path / "sys/class/tty" / name).mkdir(parents=True)
        (tmp_path / "sys/class/tty" / name / "type").write_text(kind)
    assert [Path(port.device).name for port in list_ports(tmp_path)] == ["ttyS0", "ttyUSB0"]


def test_a_port_that_says_nothing_of_itself_has_no_description(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [listed("COM3", "n/a"), listed("COM4", None)]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    assert list_ports() == [PortInfo("COM3"), PortInfo("COM4")]


def test_listing_this_machine_works() -> None:
    assert all(port.device for port in list_ports())


@given(st.lists(st.integers(0, 10**6), unique=True), st.sampled_from(["COM", "/dev/ttyUSB", "/dev/tty.usb2-"]))
def test_natural_order_is_that_of_the_numbers(numbers: list[int], prefix: str) -> None:
    names = [f"{prefix}{number}" for number in numbers]
    assert sorted(names, key=natural) == [f"{prefix}{number}" for number in sorted(numbers)]


@pytest.mark.parametrize("name", ["COM31", r"\\.\CNCA0", "/dev/ttyUSB31"])
def test_windows_names_the_process_of_multidrop_that_has_a_port_of_any_name(name: str) -> None:
    if sys.platform == "win32":
        assert holder(name) is None
        with contextlib.closing(mark(name)):
            assert str(holder(name)) == "this program itself"
        assert holder(name) is None


@pytest.mark.fork
def test_on_macos_a_ports_own_name_has_the_adapters_serial_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    assert stable_name("/dev/cu.usbserial-A5069RR4") == "/dev/cu.usbserial-A5069RR4"
