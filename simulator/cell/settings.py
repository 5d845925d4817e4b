"""The `set` table of a drive in a cell file: what its non-volatile memory holds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from multidrop.dialects import Diagnostic
from multidrop.simulator.cell.spec import Scalar, Value
from multidrop.simulator.cell.table import Table, quoted

Check = Callable[[Table, str, Value], None]
"""Refuses a word, or its value, that the product does not know. Raises Diagnostic."""


def read_settings(table: Table, check: Check) -> Mapping[str, Value]:
    """Read `set`, its words in capitals."""
    found: dict[str, Value] = {}
    for word in table.values:
        name = word.upper()
        if name in found:
            raise table.wrong(quoted(word), "is given twice")
        found[name] = _setting(table, word)
        check(table, word, found[name])
    return MappingProxyType(found)


def _setting(table: Table, word: str) -> Value:
    """Read a number or a text; true is 1, false is 0. A list of texts, or of lists of numbers, gives several lines."""
    value = table.values[word]
    if not isinstance(value, list):
        return _scalar(table, word, value)
    if not value:
        raise _wrong_shape(table, word)
    return tuple(str(_line(table, word, each)) for each in value)


def _line(table: Table, word: str, value: Any) -> Scalar:
    if not isinstance(value, list):
        return _scalar(table, word, value)
    return ",".join(str(_scalar(table, word, each)) for each in value)


def _scalar(table: Table, word: str, value: Any) -> Scalar:
    """Read a value that fits into a line to a drive."""
    if isinstance(value, str) and value.isascii() and value.isprintable():
        return value
    if isinstance(value, (int, float)) and abs(value) < 2.0**63:
        return int(value) if isinstance(value, bool) else value
    raise _wrong_shape(table, word)


def _wrong_shape(table: Table, word: str) -> Diagnostic:
    return table.wrong(quoted(word), "must be a number or text", 'several lines: IS = ["1,1,0", "2,2,0"]')
