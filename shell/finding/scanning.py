"""The search for drives on a port: language by language, baud rate by baud rate, one opening of the port for each.

It begins with the given baud rate and the default language, and ends with the first of these at which a drive replies,
unless all are asked for. Anything else may be an error to a drive that is set to another baud rate or speaks another
language, so a person is asked before it is tried. A language with a hazard of its own is searched only by its name,
after a question.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.dialects import DriveState, Procedure
from multidrop.dialects.families import DEFAULT, FAMILIES, spoken
from multidrop.dialects.scanning import WINDOW, Reach, Scan
from multidrop.drives.bus import Bus
from multidrop.drives.protected_units import silent
from multidrop.drives.silence import explained
from multidrop.drives.stopping import Halt
from multidrop.shell import stop_report
from multidrop.shell.channel import Job, running
from multidrop.shell.connect.opening import OpenedBus, Opener
from multidrop.shell.connect.scheme import Connection
from multidrop.shell.connect.urls import with_echo
from multidrop.shell.finding.limits import searched
from multidrop.shell.state.port_state import memory_of
from multidrop.shell.workspace import Workspace

LONGEST_NETWORK_DELAY = 0.2
"""The longest time for which a network's reply is waited, s; `timeout=` in the URL replaces it."""
SPREAD, JITTER = 2.0, 0.02
"""Over a network, a reply may take this many times as long as the measured one, and this time, s, more."""
PLACE = 0
REPEATED = 0.2
"""The time in which a stop is repeated once the line is quiet, s."""
UNLISTED = "It was not confirmed for drives that have not replied"
SO_FAR = "nothing more was sent"
"""The end of the message of a refused question in the middle of a search."""
HAZARD = (
    "a drive that receives another baud rate or language may take it for an error, and the OE subroutine of its "
    "program may then run and move it"
)


@dataclass(frozen=True)
class FoundDrive:
    """A drive that replied, and where."""

    connection: Connection
    """Leads to the port as the drive is set."""
    port: str
    state: DriveState

    @property
    def form(self) -> tuple[object, ...]:
        return self.port, self.connection.baud, self.state.codec.family, bool(self.state.address)

    @property
    def url(self) -> str:
        """The URL that opens this drive alone."""
        return url_of([self])

    def facts(self) -> dict[str, Any]:
        """The drive for a program."""
        state, codec = self.state, self.state.codec
        return {
            "port": self.port,
            "baud": self.connection.baud,
            "dialect": codec.family,
            "address": state.address,
            "name": state.name,
            "product": state.product,
            "part": state.part,
            "version": state.version,
            "serial": state.serial,
            **{key: getattr(codec, key, None) for key in ("party", "checksum", "em", "escape")},
            "url": self.url,
        }

    def words(self) -> str:
        """The drive for a person, in one line."""
        state = self.state
        baud = f"{self.connection.baud} baud" if self.connection.baud else ""
        name = state.address or (f"({state.name})" if state.name else "-")
        part = f"part {state.part}" if state.part else ""
        serial = f"serial {state.serial}" if state.serial else ""
        product = "" if state.version.startswith(state.product) else state.product
        modes = getattr(state.codec, "shown", "")
        return "  ".join(filter(None, (self.port, baud, name, product, state.version, part, serial, modes)))


def url_of(found: Sequence[FoundDrive]) -> str:
    """The URL that opens the first drive, with those of its language, baud rate and mode on its port."""
    found = [drive for drive in found if drive.form == found[0].form]
    connection, codec = found[0].connection, found[0].state.codec
    if connection.scheme.direct:
        return found[0].port
    keys = []
    if connection.baud:
        keys.append(f"baud={connection.baud}")
    if codec.family != DEFAULT:
        keys.append(f"dialect={codec.family}")
    party = getattr(codec, "party", None)
    if party is not None and not connection.scheme.alone:
        keys.append(f"party={int(party)}")
    if names := [drive.state.address for drive in found if drive.state.address]:
        keys.append(f"drives={','.join(names)}")
    elif party is None:
        keys.append("address=none")
    if connection.relay:
        keys.append(f"relay={connection.relay}")
    if connection.local_echo:
        keys.append("echo=local")
    base = connection.scheme.found(connection, found[0].port)
    head, _, bus = base.partition("#")
    return head + (f"?{'&'.join(keys)}" if keys else "") + (f"#{bus}" if bus else "")


