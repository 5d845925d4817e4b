"""The KEY and the VALUES of `--vary KEY=VALUES`.

A KEY is the place of a value in the table of a drive. VALUES are `a,b,c`, `A..B`, `A..B:STEP`, and all of them with
commas between; a unit may follow each, as in `290..310:5 mm`. Numbers are exact decimals until the last moment, so that
ten steps of 0.1 are ten decimals. A text that has a comma or two dots is written in quotation marks, a list of TOML in
its brackets.
"""

from __future__ import annotations

import json
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from difflib import get_close_matches
from random import Random
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import toml_of
from multidrop.simulator.cell.drive_keys import ENCODER_KEYS, WORLD_KEYS

Value = int | float | str | list[Any]
FINE = 5
"""Decimals more than the ends of a range have, for draws from a range without a step."""
MOST_RANGE_VALUES = 10**15
"""The largest number of values in a range."""
MOST_CHECKED_VALUES = 2000
"""The largest number of listed values that are looked at for a simpler one."""
_NUMBER = r"[+-]?(?:\d{1,15}(?:\.\d{1,9})?|\.\d{1,9})(?:[eE][+-]?\d)?"
_NUMERIC = re.compile(_NUMBER, re.ASCII)
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})(?::({_NUMBER}))?(?: +([A-Za-z]\w*))?", re.ASCII)
_ITEM = re.compile(r'\s*(?P<item>"(?:[^"\\]|\\.)*"|\[(?:[^\]"\[]|"[^"]*"|\[[^\]]*\])*\]|[^,"\[]*)\s*(?P<end>,|$)')
_VALID = "valid: a,b,c or A..B or A..B:STEP"


@dataclass(frozen=True)
class Single:
    """One value."""

    value: Value
    count = 1

    def at(self, index: int) -> Value:
        return self.value


@dataclass(frozen=True)
class ValueRange:
    """The values of a range: `low`, `low + step` and so on, `count` of them, each with the unit if there is one."""

    low: Decimal
    step: Decimal
    count: int
    unit: str = ""

    def at(self, index: int) -> Value:
        number = self.low + self.step * index
        return f"{number:f} {self.unit}" if self.unit else _plain(number)

    def nearest(self, value: Value) -> int:
        """The index of the value that is nearest to one; 0 for one without a number."""
        number, _, unit = str(value).partition(" ")
        if unit != self.unit or not _NUMERIC.fullmatch(number):
            return 0
        index = int(((Decimal(number) - self.low) / self.step).to_integral_value())
        return min(max(index, 0), self.count - 1)


Piece = Single | ValueRange


@dataclass(frozen=True)
class KeyValues:
    """The values of one key, in the order in which they are written."""

    pieces: tuple[Piece, ...]

    @property
    def count(self) -> int:
        return sum(piece.count for piece in self.pieces)

    def at(self, index: int) -> Value:
        for piece in self.pieces:
            if index < piece.count:
                return piece.at(index)
            index -= piece.count
        raise IndexError(index)

    def draw(self, rng: Random) -> Value:
        return self.at(rng.randrange(self.count))

    def samples(self) -> Iterator[Value]:
        for piece in self.pieces:
            yield piece.at(0)
            if piece.count > 1:
                yield piece.at(piece.count - 1)


def parse_values(text: str, *, drawn: bool = False) -> KeyValues:
    """Parse values. `drawn`: a range of fractions without a step has fine ones. Raises Diagnostic."""
    return KeyValues(tuple(_piece(item, drawn) for item in _items(text)))


def spelled(value: Value) -> str:
    """Write a value, so that `parse_values` reads it again."""
    if isinstance(value, str):
        return value if _is_bare(value) else json.dumps(value, ensure_ascii=False)
    return format(Decimal(repr(value)), "f") if isinstance(value, float) else json.dumps(value)


def _is_bare(text: str) -> bool:
    """Whether a text is read as itself without quotation marks."""
    if not text or text != text.strip() or _NUMERIC.fullmatch(text):
        return False
    return ".." not in text and not set(text) & set(',"[\\')


def _items(text: str) -> Iterator[str]:
    at, end = 0, ","
    while end:
        match = _ITEM.match(text, at)
        if match is None:
            raise Diagnostic(f"{text} has a bracket or a quotation mark without its end", hint=_VALID)
        if not match["item"].strip():
            raise Diagnostic(f"{text} has an empty value" if text.strip() else "has no values", hint=_VALID)
        yield match["item"].strip()
        at, end = match.end(), match["end"]


def _piece(item: str, drawn: bool) -> Piece:
    if item[0] in '"[':
        return Single(toml_of(f"value = {item}", item)["value"])
    if _NUMERIC.fullmatch(item):
        return Single(_plain(Decimal(item)))
    if ".." not in item:
        return Single(item)
    match = _RANGE.fullmatch(item)
    if match is None:
        raise Diagnostic(f"{item} is not a range", hint="valid: A..B or A..B:STEP; a text in quotation marks")
    low, high, step, unit = match.groups()
    return _steps(item, Decimal(low), Decimal(high), Decimal(step) if step else None, drawn, unit or "")


