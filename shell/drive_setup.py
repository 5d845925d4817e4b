"""The set-up of a drive in the configuration: its name, the scale of an axis with zero and travel, and what asks first.

A change is checked whole, with what the drive reports, before the file is written. The file is replaced as a whole and
keeps its comments. The session has the change at once, without opening the line again.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from multidrop.base.errors import Diagnostic
from multidrop.base.places import config_file
from multidrop.dialects.units import KEYS, Measure, Scale, scale
from multidrop.dialects.written_scales import written
from multidrop.shell import configuration
from multidrop.shell.configuration import TRAVEL, SavedConnection, Settings

if TYPE_CHECKING:
    from multidrop.drives.drive import Drive
    from multidrop.shell.session import Session

NO_ADDRESS = "!"
"""What the configuration calls a drive without an address."""
SCALED = ("scale", "zero", "travel", "full_steps")
_PLAIN = re.compile(r"\s*[+-]?[0-9.]+(?:\s*\.\.\s*[+-]?[0-9.]+)?\s*", re.ASCII)
"""A place or a range without a unit."""
_TO = re.compile(r"(?<=[0-9.])\s+to\s+(?=[+-]?[0-9.])")


@dataclass(frozen=True)
class SetupChange:
    """What is to be changed, as a person types it. None: it stays. An empty text: it is removed."""

    name: str | None = None
    scale: str | None = None
    """`5 mm/turn`."""
    zero: str | None = None
    """`120 mm`; without a unit it is that of the scale."""
    travel: str | None = None
    """`0..300 mm`, or `0 to 300`."""
    full_steps: str | None = None
    guard: str | None = None
    """`on`: moves that leave their travel are asked about, of every drive; `off`: they are not."""
    ask_before: str | None = None
    """Further commands that are asked about, of every drive, with commas."""
    save_as: str = ""
    """The name of a new saved connection, for a line that is not saved."""

    @property
    def scales(self) -> bool:
        """Whether the scale of an axis changes."""
        return any(getattr(self, key) is not None for key in SCALED)

    @property
    def anything(self) -> bool:
        return self != SetupChange(save_as=self.save_as)


def scale_of(present: Scale | None, change: SetupChange, own: Sequence[str]) -> Scale | None:
    """Return the scale of an axis after a change; None: it has none. Raises Diagnostic for a value that is wrong."""
    table: dict[str, Any] = dict(written(present)) if present is not None else {}
    for key in SCALED:
        typed = getattr(change, key)
        if typed is not None:
            table[key] = typed.strip()
    table = {key: value for key, value in table.items() if value != ""}
    if "scale" not in table:
        rest = [key for key in SCALED if key in table and getattr(change, key) is not None]
        if rest:
            raise Diagnostic(f"{rest[0].replace('_', ' ')} needs a scale", "", "give it one, as in 5 mm/turn")
        return None
    if "/" not in table["scale"]:
        table["scale"] += "/turn"
    unit = re.sub(r"^\s*\S+\s+", "", table["scale"]).partition("/")[0].strip()
    for key in ("zero", "travel"):
        text = _TO.sub("..", table.get(key, ""))
        if text:
            table[key] = f"{text} {unit}" if _PLAIN.fullmatch(text) else text
    if isinstance(steps := table.get("full_steps"), str):
        if not steps.isdecimal() or len(steps) > 6:
            raise Diagnostic(f"full steps {steps[:20]!r}: not a whole number", "", "200 for a motor of 1.8 degrees")
        table["full_steps"] = int(steps)
    return scale(table, own)


async def change(session: Session, drive: Drive, axis: str, wanted: SetupChange) -> str:
    """Change the set-up of a drive in the file and in the session; return the file and the name of the connection.

    Raises Diagnostic, DriveError or TransportLost, and then nothing has changed.
    """
    units, bus = session.units, session.bus(drive.link.name)
    record, scaled = session.of(bus), units.of(drive, axis)
    present = scaled.scale if scaled is not None else None
    after = scale_of(present, wanted, session.settings.own_units) if wanted.scales else present
    if after is not None and wanted.scales:
        Measure(after, await units.read(drive, axis, after.full_steps))  # a scale that it cannot use is refused
    if wanted.name:
        _check_name(session, drive, wanted.name)
    url = session.openings.url_of(bus)
    saved_as = record.connection.name if record.connection is not None else ""
    name = saved_as or wanted.save_as
    if (wanted.name is not None or wanted.scales) and not name:
        hint = f"--save-as {bus.name} saves it with the change"
        raise Diagnostic(f"{bus.name} is not a saved connection; nothing was changed", "", hint)
    if name and not url and not saved_as:
        raise Diagnostic(f"{bus.name} was not opened here, so it cannot be saved; nothing was changed")
    if name and not saved_as:
        configuration.check_new(name)
    edit = _Edit(drive, axis, wanted, after, name, url, _labels_of(record.connection))

    def make(document: Any) -> None:
        edit.make(document)

    path, settings = await asyncio.to_thread(configuration.change, make)
    _take(session, settings, name)
    if name and record.connection is not None:
        record.connection = replace(record.connection, name=name, labels=settings.connections[name].names)
    if wanted.name is not None:
        drive.label = wanted.name
    if wanted.scales:
        await _rescale(session, drive, axis, present, after)
    session.changed()
    return f"{path}{f': connection {name}' if name else ''}"


def _labels_of(connection: Any) -> Mapping[str, str]:
    return connection.labels if connection is not None else {}


def _check_name(session: Session, drive: Drive, name: str) -> None:
    """Raise Diagnostic for a name that another drive of the line has."""
    for other in session.bus(drive.link.name).drives.values():
        if other is not drive and name in (other.address, other.label):
            raise Diagnostic(f"{other.link.name}:{other.address} is called {name} already", "", "give another name")


def _take(session: Session, settings: Settings, name: str) -> None:
    """Have the session use what was written: one connection, and what asks first."""
    connections = dict(session.settings.connections)
    if name:
        connections[name] = settings.connections[name]
    session.settings = replace(session.settings, connections=connections, guards=settings.guards)


async def _rescale(session: Session, drive: Drive, axis: str, before: Scale | None, after: Scale | None) -> None:
    """Give an axis the new scale, or take it away. Places of the machine need a reference after that."""
    units = session.units
    if after is None:
        units.remove(drive, axis)
        return
    if after.anchored and (before is None or _place_of(after) != _place_of(before)):
        drive.state.reference_lost([axis])
    units.set(drive, axis, after)
    await units.confirm(drive)


def _place_of(given: Scale) -> Any:
    """What decides where the axis is: the travel is no part of it."""
    return given.value, given.unit, given.of, given.zero, given.full_steps


class _Edit:
    """The change of one document."""

    def __init__(
        self,
        drive: Drive,
        axis: str,
        wanted: SetupChange,
        after: Scale | None,
        connection: str,
        url: str,
        labels: Mapping[str, str],
    ) -> None:
        self.drive, self.axis, self.wanted, self.after = drive, axis, wanted, after
        self.connection, self.url, self.labels = connection, url, labels

    def make(self, document: Any) -> None:
        import tomlkit

        if self.connection:
            if "connections" not in document:
                document["connections"] = tomlkit.table(is_super_table=True)
            connections = document["connections"]
            if self.connection not in connections:
                connections[self.connection] = tomlkit.table()
                connections[self.connection]["url"] = self.url
            table = connections[self.connection]
            if self.wanted.scales:
                self._set_scale(table)
            if self.wanted.name is not None:
                self._set_name(table, self.wanted.name)
        if self.wanted.guard is not None:
            _list(document, "off", TRAVEL, self.wanted.guard == "off")
        if self.wanted.ask_before is not None:
            words = [word.strip().upper() for word in self.wanted.ask_before.split(",") if word.strip()]
            for word in [*_guards(document).get("also", [])]:
                _list(document, "also", word, word.upper() in words)
            for word in words:
                _list(document, "also", word, True)

    @property
    def _address(self) -> str:
        return self.drive.address or NO_ADDRESS

    def _set_name(self, table: Any, name: str) -> None:
        before = self.drive.label
        names = _sub_table(table, "names")
        keys = [key for key in names if key == self.drive.address or (before and names[key] == before)]
        key = keys[0] if keys else self._address
        if name:
            names[key] = name
        elif key in names:
            del names[key]
        if not names:
            del table["names"]
        # A scale that is listed under the name before is for the drive by its address from now on.
        units = table.get("units", {})
        for listed in [each for each in units if before and each.partition(".")[0] == before]:
            address = self._address + listed[len(before) :]
            units[address] = units.pop(listed)

    def _set_scale(self, table: Any) -> None:
        units = _sub_table(table, "units")
        drive = self.drive
        names = {self._address, drive.label, drive.state.name if not drive.address else ""} - {""}
        own = {f"{name}.{self.axis}" if self.axis else name for name in names}
        key = next((each for each in units if each in own or each.lower() in own), "")
        wide = [each for each in units if self.axis and each in names]
        if self.after is None:
            if wide:
                hint = f"the units of {wide[0]} in {config_file()} hold for all of its axes; change them there"
                raise Diagnostic(f"{wide[0]}.{self.axis} has no scale of its own; nothing was changed", "", hint)
            if key:
                del units[key]
        elif key and isinstance(units[key], Mapping):
            _merge(units[key], written(self.after))
        else:
            found = written(self.after)
            units[key or (f"{self._address}.{self.axis}" if self.axis else self._address)] = (
                _inline(found) if len(found) > 1 else found["scale"]
            )
        if not units:
            del table["units"]


def _merge(table: Any, wanted: Mapping[str, Any]) -> None:
    """Change the values of a table in place: its comments and its layout stay."""
    for key in KEYS:
        if key in wanted and table.get(key) != wanted[key]:
            table[key] = wanted[key]
        elif key not in wanted and key in table:
            del table[key]


def _inline(found: Mapping[str, Any]) -> Any:
    import tomlkit

    table = tomlkit.inline_table()
    table.update(found)
    return table


def _sub_table(table: Any, key: str) -> Any:
    import tomlkit

    if key not in table:
        table[key] = tomlkit.inline_table()
    found = table[key]
    if not isinstance(found, Mapping):
        raise Diagnostic(f"{key} is not a table", str(config_file()), "mend it first")
    return found


def _guards(document: Any) -> Any:
    found = document.get("guards", {})
    return found if isinstance(found, Mapping) else {}


def _list(document: Any, key: str, word: str, there: bool) -> None:
    """Have a word in a list of [guards], or not."""
    import tomlkit

    has = [each for each in _guards(document).get(key, []) if str(each).upper() == word.upper()]
    if bool(has) == there:
        return
    if "guards" not in document:
        document["guards"] = tomlkit.table()
    guards = document["guards"]
    if key not in guards:
        guards[key] = tomlkit.array()
    if there:
        guards[key].append(word)
    else:
        guards[key].remove(has[0])


def connection_of(session: Session, drive: Drive) -> SavedConnection | None:
    """Return the saved connection of a drive's line; None: it is not saved."""
    bus = session.buses.get(drive.link.name)
    connection = session.of(bus).connection if bus is not None else None
    return session.settings.connections.get(connection.name) if connection is not None else None
