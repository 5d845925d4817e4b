"""One simulated PMX in virtual time, for tests: ask it by its wire, let time pass, move its world."""

from __future__ import annotations

from multidrop.families.pmx.simulator.device import PmxDevice
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor


class Bench:
    """A PMX with number 00 alone on an unpaced bus; `cell` are further lines of its table."""

    def __init__(self, cell: str = "") -> None:
        text = f'[[bus]]\nname = "pmx"\n[[bus.drive]]\npersonality = "PMX"\n{cell}\n'
        self.floor = Floor(read(text))
        self.wire = self.floor.wires["pmx"]
        self.now = 0.0

    @property
    def device(self) -> PmxDevice:
        device = self.floor.drives[0].device
        assert isinstance(device, PmxDevice)
        return device

    def send(self, data: bytes) -> bytes:
        """What is answered to bytes, at once."""
        self.wire.receive(data, self.now)
        return self.wire.advance(self.now)

    def __call__(self, *commands: str) -> str:
        """The reply to the last of some commands; the others must be answered by OK."""
        for text in commands[:-1]:
            reply = self.send(f"@00{text}\r".encode())
            assert reply == b"OK\r", f"{text}: {reply!r}"
        return self.send(f"@00{commands[-1]}\r".encode()).decode().removesuffix("\r")

    def later(self, seconds: float) -> Bench:
        """Let time pass."""
        until = self.now + seconds
        while (at := self.wire.deadline) is not None and at <= until:
            self.now = max(self.now, at)
            assert self.wire.advance(self.now) == b""
        self.now = until
        return self

    def still(self, axis: str = "X", within: float = 1000.0) -> Bench:
        """Let time pass until an axis stands, to the event at which it does."""
        end = self.now + within
        while self.device.controller.moving(axis):
            at = self.wire.deadline
            assert at is not None and at <= end, "it goes on"
            self.now = at
            self.wire.advance(at)
        return self

    def number(self, command: str) -> int:
        return int(self(command))
