"""Cell files read from TOML, drive by drive with the rules of their families.

Every error in a file is a `Diagnostic` of one line that names the key and its place.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Protocol

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import LARGEST_PROGRAM, bounded, program_of, toml_of, utf8_of
from multidrop.simulator.cell.spec import BusSpec, Cell, DriveSpec, Endpoint, Faults
from multidrop.simulator.cell.table import Folder, Table, quoted

SCHEMES = ("pty", "tcp", "udp", "modbus")
DRIVE_KEYS = (
    "personality",
    "name",
    "party",
    "set",
    "variables",
    "program",
    "program_text",
    "instruction_us",
    "identity",
    "world",
)
PROGRAM_TEXT = "program_text"


class DriveRules(Protocol):
    """The rules of one family for the drives in a cell."""

    @property
    def ethernet(self) -> Collection[str]:
        """The personalities with an Ethernet port: they have their bus to themselves and speak Modbus/TCP."""

    @property
    def addressed(self) -> bool:
        """Whether each drive replies only to its own address. Otherwise a shared bus needs party mode."""

    def read_drive(self, table: Table, folder: Folder) -> DriveSpec:
        """Read a `[[bus.drive]]` whose personality is one of these. Raises Diagnostic."""


class Reader:
    """Reads cells with drives of some families; `rules` are theirs, by personality."""

    def __init__(self, rules: Mapping[str, DriveRules]) -> None:
        self._rules = rules

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
        table = Table(toml_of(text, where), where)
        table.only("seed", "bus")
        here = Folder(Path.cwd() if folder is None else folder, tuple(allow))
        cell = Cell(
            seed=table.integer("seed", 0),
            buses=tuple(self._bus(each, where, here) for each in table.tables("bus", "[[bus]]")),
        )
        _check_cell(cell, where)
        return cell

    def _bus(self, table: Table, where: str, folder: Folder) -> BusSpec:
        name = table.values.get("name")
        if isinstance(name, str) and name:
            table = Table(table.values, f"{where}: [[bus]] {quoted(name)}")
        table.only("name", "serve", "baud", "drive", "faults")
        name = table.text("name")
        if not name or not name.isprintable() or set(name) & set("#@:/ "):
            raise table.wrong("name", f"cannot be {quoted(name)}", "valid: a word without spaces, #, @, : or /")
        bus = BusSpec(
            name=name,
            serve=tuple(_endpoint(each, table, folder) for each in table.texts("serve")),
            baud=table.integer("baud", 0, low=0, high=4_000_000),
            drives=tuple(self._drive(each, folder) for each in table.tables("drive", "[[bus.drive]]")),
            faults=_faults(table.table("faults", "[bus.faults]")),
        )
        self._check_bus(bus, table)
        return bus

    def _drive(self, table: Table, folder: Folder) -> DriveSpec:
        table.only(*DRIVE_KEYS)
        personality = table.choice("personality", tuple(self._rules))
        return self._rules[personality].read_drive(table, folder)

    def _check_bus(self, bus: BusSpec, table: Table) -> None:
        """Refuse drives that cannot share a wire, and endpoints that reach no drive."""
        names: dict[str, int] = {}
        for number, drive in enumerate(bus.drives, 1):
            where = f"{table.where}: [[bus.drive]] {number}"
            if len(bus.drives) > 1:
                self._check_shared(drive, where)
            if drive.name in names:
                raise Diagnostic(
                    f'"{drive.name}" is the name of [[bus.drive]] {names[drive.name]} too', where, "use different names"
                )
            names[drive.name] = number
        speaks_modbus = any(self._is_ethernet(each.personality) for each in bus.drives)
        if any(each.scheme == "modbus" for each in bus.serve) and not speaks_modbus:
            hint = f"valid: {', '.join(filter(self._is_ethernet, self._rules))}"
            raise table.wrong("serve", "has modbus://, and no drive of the bus serves it", hint)

    def _is_ethernet(self, personality: str) -> bool:
        return personality in self._rules[personality].ethernet

    def _check_shared(self, drive: DriveSpec, where: str) -> None:
        """Refuse a drive that must have its bus to itself."""
        if self._is_ethernet(drive.personality):
            raise Diagnostic(f"an {drive.personality} cannot share its bus", where, "give it a bus of its own")
        if not (drive.party or self._rules[drive.personality].addressed):
            what = "without party mode it replies to every line of the bus"
            raise Diagnostic(what, where, "add party = true")


def common_keys(table: Table, folder: Folder) -> dict[str, Any]:
    """Read the keys of a drive that mean the same in every family, as arguments of DriveSpec. Raises Diagnostic."""
    name = table.text("program", "")
    text = table.text(PROGRAM_TEXT, "")
    if name and text:
        raise table.wrong(PROGRAM_TEXT, "is given, and program too", "use one of them")
    return {
        "personality": table.text("personality"),
        "program": text or _program(name, table, folder),
        "program_name": PROGRAM_TEXT if text else name,
        "instruction_us": table.number("instruction_us", 200.0, low=0.0, high=1e6),
    }


def _program(name: str, table: Table, folder: Folder) -> str:
    if not name:
        return ""
    try:
        _check_inside(Path(folder.real, name).resolve(), name, "program", table, folder)
        file = folder.path.joinpath(name)
        if not file.is_file():
            raise table.wrong("program", f"{quoted(name)} does not exist", "paths are relative to the cell file")
        with file.open("rb") as stream:
            return program_of(bounded(stream, name, LARGEST_PROGRAM), name)[0]
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "not a path"
        raise table.wrong("program", f"{quoted(name)} cannot be read ({why})") from None


def _check_inside(place: Path, name: str, key: str, table: Table, folder: Folder) -> None:
    """Refuse a path that leaves the folder of the cell file: the file may be another person's. Raises Diagnostic."""
    if not folder.holds(place):
        own = f"if the cell is your own: multidrop sim CELL --allow {shlex.quote(str(place))}"
        hint = f"use a path inside it; {own}, or simulator.allow in the configuration"
        raise table.wrong(key, f"{quoted(name)} leaves the folder of the cell file", hint)


