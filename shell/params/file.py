"""The settings of a drive: read from it, and its file: `[drive]`, `[parameters]`, `[io]`, `[variables]`, `[unread]`.

The file, TOML, has no date, so two backups of one drive are equal. A comment has the unit and the default of a setting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import escaped_toml, text_of, toml_of
from multidrop.dialects import DriveState
from multidrop.dialects.values import SECTIONS, VARIABLES, Readings, Value
from multidrop.drives.drive import Drive
from multidrop.shell.channel import running, transferring
from multidrop.shell.events import SettingsRead
from multidrop.shell.workspace import Workspace

DRIVE, UNREAD = "drive", "unread"
HEAD = (
    "The settings of one drive. `multidrop params diff` compares them, `multidrop params restore` sends what differs."
)
_TOML_INTEGERS = range(-(2**63), 2**63)
LISTED = 8
"""The number of settings that a message names."""


async def read(workspace: Workspace, drive: Drive, what: str) -> Readings:
    """Read every setting of a drive. Raises DriveError; nothing is changed."""
    with running(workspace, f"{workspace.display_name(drive)}: {what}") as progress:
        readings = await transferring(drive, drive.family.values.parameters.read(progress))
    workspace.publish(SettingsRead(workspace.now(), drive.link.name, drive.address, readings))
    return readings


def listed(names: Sequence[str]) -> str:
    """Names in a message, at most LISTED of them."""
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"{', '.join(names[:LISTED])}{more}"


@dataclass(frozen=True)
class SettingsFile:
    """A file of settings. `named` has the values by name, `section` the table of each."""

    path: str
    product: str = ""
    language: str = ""
    name: str = ""
    """The name of the drive that it was read from; empty: it has none."""
    named: Mapping[str, Value] = field(default_factory=dict)
    section: Mapping[str, str] = field(default_factory=dict)
    has_variables: bool = False
    """It has the table of variables, so a variable that it lacks is a difference."""


def identity(state: DriveState, language: str) -> dict[str, str]:
    """The identity that a drive reports, for its file, and the language of its settings."""
    known = {
        "language": language,
        "product": state.product,
        "version": state.version,
        "part": state.part,
        "serial": state.serial,
        "name": state.name or state.address,
    }
    return {key: text for key, text in known.items() if text}


def formatted(drive: Mapping[str, str], found: Readings) -> str:
    import tomlkit  # takes 30 ms to import

    document = tomlkit.document()
    document.add(tomlkit.comment(HEAD))
    document[DRIVE] = dict(drive)
    for section in SECTIONS:
        table = tomlkit.table()
        for reading in found.readings:
            if reading.section == section:
                item = tomlkit.item(list(reading.value) if isinstance(reading.value, tuple) else reading.value)
                default = "" if reading.default is None else f"default {shown(reading.default)}"
                if remark := ", ".join(filter(None, (reading.unit, default))):
                    item.comment(remark)
                table.add(reading.name, item)
        document[section] = table
    if found.unread:
        document[UNREAD] = dict(found.unread)
    return escaped_toml(tomlkit.dumps(document))


def shown(value: Value | None) -> str:
    """A value for a person, as the file has it."""
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return f"[{', '.join(map(shown, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)


def load(path: str | Path) -> SettingsFile:
    """Read a file. Raises Diagnostic with the file, and the table and name that are wrong."""
    where = str(path)
    tables = toml_of(text_of(path), where)
    if unknown := [name for name in tables if name not in (DRIVE, UNREAD, *SECTIONS)]:
        raise Diagnostic(f"[{unknown[0]}] is not known", where, f"valid: {_list((DRIVE, *SECTIONS))}")
    if not any(name in tables for name in SECTIONS):
        raise Diagnostic("has no settings", where, f"they are in the tables {_list(SECTIONS)}")
    drive = _table(tables, DRIVE, where)
    named: dict[str, Value] = {}
    section: dict[str, str] = {}
    for each in SECTIONS:
        for name, value in _table(tables, each, where).items():
            upper = name.upper()
            if upper in named:
                raise Diagnostic(f"{upper} is there twice", f"{where}: [{each}]", "keep one of them")
            named[upper], section[upper] = _value(value, f"{where}: [{each}] {name}"), each
    known = (drive.get(key, "") for key in ("product", "language", "name"))
    product, language, name = (text if isinstance(text, str) else "" for text in known)
    return SettingsFile(where, product, language, name, named, section, VARIABLES in tables)


def _table(tables: Mapping[str, Any], name: str, where: str) -> Mapping[str, Any]:
    table = tables.get(name, {})
    if not isinstance(table, dict):
        raise Diagnostic(f"{name} must be a table", where, f"write [{name}]")
    return table


def _value(value: Any, where: str) -> Value:
    several = isinstance(value, list) and bool(value)
    for part in value if several else (value,):
        whole = isinstance(part, int) and not isinstance(part, bool) and part in _TOML_INTEGERS
        if not (whole or isinstance(part, float | str)):
            raise Diagnostic("must be a number, a text, or a list of them", where)
    setting: Value = tuple(value) if several else value
    return setting


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(f"[{name}]" for name in names)
