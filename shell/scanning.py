"""The search for drives on a port: language by language, baud rate by baud rate, one opening of the port for each.

It begins with the given baud rate and MCode, and ends with the first of these at which a drive replies, unless all are
asked for. Anything else may be an error to a drive that is set to another baud rate or speaks another language, so a
person is asked before it is tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from dialects import Diagnostic, DriveState
from dialects.families import DEFAULT, FAMILIES
from dialects.scanning import Reach, Scan
from shell import jobs
from shell.connect.opening import port_name
from shell.connect.urls import Connection
from transports import TransportLost

if TYPE_CHECKING:
    from shell.connect.opening import Opened, Opener
    from shell.workspace import Workspace

BAUDED = ("serial", "rfc2217")
"""The schemes of ports that have a baud rate."""
PLACE = 0
BYTES = 20
"""The mean size of the questions to one address, bytes; for the estimate."""
HAZARD = (
    "a drive that receives another baud rate or language may take it for an error, and the OE subroutine of its "
    "program may then run and move it"
)


class NothingFound(TransportLost):
    """No drive replied."""


class Stage(NamedTuple):
    """One part of a search."""

    family: str
    baud: int | None
    """None: the port has no baud rate."""

    @property
    def scan(self) -> Scan[Any]:
        """The search of the family."""
        found = FAMILIES[self.family].scan
        assert found is not None
        return found

    @property
    def words(self) -> str:
        """The part for a person."""
        return f"{self.scan.title} at {self.baud} baud" if self.baud else self.scan.title


@dataclass(frozen=True)
class FoundDrive:
    """A drive that replied, and where."""

    connection: Connection
    """Leads to the port as the drive is set."""
    port: str
    state: DriveState

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
    """The URL that opens drives of one language and baud rate on one port."""
    connection, codec = found[0].connection, found[0].state.codec
    keys = []
    if connection.baud:
        keys.append(f"baud={connection.baud}")
    if codec.family != DEFAULT:
        keys.append(f"dialect={codec.family}")
    party = getattr(codec, "party", None)
    if party is not None and connection.scheme != "udp":
        keys.append(f"party={int(party)}")
    if names := [each.state.address for each in found if each.state.address]:
        keys.append(f"drives={','.join(names)}")
    elif party is None:
        keys.append("address=none")
    if connection.local_echo:
        keys.append("echo=local")
    base = f"serial:{port_name(connection)}" if connection.scheme == "serial" else found[0].port
    head, _, bus = base.partition("#")
    return f"{head}?{'&'.join(keys)}{'#' + bus if bus else ''}"


class Scanning:
    """One search of a port. `report` is called with each drive as soon as it is identified."""

    def __init__(
        self, workspace: Workspace, opener: Opener, connection: Connection, report: Callable[[FoundDrive], None]
    ) -> None:
        """Search nothing yet. Raises Diagnostic for a port that needs no search."""
        if connection.hints.family and FAMILIES[connection.hints.family].scan is None:
            raise Diagnostic(
                f"scan searches for {' and '.join(_titles(_families()))} drives", connection.text, "open it instead"
            )
        self.found: list[FoundDrive] = []
        self._workspace = workspace
        self._opener = opener
        self._connection = connection
        self._report = report
        self._done = 0

    async def run(self, bauds: Sequence[int], everything: bool) -> None:
        """Search. `bauds`: only these; `everything`: do not end with the first stage that finds a drive.

        Raises NothingFound, Diagnostic where a person does not agree, and the failures of a port.
        """
        first, *others = self._stages(bauds)
        with jobs.running(self._workspace, f"{self._connection.short}: scan") as job:
            await self._stage(first, job, [first])
        if others and (everything or not self.found):
            await self._go_on([first], others, everything)
        if not self.found:
            raise NothingFound(self._nothing([first, *others]))

    def _stages(self, bauds: Sequence[int]) -> Iterator[Stage]:
        """The stages in their order: the given language and baud rate first."""
        given = self._connection.hints.family
        for family in [given] if given else _families():
            if self._connection.scheme not in BAUDED:
                if bauds:
                    raise Diagnostic("the port has no baud rate", self._connection.text, "drop --baud")
                yield Stage(family, None)
                continue
            record = FAMILIES[family]
            assert record.scan is not None
            order = bauds or (self._connection.baud or record.baud, *record.scan.bauds)
            yield from (Stage(family, baud) for baud in dict.fromkeys(order))

    async def _go_on(self, done: list[Stage], others: list[Stage], everything: bool) -> None:
        """Ask, and search the other stages."""
        so_far = f"{len(self.found)} found" if self.found else "no drive replies"
        seconds = round(sum(map(self._seconds, others)))
        what = f"{so_far} with {_listed(done)}; the search goes on with {_listed(others)} (about {seconds} s); {HAZARD}"
        await self._workspace.confirm(what, _port(self._connection, ""))
        self._done = 0
        with jobs.running(self._workspace, f"{self._connection.short}: scan") as job:
            for stage in others:
                await self._stage(stage, job, others)
                if self.found and not everything:
                    return

    def _seconds(self, stage: Stage) -> float:
        reach = self._reach()
        return stage.scan.places(reach) * (reach.window + BYTES * 10 / (stage.baud or 1_000_000))

    def _reach(self) -> Reach:
        return Reach(alone=self._connection.scheme == "udp")

    # One stage

    async def _stage(self, stage: Stage, job: jobs.Job, all_: Sequence[Stage]) -> None:
        """Open the port for a stage, search, and close it."""
        total = sum(each.scan.places(self._reach()) for each in all_)
        begun = self._done
        repeats = False
        for connection in self._forms(stage):
            self._done = begun
            repeats = False
            for opened in await self._opener(connection, self._named):
                repeats = await self._searched(opened, stage, connection, job, total) or repeats
            if not repeats:
                return
            text = "the adapter repeats what it sends: the search begins again with echo=local"
            self._warn(_port(connection, ""), [text])

    def _forms(self, stage: Stage) -> Iterator[Connection]:
        """The connections of a stage: a second one, with echo=local, for an adapter that repeats what it sends."""
        hints = replace(self._connection.hints, family=stage.family)
        given = replace(self._connection, baud=stage.baud, hints=hints)
        yield given
        if not given.local_echo:
            self._connection = replace(self._connection, local_echo=True)
            yield replace(given, local_echo=True)

    async def _searched(self, opened: Opened, stage: Stage, connection: Connection, job: jobs.Job, total: int) -> bool:
        """Search one bus; return whether its adapter repeats what it sends."""
        bus, workspace = opened.bus, self._workspace
        port = _port(connection, bus.name)

        def found(state: DriveState) -> None:
            bus.reaches(state.address)
            each = FoundDrive(connection, port, state)
            self.found.append(each)
            self._report(each)
            self._warn(port, state.take_messages()[0])

        def step() -> None:
            self._done += 1
            job(min(self._done, total), total)

        reach = replace(self._reach(), cut=opened.hints.cut, first_mark=opened.hints.first_mark)
        workspace.adopt(opened, PLACE)
        try:
            outcome = await bus.search(stage.scan.search(reach, found, step))
        finally:
            await workspace.forget(bus)
        self._warn(f"{port}: {stage.words}", outcome.remarks)
        return bool(outcome.echo)

    def _warn(self, where: str, texts: Iterable[str]) -> None:
        for each in texts:
            self._workspace.notify(f"{where}: {each}", warning=True)

    def _named(self, name: str) -> str:
        return name

    def _nothing(self, stages: list[Stage]) -> str:
        return (
            f"no drive replies on {_port(self._connection, '')} ({_listed(stages)}; all names, with and without a "
            "checksum); check power, wiring (are A and B swapped?) and the adapter, or see rescue"
        )


def _families() -> list[str]:
    """The languages that a search tries."""
    return [name for name, family in FAMILIES.items() if family.scan is not None]


def _titles(names: Iterable[str]) -> list[str]:
    return [scan.title for name in names if (scan := FAMILIES[name].scan) is not None]


def _listed(stages: Iterable[Stage]) -> str:
    """Stages in words: `MCode at 4800, 19200 baud and PMX at 9600 baud`."""
    by_family: dict[str, list[str]] = {}
    for each in stages:
        by_family.setdefault(each.scan.title, []).extend([str(each.baud)] if each.baud else [])
    parts = [f"{title} at {', '.join(bauds)} baud" if bauds else title for title, bauds in by_family.items()]
    return " and ".join(parts)


def _port(connection: Connection, bus: str) -> str:
    """The port for a person and a program, without keys."""
    if connection.scheme == "serial":
        return connection.target
    if connection.scheme == "sim":
        return f"sim:{connection.target}" + (f"#{connection.bus or bus}" if connection.bus or bus else "")
    host = f"[{connection.host}]" if ":" in connection.host else connection.host
    return f"{connection.scheme}://{host}:{connection.port}"
