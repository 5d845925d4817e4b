"""Opening URLs, one or several side by side: places and names of their buses, and the search for the drives."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from math import inf
from typing import Any, TypeVar

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, TransportLost
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.echoes import LocalEcho
from multidrop.drives.stopping import Halt
from multidrop.shell.connect.opening import Naming, OpenedBus, Opener, first, open_buses
from multidrop.shell.connect.reconnect import Newcomer
from multidrop.shell.connect.scheme import Connection
from multidrop.shell.connect.urls import parse, with_echo
from multidrop.shell.line_syntax import EVERYONE, split_target
from multidrop.shell.raw import RawLine
from multidrop.shell.secrets import url_without_secrets
from multidrop.shell.state import crash_marks
from multidrop.shell.workspace import BeingOpened, Workspace


def model(drive: Drive) -> str:
    """The product and version that a drive reports."""
    included = drive.version.startswith(drive.product)
    return drive.version if included else f"{drive.product} {drive.version}".strip()


def described(bus: Bus) -> str:
    """A bus and its drives in one line: `press: a b c LMDCM 6.002, Hw: 3.2; d LMDCM 5.0`."""
    alike: dict[str, list[str]] = {}
    for drive in bus.drives.values():
        alike.setdefault(model(drive), []).append(drive.label or drive.address)
    drives = "; ".join(" ".join(filter(None, [*addresses, form])) for form, addresses in alike.items())
    return f"{bus.name}: {drives or 'no drive has replied'}"


Failed = Callable[[int, BaseException], None]
"""Takes the number of a URL, from 0, and the failure to open it."""
REOPENED = 2.0
"""The time in which a line is open again after a search of its port, s: later it is lost."""
CUT = (
    "the last session on this port was interrupted while it sent '{}'; a drive may hold a part of it, which the next "
    "terminator executes"
)
"""A notice in raw mode, in which nothing is repaired."""


class Openings:
    """The URLs that a session opens."""

    def __init__(self, workspace: Workspace, opener: Opener, lazy: bool, raw: bool, tried: Sequence[str] = ()) -> None:
        """Open nothing yet. `lazy`: see `Hints`. `raw`: `open_all` looks for no drives. `tried`: see `Session`."""
        self._workspace = workspace
        self._lazy, self._raw = lazy, raw
        self._tried = [split_target(target) for target in tried]
        self._opener = opener
        self._reserved: set[str] = set()
        """The names of buses that are being opened."""
        self._places = count(1)
        self._cells = asyncio.Lock()
        """Cells are opened in turn: only an open cell names its buses."""

    async def open(self, url: str, name: str | None = None, *, raw: bool = False) -> list[Bus]:
        """Open one URL; its first bus is selected where none is. `raw`: look for no drives."""
        connection = parse(url, self._workspace.settings.connections)
        opening = _Opening(self._workspace, self._reserved, next(self._places), name, by_port=connection.by_port)
        opened = await self._run(opening, connection, raw)
        self._select_first(opened)
        return opened

    async def open_all(self, urls: Sequence[str], failed: Failed | None = None) -> None:
        """Open URLs side by side. Their buses keep the order of the URLs, whichever is ready first.

        No bus is selected before every URL ahead of it is open or has failed: a typed line must not go to another
        line of drives only because that one was faster. A failure goes to `failed`; without it, it ends the others.
        """
        parsed: dict[int, Connection] = {}
        for number, url in enumerate(urls):
            try:
                parsed[number] = parse(url, self._workspace.settings.connections)
            except Diagnostic as problem:
                if failed is None:
                    raise
                failed(number, problem)
        numbers, prepared, shorts = list(parsed), [], Counter(each.short for each in parsed.values())
        for connection in parsed.values():
            sole = connection.short if not connection.scheme.simulated else ""
            if shorts[sole] > 1:
                sole = connection.by_port or sole
            opening = _Opening(self._workspace, self._reserved, next(self._places), None, sole, connection.by_port)
            prepared.append((opening, connection))
        on_failure = failed and (lambda which, failure: failed(numbers[which], failure))
        keep = failed is not None and self._tabbed and not self._raw
        await side_by_side([self._run(*each, self._raw, keep) for each in prepared], self._select_first, on_failure)
        if not self._workspace.selected_bus and self._workspace.buses:
            self._workspace.select("", next(iter(self._workspace.buses)))

    @property
    def _tabbed(self) -> bool:
        """The front end has tabs: a line that could not be opened, or on which no drive replies, keeps its own."""
        return self._workspace.front.screen is not None

    def _select_first(self, opened: list[Bus]) -> None:
        """Select the first of these buses that is still open where no bus is selected."""
        there = [bus.name for bus in opened if bus.name in self._workspace.buses and bus.lost is None]
        first = next(iter(there), "")
        if first and not self._workspace.selected_bus:
            self._workspace.select("", first)
        else:
            self._workspace.changed()

    def url_of(self, bus: Bus) -> str:
        """The URL of an open bus, without the name of a saved connection, and with the stable name of its port.

        It is empty for one that nobody opened here.
        """
        connection = self._workspace.of(bus).connection
        if connection is None:  # a search has one such for itself, and what is shown of another session has none
            return ""
        return connection.scheme.lasting(connection, self._workspace.of(bus).in_cell)

    async def raw_on(self, bus: Bus) -> None:
        """Put an open bus into raw mode. Raises TransportLost where it is lost."""
        if bus.lost is not None:
            raise bus.lost
        await bus.reserve()
        for drive in bus.drives.values():  # bytes may do anything
            drive.state.reference_lost(drive.anchored)
        begin_raw(self._workspace, bus)

    async def raw_off(self, bus: Bus) -> None:
        """Find the drives of a bus in raw mode. Raises NoAnswer where none replies, and it stays raw.

        It asks before that where drives in party mode would execute at the first line feed what a person has sent.
        """
        record = self._workspace.of(bus)
        if record.raw is not None and record.raw.half.waits:
            what = f"no drive has replied to '{record.raw.waiting}': in party mode a drive executes it now"
            await self._workspace.questions.confirm(what, bus.name, "nothing was sent, and Ctrl+X makes drives drop it")
        raw, record.raw = record.raw, None
        assert raw is not None and record.connection is not None, bus.name
        raw.close()
        known = bool(bus.drives)
        try:
            await bus.find_again(record.opened.hints, release=True)
        except (DriveError, TransportLost, asyncio.CancelledError):
            if bus.name in self._workspace.buses:
                record.raw = raw
                raw.open()
                self._workspace.notify(f"{bus.name} stays raw", bus=bus.name)
            raise
        if not known:  # else the drives keep their names, and one of them is selected
            label(bus, record.connection)
            self._workspace.identified(bus)
        self._workspace.notify(described(bus), bus=bus.name)

    def searches(self, bus: Bus) -> bool:
        """Whether `search` is for this line: no drive has replied there, and its port can be opened again."""
        record = self._workspace.of(bus)
        simulated = record.connection is None or record.connection.scheme.simulated  # it ends as it is left
        return bool(bus.silent) and self._workspace.reconnections.wanted and record.raw is None and not simulated

    async def search(self, bus: Bus) -> None:
        """Search the port of a line on which no drive has replied, and go on with the line as drives reply there.

        It begins with the baud rate and the language of the line, and asks before it tries others. Raises NothingFound,
        Diagnostic where a person does not agree or nothing can be searched, and the failures of a port.
        """
        from multidrop.shell.finding.scanning import Scanning, url_of
        from multidrop.shell.state.opened import note

        workspace, record, connection = self._workspace, self._workspace.of(bus), self._workspace.of(bus).connection
        assert connection is not None, bus.name

        async def beside(where: Connection, naming: Naming) -> list[OpenedBus]:
            return await self._opener(where, lambda base: naming(f"{base}-search"))  # two buses never share a name

        searching = Scanning(workspace, beside, connection, lambda found: workspace.output(found.words()))
        url = ""
        try:
            record.searched_until = inf
            await workspace.reconnections.remove(bus.name)
            await bus.link.detach(TransportLost(f"{bus.name} is being searched for drives"))
            await searching.run([], False)
        finally:
            record.searched_until = workspace.now() + REOPENED
            if bus.name in workspace.buses:
                if searching.found:
                    url, before = url_of(searching.found), connection
                    connection = replace(parse(url), name=before.name, labels=before.labels, timeout=before.timeout)
                    bus.set_baud(connection.baud or 0)
                    bus.line.inbox.echo = LocalEcho() if connection.local_echo else None
                    record.connection = connection
                    text = f"{bus.name}: it is opened as {url}; /keep {bus.name} saves that"
                    workspace.notify(text, bus=bus.name)
                record.opened = replace(record.opened, hints=connection.hints, reopen=first(connection))
                bus.silent = ""
                _Newcomers(workspace).add(record.opened, connection)
                workspace.reconnections.lost(bus)
                if url:
                    await asyncio.to_thread(note, workspace.settings.state, url)

    async def _run(self, opening: _Opening, connection: Connection, raw: bool = False, keep: bool = False) -> list[Bus]:
        """Open one URL. `keep`: a port that cannot be opened keeps a bus, which is tried again."""
        if waiting := self._workspace.reconnections.waiting_for(connection.port_name):
            hint = f"it comes back by itself; /close {waiting} gives it up"
            raise Diagnostic(
                f"its port belongs to {waiting}, which is lost and being tried again", connection.text, hint
            )
        try:
            in_turn = self._cells if connection.scheme.simulated else contextlib.nullcontext()
            shown = connection.name or url_without_secrets(connection.text)
            with opening.listed(connection.name or connection.text), self._workspace.under_way(f"opening {shown}"):
                async with in_turn:
                    try:
                        opened = await self._opener(connection, opening.named)
                    except TransportLost as failure:
                        if not keep or connection.scheme.simulated:
                            raise
                        opened = await open_buses(connection, opening.named, self._workspace.settings.state, failure)
            addresses = {label: address for address, label in connection.labels.items()}
            hinted = []
            for open_bus in opened:  # an address without a bus belongs to the first URL; a label counts as its address
                own = [to for name, to in self._tried if name == open_bus.bus.name or (not name and opening.place == 1)]
                tried = tuple(dict.fromkeys(addresses.get(to, to) for to in own if to and to not in EVERYONE))
                hints = replace(open_bus.hints, lazy=self._lazy and not raw, tried=tried)
                hinted.append(replace(open_bus, hints=hints))
            return await opening.identify(hinted, connection, raw, self._tabbed)
        finally:
            self._reserved -= opening.names


class _Opening:
    """One URL on its way: its place among the buses, and the names that are reserved for its own."""

    def __init__(
        self,
        workspace: Workspace,
        reserved: set[str],
        place: int,
        name: str | None = None,
        sole: str = "",
        by_port: str = "",
    ) -> None:
        """`sole`: the base of the name of its only bus, which is chosen before other URLs choose theirs.

        `by_port`: its name where that is taken.
        """
        self._workspace = workspace
        self._reserved = reserved
        self.place = place
        self._name, self._by_port = name, by_port
        self._stops = workspace.stops
        self._before = {*workspace.buses, *reserved}
        self._next = ""
        self.names: set[str] = set()
        self.bases: dict[str, str] = {}
        """The name that each was made of, which a cell gives to its bus."""
        self._next = self.named(sole) if sole else ""

    def named(self, base: str) -> str:
        """Return a free name for a bus: the requested one, to which further buses of a cell append their own.

        Raises Diagnostic for a requested name that is taken.
        """
        if self._next:
            return self._next
        name, taken = base, self._before | self.names
        if self._name is not None:
            if self._name in self._before:
                raise Diagnostic(f"bus {self._name} is already open", hint="use another name, or /close it first")
            name = self._name if taken == self._before else f"{self._name}-{base}"
        taken |= {*self._reserved, *self._workspace.buses}
        others = (f"{name}-{number}" for number in range(2, 1000))
        by_port = [self._by_port] if self._by_port and self._name is None else []
        chosen = next(each for each in (name, *by_port, *others) if each not in taken)
        self.names.add(chosen)
        self.bases[chosen] = base
        self._reserved.add(chosen)
        return chosen

    @contextlib.contextmanager
    def listed(self, url: str) -> Iterator[None]:
        """List the URL as one that no stop reaches; its buses are adopted in the turn in which this ends."""
        entry = BeingOpened(url, self._stops)
        self._workspace.opening.append(entry)
        try:
            yield
        finally:
            self._workspace.opening.remove(entry)

    async def identify(
        self, found: Sequence[OpenedBus], connection: Connection, raw: bool, keep: bool = False
    ) -> list[Bus]:
        """Adopt the buses and find their drives, but not where they are to be `raw`; a failure closes them all.

        `keep`: a bus stays where no drive replies.
        """
        workspace, newcomers = self._workspace, _Newcomers(self._workspace)
        async with contextlib.AsyncExitStack() as failing:
            for opened in found:
                failing.push_async_callback(workspace.forget, opened.bus)
            for opened in found:
                in_cell = self.bases.get(opened.bus.name, opened.bus.name)
                if opened.absent:
                    newcomers.add(opened, connection)
                record = workspace.adopt(
                    replace(opened, warnings=()) if raw else opened, self.place, connection, in_cell
                )
                if not connection.scheme.simulated:
                    doubts = workspace.settings.in_doubt
                    record.doubt = doubts.get(connection.name, "") or doubts.get("", "")
                if opened.limits:
                    workspace.notify(f"{opened.bus.name}: {opened.limits}", bus=opened.bus.name, warning=True)
                opened.bus.link.on_echo = partial(_echo_found, workspace, opened.bus)
            late: list[tuple[Bus, Halt]] = []
            for bus in [opened.bus for opened in found] if self._stops != workspace.stops else ():
                late.append((bus, bus.halt()))  # the stop that came meanwhile, before anything else
                bus.halted(late[-1][1])
                text = f"{bus.name}: the stop that came while it was being opened was sent first"
                workspace.notify(text, bus=bus.name)
            for opened in found:
                port = workspace.of(opened.bus).port = connection.port_name
                if opened.absent:
                    continue
                try:
                    await self._find(opened, connection, raw)
                except NoAnswer as failure:
                    if not keep:
                        raise
                    newcomers.add(opened, connection)
                    if newcomers.silent(opened, connection, failure):
                        workspace.reconnections.lost(opened.bus)
                    continue
                workspace.reconnections.add(opened.bus, opened.hints, opened.reopen, port)
            for bus, halt in late:  # again by name, as some drives need it, and confirmed; but none started since
                if bus.roster.strange:
                    continue
                standing = [drive for drive in bus.all_drives if not halt.started_since(drive)]
                bus.halted(bus.halt(None if len(standing) == len(bus.all_drives) else standing))
            failing.pop_all()
        return [opened.bus for opened in found]

    async def _find(self, opened: OpenedBus, connection: Connection, raw: bool) -> None:
        """Find the drives of a bus, or show its bytes."""
        workspace, bus = self._workspace, opened.bus
        if raw:
            await bus.reserve()
            begin_raw(workspace, bus)
            workspace.identified(bus)
            if opened.hints.cut:
                workspace.notify(f"{bus.name}: {CUT.format(opened.hints.cut)}", warning=True)
            return
        await bus.identify(opened.hints)
        await _Newcomers(workspace).found(opened, connection)


class _Newcomers:
    """Buses whose drives were never found in this session: the first success of the search, and each failure."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace

    def add(self, opened: OpenedBus, connection: Connection) -> None:
        """Try a bus again whenever it is lost, and find its drives then for the first time."""
        newcomer = Newcomer(partial(self.found, opened, connection), partial(self.silent, opened, connection))
        port = connection.port_name
        self._workspace.reconnections.add(opened.bus, opened.hints, opened.reopen, port, newcomer)

    async def found(self, opened: OpenedBus, connection: Connection) -> None:
        """Say what was found, and name it."""
        workspace, bus = self._workspace, opened.bus
        label(bus, connection)
        workspace.identified(bus)
        workspace.notify(described(bus), bus=bus.name)
        known = workspace.of(bus).connection
        if known is not None and known.local_echo and not connection.local_echo:
            _say_echo(workspace, bus)
        for callback in workspace.on_opened if workspace.scaled and not opened.hints.lazy else ():
            await callback(bus)
        for text in crash_marks.left(workspace.settings.state, workspace.of(bus).port):
            workspace.notify(f"{bus.name}: {text}", bus=bus.name, warning=True)

    def silent(self, opened: OpenedBus, connection: Connection, failure: DriveError) -> bool:
        """Say once that no drive replies, what came, and the ways on; return whether the line is asked again by itself.

        It is where drives are known to reply as they are asked, or where no baud rate can be wrong. To other drives
        each question may be an error.
        """
        workspace, bus, hints = self._workspace, opened.bus, opened.hints
        known = bool(not connection.scheme.bauded or hints.drives or hints.remembered)
        again = known and workspace.reconnections.tries(bus.name)
        said, reason = bus.silent, str(failure)
        bus.unanswered(reason)
        if said != reason:
            texts = filter(None, (reason, "it is asked again every 5 s" if again else ""))
            workspace.notify(f"{bus.name}: {'; '.join(texts)}", bus=bus.name, warning=True)
            workspace.notify(f"{bus.name}: {self._way_on(connection)}/raw on shows all that comes", bus=bus.name)
        workspace.changed()
        return again

    def _way_on(self, connection: Connection) -> str:
        """The offer of a search, with its time; empty where none is possible."""
        from multidrop.shell.finding.scanning import Scanning

        try:
            searching = Scanning(self._workspace, open_buses, connection, lambda found: None)
            about = searching.about(searching.stages(()))
        except Diagnostic:
            return ""
        return f"search ({about})? Enter alone begins it, and it asks before other baud rates and languages; "


