"""Tables of the configuration file that features read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from multidrop.base import registry
from multidrop.base.errors import Diagnostic

CORE = ("connections", "guards", "keys", "log", "own_units", "screen", "simulator")
"""The tables, and the keys outside of tables, of multidrop itself."""


class Section(NamedTuple):
    """A table of the configuration file: `Settings.section` gives what `read` makes of it."""

    name: str
    keys: tuple[str, ...]
    example: str
    """What to write in place of something that is no such table."""
    read: Callable[[Mapping[str, Any], str], Any]
    """From the table, which has no keys but these, and the path of the file. Raises Diagnostic: `NAME.KEY ...`."""
    shown: Callable[[Any], Mapping[str, object]]
    """The keys and the values for `config show`, without secrets."""
    unreadable: Callable[[Any], Iterable[str]] = lambda found: ()
    """What is wrong with the files that it names, each with the key at the beginning."""

    def claims(self) -> tuple[str, ...]:
        """What only one feature can add."""
        return (f"[{self.name}]",)


def sections() -> dict[str, Section]:
    """The tables of the features that are there, by name."""
    return {section.name: section for section in registry.added(Section) if section.name not in CORE}


def valid() -> tuple[str, ...]:
    """The names of all tables, also of features of the wheel that are not there: these read nothing."""
    absent = (word.strip("[]") for word in registry.words() if word.startswith("["))
    return tuple(sorted({*CORE, *sections(), *absent}))


def text_list(table: Mapping[str, Any], name: str, key: str, where: str) -> tuple[str, ...]:
    """A list of texts in a table. Raises Diagnostic."""
    texts = table.get(key, [])
    if not isinstance(texts, list) or not all(isinstance(text, str) and text for text in texts):
        raise Diagnostic(f"{name}.{key} is not a list of texts", where, f'as in {key} = ["..."]')
    return tuple(texts)
