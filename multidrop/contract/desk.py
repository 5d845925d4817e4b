"""A line with simulated drives of one family, in virtual time: what was written to them, and what becomes of replies.

A session, a program of the API and a command of the command line open it by its URL, as they would open a gateway.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import io
import os
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from multidrop.base import registry
from multidrop.base.errors import Diagnostic, DriveError, TransportLost
from multidrop.contract.sample import FamilySample
from multidrop.dialects.codec import Priority
from multidrop.dialects.families import dialects
from multidrop.dialects.family import Motion
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.shell.batch.virtual_loop import VirtualLoop
from multidrop.shell.configuration import Settings
from multidrop.shell.connect import schemes
from multidrop.shell.events import Failed, Notified, Output, Printed, SessionEvent
from multidrop.shell.origin import Origin
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.families import family_of
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.in_process import SimPipe
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Transport, Unreachable

LONGEST = 1e5
"""Virtual seconds after which a test has failed."""
LINE = "line"
"""The name of the bus, and the host in its URL."""
TIMEOUT = 0.5
"""s; what the host waits for a reply."""


class Done(NamedTuple):
    """How a command ended, and what it printed."""

    code: int
    out: str
    err: str


def in_virtual_time(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Run an async test on a loop whose clock does not wait."""

    async def limited(*given: Any, **named: Any) -> None:
        async with asyncio.timeout(LONGEST):
            await test(*given, **named)

    @functools.wraps(test)
    def run(*given: Any, **named: Any) -> None:
        with asyncio.Runner(loop_factory=VirtualLoop) as runner:
            runner.run(limited(*given, **named))

    return run


def _deaf(receive: Callable[..., None], port: object) -> Callable[..., None]:
    def heard(self: object, data: bytes, now: float) -> None:
        if self is not port:
            receive(self, data, now)

    return heard


class Wire(SimPipe):
    """The host's end of the line. It keeps what is written; replies can be held back for a while, or lost."""

    def __init__(self, running: RunningFloor, own_port: bool) -> None:
        super().__init__(f"sim:#{LINE}", running, LINE, lambda: None)
        self.written = list[bytes]()
        self.lossy = False
        """Whether what the drives send is lost."""
        self._running = running
        self._held: bytearray | None = None
        unit = running.floor.drives[0].unit
        self._port = unit.connect() if own_port and unit.connect is not None else None

    def write(self, data: bytes) -> bool:
        """Write, to the drive's own port where it has one."""
        self.written.append(data)
        if self._port is None:
            return super().write(data)
        self.receive(self._running.exchange(LINE, self._port, data), own=True)
        return True

    def receive(self, data: bytes, own: bool = False) -> None:
        """Take what drives send."""
        if self.lossy or not data or own != (self._port is not None):
            return
        if self._held is not None:
            self._held += data
        else:
            super().receive(data)

    def hold(self) -> None:
        """Keep replies back until `release`."""
        self._held = bytearray()

    def release(self) -> None:
        """Deliver what was kept back, and all that follows."""
        held, self._held = bytes(self._held or b""), None
        if held:
            super().receive(held)