class NothingFound(TransportLost):
    """No drive replied."""


class Stage(NamedTuple):
    """One part of a search."""

    family: str
    baud: int | None
    """None: the port has no baud rate."""

    @property
    def scan(self) -> Scan:
        scan = FAMILIES[self.family].scan()
        assert scan is not None
        return scan

    @property
    def words(self) -> str:
        """The part for a person."""
        return f"{self.scan.title} at {self.baud} baud" if self.baud else self.scan.title


class Scanning:
    """One search of a port. `report` is called with each drive as soon as it is identified."""

    def __init__(
        self, workspace: Workspace, opener: Opener, connection: Connection, report: Callable[[FoundDrive], None]
    ) -> None:
        """Search nothing yet. Raises Diagnostic for a port that needs no search."""
        if connection.hints.family and FAMILIES[connection.hints.family].scan() is None:
            titles = [scan.title for family in FAMILIES.values() if (scan := family.scan()) is not None]
            searched = f"{', '.join(titles[:-1])} and {titles[-1]}"
            raise Diagnostic(f"scan searches for {searched} drives", connection.text, "open it instead")
        self.found: list[FoundDrive] = []
        self.port = connection.scheme.shown(connection)
        """The port for a person."""
        self._workspace = workspace
        self._opener = opener
        self._connection = connection
        self._report = report
        self._done = 0
        self._agreed_to: dict[Stage, None] = {}
        """The stages that need no question, and those that a person has agreed to."""
        self._tried: dict[Stage, None] = {}
        """The stages at which the port was opened."""
        self._stopped: dict[Stage, None] = {}
        """The stages at which a stop was sent."""
        self._read: list[Halt] = []
        """The stops whose drives were read."""
        self._asked: dict[Stage, dict[str, None]] = {}
        """The addresses that a stage has asked, where a stop must name each."""
        self._woken: dict[Stage, dict[str, None]] = {}
        """The addresses that replied to a stop only."""
        self._everything = False
        self._other = ""
        """What shows that drives of another family reply on the line, in words."""
        self._said: set[str] = set()
        self._first: Bus | None = None
        """The first bus on which something was received, or else the bus of the first stage."""
        self._received = False
        """Something was received on a bus."""

    async def run(self, bauds: Sequence[int], everything: bool) -> None:
        """Search. `bauds`: only these; `everything`: do not end with the first stage that finds a drive.

        Raises NothingFound, Diagnostic where a person does not agree, and the failures of a port.
        """
        self._everything = everything
        first, *others = self.stages(bauds)
        reach = self._reach()

        if first.scan.hazard:
            asks = f"the search with {listed([first])} asks {first.scan.asked(reach)}, {self.about([first])}"
            await self._workspace.questions.confirm(f"{asks}; {first.scan.hazard}", self.port)
        async with self.stopping_all():
            await self.search([first], False)
            if self._other:  # its drives would reply to each question of the other stages, too
                others = []
            if others and (everything or not self.found):
                so_far = f"{len(self.found)} found" if self.found else "no drive replies"
                on = f"the search goes on with {listed(others)} ({self.about(others)})"
                try:
                    what = f"{so_far} with {listed([first])}; {on}; {HAZARD}"
                    await self._workspace.questions.confirm(what, self.port, SO_FAR)
                except Diagnostic:
                    if not self.found or self._workspace.front.ask is None:
                        raise
                    return  # a no ends the search where a drive was found
                await self.search(others, everything)
        if not self.found:
            advice = "; multidrop rescue PORT frees a drive that is stuck" if first.scan.clears else ""
            raise self.nothing([first, *others], advice)

    def about(self, stages: Iterable[Stage]) -> str:
        """The time that a search takes, where no drive replies."""
        return f"about {round(sum(stage.scan.seconds(self._reach(), stage.baud) for stage in stages))} s"

    def stages(self, bauds: Sequence[int]) -> list[Stage]:
        """The stages in their order: the given language and baud rate first."""
        given = self._connection
        searched = [
            name for name, family in FAMILIES.items() if (scan := family.scan()) is not None and not scan.hazard
        ]
        stages = [Stage(family, None) for family in ([given.hints.family] if given.hints.family else searched)]
        if not given.scheme.bauded:
            if bauds:
                raise Diagnostic("the port has no baud rate", given.text, "drop --baud")
            return stages
        return [
            Stage(stage.family, baud)
            for stage in stages
            for baud in dict.fromkeys(bauds or (given.baud or FAMILIES[stage.family].baud, *stage.scan.bauds))
        ]

    async def search(self, stages: Sequence[Stage], everything: bool, hasty: bool = False) -> None:
        """Search these stages, to the first one that finds a drive unless `everything`. `hasty`: see `Reach`.

        A person has agreed to all of them, or need not.
        """
        before, self._done = len(self.found), 0
        self._agreed_to |= dict.fromkeys(stages)
        with running(self._workspace, f"{self._connection.short}: scan") as job:
            for stage in stages:
                await self._stage(stage, job, stages, hasty)
                if len(self.found) > before and not everything:
                    return

    # A stop meanwhile

    @asynccontextmanager
    async def stopping_all(self) -> AsyncIterator[None]:
        """Have a stop meanwhile reach drives wherever they may be, once it was written as the port is open now."""
        stops = self._workspace.stops
        try:
            yield
        except BaseException:
            if self._workspace.stops != stops:
                stopping = asyncio.ensure_future(self._stop_everywhere())
                while not stopping.done():
                    with suppress(asyncio.CancelledError):  # another stop key, or the end: the stop goes on
                        await asyncio.shield(stopping)
                stopping.result()
            raise

    async def _stop_everywhere(self) -> None:
        """Send a stop where drives replied, are remembered or were sent something; then as far as was agreed.

        At a wrong rate it is an error, and an OE subroutine may move its drive: so the first ones follow again. What
        replied is read in the end, because that takes as long as a drive slows down.
        """
        replied = [_stage_of(drive.connection) for drive in self.found]
        memory, _ = memory_of(self._workspace.settings.state, self._connection.port_name)
        named = self._connection.hints.family in ("", DEFAULT)
        remembered = [Stage(DEFAULT, memory.baud)] if named and memory.drives and memory.baud else []
        likely = list(dict.fromkeys([*replied, *remembered, *self._tried]))
        others = [each for each in self._agreed_to if each not in likely]
        for stage in [*(each for each in likely if each not in self._stopped), *others]:
            await self._stop_at(stage, confirm=False)
        for stage in likely if others else dict.fromkeys([*replied, *self._woken]):
            await self._stop_at(stage, confirm=True)
        if self._stopped:
            left_out = [
                other_stage
                for other_stage in self.stages(())
                if other_stage not in {**self._stopped, **self._agreed_to}
            ]
            why = f"; not with {listed(left_out)}: no search there was agreed to" if left_out else ""
            tally = stop_report.of_halts(self._read, self._workspace.wall(self._workspace.stopped_at), False)
            read = f"; {stop_report.words(tally)}" if tally.found else ""
            self._warn(self.port, [f"the stop was sent with {listed(self._stopped)}{why}{read}. {UNLISTED}"])

    async def _stop_at(self, stage: Stage, confirm: bool) -> None:
        """Send a stop at a stage, to the drives that replied there by name; `confirm`: read them, else ask no others.

        An address that was asked and has not replied gets a short stop. Where that is answered, the whole one follows.
        """
        try:
            opened = await self._opener(self.connection(stage), str)
        except TransportLost as loss:
            self._warn(self.port, [f"NO STOP SENT with {stage.words}: {loss}"])
            return
        for opening in opened:
            async with self._adopted(opening, stage):
                for found_drive in self.found:
                    if _stage_of(found_drive.connection) == stage:
                        opening.bus.roster.found(found_drive.state)
                roster, woken = opening.bus.roster, self._woken.get(stage, {})
                for name in woken:
                    roster.found(roster.family.new_state(roster.family.codec, name))
                asked = [name for name in self._asked.get(stage, ()) if name not in roster.drives]
                roster.sweep = () if confirm else tuple(stage.scan.stop(asked))
                with opening.bus.link.received() as heard:
                    await self._halted(opening.bus, stage, confirm)
                replied = roster.family.in_frames(bytes(heard)) if roster.sweep else ()
                if new := [name for name in replied if name not in roster.drives]:
                    self._woken[stage] = woken | dict.fromkeys(new)
                    roster.sweep = ()
                    for name in new:
                        roster.found(roster.family.new_state(roster.family.codec, name))
                    await self._halted(opening.bus, stage, False)

    async def _halted(self, bus: Bus, stage: Stage, confirm: bool) -> None:
        """Stop a bus, and wait until the whole stop has left; `confirm`: read the drives that are listed."""
        halt = bus.halt()
        bus.halted(halt, confirm=confirm and bool(bus.drives))
        await bus.stopped()
        while bus.line.stopping:
            await asyncio.sleep(REPEATED)
        await asyncio.sleep(REPEATED + 2 * len(halt.data) * 10 / (stage.baud or 1_000_000))
        if confirm and bus.drives:
            self._read.append(halt)

    def connection(self, stage: Stage) -> Connection:
        """The connection as a stage opens it."""
        return replace(self._connection, baud=stage.baud, hints=replace(self._connection.hints, family=stage.family))

    async def converse(self, connection: Connection, procedure: Callable[[], Procedure[None]]) -> None:
        """Open the port, and run a conversation with all that is there."""
        async with self.opened(connection) as bus:
            await bus.search(procedure())

    @asynccontextmanager
    async def opened(self, connection: Connection) -> AsyncIterator[Bus]:
        """Open the port, of several simulated buses the first, and close it in the end; a stop reaches it meanwhile."""
        opened, *others = await self._opener(connection, str)
        for opening in others:
            await opening.bus.close()
        async with self._adopted(opened, _stage_of(connection)) as bus:
            yield bus

    @asynccontextmanager
    async def _adopted(self, opened: OpenedBus, stage: Stage) -> AsyncIterator[Bus]:
        """Have a stop reach a bus, and close it in the end."""
        bus = opened.bus
        self._tried[stage] = None
        self._first = self._first or bus
        bus.roster.probing = stage.scan.names
        self._workspace.adopt(opened, PLACE).probe = True
        if opened.limits and opened.limits not in self._said:
            self._said.add(opened.limits)
            self._warn(self.port, [opened.limits])
        try:
            yield bus
        finally:
            if bus.last_stop is not None and bus.last_stop.data:
                self._stopped[stage] = None
            if stage in self._asked and bus.line.take_repeats():
                self._stopped.pop(stage, None)  # frames without the time for replies reach no module: it is sent again
            await self._workspace.forget(bus)

    def nothing(self, stages: Sequence[Stage], advice: str = "") -> NothingFound:
        """Make the failure that names what was tried."""
        nothing = NothingFound(
            f"no drive replies on {self.port} ({listed(stages)}; {stages[0].scan.asked(self._reach())}){advice}"
        )
        if self._first is None:
            return nothing
        link, family = self._first.link, self._first.roster.family
        return silent(explained(nothing, link, family.name), link, family)

    def _reach(self, distance: float = 0.0, hasty: bool = False) -> Reach:
        """The manner of the search. `distance`: the time of the network to a drive and back, s."""
        scheme, window = self._connection.scheme, self._connection.timeout or WINDOW
        if self._connection.timeout is None:
            window += distance
        return Reach(window=window, alone=scheme.alone, hasty=hasty, everything=self._everything)

    # One stage

    async def _stage(self, stage: Stage, job: Job, all_: Sequence[Stage], hasty: bool) -> None:
        """Open the port for a stage, search, and close it."""
        total = sum(each.scan.places(self._reach()) for each in all_)
        begun = self._done

        def step() -> None:
            self._done = min(self._done + 1, total)
            job(self._done, total)

        connection, began = self.connection(stage), self._workspace.now()
        buses = await self._opener(connection, str)
        distance = min((self._workspace.now() - began) * connection.scheme.turns, LONGEST_NETWORK_DELAY)
        if (trip := buses[0].bus.link.transport.round_trip) is not None:
            distance = SPREAD * trip + JITTER
        async with AsyncExitStack() as open_:
            for bus in buses:
                await open_.enter_async_context(self._adopted(bus, stage))
            for bus in buses:
                self._done = begun
                await self._searched(bus, stage, self._reach(distance, hasty), step)

    def _repeats(self) -> None:
        """Note that the adapter repeats what it sends: every stage opens its port with echo=local from now on."""
        if not self._connection.local_echo:
            self._connection = with_echo(self._connection)
            text = "the adapter repeats what it sends; the URLs that are found have echo=local"
            self._warn(self._connection.scheme.shown(self._connection), [text])

    async def _searched(self, opened: OpenedBus, stage: Stage, reach: Reach, step: Callable[[], None]) -> None:
        """Search one bus."""
        bus, hints = opened.bus, opened.hints
        port = self._connection.scheme.shown(self._connection, bus.name)
        bus.link.on_echo = self._repeats

        def found(state: DriveState) -> None:
            bus.roster.probes(state.address)
            drive = FoundDrive(self.connection(stage), port, state)
            self.found.append(drive)
            self._report(drive)
            self._warn(port, state.take_messages()[0])

        def asks(address: str) -> None:
            self._asked.setdefault(stage, {})[address] = None

        reach = replace(reach, asks=asks, cut=hints.cut, first_mark=hints.first_mark)
        with bus.link.received() as heard:
            outcome = await searched(bus, stage.scan, reach, found, step)
        if heard and not self._received:
            self._first, self._received = bus, True
        self._other = spoken(bytes(heard), stage.family) or self._other
        self._warn(f"{port}: {stage.words}", filter(None, (*outcome.remarks, self._other)))

    def _warn(self, where: str, texts: Iterable[str]) -> None:
        for text in texts:
            self._workspace.notify(f"{where}: {text}", warning=True)


