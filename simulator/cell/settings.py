"""The `set` of a drive in a cell file: parameters in NVM, checked against the words that its product knows."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from dialects import Diagnostic
from dialects.mcode.manual.table import Mnemonic, lookup, words
from simulator.cell.table import Table, quoted, shown

Scalar = int | float | str
Value = Scalar | tuple[str, ...]


def settings(table: Table, personality: str) -> Mapping[str, Value]:
    """The table `set`, its words in capitals and known to the product, its numbers in range."""
    found: dict[str, Value] = {}
    for word in table.values:
        name = word.upper()
        if name in found:
            raise table.wrong(quoted(word), "is given twice")
        found[name] = _setting(table, word)
        if personality != "PMX":
            _check_setting(table, word, found[name], _mnemonic(table, word, personality))
        elif not (word.isascii() and word.isalnum()):
            raise table.wrong(quoted(word), "is not a PMX command")
    return MappingProxyType(found)


def _mnemonic(table: Table, word: str, personality: str) -> Mnemonic:
    """The row of a word that can be set. Its name and party mode have keys of their own."""
    if word.upper() in ("DN", "PY"):
        key = "name" if word.upper() == "DN" else "party"
        raise table.wrong(word, "has a key of its own", f'use "{key}"')
    row = lookup(word, personality)
    if row is None:
        state = [name for name, each in words(personality).items() if "W" in each.access and name.isalnum()]
        near = get_close_matches(word.upper(), state, n=1)
        hint = f'did you mean "{near[0]}"?' if near else ""
        raise table.wrong(quoted(word), f"is not an MCode mnemonic of an {personality}", hint)
    if "W" not in row.access:
        raise table.wrong(word, f"cannot be set ({row.title})")
    return row


def _check_setting(table: Table, word: str, value: Value, row: Mnemonic) -> None:
    encoder = table.values.get("EE") == 1 and not table.values.get("AS")
    if isinstance(value, (int, float)) and not row.accepts(value, encoder):
        low, high = row.bounds(encoder)
        wanted = f"one of {', '.join(map(str, row.values))}" if row.values else f"from {low} to {high}"
        raise table.wrong(word, f"must be {wanted}, not {shown(value)}")


def _setting(table: Table, word: str) -> Value:
    """A number or text; true is 1, false is 0; a list of texts, or of lists of numbers, is several lines."""
    value = table.values[word]
    if not isinstance(value, list):
        return _scalar(table, word, value)
    if not value:
        raise _shape(table, word)
    return tuple(str(_line(table, word, each)) for each in value)


def _line(table: Table, word: str, value: Any) -> Scalar:
    if not isinstance(value, list):
        return _scalar(table, word, value)
    return ",".join(str(_scalar(table, word, each)) for each in value)


def _scalar(table: Table, word: str, value: Any) -> Scalar:
    """A value that can stand in a line to a drive."""
    if isinstance(value, str) and value.isascii() and value.isprintable():
        return value
    if isinstance(value, (int, float)) and abs(value) < 2.0**63:
        return int(value) if isinstance(value, bool) else value
    raise _shape(table, word)


def _shape(table: Table, word: str) -> Diagnostic:
    return table.wrong(quoted(word), "must be a number or text", 'several lines: IS = ["1,1,0", "2,2,0"]')
