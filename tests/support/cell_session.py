"""A session on a simulated cell in virtual time: what moves is asked of the simulator, never of the session."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from multidrop.dialects.units import scale
from multidrop.drives.events import Traffic
from multidrop.shell.configuration import Guarding, SavedConnection, Settings
from multidrop.shell.connect.opening import Opener
from multidrop.shell.events import Failed, Notified, OnBus, Output, Printed
from multidrop.shell.session import Session
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor


def bus(name: str, *drives: str, baud: int = 9600, serve: Sequence[str] = ()) -> str:
    """A bus of a cell file; a drive is its lines. `serve`: where it is served."""
    served = f"serve = {json.dumps(serve)}\n" if serve else ""
    return f'[[bus]]\nname = "{name}"\n{served}baud = {baud}\n' + "".join(f"[[bus.drive]]\n{each}\n" for each in drives)


def drive(personality: str, name: str = "", *lines: str, party: bool = False, **settings: int) -> str:
    """A drive, as it is from the factory but for these settings; further lines of its table."""
    table = f'personality = "{personality}"\n'
    if name:
        table += f'name = "{name}"\n'
    if party:
        table += "party = true\n"
    if settings:
        table += "set = { " + ", ".join(f"{key} = {value}" for key, value in settings.items()) + " }\n"
    return table + "\n".join(lines)


def party(name: str, *lines: str, **settings: int) -> str:
    """A drive on a party line."""
    return drive("LMDCM", name, *lines, party=True, **{"EM": 1, "CK": 1, **settings})


ETHERNET = 'personality = "LMDCE"'


TCP = ["tcp://127.0.0.1:0"]


def pmx(number: str, *lines: str) -> str:
    """A controller with its device number."""
    return drive("PMX", number, *lines)


def moves(device: Any, now: float) -> bool:
    """Whether a simulated drive moves, an axis of it where it has several."""
    if hasattr(device, "controller"):
        return any(axis.pulses.profile.moving(now) or axis.homing is not None for axis in device.controller.axes)
    if hasattr(device, "motors"):
        return any(motor.moving(now) for motor in device.motors)
    return bool(device.moving(now))


@asynccontextmanager
async def session_on(folder: Path, cell: str, *, opened: bool = True, agreed: bool = False) -> AsyncIterator[Any]:
    """A session on a cell, opened unless told otherwise; `events` is all that it told."""
    (folder / "cell.toml").write_text(cell)
    session: Any = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"))
    session.questions.agreed, session.events = agreed, []
    session.subscribe(session.events.append)
    try:
        if opened:
            await session.open(f"sim:{folder / 'cell.toml'}")
        yield session
    finally:
        await session.close()


def _on_usb(path: Path) -> dict[str, SavedConnection]:
    """A saved connection for the first controller of each bus."""
    buses = enumerate(load(path).buses, 1)
    return {bus.name: SavedConnection(bus.name, f"usb:2ED{bus.drives[0].name}@1-{n}") for n, bus in buses}


class CellSession:
    """`async with`: the session of a cell, open, and what it told. `bus:name` names a drive of the cell.

    It agrees to every question. `units`: the scales of a saved connection; `guards`: those that are off. `usb`: the
    cell is of controllers; the first of each bus is on the USB of this machine, under the name of its bus.
    """

    def __init__(
        self,
        folder: Path,
        *buses: str,
        reconnect: bool = False,
        units: Mapping[str, Any] = MappingProxyType({}),
        own: tuple[str, ...] = (),
        guards: Sequence[str] = (),
        usb: bool = False,
        opener: Opener | None = None,
    ) -> None:
        if usb:
            pytest.importorskip("multidrop.features.usb")
        (folder / "cell.toml").write_text("".join(buses))
        self.path, self.usb = folder / "cell.toml", usb
        self.url = f"sim:{self.path}"
        saved = _on_usb(self.path) if usb else {}
        if units:
            scales = {axis: scale(found, own) for axis, found in units.items()}
            saved, self.url = {"saved": SavedConnection("saved", self.url, {}, scales)}, "saved"
        off = Guarding(off=frozenset(guards))
        settings = Settings(saved, folder / "config", folder / "state", off, own_units=own, data=folder / "data")
        self.session = Session(settings, reconnect=reconnect, opener=opener)
        self.session.questions.agreed = True
        self._open = ExitStack()
        self.events: list[Any] = []
        self.session.subscribe(self.events.append)

    async def __aenter__(self) -> CellSession:
        if self.usb:
            from tests.support.usb_stand_in import plugged_in

            self._running = RunningFloor(Floor(load(self.path)))
            self._open.callback(self._running.close)
            self._open.enter_context(plugged_in(self._running, self.session.settings.connections))
        for url in self.session.settings.connections if self.usb else [self.url]:
            await self.session.open(url)
        self.events.clear()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.session.close()
        self._open.close()

    @property
    def floor(self) -> Any:
        """The simulated cell, which runs."""
        return self._running if self.usb else next(iter(self.session.cells.values()))

    def address(self, number: str) -> str:
        """The address of a controller: none on USB."""
        return "" if self.usb else number

    def moving(self) -> set[str]:
        """Which drives move, in the simulator."""
        floor = self.floor
        return {
            f"{placed.bus}:{placed.spec.name}" for placed in floor.floor.drives if moves(placed.device, floor.now())
        }

    def device(self, name: str) -> Any:
        """A simulated drive, as `bus:name`."""
        drives = self.floor.floor.drives
        return next(placed.device for placed in drives if f"{placed.bus}:{placed.spec.name}" == name)

    def world(self, command: str) -> None:
        """A `/sim` line."""
        self.floor.command(command)

    def told(self, *kinds: type) -> list[str]:
        """What was narrated or failed."""
        return [event.text for event in self.events if isinstance(event, kinds or (Notified, Failed))]

    def warned(self) -> list[str]:
        """What was narrated as a warning."""
        return [event.text for event in self.events if isinstance(event, Notified) and event.warning]

    def printed(self) -> list[str]:
        """What went to standard output."""
        return [event.text for event in self.events if isinstance(event, Printed | Output)]

    def written(self, name: str) -> bytes:
        """What was written to a bus."""
        return b"".join(
            event.event.data
            for event in self.events
            if isinstance(event, OnBus)
            and event.bus == name
            and isinstance(event.event, Traffic)
            and event.event.outgoing
        )
