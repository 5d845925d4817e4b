"""The serial ports of this machine."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

_LINKS = ("dev/serial/by-id", "dev/serial/by-path")


@dataclass(frozen=True)
class PortInfo:
    """A port: its current name, its stable name, and a description."""

    device: str
    stable_name: str = ""
    """A link that follows the adapter, or else the socket that it is plugged into; empty if there is none."""
    description: str = ""


def list_ports(root: Path = Path("/")) -> list[PortInfo]:
    """List the ports in the order of their numbers. `root` is the folder of `dev` and `sys`."""
    from serial.tools import list_ports as pyserial

    stable = _stable_names(root)
    found = [
        PortInfo(port.device, stable.get(os.path.realpath(port.device), ""), _words(port.description))
        for port in pyserial.comports()
        if _has_hardware(port.device, root)
    ]
    return sorted(found, key=lambda port: natural(port.device))


def stable_name(device: str, root: Path = Path("/")) -> str:
    """Return the stable name of a port, or the given one if it has none."""
    return _stable_names(root).get(os.path.realpath(device), os.path.abspath(device) if "/" in device else device)


def natural(name: str) -> list[tuple[int, str]]:
    """A sort key that puts COM9 before COM10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", name)]


def _words(description: str | None) -> str:
    return "" if description in (None, "n/a") else str(description)


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


def _entries(folder: Path) -> Iterable[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return ()
