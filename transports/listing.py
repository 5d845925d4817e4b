"""The serial ports of this machine."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports as pyserial

_LINKS = ("dev/serial/by-id", "dev/serial/by-path")


@dataclass(frozen=True)
class PortInfo:
    """A port as it is called now, as it is called after every start and in every socket, and what it is."""

    device: str
    stable_name: str = ""
    """A link that stays with the adapter (else with the socket that it is in); empty where there is none."""
    description: str = ""


def list_ports(root: Path = Path("/")) -> list[PortInfo]:
    """The ports that there are, in the order of their numbers. `root`: the folder of `dev` and `sys`."""
    stable = _stable_names(root)
    found = [
        PortInfo(port.device, stable.get(os.path.realpath(port.device), ""), _words(port.description))
        for port in pyserial.comports()
        if _has_hardware(port.device, root)
    ]
    return sorted(found, key=lambda port: natural(port.device))


def stable_name(device: str, root: Path = Path("/")) -> str:
    """What a port is called after every start and in every socket; as it is given where nothing tells."""
    return _stable_names(root).get(os.path.realpath(device), os.path.abspath(device) if "/" in device else device)


def natural(name: str) -> list[tuple[int, str]]:
    """A sort key in which COM9 stands before COM10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", name)]


def _words(description: str | None) -> str:
    return "" if description in (None, "n/a") else str(description)


def _has_hardware(device: str, root: Path) -> bool:
    """Linux makes some `ttyS` whether there is a chip behind them or not; type 0 is "none found"."""
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