def _stage_of(connection: Connection) -> Stage:
    return Stage(connection.hints.family or DEFAULT, connection.baud)


async def extend(workspace: Workspace, bus: Bus) -> list[str]:
    """Search an open bus for drives that are not listed, and list them; return their addresses. Raises Diagnostic."""
    scan = bus.roster.family.scan()
    if scan is None or scan.hazard:
        raise Diagnostic(f"{bus.name}: its drives cannot be searched for", hint="/open URL names them in drives=")
    if "" in bus.drives:
        raise Diagnostic(f"{bus.name}: its drive takes no address", hint="no other drive can share its line")
    if storing := [drive.address for drive in bus.all_drives if drive.programming]:
        raise Diagnostic(f"{bus.name}: {storing[0]} is in program mode", hint=f"@{storing[0]} PG ends it")
    states: list[DriveState] = []
    reach = Reach(known=tuple(bus.drives))
    total, done = scan.places(reach), 0

    def step() -> None:
        nonlocal done
        done += 1
        job(done, total)

    with running(workspace, f"{bus.name}: scan") as job:
        outcome = await searched(bus, scan, reach, states.append, step)
    for remark in outcome.remarks:
        workspace.notify(f"{bus.name}: {remark}", bus=bus.name, warning=True)
    await bus.add(states)
    return [state.address for state in states]


def listed(stages: Iterable[Stage]) -> str:
    """Stages in words: `LANGUAGE at 4800, 19200 baud and OTHER at 9600 baud`."""
    by_family: dict[str, list[str]] = {}
    for stage in stages:
        by_family.setdefault(stage.scan.title, []).extend([str(stage.baud)] if stage.baud else [])
    parts = [f"{title} at {', '.join(bauds)} baud" if bauds else title for title, bauds in by_family.items()]
    return " and ".join(parts)
