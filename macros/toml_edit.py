"""Changes of values in a hand-written TOML file: all else stays byte for byte, comments and line ends included."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping

from multidrop.dialects.errors import Diagnostic
from multidrop.macros.toml_format import quoted

MARK = "\ufeff"
"""Byte order mark, which some editors write at the start."""


def with_values(text: str, values: Mapping[str, str], where: str) -> str:
    """Change several top-level text values, as `with_value` does."""
    for key, value in values.items():
        text = with_value(text, key, value, where)
    return text


def with_value(text: str, key: str, value: str, where: str) -> str:
    """Change a top-level text value, or add it after the first one; return the new text.

    Raises Diagnostic if that would change anything else in the file.
    """
    body = text.removeprefix(MARK)
    before = tomllib.loads(body)
    edited = _replaced(body, key, value) if key in before else _added(body, f"{key} = {quoted(value)}")
    try:
        same = tomllib.loads(edited) == {**before, key: value}
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        raise Diagnostic(f"cannot set {key} in this file automatically", where, f"write {key} = {quoted(value)} in it")
    return text[: len(text) - len(body)] + edited


def _replaced(text: str, key: str, value: str) -> str:
    import tomlkit  # takes 30 ms to import, and only a change wants it

    document = tomlkit.parse(text)
    document[key] = value
    return tomlkit.dumps(document)


def _added(text: str, line: str) -> str:
    """Insert a line after the first statement, or before it if it spans several lines or begins a table.

    tomlkit inserts a new key just before the next table, after the comment above that table.
    """
    lines = re.split(r"(?<=\n)", text)
    first = next((n for n, each in enumerate(lines) if each.strip() and not each.lstrip().startswith("#")), len(lines))
    whole = first < len(lines) and not lines[first].lstrip().startswith("[") and _is_whole(lines[first])
    end = "\r\n" if any(each.endswith("\r\n") for each in lines[: first + 1]) else "\n"
    if whole and not lines[first].endswith(("\n", "\r\n")):
        lines[first] += end
    lines.insert(first + whole, line + end)
    return "".join(lines)


def _is_whole(line: str) -> bool:
    """Whether a line is a complete statement."""
    try:
        tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return False
    return True
