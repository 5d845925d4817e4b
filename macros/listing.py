"""The list of all macros, as a person reads it."""

from __future__ import annotations

from typing import NamedTuple

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.text import visible
from multidrop.macros.store import MacroStore


class Listing(NamedTuple):
    """A line for each macro, the warnings about them, and the problems of the files that cannot be read."""

    lines: list[str]
    warnings: list[str]
    broken: list[Diagnostic]


def listed(store: MacroStore) -> Listing:
    """List the macros: name, key and page, length, values, roles, note; and which are beside the project."""
    lines, broken = [], list[Diagnostic]()
    for name in store.names():
        try:
            summary = visible(store.load(name).summary)
        except Diagnostic as problem:
            broken.append(problem)
        else:
            lines.append(f"{summary}  [{store.project}]" if store.is_project(name) else summary)
    return Listing(lines, [*store.clashes(), *store.hidden()], broken)
