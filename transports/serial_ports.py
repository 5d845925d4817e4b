"""The serial ports of this machine."""

from __future__ import annotations

import os
import re
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

_COM = re.compile(r"(?:\\\\[.?]\\)?(COM[0-9]+)", re.IGNORECASE)
_LINKS = ("dev/serial/by-id", "dev/serial/by-path")


@dataclass(frozen=True)
class PortInfo:
    """A port: its current name, its stable name, and a description."""

    device: str
    stable_name: str = ""
    """A name that follows the adapter, or else the socket that it is plugged into; empty if there is none.

    On Windows it is made of the adapter's USB serial number.
    """
    description: str = ""


def list_ports(root: Path = Path("/")) -> list[PortInfo]:
    """List the ports in the order of their numbers. `root` is the folder of `dev` and `sys`."""
    from serial.tools import list_ports as pyserial

    listed = pyserial.comports()
    stable = usb_names(listed) if sys.platform == "win32" else _stable_names(root)
    infos = [
        PortInfo(
            port.device,
            stable.get(port.device if sys.platform == "win32" else os.path.realpath(port.device), ""),
            "" if port.description in (None, "n/a") else str(port.description),
        )
        for port in listed
        if _has_hardware(port.device, root)
    ]
    return sorted(infos, key=lambda port: natural(port.device))


def stable_name(device: str, root: Path = Path("/")) -> str:
    """Return the stable name of a port, or the given one if it has none."""
    if sys.platform == "win32":
        from serial.tools import list_ports as pyserial

        return usb_names(pyserial.comports()).get(com_name(device), com_name(device))
    return _stable_names(root).get(os.path.realpath(device), os.path.abspath(device) if "/" in device else device)


def present(name: str) -> str:
    """Return the port that a name leads to now; empty: it is not there. It may take a while on Windows."""
    if sys.platform == "win32":
        import ctypes

        if not name.startswith("usb-"):
            target = ctypes.create_unicode_buffer(1024)
            return name if ctypes.windll.kernel32.QueryDosDeviceW(com_name(name), target, 1024) else ""
        from serial.tools import list_ports as pyserial

        return next((port for port, stable in usb_names(pyserial.comports()).items() if stable == name), "")
    return name if os.path.exists(name) else ""


def com_name(port: str) -> str:
    r"""Return the one form of a COM port's name: `COM10` for `com10` and `\\.\COM10`; other names as they are."""
    match = _COM.fullmatch(port)
    return match[1].upper() if match else port


def usb_names(ports: Iterable[ListPortInfo]) -> dict[str, str]:
    """Return the name by USB serial number of each port that has one to itself, as in `usb-0403-6001-A5069RR4`."""
    names = {
        port.device: f"usb-{port.vid:04x}-{port.pid:04x}-{port.serial_number}"
        for port in ports
        if port.vid is not None and port.pid is not None and re.fullmatch(r"\w+", port.serial_number or "")
    }
    ports_of = Counter(names.values())
    return {device: name for device, name in names.items() if ports_of[name] == 1}


def natural(name: str) -> list[tuple[int, str]]:
    """A sort key that puts COM9 before COM10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", name)]


def _has_hardware(device: str, root: Path) -> bool:
    """True if a port has a chip: Linux creates some `ttyS` without one, and gives them type 0."""
    try:
        return (root / "sys/class/tty" / Path(device).name / "type").read_text().strip() != "0"
    except OSError:
        return True


def _stable_names(root: Path) -> dict[str, str]:
    names: dict[str, str] = {}
    for folder in _LINKS:
        for link in _entries(root / folder):
            names.setdefault(os.path.realpath(link), str(link))
    return names


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []
