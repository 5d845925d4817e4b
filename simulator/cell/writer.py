"""Cell files written from drives as they were read. Equal drives give equal files, byte by byte."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from multidrop.base.files import escaped_toml
from multidrop.base.text import visible
from multidrop.dialects.units import PLACES, Scale
from multidrop.dialects.values import Reading, same
from multidrop.dialects.written_scales import written
from multidrop.simulator.cell.drive_keys import LONGEST_TEXT_VALUE
from multidrop.simulator.declared import own_ports

HEAD = "A machine as it was read. Open it with sim:FILE; `multidrop snapshot apply FILE URL` puts a drive onto a unit."


@dataclass(frozen=True)
class CellEntry:
    """One line of a table, with a remark after it."""

    key: str
    value: Any
    remark: str = ""


@dataclass(frozen=True)
class DriveText:
    """The `[[bus.drive]]` table of one drive."""

    personality: str
    name: str
    party: bool = False
    remarks: Sequence[str] = ()
    unread: Sequence[tuple[str, str]] = ()
    """What could not be read, with reasons."""
    program: Sequence[str] = ()
    settings: Sequence[CellEntry] = ()
    variables: Sequence[CellEntry] = ()
    identity: Sequence[CellEntry] = ()
    worlds: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: MappingProxyType({}))
    """The keys of each axis; "" is the only one."""
    ethernet: bool = False
    baud: int = 0
    units: Mapping[str, Scale] = field(default_factory=lambda: MappingProxyType({}))
    """The scales of its axes; "" is the only one."""


@dataclass(frozen=True)
class BusText:
    """A `[[bus]]` table. `missing`: remarks on drives that were not read."""

    name: str
    drives: Sequence[DriveText]
    baud: int = 0
    missing: Sequence[str] = ()


def remark(reading: Reading) -> str:
    """What a person wants to know of a value: its unit, and the factory's value where it differs."""
    known = reading.default is not None and not same(reading.default, reading.value)
    return "; ".join(part for part in (reading.unit, f"factory {reading.default}" if known else "") if part)


def plain(text: str) -> str:
    """A text that a unit reports, as `identity` takes it: odd characters become question marks."""
    return "".join(character if character.isascii() and character.isprintable() else "?" for character in text)[
        :LONGEST_TEXT_VALUE
    ]


def write(buses: Sequence[BusText]) -> str:
    """Return the text of a cell file."""
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment(HEAD))
    scales = [scale for bus in buses for drive in bus.drives for scale in drive.units.values()]
    if own := sorted({scale.unit.name for scale in scales}.difference(PLACES)):
        document.add("own_units", own)
    tables = tomlkit.aot()
    for bus in buses:
        tables.append(_bus(bus))
    document.add("bus", tables)
    return escaped_toml(tomlkit.dumps(document))


def _bus(bus: BusText) -> Any:
    import tomlkit

    ethernet = any(drive.ethernet for drive in bus.drives)
    baud = bus.baud or next((drive.baud for drive in bus.drives if drive.baud), 0)
    table = tomlkit.table()
    table.add("name", bus.name)
    table.add("serve", [ANY_PORT, *map(ANY.format, own_ports())] if ethernet else ["pty:", ANY_PORT])
    if baud and not ethernet:
        table.add("baud", baud)
    for text in bus.missing:
        table.add(tomlkit.comment(visible(text)))
    drives = tomlkit.aot()
    for drive in bus.drives:
        drives.append(_drive(drive))
    if bus.drives:
        table.add("drive", drives)
    return table


ANY = "{}://127.0.0.1:0"
ANY_PORT = ANY.format("tcp")


def _drive(drive: DriveText) -> Any:
    import tomlkit

    table = tomlkit.table()
    table.add("personality", drive.personality)
    table.add("name", drive.name)
    if drive.party:
        table.add("party", True)
    if drive.units:
        scales = {axis: _written(unit) for axis, unit in drive.units.items()}
        table.add("units", scales[""] if "" in scales else _inline(scales))
    for text in (*drive.remarks, *_not_read(drive.unread)):
        table.add(tomlkit.comment(visible(text)))
    if drive.program:
        table.add("program_text", tomlkit.string("".join(f"{line}\n" for line in drive.program), multiline=True))
    for key, entries in (("set", drive.settings), ("variables", drive.variables), ("identity", drive.identity)):
        if entries:
            table.add(key, _entries(entries))
    if drive.worlds:
        table.add("world", _world(drive.worlds))
    return table


def _written(scale: Scale) -> Any:
    """A scale as it is read again: its text, or a table where it has more."""
    table = written(scale)
    return _inline(table) if len(table) > 1 else str(scale)


def _inline(found: Mapping[str, Any]) -> Any:
    import tomlkit

    table = tomlkit.inline_table()
    table.update(found)
    return table


def _not_read(unread: Sequence[tuple[str, str]]) -> list[str]:
    """A remark for each reason, with the names that have it."""
    reasons: dict[str, list[str]] = {}
    for name, why in unread:
        reasons.setdefault(why, []).append(name)
    return [f"not read: {', '.join(names)} ({why})" for why, names in reasons.items()]


def _entries(entries: Sequence[CellEntry]) -> Any:
    import tomlkit

    table = tomlkit.table()
    for entry in entries:
        item = tomlkit.item(entry.value)
        if entry.remark:
            item.comment(entry.remark)
        table.add(entry.key, item)
    return table


def _world(worlds: Mapping[str, Mapping[str, Any]]) -> Any:
    import tomlkit

    table = tomlkit.table()
    for axis, keys in worlds.items():
        own = table if not axis else tomlkit.table()
        for key, value in keys.items():
            own.add(key, value)
        if axis:
            table.add(axis, own)
    return table
