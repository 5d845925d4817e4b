"""`sim:` URLs: the buses of a cell as in-process transports, in real time, without a server or a port.

Each cell runs once in a process, however many of its buses are opened and however often. It ends when its last pipe is
closed.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.dialects.units import Scale
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import BusSpec, Cell
from multidrop.simulator.families import FAMILIES, family_of
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import Listener, RunningFloor
from multidrop.transports import Lost, Received, Transport

DEFAULT = next(iter(FAMILIES))
"""The dialect for a bus without drives."""


@dataclass(frozen=True)
class SimBus:
    """A simulated bus: its pipe, and what a URL would say about it.

    `floor.command("/sim ...")` moves the world. `names` are those of the cell file; `baud` 0 is an unpaced wire.
    """

    name: str
    transport: Transport
    names: tuple[str, ...]
    dialect: str
    party: bool
    floor: RunningFloor
    again: Callable[[], Transport]
    """Makes another pipe to the bus, after the last one broke."""
    baud: int = 0
    units: Mapping[str, Scale] = field(default_factory=lambda: MappingProxyType({}))
    """The scales of its drives, by name, or `NAME.AXIS`."""

    @property
    def present(self) -> bool:
        """Whether a pipe can be made: the bus is plugged in, and its Ethernet drive has booted."""
        return self.floor.floor.connectable(self.name) and not self.floor.floor.wires[self.name].hung_up


@dataclass
class _Running:
    """A running cell, and the number of its open pipes."""

    cell: Cell
    floor: RunningFloor
    pipes: int = 0


_running: dict[str, _Running] = {}


async def connect(target: str, allow: Sequence[Path] = ()) -> list[SimBus]:
    """Open the buses of a `sim:` URL: all of the demo cell, `#BUS`, `CELL.toml` or `CELL.toml#BUS`.

    `allow`: its paths may lead there, too. Raises Diagnostic for an error in the cell file, and for a bus that does not
    exist.
    """
    path, _, bus = target.removeprefix("sim:").partition("#")
    key = _key(path)
    running = _running.get(key)
    if running is None or running.floor.loop is not asyncio.get_running_loop():
        cell = cells.load(path, allow) if path else cells.demo()
        running = _Running(cell, RunningFloor(Floor(cell)))
    try:
        specs = _chosen(running.cell, bus, path or "demo cell")
    except Diagnostic:
        if not running.pipes:
            running.floor.close()
        raise
    _running[key] = running
    return [_open(key, running, spec, path) for spec in specs]


def _key(path: str) -> str:
    """The key of a cell file, however it is named; a name of no file is an error when it is read."""
    try:
        return os.path.realpath(path) if path else ""
    except (OSError, ValueError):  # a NUL in it, or no current folder
        return path


def _chosen(cell: Cell, bus: str, where: str) -> list[BusSpec]:
    chosen = [spec for spec in cell.buses if bus in ("", spec.name)]
    if not chosen:
        names = ", ".join(spec.name for spec in cell.buses)
        what = f'no bus "{bus}"' if bus else "the cell has no bus"
        raise Diagnostic(what, where, f"valid: {names}" if names else "")
    return chosen


def _open(key: str, running: _Running, spec: BusSpec, path: str) -> SimBus:
    def closed() -> None:
        running.pipes -= 1
        if not running.pipes:
            running.floor.close()
            if _running.get(key) is running:
                del _running[key]

    def pipe() -> SimPipe:
        running.pipes += 1
        return SimPipe(f"sim:{path}#{spec.name}", running.floor, spec.name, closed)

    families = [family_of(drive.personality) for drive in spec.drives]
    # on a mixed bus the dialect is that of a family whose drives always have an address
    chosen = next((family for family in families if family.addressed), families[0] if families else None)
    return SimBus(
        name=spec.name,
        transport=pipe(),
        again=pipe,
        names=tuple(drive.name for drive in spec.drives),
        dialect=chosen.name if chosen else DEFAULT,
        party=any(drive.party for drive in spec.drives) or any(family.addressed for family in families),
        floor=running.floor,
        baud=spec.baud,
        units={f"{drive.name}.{axis}".rstrip("."): unit for drive in spec.drives for axis, unit in drive.units.items()},
    )


class SimPipe(Transport, Listener):
    """A transport to a bus of a running floor. Bytes are delivered in the loop's next turn."""

    def __init__(self, name: str, floor: RunningFloor, bus: str, closed: Callable[[], None]) -> None:
        self.name, self._floor, self._bus, self._closed = name, floor, bus, closed
        self._source = floor.source()
        self.network = bus in floor.floor.ethernet
        self._received: Received | None = None
        self._lost: Lost | None = None
        self._received_bytes = bytearray()
        self._why = "" if floor.floor.connectable(bus) else "no power"
        self._open = True
        self._detach = floor.attach(bus, self)

    def start(self, received: Received, lost: Lost) -> None:
        """Begin to deliver; what came before is dropped."""
        self._received, self._lost = received, lost
        self._received_bytes.clear()
        if self._why:
            self._floor.loop.call_soon(self._report_lost)

    def write(self, data: bytes) -> bool:
        """Put it on the wire; False where there is none."""
        usable = self._open and not self._why
        if usable:
            self._floor.write(self._bus, data, self._source)
        return usable

    @property
    def pending(self) -> int:
        """Number of bytes that have not arrived at the drives yet."""
        return self._floor.floor.wires[self._bus].queued(self._source)

    def discard(self, whole: bool = False) -> int:
        """Take back what has not begun to go out; nothing with `whole`, since that may be part of a message."""
        return self._floor.retract(self._bus, self._source) if self._open and not whole else 0

    async def close(self) -> None:
        """Close the pipe; the last pipe ends the floor."""
        if self._open:
            self._open = False
            self._detach()
            self._closed()

    # -- Listener -----------------------------------------------------------------------------------

    def receive(self, data: bytes) -> None:
        """Deliver in a turn of its own, so that no caller of `write` is called back from within."""
        if self._why or self._received is None:
            return
        if not self._received_bytes:
            self._floor.loop.call_soon(self._deliver)
        self._received_bytes += data

    def unplugged(self) -> None:
        self._break("unplugged")

    def disconnected(self) -> None:
        self._break("no power")

    def _break(self, why: str) -> None:
        if not self._why:
            self._why = why
            self._floor.loop.call_soon(self._report_lost)

    def _deliver(self) -> None:
        data = bytes(self._received_bytes)
        self._received_bytes.clear()
        if data and self._open and self._received is not None:
            self._received(data)

    def _report_lost(self) -> None:
        self._deliver()
        if self._open and self._lost is not None:
            lost, self._lost = self._lost, None
            lost(TransportLost(f"{self.name} was lost: {self._why}"))
