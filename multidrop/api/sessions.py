"""The awaited session: everything that a program has open."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from types import TracebackType
from typing import TYPE_CHECKING, TypeVar

from multidrop.api import endings
from multidrop.api.calls import Calls, WrittenStop
from multidrop.api.drives import AsyncDrive
from multidrop.api.events import AsyncEvents
from multidrop.api.fixed import Fixed
from multidrop.api.notebooks import picture
from multidrop.api.returns import Returns
from multidrop.api.telemetry import RATE, AsyncTelemetry
from multidrop.api.values import seconds, text_of
from multidrop.base.errors import Diagnostic, DriveError, Timeout, TransportLost
from multidrop.base.isolation import isolated
from multidrop.drives.telemetry import WATCH_PERIOD
from multidrop.shell import stop_report, waits
from multidrop.shell.automation import settled
from multidrop.shell.channel import Front
from multidrop.shell.configuration import load
from multidrop.shell.events import Notified, SessionEvent
from multidrop.shell.session import Session as Shell

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.scripts.model import LineResult


@dataclass(frozen=True)
class Run:
    """A script that was executed to its end."""

    file: str
    results: tuple[LineResult, ...]
    """The result of each line; lines that only steer have none."""

    @property
    def printed(self) -> list[str]:
        """All lines that it printed."""
        return [text for result in self.results for text in result.printed]

    def _repr_html_(self) -> str | None:
        """Return a table of the lines, for a notebook."""
        return picture("Run", self)


T = TypeVar("T")
Notice = Callable[[str, bool], object]
"""Takes a line for a person, and whether it is a warning; otherwise it is the outcome of what was asked for."""


def log(text: str, warning: bool) -> None:
    """Pass a line to `logging`, whose default shows warnings on standard error."""
    endings.flush_printed()
    logging.getLogger("multidrop").log(logging.WARNING if warning else logging.INFO, text)


class AsyncSession(Fixed):
    """Open connections and their drives: `async with connect_async(URL) as session`.

    Leaving it by an exception stops every drive that it has set in motion.
    """

    def __init__(
        self,
        urls: Sequence[str],
        *,
        yes: bool,
        beyond: bool,
        reconnect: bool,
        notice: Notice,
    ) -> None:
        self._urls = urls
        self._reconnect = reconnect
        self._yes, self._beyond = yes, beyond
        self._notice = notice
        self._calls = Calls()

    # Beginning and end

    async def __aenter__(self) -> AsyncSession:
        """Open the connections. Raises Diagnostic, TransportLost, NoAnswer."""
        await self._open()
        endings.opened(self, self._end_early)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close; after an exception stop what was started, and say what the stop did not reach."""
        try:
            await self.close(stop=failure is not None)
        finally:
            endings.closed(self)

    def _end_early(self) -> None:
        """Write the stop of every line: the process ends, and the event loop does no more."""
        if self._calls.opened:
            for name, bus in list(self._shell.buses.items()):
                with isolated(f"the stop of {name}", exits=[]):
                    if not bus.roster.strange:  # nobody asks for this stop: only a known drive gets it
                        bus.stop_ahead()
            self._notice("a session was not closed; the stop of its lines was sent, and no drive was asked", True)

    async def _open(self) -> None:
        """Open the connections and find their drives. Moves nothing."""
        if self._calls.opened:
            return
        from multidrop.shell.log.writer import begin as begin_log

        shell = Shell(load(), reconnect=self._reconnect)
        shell.questions.agreed, shell.questions.beyond = self._yes, self._beyond
        shell.front = Front(way="connect(URL, yes=True)", beyond="beyond=True")
        shell.subscribe(self._take, Notified)
        self._calls.open(shell)
        if self._reconnect:
            self._calls.returns = Returns(shell)
        begin_log(shell)
        try:
            await self._calls.begin()
            await self.add(*self._urls)
        except BaseException:
            await self.close(stop=True)
            raise

    async def add(self, /, *urls: str, **named: str) -> None:
        """Open further connections; those with a name become buses of that name. Moves nothing."""
        await self._calls.run(lambda origin: self._shell.open_all(urls))
        for name, url in named.items():
            await self._add_named(url, name)
        if (returns := self._calls.returns) is not None:
            for drive in self.drives:
                with contextlib.suppress(DriveError):  # it is read again, or nothing is known of it
                    await self._note(returns, drive._drive)

    async def _add_named(self, url: str, name: str) -> None:
        await self._calls.run(lambda origin: self._shell.open(url, name))

    async def _note(self, returns: Returns, drive: Drive) -> None:
        await self._calls.run(lambda origin: returns.note(drive))

    async def wait_back(self, timeout: float = waits.WAIT_TIMEOUT) -> None:
        """Wait until every lost connection is back. Raises Timeout, and Lost where one is not tried again."""
        limit = seconds(timeout, "wait_back")
        await self._calls.run(lambda origin: self._back(limit))
        if self._calls.returns is not None:
            await self._calls.returns.compared()

    async def _back(self, timeout: float) -> None:
        shell = self._shell
        deadline = shell.now() + timeout
        while gone := [bus for bus in shell.buses.values() if bus.link.loss is not None]:
            names = ", ".join(bus.name for bus in gone)
            for bus in gone:
                if bus.name not in shell.reconnections.trying:
                    raise TransportLost(f"{bus.link.loss}; connect(URL, reconnect=True) tries it again")
            if shell.now() >= deadline:
                raise Timeout(f"wait_back: {names} still lost after {timeout:g} s")
            await waits.sleep(waits.READING_INTERVAL)

    async def close(self, *, stop: bool = False) -> None:
        """Close everything. Drives go on as they are, unless a `stop` is asked for. May be called again."""
        if not self._calls.closing():
            return
        try:
            if stop:
                await self._interrupt()
            await self._calls.end()
            await settled(self._shell)  # a stop that is under way is repeated and confirmed
            if self._shell.latched:
                self._notice(f"stop: {stop_report.words(self._shell.tally())}", True)
        finally:
            await self._calls.closed().close()

    async def _interrupt(self) -> None:
        for text in await self._calls.interrupt():
            self._notice(text, True)

    def _take(self, event: SessionEvent) -> None:
        if isinstance(event, Notified) and (event.warning or event.outcome):
            self._notice(event.text, event.warning)

    @property
    def _shell(self) -> Shell:
        """The session of the house, with its events and everything else. Raises Diagnostic where none is open."""
        return self._calls.shell

    async def _break_off(self) -> None:
        """End all calls, and stop what this session started. It stays open."""
        if self._calls.accepted:
            await self._interrupt()
            await self._calls.begin()

    # Drives

    @property
    def drives(self) -> list[AsyncDrive]:
        """Every drive that was found."""
        return [AsyncDrive(self._calls, drive) for bus in self._shell.buses.values() for drive in bus.drives.values()]

    def drive(self, address: str = "", axis: str = "") -> AsyncDrive:
        """The drive at an address: `a`, `press:a`, a name of the saved connection; without one the selected drive.

        `axis`: for a drive with several, such as `y`; by default the first. Raises Diagnostic, NoAnswer.
        """
        return AsyncDrive(self._calls, self._found(address), axis)

    def _found(self, address: str) -> Drive:
        """The drive at an address, if there is one. Raises Diagnostic, NoAnswer."""
        from multidrop.shell.line_syntax import EVERYONE, split_target

        bus, own = split_target(address)
        drive = self._shell.drive(bus, own or None)
        known = self._shell.bus(bus).drives
        if drive.address in EVERYONE or drive.address not in known:
            hint = f"found: {', '.join(map(self._shell.display_name, known.values()))}" if known else ""
            raise Diagnostic(f"no drive {address}", "session.drive", hint or "no drive has replied there")
        return drive

    # Lines, scripts, samples

    async def send(self, line: str) -> list[str]:
        """Run a line as typed at the prompt (`PR P`, `@b MR 100`, `/drives`); return the lines that it prints."""
        printed: list[str] = []
        await self._calls.run(lambda origin: self._shell.run(line, origin), printed)
        return printed

    async def run(self, file: str, /, **values: object) -> Run:
        """Execute a script of lines. It is checked whole before; `values` are those of `--set`. Raises its failure."""
        from multidrop.shell.scripts.executor import run_script
        from multidrop.shell.scripts.reading import read_script  # with all verbs, which few programs need

        texts = {name: text_of(value, f"{name} of {file}") for name, value in values.items()}
        script = read_script(file, texts, self._shell.macros)
        results: list[LineResult] = []
        await self._calls.run(lambda origin: run_script(self._shell, origin, script, results.append))
        return Run(file, tuple(results))

    def telemetry(self, *addresses: str, rate: float = RATE) -> AsyncTelemetry:
        """Read position and velocity of drives (all without an address), each `rate` times a second at most.

        A rate of `math.inf` is as fast as the line allows.
        """
        drives = [self._found(address) for address in addresses] or [each._drive for each in self.drives]
        return self._calls.telemetry(drives, rate)

    # Stop

    def stop(self) -> WrittenStop:
        """Stop every drive on every connection now; await what is returned for the report.

        It ends all calls with Stopped, and refuses further ones that send commands until `resume`.
        """
        shell = self._shell
        shell.stop("session.stop()")
        return WrittenStop(shell, shell.tally)

    async def resume(self) -> None:
        """Let commands be sent again after a stop."""
        self._shell.resume()

    def events(self, *addresses: str, every: float = WATCH_PERIOD) -> AsyncEvents:
        """Iterate over what happens to drives (all without an address) and their lines: see `Event`.

        `every`: seconds between two readings of a drive.
        """
        if not (isinstance(every, (int, float)) and 0 < every < inf):  # with NaN nothing would ever be read
            raise Diagnostic(f"no period {every!r}", "events", "valid: above 0, in seconds")
        drives = [self._found(address) for address in addresses] or [each._drive for each in self.drives]
        return self._calls.kept(AsyncEvents(self._shell, drives, every))

    def __repr__(self) -> str:
        """Return its lines and their drives."""
        if not self._calls.opened:
            return "<multidrop: a closed session>"
        lines = [f"{bus.name}: {', '.join(bus.drives) or 'no drive'}" for bus in self._shell.buses.values()]
        return f"<multidrop: {'; '.join(lines) or 'nothing is open'}>"

    def _repr_html_(self) -> str | None:
        """Return a table of the drives, for a notebook."""
        return picture("Session", self)


def connect_async(*urls: str, yes: bool = False, beyond: bool = False, reconnect: bool = False) -> AsyncSession:
    """Make a session for `async with`, in the running event loop. Arguments as for `connect`."""
    return AsyncSession(urls, yes=yes, beyond=beyond, reconnect=reconnect, notice=log)
