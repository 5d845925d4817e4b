"""The tables of a cell file, read strictly: every error names the key and its place, in one line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.resources.abc import Traversable
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.files import Way, toml_keys

Column = tuple[str, float, float]
"""A column of a row: its word, lowest and highest value; whole numbers only if the highest is an int."""

PLACES = (-(2.0**40), 2.0**40)
"""The range of positions, motor steps."""


@dataclass(frozen=True)
class Folder:
    """The folder of a cell file, and where its paths may lead, too."""

    path: Traversable
    allowed: tuple[Path, ...] = ()

    @property
    def real(self) -> Path:
        """The folder without symbolic links."""
        return Path(str(self.path)).resolve()

    def holds(self, place: Path) -> bool:
        """Whether a path may be used; its folder is free of symbolic links, and it may be one itself."""
        links = [each.parent.resolve() / each.name for each in self.allowed]
        return any(place.is_relative_to(each) for each in (self.real, *map(Path.resolve, self.allowed), *links))


class Source(NamedTuple):
    """The text of a cell file, its name in messages, and the words for units that it declares."""

    text: str = ""
    name: str = ""
    own_units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """One table of a TOML file, its name in messages and the way to it. Every reader raises Diagnostic."""

    values: Mapping[str, Any]
    where: str
    source: Source = Source()
    way: Way = ()

    def at_line(self, key: str) -> str:
        """The place of a key with its line, where the text is known."""
        line = line_of(self.source.text, self.way, key)
        name = self.source.name
        return self.where.replace(name, f"{name}:{line}", 1) if line and name else self.where

    def merged(self, other: Table) -> Table:
        """Both tables as one, at the place of the other one if that has keys."""
        place = other if other.values else self
        return Table({**self.values, **other.values}, place.where, self.source, place.way)

    def only(self, *keys: str) -> None:
        """Refuse any other key."""
        for key in self.values:
            if key not in keys:
                raise Diagnostic(f"unknown key {quoted(key)}", self.at_line(key), nearest(key, keys))

    def wrong(self, key: str, message: str, hint: str = "") -> Diagnostic:
        """Make the error about the value of a key, to be raised."""
        return Diagnostic(f"{key} {message}", self.at_line(key), hint)

    def text(self, key: str, default: str | None = None) -> str:
        """Read a string; without a default it must exist."""
        if key not in self.values and default is None:
            raise self.wrong(key, "is missing")
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self.wrong(key, f"must be text, not {shown(value)}")
        return value

    def choice(self, key: str, choices: Sequence[str]) -> str:
        """Read one of some words; it must exist."""
        value = self.text(key)
        if value not in choices:
            raise self.wrong(key, f"cannot be {quoted(value)}", nearest(value.upper(), choices))
        return value

    def boolean(self, key: str, default: bool) -> bool:
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            raise self.wrong(key, f"must be true or false, not {shown(value)}")
        return value

    def integer(self, key: str, default: int, low: int = -(2**63), high: int = 2**63 - 1) -> int:
        """Read a whole number in a range."""
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self.wrong(key, f"must be a whole number, not {shown(value)}")
        if not low <= value <= high:
            raise self.wrong(key, f"must be from {low} to {high}, not {shown(value)}")
        return value

    def number(self, key: str, default: float, low: float = -inf, high: float = inf) -> float:
        """Read a finite number in a range."""
        return self._number(key, self.values.get(key, default), low, high)

    def position(self, key: str) -> float | None:
        """Read a position in motor steps; None if the key is missing."""
        return self.number(key, 0.0, *PLACES) if key in self.values else None

    def edges(self, key: str) -> float | tuple[float, float] | None:
        """Read a position, or the two between which a switch is closed; None if the key is missing."""
        value = self.values.get(key)
        if not isinstance(value, list):
            return self.position(key)
        if len(value) != 2:
            raise self.wrong(key, "must be one position or two, as in [-2000, 0]")
        low, high = (self._number(key, edge, *PLACES) for edge in value)
        if low >= high:
            raise self.wrong(key, f"must go up, not from {low:g} to {high:g}")
        return low, high

    def texts(self, key: str) -> tuple[str, ...]:
        values = self._list(key)
        if not all(isinstance(value, str) for value in values):
            raise self.wrong(key, 'must be a list of texts, as in ["pty:", "tcp://127.0.0.1:0"]')
        return tuple(values)

    def span(self, key: str, default: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
        """Read two numbers from 0 up, the second not below the first."""
        values = self._list(key, default)
        if len(values) != 2:
            raise self.wrong(key, "must be two numbers, as in [0.001, 0.02]")
        low, high = (self._number(key, value, 0.0, 3600.0) for value in values)
        if low > high:
            raise self.wrong(key, f"goes down, from {low:g} to {high:g}")
        return low, high

    def rows(self, key: str, columns: Sequence[Column]) -> tuple[tuple[float, ...], ...]:
        shape = f"[{', '.join(word for word, _, _ in columns)}]"
        rows = []
        for number, row in enumerate(self._list(key), 1):
            if not isinstance(row, list) or len(row) != len(columns):
                raise self.wrong(key, f"must be a list of {shape}: row {number} is {shown(row)}")
            pairs = zip(row, columns, strict=True)
            rows.append(tuple(self._cell(key, number, cell, column) for cell, column in pairs))
        return tuple(rows)

    def table(self, key: str, name: str) -> Table:
        """Read a table within; empty if the key is missing."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(key, f"must be a table, not {shown(value)}")
        return Table(value, f"{self.where}: {name}", self.source, (*self.way, (key, 0)))

    def tables(self, key: str, name: str) -> list[Table]:
        """Read a list of tables within."""
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.wrong(key, f"must be tables that begin with {name}")
        return [
            Table(value, f"{self.where}: {name} {number}", self.source, (*self.way, (key, number)))
            for number, value in enumerate(values, 1)
        ]

    def _list(self, key: str, default: Sequence[Any] = ()) -> list[Any]:
        value = self.values.get(key, list(default))
        if not isinstance(value, list):
            raise self.wrong(key, f"must be a list, not {shown(value)}")
        return value

    def _cell(self, key: str, number: int, value: Any, column: Column) -> float:
        word, low, high = column
        if isinstance(high, int) and not isinstance(value, int):
            raise self.wrong(key, f"row {number}: {word} must be a whole number, not {shown(value)}")
        return self._number(f"{key} row {number}: {word}", value, low, high)

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        if not isinstance(value, (int, float)) or isinstance(value, bool) or value != value:
            raise self.wrong(key, f"must be a number, not {shown(value)}")
        if not low <= value <= high or value in (inf, -inf) or abs(value) > 2**63:
            bounds = f"from {low:g} to {high:g}" if isfinite(high) else f"{low:g} or more"
            raise self.wrong(key, f"must be {bounds}, not {shown(value)}")
        return float(value)


def line_of(text: str, way: Way, key: str) -> int:
    """The number of the line with a key of a table, with the inline table that has it, or of its head; 0: not found."""
    head = 0
    for key_path, number, is_key in toml_keys(text):
        if is_key and key_path in ((*way, (key, 0)), way[: len(key_path)]):
            return number
        head = number if key_path == way else head
    return head


def nearest(word: str, valid: Sequence[str]) -> str:
    """Make a hint: the known word that was probably meant, or all of them."""
    near = get_close_matches(word, valid, n=1, cutoff=0.6)
    return f'did you mean "{near[0]}"?' if near else f"valid: {', '.join(valid)}"


def quoted(text: str) -> str:
    """Quote a text of the file, short and on one line."""
    text = text if len(text) <= 40 else text[:37] + "..."
    return '"' + "".join(c if c.isprintable() else repr(c)[1:-1] for c in text) + '"'


def shown(value: Any) -> str:
    """Show a value as it was probably written, short and on one line."""
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:g}" if isinstance(value, float) or abs(value) < 10**15 else "a huge number"
    return "a table" if isinstance(value, dict) else "a list" if isinstance(value, list) else "a date or time"
