"""Cell files read from TOML, drive by drive with the rules of their families, and single drives of them.

Every error in a file is a `Diagnostic` of one line that names the key and its place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from multidrop.base import registry
from multidrop.base.errors import Diagnostic
from multidrop.base.files import toml_of, utf8_of
from multidrop.base.text import NOT_FIRST, acts_first
from multidrop.dialects.units import check_own
from multidrop.simulator.cell.drive_keys import check_inside
from multidrop.simulator.cell.endpoint_kinds import kind_of, kinds
from multidrop.simulator.cell.spec import BusSpec, Cell, DriveSpec, Endpoint, Faults, MotorSpec
from multidrop.simulator.cell.table import Folder, Source, Table, quoted
from multidrop.simulator.declared import Demo, own_ports
from multidrop.simulator.families import BY_PERSONALITY
from multidrop.simulator.motor_files import with_motor

if TYPE_CHECKING:
    from multidrop.simulator.family import SimulatedFamily

SCHEMES = ("pty", "tcp", "udp")
"""Of endpoints; families add those of `own_ports`, and features others (`EndpointKind`)."""
DEMO_SEED = 1
LONGEST_GATHER = 0.02
"""The highest `gather`, s: USB chips hold bytes for up to 16 ms."""
DRIVE_KEYS = (
    "personality",
    "name",
    "party",
    "set",
    "variables",
    "program",
    "program_text",
    "instruction_us",
    "cse",
    "units",
    "motor",
    "identity",
    "world",
)


class CellReader:
    """Reads cells with drives of some families, given by personality."""

    def __init__(self, families: Mapping[str, type[SimulatedFamily]]) -> None:
        self._families = families

    def load(self, path: str | Path, allow: Sequence[Path] = ()) -> Cell:
        """Read a cell file; `allow`: its paths may lead there, too. Raises Diagnostic."""
        path = Path(path)
        cell = self.read(utf8_of(path), str(path), path.absolute().parent, allow)
        if not cell.buses:
            raise Diagnostic("has no bus", str(path), "each begins with [[bus]]")
        return cell

    def read(
        self, text: str, where: str = "cell", folder: Traversable | None = None, allow: Sequence[Path] = ()
    ) -> Cell:
        """Read the text of a cell; its paths are relative to `folder` (None: the current one). Raises Diagnostic.

        They stay in that folder, or in what is `allow`ed by the person who opens the cell.
        """
        table = Table(toml_of(text, where), where, Source(text, where))
        table.only("seed", "own_units", "bus")
        own = table.texts("own_units")
        table = Table(table.values, where, Source(text, where, own))
        try:
            check_own(own)
        except Diagnostic as problem:
            raise Diagnostic(f"own_units: {problem.message}", table.at_line("own_units"), problem.hint) from None
        here = Folder(Path.cwd() if folder is None else folder, tuple(allow))
        cell = Cell(
            seed=table.integer("seed", 0),
            own_units=own,
            buses=tuple(self._bus(each, where, here, text) for each in table.tables("bus", "[[bus]]")),
        )
        _check_cell(cell, where)
        return cell

    def _bus(self, table: Table, where: str, folder: Folder, text: str) -> BusSpec:
        name = table.values.get("name")
        if isinstance(name, str) and name:
            table = replace(table, where=f"{where}: [[bus]] {quoted(name)}")
        table.only("name", "serve", "baud", "gather", "drive", "faults")
        name = table.text("name")
        if not name or not name.isprintable() or set(name) & set("#@:/ ") or acts_first(name):
            hint = f"valid: a word without spaces, #, @, : or /, {NOT_FIRST}"
            raise table.wrong("name", f"cannot be {quoted(name)}", hint)
        bus = BusSpec(
            name=name,
            serve=tuple(_endpoint(each, table, folder) for each in table.texts("serve")),
            baud=table.integer("baud", 0, low=0, high=4_000_000),
            drives=tuple(self._drive(each, folder) for each in table.tables("drive", "[[bus.drive]]")),
            faults=_faults(table.table("faults", "[bus.faults]")),
            gather=table.number("gather", 0.0, 0.0, LONGEST_GATHER) if "gather" in table.values else None,
        )
        self._check_bus(bus, table)
        self._check_kinds(bus, where, text)
        return bus

    def _drive(self, table: Table, folder: Folder) -> DriveSpec:
        name = table.values.get("personality")
        if isinstance(name, str) and name not in self._families:
            registry.load_others()
        own = self._families[name].keys if isinstance(name, str) and name in self._families else ()
        table.only(*DRIVE_KEYS, *own)
        personality = table.choice("personality", tuple(self._families))
        drive = with_motor(self._families[personality].read_drive(table, folder), table, folder)
        if drive.cse and not self._is_ethernet(personality):
            raise table.wrong("cse", "is for Ethernet drives", f"valid: {self._ethernet}")
        return drive

    def _check_bus(self, bus: BusSpec, table: Table) -> None:
        """Refuse drives that cannot share a wire, and endpoints that reach no drive."""
        names: dict[str, int] = {}
        for number, drive in enumerate(bus.drives, 1):
            where = f"{table.where}: [[bus.drive]] {number}"
            if len(bus.drives) > 1:
                # Refuse a drive that must have its bus to itself.
                if self._is_ethernet(drive.personality):
                    raise Diagnostic(f"an {drive.personality} cannot share its bus", where, "give it a bus of its own")
                if not (drive.party or self._families[drive.personality].addressed):
                    what = "without party mode it replies to every line of the bus"
                    raise Diagnostic(what, where, "add party = true")
            if drive.name in names:
                raise Diagnostic(
                    f'"{drive.name}" is the name of [[bus.drive]] {names[drive.name]} too', where, "use different names"
                )
            names[drive.name] = number
        on_ethernet = any(self._is_ethernet(each.personality) for each in bus.drives)
        own = next((endpoint.scheme for endpoint in bus.serve if endpoint.scheme in own_ports()), "")
        if own and not on_ethernet:
            raise table.wrong("serve", f"has {own}://, and no drive of the bus serves it", f"valid: {self._ethernet}")
        if bus.gather is not None and on_ethernet:
            raise table.wrong("gather", "is for serial drives", "leave it out: an Ethernet drive sends whole replies")

    def _check_kinds(self, bus: BusSpec, where: str, text: str) -> None:
        """Refuse an endpoint that features serve for other drives than it is for, with the line that has it."""
        for scheme in dict.fromkeys(endpoint.scheme for endpoint in bus.serve):
            kind = None if scheme in _schemes() else kind_of(scheme)
            if kind is None or not kind.families:
                continue
            fits = [name for name, family in self._families.items() if family.name in kind.families]
            others = [drive.personality for drive in bus.drives if drive.personality not in fits]
            if others or not bus.drives:
                lack = f"{others[0]} {kind.lack}" if others else "the bus has no drive"
                line = text.count("\n", 0, text.find(f"{scheme}:", text.find(f'"{bus.name}"'))) + 1
                what = f"serve of [[bus]] {quoted(bus.name)} has {scheme}://, and {lack}"
                raise Diagnostic(what, f"{where}:{line}", f"valid: a bus of {' or '.join(fits)} only")

    @property
    def _ethernet(self) -> str:
        """The personalities with an Ethernet port."""
        return ", ".join(filter(self._is_ethernet, self._families))

    def _is_ethernet(self, personality: str) -> bool:
        return personality in self._families[personality].ethernet


def _schemes() -> tuple[str, ...]:
    return (*SCHEMES, *own_ports())


def _endpoint(text: str, table: Table, folder: Folder) -> Endpoint:
    scheme, colon, rest = text.partition(":")
    if not colon or (scheme not in _schemes() and kind_of(scheme) is None):
        *forms, last = (f"{each}://" for each in (*_schemes()[1:], *(kind.scheme for kind in kinds())))
        what = f"valid: pty:, {', '.join(forms)} or {last} at the beginning"
        raise table.wrong("serve", f"cannot be {quoted(text)}", what)
    if scheme == "pty":
        if not rest.isprintable():
            raise table.wrong("serve", f"cannot be {quoted(text)}")
        link = Path(str(folder.path), rest)
        if rest:
            check_inside(link.parent.resolve() / link.name, rest, "serve", table, folder)
        return Endpoint(text, scheme, path=link if rest else None)
    host, colon, port = rest.removeprefix("//").rpartition(":")
    if not (colon and port.isascii() and port.isdigit() and len(port) < 6 and int(port) < 65536):
        raise table.wrong("serve", f"{quoted(text)} has no port", f"for any free port: {scheme}://127.0.0.1:0")
    if not all(c.isalnum() or c in "-._[]:" for c in host):
        raise table.wrong("serve", f"{quoted(text)} has no valid host", f"as in {scheme}://127.0.0.1:0")
    return Endpoint(text, scheme, host.strip("[]") or "127.0.0.1", int(port))


def _faults(table: Table) -> Faults:
    table.only(*(field.name for field in fields(Faults)))
    if "hangup_for" in table.values and "hangup_after" not in table.values:
        raise table.wrong("hangup_for", "needs hangup_after", "as in hangup_after = 30.0")
    chances = {
        name: table.number(name, 0.0, low=0.0, high=1.0) for name in ("flip", "drop", "double", "insert", "late")
    }
    return Faults(
        **chances,
        late_by=table.span("late_by", Faults.late_by),
        delay=table.span("delay"),
        hangup_after=table.number("hangup_after", 0.0, low=0.0) if "hangup_after" in table.values else None,
        hangup_for=table.number("hangup_for", 0.0, low=0.001) if "hangup_for" in table.values else None,
    )


def _check_cell(cell: Cell, where: str) -> None:
    """Refuse two buses of one name, and two endpoints on one link or port (port 0 is any free one)."""
    names: set[str] = set()
    taken: dict[object, str] = {}
    for bus in cell.buses:
        if bus.name in names:
            raise Diagnostic(f'two buses have the name "{bus.name}"', where, "use different names")
        names.add(bus.name)
        for endpoint in bus.serve:
            place = endpoint.path or (endpoint.port and (endpoint.scheme == "udp", endpoint.host, endpoint.port))
            if place and place in taken:
                message = f"serve {quoted(endpoint.text)} uses the place of {quoted(taken[place])}"
                raise Diagnostic(message, f"{where}: [[bus]] {quoted(bus.name)}")
            taken[place] = endpoint.text


_READER = CellReader(BY_PERSONALITY)
load = _READER.load
read = _READER.read


def demo() -> Cell:
    """Read the cell that comes with the program: the buses that the families show, in order."""
    buses = [bus for path in _shown() for bus in read(_text(path), "demo cell", path).buses]
    cell = Cell(seed=DEMO_SEED, buses=tuple(buses))
    _check_cell(cell, "demo cell")
    return cell


def _shown() -> list[Traversable]:
    """The folders with a demo.toml."""
    return [resources.files(record.package) for record in registry.records(registry.families(), Demo)]


def _text(folder: Traversable) -> str:
    return folder.joinpath("demo.toml").read_text(encoding="utf-8")


class CellDrive(NamedTuple):
    """A drive of a cell, and its table. `cell` is the path of the file, empty for the demo cell."""

    cell: str
    bus: str
    spec: DriveSpec
    table: Mapping[str, Any]
    own_units: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """The drive as `placed` finds it."""
        return f"{self.cell}#{self.bus}:{self.spec.name}"


def placed(cell: str, allow: Sequence[Path] = ()) -> CellDrive:
    """Find a drive: `CELL` if it has only one, else `CELL#BUS` or `CELL#BUS:NAME`. Raises Diagnostic.

    No CELL before the # means the demo cell, as in `sim:#press`. `allow`: as for `load`.
    """
    specs = matching(cell, allow)
    if len(specs) == 1:
        return specs[0]
    path, _, place = cell.partition("#")
    where = path or "demo cell"
    names = ", ".join(spec.place for spec in specs or matching(path, allow))
    what = f"{len(specs)} drives match" if specs else "no such drive"
    raise Diagnostic(what, f"{where}#{place}" if place else where, f"valid for --cell: {names}" if names else "")


def matching(cell: str, allow: Sequence[Path] = ()) -> Sequence[CellDrive]:
    """All drives that `CELL`, `CELL#BUS` or `CELL#BUS:NAME` means. Raises Diagnostic."""
    path, _, place = cell.partition("#")
    bus, _, name = place.partition(":")
    return [drive for drive in _drives(path, allow) if bus in ("", drive.bus) and name in ("", drive.spec.name)]


def _drives(path: str, allow: Sequence[Path]) -> list[CellDrive]:
    texts = [utf8_of(path)] if path else [*map(_text, _shown())]
    shop = read(texts[0], path, Path(path).absolute().parent, allow) if path else demo()
    tables = [table for text in texts for table in toml_of(text, path).get("bus", [])]
    return [
        CellDrive(path, bus.name, spec, _without_files(table, spec), shop.own_units)
        for bus, rows in zip(shop.buses, tables, strict=True)
        for spec, table in zip(bus.drives, rows.get("drive", []), strict=True)
    ]


def _without_files(table: Mapping[str, Any], spec: DriveSpec) -> Mapping[str, Any]:
    """The table with the rows of a motor in place of their file: workers read no file."""
    curve, rotor = spec.world.motor or MotorSpec(())
    return table if rotor or not curve else {**table, "motor": [list(row) for row in curve]}


def read_drive(table: Mapping[str, Any], where: str, own_units: tuple[str, ...] = ()) -> DriveSpec:
    """Read the table of a drive, of which no file is read. Raises Diagnostic."""
    source = Source(own_units=own_units)
    read, folder = Table(table, where, source), Folder(Path())
    return with_motor(BY_PERSONALITY[table["personality"]].read_drive(read, folder), read, folder)