def _steps(item: str, low: Decimal, high: Decimal, step: Decimal | None, drawn: bool, unit: str) -> ValueRange:
    places = max(0, -int(low.as_tuple().exponent), -int(high.as_tuple().exponent))
    if step is None:
        if places and not drawn and high - low < 1:
            raise Diagnostic(f"{item} has no step", hint=f"as in {item}:0.1")
        step = Decimal(1).scaleb(-places - FINE) if places and drawn else Decimal(1)
    if not step:
        raise Diagnostic(f"{item} has a step of 0", hint=_VALID)
    count = int((high - low) / step) + 1 if (high - low) / step >= 0 else 0
    if count > MOST_RANGE_VALUES:
        raise Diagnostic(
            f"{item} has too many values", hint=f"valid: up to {MOST_RANGE_VALUES:.0e}, with a larger step"
        )
    if not count:
        raise Diagnostic(f"{item} is an empty range", hint="the smaller end comes first, or the step is negative")
    return ValueRange(low, step, count, unit)


def _plain(number: Decimal) -> int | float:
    """The number as a value of TOML; a whole one is an int."""
    return int(number) if number == number.to_integral_value() else float(number)


def simpler(values: KeyValues, value: Value, origin: Value | None) -> Sequence[Value]:
    """The values nearer to `origin` than `value` is, nearest first; of texts and lists, those written before it.

    `origin` None is 0. Of a range, these are the values between.
    """
    origin = 0 if origin is None else origin
    piece, numbers = values.pieces[0], isinstance(value, int | float) and isinstance(origin, int | float)
    if len(values.pieces) == 1 and isinstance(piece, ValueRange) and (piece.unit or numbers):
        first, last = piece.nearest(origin), piece.nearest(value)
        return _Between(piece, range(first, last, 1 if last > first else -1))
    if not (isinstance(value, int | float) and isinstance(origin, int | float)):
        listed = [single.value for single in values.pieces if isinstance(single, Single)]
        return listed[: listed.index(value)] if value in listed else []
    far = abs(value - origin)
    listed = [values.at(index) for index in range(min(values.count, MOST_CHECKED_VALUES))]
    near = {abs(number - origin): number for number in listed if isinstance(number, int | float)}
    return [near[gap] for gap in sorted(near) if gap < far]


@dataclass(frozen=True)
class _Between(Sequence[Value]):
    piece: ValueRange
    indices: range

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, index: Any) -> Any:
        return self.piece.at(self.indices[index])


SEED = "seed"
WORLD, SETTINGS = "world", "set"
DRIVE, MOTOR = "", "motor"
"""The part of a key of the drive's table itself, and the only such key."""
AXES = ("x", "y")
"""The axes that have a world of their own; keys without an axis belong to the first."""
OWN_KEYS = ("program", "program_text")
"""Keys of a drive's table that a program test does not use."""
Drive = Mapping[str, Any]
"""The table of a drive."""


@dataclass(frozen=True)
class VariedKey:
    """A key as it is written, and its place: `world`, `set` or none, the axis, the name in the table; or the seed."""

    text: str
    part: str
    name: str
    axis: str = ""

    def own(self, drive: Drive) -> Value | None:
        """The value in a drive's table; None: it has none."""
        if self.part == SEED:
            return None
        if self.part == DRIVE:
            return drive.get(self.name)
        table = _table(drive, self.part)
        if self.part == SETTINGS:
            return next((value for name, value in table.items() if name.upper() == self.name), None)
        of_axis = _table(table, self.axis or AXES[0])
        value: Value | None = of_axis.get(self.name)
        return table.get(self.name) if value is None and self.axis in ("", AXES[0]) else value

    def put(self, drive: Drive, value: Value) -> Drive:
        if self.part == SEED:
            return drive
        if self.part == DRIVE:
            return {**drive, self.name: value}
        table = dict(_table(drive, self.part))
        if self.part == SETTINGS:
            table = {name: each for name, each in table.items() if name.upper() != self.name}
        axis = self.axis or (AXES[0] if self.name in _table(table, AXES[0]) else "")
        if axis == AXES[0]:
            table.pop(self.name, None)
        entry = {axis: {**_table(table, axis), self.name: value}} if axis else {self.name: value}
        return {**drive, self.part: {**table, **entry}}


def parse_key(text: str, names: Container[str]) -> tuple[str, VariedKey]:
    """Parse a key; return its drive, empty for none, and the key. `names` are the drives'. Raises Diagnostic."""
    if text == SEED:
        return "", VariedKey(text, SEED, SEED)
    drive, dot, rest = text.partition(".")
    if drive not in names:
        if dot and drive.lower() not in AXES:
            raise Diagnostic(f"no drive {drive}", f"--vary {text}")
        drive, rest = "", text
    axis, dot, name = rest.partition(".")
    axis, name = (axis.lower(), name) if dot else ("", rest)
    of_an_axis = axis in AXES and _in_world(name)
    if not name or (dot and not of_an_axis):
        raise Diagnostic("is not a key", f"--vary {text}", "valid: seed, DRIVE.KEY, or KEY with one drive")
    if name.lower() == MOTOR:
        return drive, VariedKey(text, DRIVE, MOTOR)
    if axis or _in_world(name):
        return drive, VariedKey(text, WORLD, name.lower(), axis)
    return drive, VariedKey(text, SETTINGS, name.upper())


def misplaced_hint(key: VariedKey) -> str:
    """What a refused setting may have meant: a key of the world with a similar name; empty if none has."""
    near = get_close_matches(key.name.lower(), (*WORLD_KEYS, *ENCODER_KEYS), 1, 0.7) if key.part == SETTINGS else ()
    return f"did you mean the world's {near[0]}?" if near else ""


def _in_world(name: str) -> bool:
    return name.lower() in (*WORLD_KEYS, *ENCODER_KEYS)


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    subtable: Mapping[str, Any] = table.get(key, {})
    return subtable
