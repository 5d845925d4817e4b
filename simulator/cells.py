"""Cell files with drives of every simulated family, and single drives of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import toml_of, utf8_of
from multidrop.simulator.cell.reader import Reader
from multidrop.simulator.cell.spec import Cell, DriveSpec
from multidrop.simulator.cell.table import Folder, Table
from multidrop.simulator.families import BY_PERSONALITY

_READER = Reader(BY_PERSONALITY)
load = _READER.load
read = _READER.read


def demo() -> Cell:
    """Read the cell that comes with the program."""
    return read(_demo_text(), "demo cell", resources.files("multidrop.simulator"))


def _demo_text() -> str:
    return resources.files("multidrop.simulator").joinpath("demo.toml").read_text(encoding="utf-8")


class Placed(NamedTuple):
    """A drive of a cell, and its table. `cell` is the path of the file, empty for the demo cell."""

    cell: str
    bus: str
    spec: DriveSpec
    table: Mapping[str, Any]

    @property
    def place(self) -> str:
        """The drive as `placed` finds it."""
        return f"{self.cell}#{self.bus}:{self.spec.name}"


def placed(cell: str, allow: Sequence[Path] = ()) -> Placed:
    """Find a drive: `CELL` if it has only one, else `CELL#BUS` or `CELL#BUS:NAME`. Raises Diagnostic.

    No CELL before the # means the demo cell, as in `sim:#press`. `allow`: as for `load`.
    """
    found = matching(cell, allow)
    if len(found) == 1:
        return found[0]
    path, _, place = cell.partition("#")
    where = path or "demo cell"
    names = ", ".join(each.place for each in found or matching(path, allow))
    what = f"{len(found)} drives match" if found else "no such drive"
    raise Diagnostic(what, f"{where}#{place}" if place else where, f"valid for --cell: {names}" if names else "")


def matching(cell: str, allow: Sequence[Path] = ()) -> Sequence[Placed]:
    """All drives that `CELL`, `CELL#BUS` or `CELL#BUS:NAME` means. Raises Diagnostic."""
    path, _, place = cell.partition("#")
    bus, _, name = place.partition(":")
    return [each for each in _drives(path, allow) if bus in ("", each.bus) and name in ("", each.spec.name)]


def _drives(path: str, allow: Sequence[Path]) -> list[Placed]:
    text = utf8_of(path) if path else _demo_text()
    shop = read(text, path, Path(path).absolute().parent, allow) if path else demo()
    tables = toml_of(text, path).get("bus", [])
    return [
        Placed(path, bus.name, spec, table)
        for bus, rows in zip(shop.buses, tables, strict=True)
        for spec, table in zip(bus.drives, rows.get("drive", []), strict=True)
    ]


def read_drive(table: Mapping[str, Any], where: str) -> DriveSpec:
    """Read the table of a drive, of which no file is read. Raises Diagnostic."""
    return BY_PERSONALITY[table["personality"]].read_drive(Table(table, where), Folder(Path()))
