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
from multidrop.simulator.cell.drive_keys import LONGEST
from multidrop.simulator.declared import own_ports

HEAD = "A machine as it was read. Open it with sim:FILE; `multidrop snapshot apply FILE URL` puts a drive onto a unit."


@dataclass(frozen=True)
class Entry:
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
    settings: Sequence[Entry] = ()
    variables: Sequence[Entry] = ()
    identity: Sequence[Entry] = ()
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
    return "; ".join(each for each in (reading.unit, f"factory {reading.default}" if known else "") if each)


def plain(text: str) -> str:
    """A text that a unit reports, as `identity` takes it: odd characters become question marks."""
    return "".join(each if each.isascii() and each.isprintable() else "?" for each in text)[:LONGEST]


def write(buses: Sequence[BusText]) -> str:
    """Return the text of a cell file."""
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment(HEAD))
    scales = [scale for bus in buses for drive in bus.drives for scale in drive.units.values()]
    if own := sorted({each.unit.name for each in scales}.difference(PLACES)):
        document.add("own_units", own)
    tables = tomlkit.aot()
    for each in buses:
        tables.append(_bus(each))
    document.add("bus", tables)
    return escaped_toml(tomlkit.dumps(document))


def _bus(bus: BusText) -> Any:
    import tomlkit

    ethernet = any(each.ethernet for each in bus.drives)
    baud = bus.baud or next((each.baud for each in bus.drives if each.baud), 0)
    table = tomlkit.table()
    table.add("name", bus.name)
    table.add("serve", [ANY_PORT, *map(ANY.format, own_ports())] if ethernet else ["pty:", ANY_PORT])
    if baud and not ethernet:
        table.add("baud", baud)
    for text in bus.missing:
        table.add(tomlkit.comment(visible(text)))
    drives = tomlkit.aot()
    for each in bus.drives:
        drives.append(_drive(each))
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
        scales = {axis: _written(each) for axis, each in drive.units.items()}
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
    found: dict[str, str | int] = {"scale": str(scale)}
    if scale.anchored:
        found["zero"] = scale.shown(scale.zero)
    if scale.travel is not None:
        found["travel"] = scale.shown_travel
    if scale.full_steps is not None:
        found["full_steps"] = scale.full_steps
    return _inline(found) if len(found) > 1 else str(scale)


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


def _entries(entries: Sequence[Entry]) -> Any:
    import tomlkit

    table = tomlkit.table()
    for each in entries:
        item = tomlkit.item(each.value)
        if each.remark:
            item.comment(each.remark)
        table.add(each.key, item)
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
