"""The lines that need a person's yes: the families' guards, as the configuration changes them.

[guards]
off = ["BD", "*"]       # guards that ask no more; "*": what can start every drive of a line
also = ["S", "EX"]      # words that ask, too
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from multidrop.dialects import Diagnostic

if TYPE_CHECKING:
    from multidrop.dialects import DriveState, Family

KEYS = ("also", "off")


@dataclass(frozen=True)
class Guarding:
    """The changes of the configuration to the families' guards, in capitals."""

    off: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()

    def what(self, family: Family[Any], state: DriveState, text: str) -> str:
        """What a line for a drive will do, if a person must agree to it; empty: it needs no yes."""
        guards = family.guards
        if guards is None or state.programming:
            return ""
        found = guards.find(state, text)
        if found is not None and found.name not in self.off:
            return found.what
        word = guards.word_of(text) if self.also else ""
        return f"'{text.strip()}' is sent: [guards] also has {word}" if word in self.also else ""


def read(table: Any, where: str) -> Guarding:
    """Read the table `guards` of the configuration. Raises Diagnostic with file and key."""
    if not isinstance(table, dict):
        raise Diagnostic("guards is not a table", where, 'write [guards] with off = ["WORD"] or also = ["WORD"]')
    for key in table:
        if key not in KEYS:
            raise Diagnostic(f"no key guards.{key}", where, f"valid: {', '.join(KEYS)}")
    return Guarding(_off(_words(table, "off", where), where), _also(_words(table, "also", where), where))


def _words(table: Mapping[str, Any], key: str, where: str) -> frozenset[str]:
    words = table.get(key, [])
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise Diagnostic(f"guards.{key} is not a list of words", where, f'as in {key} = ["BD"]')
    return frozenset(word.upper() for word in words)


def _off(words: frozenset[str], where: str) -> frozenset[str]:
    if words:
        known = sorted({name for family in _families() if family.guards for name in family.guards.names})
        for word in sorted(words):
            if word not in known:
                raise Diagnostic(f"guards.off: no guard {word}", where, f"valid: {', '.join(known)}")
    return words


def _also(words: frozenset[str], where: str) -> frozenset[str]:
    for word in sorted(words):
        if not any(family.language.knows(word) for family in _families()):
            raise Diagnostic(f"guards.also: no drive has a word {word}", where, "valid: words that /help lists")
    return words


def _families() -> list[Family[Any]]:
    """Every family; only a configuration with guards imports them all."""
    from multidrop.dialects.families import FAMILIES

    return list(FAMILIES.values())