def _endpoint(text: str, table: Table, folder: Folder) -> Endpoint:
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in SCHEMES:
        raise table.wrong(
            "serve", f"cannot be {quoted(text)}", "valid: pty:, tcp://, udp:// or modbus:// at the beginning"
        )
    if scheme == "pty":
        if not rest.isprintable():
            raise table.wrong("serve", f"cannot be {quoted(text)}")
        link = Path(str(folder.path), rest)
        if rest:
            _check_inside(link.parent.resolve() / link.name, rest, "serve", table, folder)
        return Endpoint(text, scheme, path=link if rest else None)
    host, colon, port = rest.removeprefix("//").rpartition(":")
    if not (colon and port.isascii() and port.isdigit() and len(port) < 6 and int(port) < 65536):
        raise table.wrong("serve", f"{quoted(text)} has no port", f"for any free port: {scheme}://127.0.0.1:0")
    if not all(c.isalnum() or c in "-._[]:" for c in host):
        raise table.wrong("serve", f"{quoted(text)} has no valid host", f"as in {scheme}://127.0.0.1:0")
    return Endpoint(text, scheme, host.strip("[]") or "127.0.0.1", int(port))


def _faults(table: Table) -> Faults:
    table.only(*(each.name for each in fields(Faults)))
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
        for each in bus.serve:
            place = each.path or (each.port and (each.scheme == "udp", each.host, each.port))
            if place and place in taken:
                message = f"serve {quoted(each.text)} uses the place of {quoted(taken[place])}"
                raise Diagnostic(message, f"{where}: [[bus]] {quoted(bus.name)}")
            taken[place] = each.text
