"""The awaited drive: one address, and on it one axis, with its program and its settings."""

from __future__ import annotations

import operator
import re
from collections.abc import Collection
from typing import TYPE_CHECKING

from multidrop.api.calls import Calls, Stopping
from multidrop.api.pictures import table
from multidrop.dialects import Diagnostic, Motion, Refused
from multidrop.dialects.units import QUANTITY
from multidrop.drives.drive import still
from multidrop.macros import model
from multidrop.shell import new_file, program_listing, stop_report, waits
from multidrop.shell.events import By
from multidrop.shell.line_syntax import join_target
from multidrop.shell.params import file as files
from multidrop.shell.params.work import Difference, Options, differences, restore
from multidrop.shell.programs import transfers
from multidrop.shell.programs.transfers import Wanted
from multidrop.shell.scripts.expression import Value, Word, written
from multidrop.shell.scripts.questions import ask
from multidrop.shell.travel import BEYOND

if TYPE_CHECKING:
    from multidrop.api.telemetry import AsyncTelemetry
    from multidrop.dialects.values import Readings
    from multidrop.drives.drive import Drive


Lines = list[str]


class AsyncPrograms:
    """The program of one drive. Raises Inexpressible where its family has none."""

    def __init__(self, calls: Calls, drive: Drive) -> None:
        self._calls, self._drive = calls, drive

    async def list(self) -> Lines:
        """Read the program as a listing, with the remarks of its file where those are known."""
        shell = self._calls.shell
        return await self._calls.run(lambda: program_listing.readable(shell, self._drive))

    async def upload(self, file: str = "", *, raw: bool = False) -> Lines:
        """Read the program as the lines of a file; write them to a new `file` if one is named.

        `raw`: as they are stored. Raises Diagnostic for a file that exists.
        """
        if file:
            new_file.check(file)
        shell = self._calls.shell
        lines = await self._calls.run(lambda: program_listing.upload(shell, self._drive, raw))
        if file:
            new_file.write(file, "".join(f"{line}\n" for line in lines))
        return lines

    async def download(
        self,
        file: str,
        text: str | None = None,
        *,
        save: bool = False,
        verify: bool = True,
        only_changed: bool = False,
        run: str = "",
    ) -> None:
        """Check a program file, back up what the drive holds, send the file, and compare.

        `text`: what a file of that name would hold. `save`: keep it over power-off. `run`: the label to execute then.
        Raises Diagnostic for the file, Refused, NoAnswer, Differs.
        """
        shell, wanted = self._calls.shell, Wanted(verify, save, only_changed, run)
        await self._calls.run(lambda: transfers.download(shell, self._drive, file, wanted, text))


class AsyncParameters:
    """The settings of one drive. Raises Inexpressible where the host reads none of its family."""

    def __init__(self, calls: Calls, drive: Drive) -> None:
        self._calls, self._drive = calls, drive

    async def read(self) -> Readings:
        """Read every setting: `.values` by name, `.defaults`, and each with its unit in `.readings`."""
        shell = self._calls.shell
        return await self._calls.run(lambda: files.read(shell, self._drive, "reading"))

    async def backup(self, file: str) -> Readings:
        """Read every setting, and write them to a new file. Raises Diagnostic for a file that exists."""
        new_file.check(file)
        found = await self.read()
        identity = files.identity(self._drive.state, self._drive.family.values.parameters.language)
        new_file.write(file, files.formatted(identity, found))
        return found

    async def diff(self, file: str = "") -> list[Difference]:
        """Compare with a file, or without one with the defaults: (name, value here, value there)."""
        there = files.load(file) if file else None
        found = await self.read()
        return differences(found, there, self._calls.shell.display_name(self._drive))

    async def restore(
        self,
        file: str,
        *,
        save: bool = False,
        named: Collection[str] = (),
        communication: bool = False,
        other_product: bool = False,
        dry_run: bool = False,
    ) -> list[str]:
        """Send what differs from a file; return the steps. It needs `connect(URL, yes=True)`, or `dry_run`.

        `named`: settings that are only written when named, since they can move the motor or lock the drive.
        """
        shell, printed = self._calls.shell, list[str]()
        options = Options(frozenset(named), communication, save, dry_run, other_product)
        loaded = files.load(file)
        await self._calls.run(lambda: restore(shell, self._drive, loaded, options), printed)
        return printed


