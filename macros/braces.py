"""Braces in a line: `{NAME}` takes a value; `{{` and `}}` are literal braces."""

from __future__ import annotations

import re
from collections.abc import Mapping

from multidrop.dialects.errors import Diagnostic

_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[A-Za-z0-9_-]+)\}|[{}]")


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
