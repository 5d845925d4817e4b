"""The settings of a drive as a table for a screen: rows, a search, a comparison, and the lines that change one of them.

It reads nothing and sends nothing.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic
from multidrop.dialects.values import ORDINARY, Parameters, Permission, Reading, Readings, Scalar, Value, same
from multidrop.shell.params.file import shown

if TYPE_CHECKING:
    from multidrop.dialects.family import Language

_NUMBER = re.compile(r"[+-]?\d{1,20}")
_FRACTION = re.compile(r"[+-]?(?:\d{1,20}\.\d*|\.\d+)(?:[eE][+-]?\d{1,3})?")


@dataclass(frozen=True)
class Row:
    """One setting: its value here and what it is compared with, each as text."""

    reading: Reading
    value: str
    other: str = ""
    """Empty where there is nothing to compare with."""
    differs: bool = False
    meaning: str = ""


def rows(found: Readings, other: Mapping[str, Value] | None, meanings: Mapping[str, str]) -> list[Row]:
    """A row for each setting. `other`: the values to compare with."""
    made = []
    for each in found.readings:
        there = None if other is None else other.get(each.name)
        compared = "" if there is None else shown(there)
        differs = there is not None and not same(each.value, there)
        made.append(Row(each, shown(each.value), compared, differs, meanings.get(each.name, "")))
    return made


def found_in(table: Sequence[Row], words: str, *, differing: bool = False) -> list[Row]:
    """The rows that contain every word: names, sections, values, meanings."""
    wanted = words.casefold().split()

    def contains(row: Row) -> bool:
        text = f"{row.reading.name} {row.reading.section} {row.value} {row.reading.unit} {row.meaning}".casefold()
        return all(each in text for each in wanted)

    chosen = [row for row in table if contains(row) and (row.differs or not differing)]
    return sorted(chosen, key=lambda row: row.reading.name.casefold() != words.strip().casefold())


def meanings_of(found: Readings, language: Language, product: str) -> dict[str, str]:
    """The first line of help on each setting, without its name."""
    made = {}
    for each in found.readings:
        for word in (each.name, each.name.rstrip("0123456789")):
            try:
                first = language.describe(word, product)[0]
            except Diagnostic:
                continue
            made[each.name] = re.sub(r" \((?:variable|flag)\)$", "", first.partition(": ")[2] or first)
            break
    return made


def parsed(text: str) -> Value:
    """Read a typed value: a number, a text, or the fields of a set-up with commas. Raises Diagnostic."""
    fields = [each.strip() for each in text.strip().strip("[]").split(",")]
    if not all(fields):
        raise Diagnostic("a value is missing", text, "such as 600000, or 1,1,0 for a set-up")
    values: list[Scalar] = []
    for each in fields:
        if _NUMBER.fullmatch(each):
            values.append(int(each))
        elif _FRACTION.fullmatch(each):
            values.append(float(each))
        elif each.isascii() and each.isprintable():
            values.append(each.strip('"'))
        else:
            raise Diagnostic("not a value", each, "a number, or text in plain ASCII")
    return values[0] if len(values) == 1 else tuple(values)


@dataclass(frozen=True)
class Edit:
    """The lines that change one setting, and what a person must know before they are sent."""

    lines: tuple[str, ...]
    warning: str = ""


def edit(parameters: Parameters[Any], state: Any, present: Readings, name: str, value: Value) -> Edit:
    """Plan the lines that set one value. Raises Diagnostic for a value that the drive refuses."""
    made = parameters.plan(state, present, {name: value}, ORDINARY)
    warning = "; ".join(reason for _, reason in made.withheld)
    if made.withheld:
        made = parameters.plan(state, present, {name: value}, Permission(frozenset({name}), communication=True))
    if made.impossible:
        raise Diagnostic("; ".join(reason for _, reason in made.impossible), name)
    if not made.changes:
        raise Diagnostic(f"it is {shown(value)} already", name)
    return Edit(tuple(change.text for change in made.changes), "; ".join(filter(None, (warning, *made.remarks))))