def _amount(number: float, unit: str) -> int | str:
    """Whole steps, or a quantity as a line has it. Raises Diagnostic for another number, TypeError for such steps."""
    if not unit:
        return operator.index(number)  # type: ignore[arg-type]
    text = f"{{{model.written(number)} {unit}}}"
    if QUANTITY.fullmatch(text) is None:
        raise Diagnostic(f"{number} {unit} is no quantity", "", 'valid: as in move(12.5, "mm")')
    return text


_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)


class DriveFacts:
    """The facts of a drive that are known without asking it."""

    def __init__(self, calls: Calls, drive: Drive, axis: str) -> None:
        self._drive = drive
        self.axis = axis
        """The axis that it moves and reads; empty: the first."""
        self._calls = calls

    @property
    def name(self) -> str:
        """Its address, with the bus where several are open."""
        return self._calls.shell.display_name(self._drive)

    @property
    def address(self) -> str:
        """Its address on the wire; empty where it needs none."""
        return self._drive.address

    @property
    def product(self) -> str:
        """The short name of the product, such as LMDCM; empty if unknown."""
        return self._drive.product

    @property
    def version(self) -> str:
        """The version that it reports."""
        return self._drive.version

    @property
    def referenced(self) -> bool:
        """False after a restart that was seen, until a homing has ended or the position was set."""
        lost = self._drive.state.unreferenced
        return not (lost & {self.axis.lower(), ""} if self.axis else lost)

    @property
    def target(self) -> str:
        """Its address with its bus, as after an `@`."""
        return join_target(self._drive.link.name, self._drive.address)

    def __repr__(self) -> str:
        """Return its name and product."""
        axis = f", axis {self.axis}" if self.axis else ""
        return f"<{self.name or 'drive'} {self.product}{axis}>"

    def _repr_html_(self) -> str:
        """Return what is known of it, for a notebook."""
        seen = "" if self._drive.seen is None else f"{self._drive.seen.velocity}"
        heads = ("drive", "axis", "product", "version", "last velocity")
        return table("drive", heads, [(self.name, self.axis, self.product, self.version, seen)])