ECHO = (
    "the adapter repeats what it sends; multidrop removes its own bytes for this session. To state that in the URL: {}"
)


def _echo_found(workspace: Workspace, bus: Bus) -> None:
    """Keep with the connection that the adapter repeats what it sends; say it as soon as drives are listed."""
    record = workspace.of(bus)
    known = record.connection is None or record.connection.local_echo
    if record.connection is not None:
        record.connection = with_echo(record.connection)
    if bus.drives and not known:
        _say_echo(workspace, bus)


def _say_echo(workspace: Workspace, bus: Bus) -> None:
    connection = workspace.of(bus).connection
    if connection is not None:
        text = ECHO.format(url_without_secrets(connection.text))
        workspace.notify(f"{bus.name}: {text}", bus=bus.name, warning=True)


def label(bus: Bus, connection: Connection) -> None:
    """Give the drives of a bus the names that a saved connection has for them."""
    labels, drives = connection.labels, list(bus.drives.values())
    for drive in drives:
        sole = next(iter(labels.values()), "") if len(drives) == len(labels) == 1 else ""
        drive.label = labels.get(drive.address, sole)


def begin_raw(workspace: Workspace, bus: Bus) -> None:
    """Show every byte of a reserved bus from now on."""
    record = workspace.of(bus)
    if record.bytes_shown is not None:
        record.bytes_shown.close()
        record.bytes_shown = None
    record.raw = raw = RawLine(bus, workspace.publish, workspace.wall)
    raw.open()
    text = f"{bus.name} is raw: text goes to {bus.link.transport.name} with CR; /help /raw"
    workspace.notify(text, bus=bus.name)


T = TypeVar("T")


async def side_by_side(
    works: Sequence[Coroutine[Any, Any, T]],
    ready: Callable[[T], None],
    failed: Callable[[int, BaseException], None] | None = None,
) -> None:
    """Await all work at once; call `ready` with each result, in the order of the work.

    A failure goes to `failed`, and the rest goes on; without `failed` the rest is cancelled and the failure raised.
    A cancellation of the caller cancels all work. Nothing is left running on return.
    """
    tasks = [asyncio.ensure_future(work) for work in works]
    pending, passed = set(tasks), 0
    try:
        while pending:
            done, pending = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
            for number, task in enumerate(tasks):
                if task in done and (failure := task.exception()) is not None:
                    if failed is None:
                        raise failure
                    failed(number, failure)
            while passed < len(tasks) and tasks[passed].done():
                if tasks[passed].exception() is None:
                    ready(tasks[passed].result())
                passed += 1
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
