"""A bus on simulated drives, in virtual time: what it wrote, told and heard, and the drives behind the wire."""

from __future__ import annotations

from typing import Any

from multidrop.dialects import Hints
from multidrop.drives.bus import Bus
from multidrop.drives.events import Notice, Traffic, Unsolicited
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.in_process import SimPipe
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cell_session import bus


class SimulatedBus:
    """A bus, started, on drives that are tables of a cell file; `more` goes to the bus."""

    def __init__(self, *drives: str, baud: int = 9600, pipe: type[SimPipe] = SimPipe, **more: Any) -> None:
        self.floor = RunningFloor(Floor(read(bus("w", *drives, baud=baud), "cell")))
        self.devices = {placed.spec.name: placed.device for placed in self.floor.floor.drives}
        self.events: list[Any] = []
        self.pipe, self.baud, self.more = pipe, baud, more
        self.begin()

    def begin(self) -> None:
        """Put a new bus on the same drives."""
        self.transport = self.pipe("sim:#w", self.floor, "w", lambda: None)
        self.bus = Bus("w", self.transport, baud=self.baud, **self.more)
        self.bus.watch(self.events.append)
        self.bus.start()

    async def open(self, *names: str, **known: int) -> SimulatedBus:
        """Look for these drives, for one that is alone without a name. `known`: settings that are not asked for."""
        await self.bus.identify(Hints(drives=names, party=bool(names), **known))
        return self

    async def send(self, address: str, text: str) -> tuple[str, ...]:
        return await self.bus.drives[address].send(text)

    @property
    def sent(self) -> list[bytes]:
        return [e.data for e in self.events if isinstance(e, Traffic) and e.outgoing]

    @property
    def written(self) -> bytes:
        return b"".join(self.sent)

    @property
    def told(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notice)]

    @property
    def said(self) -> str:
        return "\n".join(self.told)

    @property
    def heard(self) -> list[str]:
        """Lines of programs."""
        return [line for event in self.events if isinstance(event, Unsolicited) for line in event.lines]

    def moving(self, name: str) -> bool:
        return bool(self.devices[name].moving(self.floor.now()))