class AsyncDrive(DriveFacts):
    """A drive of a session. Steps are the drive's own units: motor steps, or counts with its encoder in use."""

    def __init__(self, calls: Calls, drive: Drive, axis: str = "") -> None:
        super().__init__(calls, drive, axis)
        self._axis_known = not axis
        self.programs = AsyncPrograms(calls, drive)
        self.parameters = AsyncParameters(calls, drive)

    # Lines

    async def send(self, line: str) -> list[str]:
        """Send a line in the drive's own language; return the lines that it prints. Raises Refused, NoAnswer."""
        printed: list[str] = []
        await self._calls.run(lambda: self._send(line), printed)
        return printed

    async def _send(self, *lines: str, beyond: bool = False) -> None:
        shell = self._calls.shell
        if beyond:
            BEYOND.set(True)  # in the context of this call
        for line in lines:
            await shell.run(f"@{self.target} {line}", By.SCRIPT)

    async def read(self, name: str) -> Value:
        """Read the value of a word of the drive, such as `VM`; `[LINE]` asks with a line that prints one value."""
        line = name.startswith("[") and name.endswith("]")
        word = Word(name[1:-1] if line else name, self.target, line)
        shell = self._calls.shell
        if not line and not _WORD.fullmatch(name):
            raise Diagnostic(f"{name!r} is not a word of a drive", self.name, "valid: as in read('VM')")
        return await self._calls.run(lambda: ask(shell, word, By.SCRIPT))

    async def write(self, name: str, value: Value) -> None:
        """Give a word of the drive a value. Raises Refused; Diagnostic where its language has no such form."""
        line = self._drive.family.assign(name, written(value)) if _WORD.fullmatch(name) else None
        if line is None:
            raise Diagnostic(f"no line gives {name!r} a value", self.name, "send() takes any line of the drive")
        self._check_executes()
        await self._calls.run(lambda: self._send(line))

    # Motion

    async def move(self, steps: float, unit: str = "", *, beyond: bool = False) -> None:
        """Begin to move by a distance: whole steps, or a number of a unit, as in `move(12.5, "mm")`.

        `beyond`: it may leave the travel of its axis. Raises Refused; Diagnostic for a unit that its scale has not;
        TypeError for a fraction of a step.
        """
        await self._move(self._drive.family.move(self.axis, _amount(steps, unit)), beyond)

    async def move_to(self, position: float, unit: str = "", *, beyond: bool = False) -> None:
        """Begin to move to a position: whole steps, or a number of a unit. As `move` in all else."""
        await self._move(self._drive.family.move_to(self.axis, _amount(position, unit)), beyond)

    async def _move(self, lines: tuple[str, ...], beyond: bool) -> None:
        self._check_executes()
        if not self._axis_known:
            await self.motion()
        async with self._calls.moves(self._drive):  # a mode and its move belong together
            await self._calls.run(lambda: self._send(*lines, beyond=beyond))

    async def wait(self, timeout: float = waits.LIMIT, *, idle: bool = False) -> None:
        """Wait until two readings show it at rest; with `idle` also until no program runs.

        Raises DriveError after `timeout` seconds.
        """
        shell, drives = self._calls.shell, [self._drive]
        await self._calls.run(lambda: waits.wait(shell, timeout, idle=idle, drives=drives))

    async def position(self) -> int:
        """Read the position."""
        return (await self.motion()).position

    async def velocity(self) -> int:
        """Read the velocity, signed, per second."""
        return (await self.motion()).velocity

    async def position_in(self, unit: str) -> float:
        """Read the position in a unit of its scale, such as `mm`. Raises Diagnostic where it has none."""
        return await self._in("position", unit)

    async def velocity_in(self, unit: str) -> float:
        """Read the velocity in a unit of its scale, such as `mm/s`, signed. Raises as `position_in`."""
        return await self._in("velocity", unit)

    async def _in(self, what: str, unit: str) -> float:
        self._check_executes()
        units, axis = self._calls.shell.units, self.axis.lower()
        return await self._calls.run(lambda: units.reading(self._drive, axis, what, unit))

    async def moving(self) -> bool:
        """Read whether it moves; at rest, two readings say so."""
        self._check_executes()
        return not await self._calls.run(lambda: still(self._drive))

    async def motion(self) -> Motion:
        """Read position and velocity of its axis at one time."""
        self._check_executes()
        axes = await self._calls.run(self._drive.motion)
        wanted = self.axis.lower()
        found = next((each for each in axes if wanted in ("", each.axis.lower())), None)
        if found is None:
            names = ", ".join(each.axis for each in axes if each.axis)
            raise Diagnostic(f"no axis {self.axis}", self.name, f"valid: {names}" if names else "it has one axis")
        self._axis_known = True
        return found

    def _check_executes(self) -> None:
        """Raise Refused in program mode, where the drive would store a line or a question."""
        if self._drive.programming:
            raise Refused(f"{self.name} is in program mode and would store this; PG ends it")

    # Stop, samples

    def stop(self) -> Stopping:
        """Stop this drive now; await what is returned for the report. It refuses nothing afterwards."""
        shell = self._calls.shell
        halt = shell.bus(self._drive.link.name).stop([self._drive])
        several = len(shell.buses) > 1
        return Stopping(shell, lambda: stop_report.of_halts([halt], shell.wall(halt.at), several))

    def telemetry(self, rate: float = 50.0) -> AsyncTelemetry:
        """Read position and velocity `rate` times a second at most, as an iterator of samples."""
        return self._calls.telemetry([self._drive], rate)
