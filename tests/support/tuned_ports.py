"""Simulated buses as ports with a baud rate: bytes of another rate arrive as garbage, both ways, in virtual time."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.drives.bus import Bus
from multidrop.shell.configuration import Settings
from multidrop.shell.connect import opening
from multidrop.shell.connect.opening import OpenedBus
from multidrop.shell.events import Notified, Output, Progressed
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from multidrop.simulator.wire import resample
from multidrop.transports import Transport


def lead_to(monkeypatch: pytest.MonkeyPatch, transport: Callable[..., Awaitable[Any]]) -> None:
    """Have every port that a session opens be what this makes of its connection, time limit and baud rate."""
    monkeypatch.setattr(opening, "_transport", transport)


class TunedPipe(Transport):
    """A transport to a bus at a baud rate; `repeats`: the adapter gives back what it sends."""

    gathers = False

    def __init__(self, floor: RunningFloor, bus: str, baud: int, repeats: bool) -> None:
        self.name, self._floor, self._bus, self._baud, self._repeats = "port", floor, bus, baud, repeats
        self._received: Any = None
        self.written = b""
        self._detach = floor.attach(bus, self)

    def start(self, received: Any, lost: Any) -> None:
        self._received, self._lost = received, lost

    def hear(self, data: bytes) -> None:
        """Have the host receive bytes that no drive has sent."""
        self._received(data)

    def write(self, data: bytes) -> bool:
        self.written += data
        if self._repeats:
            self._floor.loop.call_soon(self._received, data)
        self._floor.write(self._bus, data, 0, self._baud)
        return True

    def receive(self, data: bytes) -> None:
        wire = self._floor.floor.wires[self._bus].baud
        if self._received is not None:
            self._floor.loop.call_soon(self._received, resample(data, wire, self._baud))

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None:
        self._detach()

    def unplugged(self) -> None: ...
    def plugged(self) -> None: ...
    def disconnected(self) -> None: ...
    def connectable(self) -> None: ...
    def commanded(self) -> None: ...


class Port:
    """A serial port with simulated drives on it, and a session; `opened` lists each opening: language, baud rate."""

    def __init__(self, folder: Path, cell: str, repeats: bool = False) -> None:
        self.session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))
        self.events: list[Any] = []
        self.session.subscribe(self.events.append)
        self.floor = RunningFloor(Floor(read(cell, "cell.toml")))
        self.opened: list[tuple[str, int]] = []
        self.repeats = repeats
        self.pipes: list[TunedPipe] = []

    async def opener(self, connection: Any, naming: Any) -> list[OpenedBus]:
        family = connection.hints.family or "mcode"
        baud = connection.baud or FAMILIES[family].baud
        self.opened.append((family, baud))
        pipe: Any = TunedPipe(self.floor, next(iter(self.floor.floor.wires)), baud, self.repeats)
        self.pipes.append(pipe)
        made = Bus(naming(connection.short), pipe, baud=baud, local_echo=connection.local_echo, family=family)
        return [OpenedBus(made, connection.hints)]

    @property
    def devices(self) -> list[Any]:
        return [placed.device for placed in self.floor.floor.drives]

    def told(self, *kinds: type) -> list[str]:
        return [event.text for event in self.events if isinstance(event, kinds or (Notified, Output))]

    @property
    def progress(self) -> list[Progressed]:
        return [event for event in self.events if isinstance(event, Progressed)]
