"""What the shell adds to a port of another machine: its baud rate after a loss, its limits, its distance in a scan."""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from multidrop.base.errors import DriveError
from multidrop.drives.bus import Bus
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import OpenedBus
from multidrop.shell.connect.reconnect import LOGIN, LoginAgain
from multidrop.shell.connect.urls import Connection, parse
from multidrop.shell.events import Notified
from multidrop.shell.finding.scanning import NothingFound, Scanning
from multidrop.shell.session import Session
from multidrop.transports import Lost, Received, Transport, Unreachable

pytestmark = pytest.mark.virtual
LIMITS = "on pc socat passes the bytes on: a stop waits there"


@dataclass
class Control:
    baud: int


@dataclass
class FakeSsh(Transport):
    """A port on which nobody replies."""

    control: Control | None = None
    limits: str = LIMITS
    name: str = "ssh://pc/dev/ttyS0"
    written: bytearray = field(default_factory=bytearray)

    def start(self, received: Received, lost: Lost) -> None: ...

    def write(self, data: bytes) -> bool:
        self.written += data
        return True

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None: ...


class FakeRelay(FakeSsh):
    round_trip = 0.05


@pytest.mark.parametrize(("control", "baud"), [(Control(115200), 115200), (None, None)])
async def test_a_lost_port_is_opened_at_the_rate_that_it_had(control: Control | None, baud: int | None) -> None:
    asked = []

    async def open_(within: float, rate: int | None) -> FakeSsh:
        asked.append((within, rate))
        return FakeSsh()

    await LoginAgain(open_, 0.3)(FakeSsh(control))
    await LoginAgain(open_, 2.0)(FakeSsh(control))
    assert asked == [(LOGIN, baud), (8.0, baud)]


async def test_logins_that_fail_are_tried_ever_less_often_until_one_works() -> None:
    clock, at = asyncio.get_running_loop(), list[float]()

    async def open_(within: float, rate: int | None) -> FakeSsh:
        at.append(clock.time())
        if len(at) in (7, 8):
            return FakeSsh()
        raise Unreachable("ssh://pc/dev/ttyS0: not reached: Permission denied (publickey)")

    again = LoginAgain(open_, 0.3)
    for _ in range(8):
        with contextlib.suppress(Unreachable):
            await again(FakeSsh())
    assert [round(b - a, 3) for a, b in pairwise(at)] == [0.5, 1.5, 3.5, 5.0, 5.0, 5.0, 0.0]


class Shop:
    """A session that opens the same kind of port each time, and what it says."""

    def __init__(self, folder: Path, kind: type[FakeSsh]) -> None:
        self.kind, self.said = kind, list[str]()
        self.session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"), self.opener)
        self.session.questions.agreed = True
        self.session.subscribe(lambda event: self.said.append(event.text) if isinstance(event, Notified) else None)

    async def opener(self, connection: Connection, _: object) -> list[OpenedBus]:
        bus = Bus("pc", self.kind(), baud=connection.baud or 9600, timeout=0.1)
        return [OpenedBus(bus, connection.hints, limits=LIMITS)]

    @property
    def limits(self) -> int:
        """How often the limits were said."""
        return sum(LIMITS in text for text in self.said)

    async def scan(self) -> float:
        """Search two baud rates in vain; return how long that took, s."""
        began = asyncio.get_running_loop().time()
        search = Scanning(self.session, self.opener, parse("ssh://pc/dev/ttyS0?dialect=mcode"), lambda drive: None)
        with pytest.raises(NothingFound):
            await search.run([9600, 115200], True)
        return asyncio.get_running_loop().time() - began


async def test_the_limits_of_the_far_side_are_said_once_at_the_opening(tmp_path: Path) -> None:
    shop = Shop(tmp_path, FakeSsh)
    with pytest.raises(DriveError):
        await shop.session.open("ssh://pc/dev/ttyS0?drives=a")
    assert shop.limits == 1


async def test_a_scan_waits_for_the_network_and_says_the_limits_once(tmp_path: Path) -> None:
    near, far = Shop(tmp_path / "near", FakeSsh), Shop(tmp_path / "far", FakeRelay)
    assert await far.scan() > 2 * await near.scan()
    assert near.limits == far.limits == 1
