"""The `identity` and `variables` tables of a drive in a cell file: what a snapshot keeps of one unit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType

from multidrop.simulator.cell.spec import Identity
from multidrop.simulator.cell.table import Table, quoted

LONGEST = 60
"""Characters of a text."""
INT32 = 2**31


def read_identity(table: Table, texts: Collection[str], counters: Mapping[str, int]) -> Identity:
    """Read `identity`. `texts`: the valid ones of part, version and serial; `counters`: their axes, by key."""
    table.only(*texts, *counters)
    return Identity(
        **{key: _text(table, key) for key in texts},
        counters=MappingProxyType({key: _counts(table, key, counters[key]) for key in counters if key in table.values}),
    )


def read_variables(table: Table, valid: Callable[[str], bool], hint: str) -> Mapping[str, int]:
    """Read `variables`: whole numbers by name."""
    found: dict[str, int] = {}
    for word in table.values:
        name = word.upper()
        if not valid(name):
            raise table.wrong(quoted(word), "is not the name of a variable", hint)
        if name in found:
            raise table.wrong(quoted(word), "is given twice")
        found[name] = table.integer(word, 0, -INT32, INT32 - 1)
    return MappingProxyType(found)


def _text(table: Table, key: str) -> str:
    value = table.text(key, "")
    if len(value) > LONGEST or not (value.isascii() and value.isprintable()):
        raise table.wrong(key, f"cannot be {quoted(value)}", f"valid: up to {LONGEST} printable ASCII characters")
    return value


def _counts(table: Table, key: str, axes: int) -> tuple[int, ...]:
    """Read one whole number, or a list with one for each axis."""
    if axes == 1:
        return (table.integer(key, 0, -INT32, INT32 - 1),)
    rows = table.values[key]
    if not isinstance(rows, list) or len(rows) != axes:
        raise table.wrong(key, f"must be a list of {axes} whole numbers, one for each axis")
    return tuple(Table({key: each}, table.where).integer(key, 0, -INT32, INT32 - 1) for each in rows)
