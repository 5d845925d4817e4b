"""A bus that opens at once and notes stops, for tests of the order and the time in which several are opened."""

import asyncio
from dataclasses import dataclass, field

from multidrop.dialects import Motion
from multidrop.dialects.families import family_of
from multidrop.drives.motion_record import MotionRecord
from multidrop.drives.stopping import Halt
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState


@dataclass(eq=False)
class FakeDrive:
    bus: "FakeBus"
    address: str
    label: str = ""
    product: str = "LMDCM"
    version: str = "6.002"
    programming: bool = False
    stores: bool = False
    state: MCodeState = field(default_factory=lambda: MCodeState(MCode()))

    seen = running = noted = None
    commands = requests = starting = stops = 0
    missing = transferring = False
    started_at = commanded_at = float("-inf")

    def __post_init__(self):
        self.motions = MotionRecord()

    @property
    def link(self):
        return self.bus

    @property
    def family(self):
        return family_of(self.state)

    @property
    def codec(self):
        return self.state.codec

    @property
    def recipients(self):
        return [self]

    def check_line(self, text):
        pass

    def starts(self, text):
        return not text.startswith("PR")

    async def send(self, text, check=None):
        return ()

    async def motion(self):
        return (Motion(0, 0),)


class FakeBus:
    """A bus with drives that take every line."""

    lost = away = loss = last_stop = None
    stops, closed, silent = 0, False, ""

    def __init__(self, name, addresses):
        self.name = name
        self.drives = {address: FakeDrive(self, address) for address in addresses}

    @property
    def link(self):
        return self

    @property
    def all_drives(self):
        return list(self.drives.values())

    def now(self):
        return asyncio.get_running_loop().time()

    stamp = now

    def watch(self, watcher):
        return lambda: None

    def start(self):
        pass

    async def identify(self, hints):
        return self.all_drives

    def at(self, address):
        return self.drives[address]

    def halt(self, only=None, follows=True, started=None):
        """Noted as the real one does it."""
        self.stops += 1
        drives = tuple(self.all_drives if only is None else only)
        self.last_stop = Halt(self, asyncio.get_running_loop().time(), self.stops, only is None, drives, data=b"!")
        return self.last_stop

    def halted(self, halt):
        pass

    async def settled(self):
        pass

    async def close(self):
        self.closed = True
