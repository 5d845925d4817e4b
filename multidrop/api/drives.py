"""The awaited drive: one address, and on it one axis."""

from __future__ import annotations

import operator
import re
from typing import TYPE_CHECKING, Protocol

from multidrop.api import owner
from multidrop.api.parameters import AsyncParameters
from multidrop.api.pictures import table
from multidrop.api.programs import AsyncPrograms
from multidrop.api.stopping import Stopping
from multidrop.dialects import Diagnostic, Motion, Refused
from multidrop.drives.drive import still
from multidrop.shell import stop_report, waits
from multidrop.shell.events import By
from multidrop.shell.lines import join_target
from multidrop.shell.scripts.execution import ask
from multidrop.shell.scripts.expression import Value, Word, written

if TYPE_CHECKING:
    from multidrop.api.telemetry import AsyncTelemetry
    from multidrop.drives.drive import Drive as Wire

_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)


class Owner(owner.Owner, Protocol):
    """The session of a drive, with its telemetry."""

    def telemetry(self, *addresses: str, rate: float = ...) -> AsyncTelemetry:
        """Read drives."""


class AsyncDrive:
    """A drive of a session. Steps are the drive's own units: motor steps, or counts with its encoder in use."""

    def __init__(self, session: Owner, drive: Wire, axis: str = "") -> None:
        self.drive = drive
        self.axis = axis
        """The axis that it moves and reads; empty: the first."""
        self._owner = session
        self._axis_known = not axis
        self.programs = AsyncPrograms(session, drive)
        self.parameters = AsyncParameters(session, drive)

    # What it is

    @property
    def name(self) -> str:
        """Its address, with the bus where several are open."""
        return self._owner.shell.display_name(self.drive)

    @property
    def address(self) -> str:
        """Its address on the wire; empty where it needs none."""
        return self.drive.address

    @property
    def product(self) -> str:
        """The short name of the product, such as LMDCM; empty if unknown."""
        return self.drive.product

    @property
    def version(self) -> str:
        """The version that it reports."""
        return self.drive.version

    # Lines

    async def send(self, line: str) -> list[str]:
        """Send a line in the drive's own language; return the lines that it prints. Raises Refused, NoAnswer."""
        printed: list[str] = []
        await self._owner.call(lambda: self._send(line), printed)
        return printed

    async def _send(self, *lines: str) -> None:
        shell = self._owner.shell
        for line in lines:
            await shell.run(f"@{self.target} {line}", By.SCRIPT)

    @property
    def target(self) -> str:
        """Its address with its bus, as after an `@`."""
        return join_target(self.drive.link.name, self.drive.address)

    async def read(self, name: str) -> Value:
        """Read the value of a word of the drive, such as `VM`; `[LINE]` asks with a line that prints one value."""
        line = name.startswith("[") and name.endswith("]")
        word = Word(name[1:-1] if line else name, self.target, line)
        shell = self._owner.shell
        if not line and not _WORD.fullmatch(name):
            raise Diagnostic(f"{name!r} is not a word of a drive", self.name, "valid: as in read('VM')")
        return await self._owner.call(lambda: ask(shell, word, By.SCRIPT))

    async def write(self, name: str, value: Value) -> None:
        """Give a word of the drive a value. Raises Refused; Diagnostic where its language has no such form."""
        line = self.drive.family.sentences.assign(name, written(value)) if _WORD.fullmatch(name) else None
        if line is None:
            raise Diagnostic(f"no line gives {name!r} a value", self.name, "send() takes any line of the drive")
        self._check_executes()
        await self._owner.call(lambda: self._send(line))

    # Motion

    async def move(self, steps: int) -> None:
        """Begin to move by a distance. Raises Refused."""
        await self._move(self.drive.family.sentences.move(self.axis, operator.index(steps)))

    async def move_to(self, position: int) -> None:
        """Begin to move to a position. Raises Refused."""
        await self._move(self.drive.family.sentences.move_to(self.axis, operator.index(position)))

    async def _move(self, lines: tuple[str, ...]) -> None:
        self._check_executes()
        if not self._axis_known:
            await self.motion()
        async with self._owner.moves(self.drive):  # a mode and its move belong together
            await self._owner.call(lambda: self._send(*lines))

    async def wait(self, timeout: float = waits.LIMIT, *, idle: bool = False) -> None:
        """Wait until two readings show it at rest; with `idle` also until no program runs.

        Raises DriveError after `timeout` seconds.
        """
        shell, drives = self._owner.shell, [self.drive]
        await self._owner.call(lambda: waits.wait(shell, timeout, idle=idle, drives=drives))

    async def position(self) -> int:
        """Read the position."""
        return (await self.motion()).position

    @property
    def referenced(self) -> bool:
        """False after a restart that was seen, until a homing has ended or the position was set."""
        lost = self.drive.state.unreferenced
        return not (lost & {self.axis.lower(), ""} if self.axis else lost)

    async def velocity(self) -> int:
        """Read the velocity, signed, per second."""
        return (await self.motion()).velocity

    async def moving(self) -> bool:
        """Read whether it moves; at rest, two readings say so."""
        self._check_executes()
        return not await self._owner.call(lambda: still(self.drive))

    async def motion(self) -> Motion:
        """Read position and velocity of its axis at one time."""
        self._check_executes()
        axes = await self._owner.call(self.drive.motion)
        wanted = self.axis.lower()
        found = next((each for each in axes if wanted in ("", each.axis.lower())), None)
        if found is None:
            names = ", ".join(each.axis for each in axes if each.axis)
            raise Diagnostic(f"no axis {self.axis}", self.name, f"valid: {names}" if names else "it has one axis")
        self._axis_known = True
        return found

    def _check_executes(self) -> None:
        """Raise Refused in program mode, where the drive would store a line or a question."""
        if self.drive.programming:
            raise Refused(f"{self.name} is in program mode and would store this; PG ends it")

    # Stop, samples

    def stop(self) -> Stopping:
        """Stop this drive now; await what is returned for the report. It refuses nothing afterwards."""
        shell = self._owner.shell
        halt = shell.bus(self.drive.link.name).stop([self.drive])
        several = len(shell.buses) > 1
        return Stopping(shell, lambda: stop_report.of_halts([halt], shell.wall(halt.at), several))

    def telemetry(self, rate: float = 50.0) -> AsyncTelemetry:
        """Read position and velocity `rate` times a second at most, as an iterator of samples."""
        return self._owner.telemetry(self.target, rate=rate)

    def __repr__(self) -> str:
        """Return its name and product."""
        axis = f", axis {self.axis}" if self.axis else ""
        return f"<{self.name or 'drive'} {self.product}{axis}>"

    def _repr_html_(self) -> str:
        """Return what is known of it, for a notebook."""
        seen = "" if self.drive.seen is None else f"{self.drive.seen.velocity}"
        heads = ("drive", "axis", "product", "version", "last velocity")
        return table("drive", heads, [(self.name, self.axis, self.product, self.version, seen)])
