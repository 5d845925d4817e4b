"""A macro: lines as typed, with the seconds between them; and the rules for its parts.

A line may hold `{NAME}`, which takes a value when the macro is played; `{{` and `}}` are literal braces.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dialects.errors import Diagnostic

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")
KEYS = tuple(f"F{number}" for number in range(2, 13))
"""The keys that can play a macro."""
_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[A-Za-z0-9_-]+)\}|[{}]")


@dataclass(frozen=True)
class Step:
    """One line, run `after` seconds after the start of the step before."""

    after: float
    line: str


@dataclass(frozen=True)
class Macro:
    """Steps under a name, and the function key that plays them (empty: none)."""

    name: str
    steps: tuple[Step, ...]
    key: str = ""
    note: str = ""

    @property
    def length(self) -> str:
        """The number of its lines, in words."""
        return f"{len(self.steps)} {'line' if len(self.steps) == 1 else 'lines'}"

    @property
    def summary(self) -> str:
        """Name, key, length and note in one line."""
        return f"{self.name:<16} {self.key or '-':<4} {self.length}  {self.note}".rstrip()


def check_name(name: str, where: str = "") -> None:
    """Raise Diagnostic unless `name` is valid for a macro and its file."""
    if not NAME.fullmatch(name):
        raise Diagnostic(
            f"invalid macro name {name!r}",
            where,
            "use up to 64 letters, digits, - and _, the first of them no -",
        )


def check(macro: Macro, where: str = "") -> None:
    """Raise Diagnostic for a macro that cannot be stored or played."""
    check_name(macro.name, where)
    _check_key(macro.key, where)
    _check_text(macro.note, "note", where)
    if not macro.steps:
        raise Diagnostic("a macro without steps", where, 'add a [[step]] with after = 0.0 and line = "..."')
    for number, step in enumerate(macro.steps, 1):
        _check_step(step, f"step {number}", where)


def _check_key(key: str, where: str) -> None:
    if key and key not in KEYS:
        raise Diagnostic(f"invalid key {key!r}", where, 'use F2 to F12, or key = ""')


def _check_step(step: Step, which: str, where: str) -> None:
    if not math.isfinite(step.after) or step.after < 0:
        raise Diagnostic(f"{which}: invalid after = {step.after}", where, "valid: 0.0 s or more")
    _check_text(step.line, f"{which}: line", where)
    if "\n" in step.line or "\r" in step.line:
        raise Diagnostic(f"{which}: more than one line of text", where, "give each line a [[step]]")


def _check_text(text: str, what: str, where: str) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise Diagnostic(
            f"{what}: half a character at position {error.start + 1}", where, "type the line again"
        ) from None


def describe_clash(key: str, names: Sequence[str]) -> str:
    """Describe the clash on a key with several macros, in one line."""
    return f"{' and '.join(names)} are {'both' if len(names) == 2 else 'all'} on {key}, which plays none of them"


def escape(line: str) -> str:
    """Double the braces of a line, so that `fill` returns it unchanged."""
    return line.replace("{", "{{").replace("}", "}}")


def value_names(line: str) -> set[str]:
    """The names of the values that a line takes."""
    return {match["name"] for match in _BRACES.finditer(line) if match["name"]}


def fill(line: str, values: Mapping[str, str], where: str = "") -> str:
    """Replace each `{NAME}` by its value. Raises Diagnostic for a missing value or a lone brace."""

    def one(match: re.Match[str]) -> str:
        name = match["name"]
        if name is None and len(match[0]) == 2:
            return match[0][0]
        if name is None:
            raise Diagnostic(
                f"a lone {match[0]} at column {match.start() + 1}",
                where,
                f"write {match[0] * 2} for a brace",
            )
        if name not in values:
            raise Diagnostic(f"no value for {{{name}}}", where, f"set {name}=VALUE, or write {{{{ for a brace")
        return values[name]

    return _BRACES.sub(one, line)