class Desk:
    """A line with the drives of a sample."""

    def __init__(
        self, sample: FamilySample, folder: Path, patch: pytest.MonkeyPatch, drive: str = "", cell: str = ""
    ) -> None:
        registry.load_others()
        self.sample, self.folder = sample, folder
        folder.mkdir(exist_ok=True)
        self.cell = cell or self._cell(drive or sample.drive)
        for name in ("CONFIG", "STATE", "DATA"):
            patch.setenv(f"MULTIDROP_{name}_DIR", str(folder / name.lower()))
        self.scheme = dialects()[sample.family].scheme
        known = schemes.named(self.scheme or "tcp")
        assert known is not None
        patch.setattr(type(known), "open", self._open)
        self._patch, self._runner = patch, asyncio.Runner
        patch.setattr(asyncio, "Runner", lambda **more: self._runner(**more | {"loop_factory": VirtualLoop}))
        self.wire: Wire
        self.deaf = False
        """Whether the host hears nothing from the drives, from the first."""
        self._floors = dict[asyncio.AbstractEventLoop, RunningFloor]()

    def again(self, drive: str = "", cell: str = "") -> Desk:
        """Another line with such drives, of other tables or of the cell file that a snapshot wrote."""
        return Desk(self.sample, self.folder, self._patch, drive, cell)

    @property
    def names(self) -> tuple[str, ...]:
        """The addresses of its drives."""
        return self.sample.addresses

    @property
    def url(self) -> str:
        """The URL of the line, which names its drives."""
        named = ",".join(filter(None, self.names))
        keys = [*([] if self.scheme else [f"dialect={self.sample.family}"]), *([f"drives={named}"] if named else [])]
        text = "&".join([*keys, *filter(None, [self.sample.keys]), f"timeout={TIMEOUT}"])
        return f"{self.scheme or 'tcp'}://{LINE}?{text}"

    def _cell(self, drive: str) -> str:
        named = (f'name = "{name}"\n' if name else "" for name in self.names)
        tables = (f"[[bus.drive]]\n{each}{drive.strip()}\n" for each in named)
        return f'[[bus]]\nname = "{LINE}"\nbaud = 0\n{"".join(tables)}'

    async def _open(self, *given: object, **named: object) -> Transport:
        if self.floor.floor.wires[LINE].hung_up:
            raise Unreachable(f"{LINE}: unplugged")
        self.wire = Wire(self.floor, self.scheme != "" and self.sample.family != self._simulated)
        self.wire.lossy = self.deaf
        return self.wire

    @property
    def _simulated(self) -> str:
        return family_of(self.floor.floor.cell.buses[0].drives[0].personality).name

    @property
    def floor(self) -> RunningFloor:
        """The simulated line in the loop that runs."""
        loop = asyncio.get_running_loop()
        if loop not in self._floors:
            (self.folder / "cell.toml").write_text(self.cell, encoding="utf-8")
            self._floors[loop] = RunningFloor(Floor(read(self.cell, str(self.folder / "cell.toml"))))
        return self._floors[loop]

    def silence(self, address: str) -> None:
        """Let no bytes reach a drive any more, as if its cable were cut."""
        (drive,) = [each for each in self.floor.floor.drives if each.spec.name == address]
        self._patch.setattr(type(drive.unit.port), "receive", _deaf(type(drive.unit.port).receive, drive.unit.port))

    @asynccontextmanager
    async def session(self, *, agreed: bool = True) -> AsyncIterator[Opened]:
        """A session on the line; `agreed`: a person says yes to each question."""
        folder = self.folder
        session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"), reconnect=True)
        session.questions.agreed = agreed
        opened = Opened(self, session)
        session.subscribe(opened.events.append)
        try:
            await session.open(self.url, LINE)
            opened.begin()
            yield opened
        finally:
            await session.close()

    def really(self, run: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Run something in real time: threads that write files have no other."""
        with self._runner() as runner:
            runner.run(run())

    def command(self, *words: str) -> Done:
        """Run a command of the command line in the folder of the test."""
        from multidrop.__main__ import main

        out, err = io.StringIO(), io.StringIO()
        before = os.getcwd()
        os.chdir(self.folder)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = main(words)
        finally:
            os.chdir(before)
        return Done(code, out.getvalue(), err.getvalue())


class Opened:
    """An open session: what it told, and what was written."""

    def __init__(self, desk: Desk, session: Session) -> None:
        self.desk, self.session = desk, session
        self.events = list[SessionEvent]()
        self.last = ""
        """The line of an automation that was run last."""

    def begin(self) -> None:
        """Forget what was told and written."""
        self.events.clear()
        self.wire.written.clear()

    @property
    def wire(self) -> Wire:
        """The host's end of the line."""
        return self.desk.wire

    @property
    def bus(self) -> Bus:
        """The line."""
        return self.session.buses[LINE]

    @property
    def drive(self) -> Drive:
        """The first drive."""
        return self.bus.drives[self.desk.names[0]]

    @property
    def written(self) -> bytes:
        """What was written since the beginning."""
        return b"".join(self.wire.written)

    async def run(self, line: str, origin: Origin | None = None) -> None:
        """Run a line for the first drive, or with an address of its own, or a verb."""
        await self.session.run(self.desk.sample.to_first(line), origin)

    async def automation(self, *lines: str) -> None:
        """Run lines as one automation, as `send` and a script do."""
        async with self.session.automations.run(self.session.origin) as origin:
            for self.last in lines:
                await self.run(self.last, origin)

    async def say(self, *lines: str) -> list[str]:
        """Run lines; return what they printed."""
        self.events.clear()
        for line in lines:
            await self.run(line)
        return [event.text for event in self.events if isinstance(event, Printed | Output)]

    async def refusal(self, *lines: str) -> str:
        """Run lines of which the last one must fail; return its one line."""
        for line in lines[:-1]:
            await self.run(line)
        self.begin()
        with pytest.raises((Diagnostic, DriveError, TransportLost)) as failure:
            await self.run(lines[-1])
        text = str(failure.value)
        assert text and "\n" not in text
        return text

    def told(self) -> list[str]:
        """What was narrated or failed."""
        return [event.text for event in self.events if isinstance(event, Notified | Failed)]

    async def motions(self, address: str) -> tuple[Motion, ...]:
        """Position and velocity of each axis of a drive, as it reports them."""
        drive = self.bus.drives[address]
        return await drive.run(drive.family.motion(Priority.OPERATOR))
