"""The text of a macro's file: TOML that a person can read and edit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dialects.errors import Diagnostic
from dialects.files import toml_of
from macros.model import Macro, Step, check

_HEAD = "# a macro of multidrop: lines as typed, with the seconds after the line before\n"
_SHORT = {"\\": "\\\\", '"': '\\"', "\t": "\\t", "\n": "\\n", "\r": "\\r", "\b": "\\b", "\f": "\\f"}
_KEYS = {"name": str, "key": str, "note": str, "step": list}
_STEP_KEYS = {"after": float, "line": str}
_LARGEST = 10**15
"""Largest whole number; a float has no room for one of some hundred digits."""
_TYPE_NAMES = {str: "text in quotes", float: "a number", list: "[[step]] tables", dict: "a table"}


def format_macro(macro: Macro) -> str:
    """Format a macro as the text of its file."""
    parts = [_HEAD]
    parts += [f"{key} = {_quoted(getattr(macro, key))}\n" for key in ("name", "key", "note")]
    for step in macro.steps:
        parts.append(f"\n[[step]]\nafter = {float(step.after)!r}\nline = {_quoted(step.line)}\n")
    return "".join(parts)


def parse_macro(text: str, where: str = "") -> Macro:
    """Parse the text of a file. Raises Diagnostic with `where` for any text that is not a macro."""
    table = toml_of(text, where)
    _check_table(table, _KEYS, "", where)
    if "name" not in table:
        raise Diagnostic("no name", where, 'add name = "..."')
    steps = tuple(_step(each, f"step {number}: ", where) for number, each in enumerate(table.get("step", []), 1))
    macro = Macro(table["name"], steps, table.get("key", "").upper(), table.get("note", ""))
    check(macro, where)
    return macro


def _step(table: Any, which: str, where: str) -> Step:
    if not isinstance(table, dict):
        raise Diagnostic(f"{which}must be a table", where, "write [[step]], then after = and line =")
    _check_table(table, _STEP_KEYS, which, where)
    if "line" not in table:
        raise Diagnostic(f"{which}no line", where, 'add line = "..."')
    return Step(float(table.get("after", 0.0)), table["line"])


def _check_table(table: dict[str, Any], keys: Mapping[str, type], which: str, where: str) -> None:
    for key, value in table.items():
        if key not in keys:
            raise Diagnostic(f"{which}unknown key {key!r}", where, f"valid keys: {', '.join(keys)}")
        if not _fits(value, keys[key]):
            raise Diagnostic(f"{which}{key} must be {_TYPE_NAMES[keys[key]]}", where)


def _fits(value: object, kind: type) -> bool:
    """Whether a TOML value has the type of a key; a whole number is a float, a boolean is neither."""
    if isinstance(value, bool):
        return False
    if isinstance(value, int) and kind is float:
        return abs(value) <= _LARGEST
    return isinstance(value, kind)


def _quoted(text: str) -> str:
    """Format a TOML basic string; escape quotes, backslashes, and all that TOML or a terminal would act upon."""
    return '"' + "".join(_SHORT.get(char) or (char if _plain(char) else _coded(char)) for char in text) + '"'


def _plain(char: str) -> bool:
    return char == " " or char.isprintable()


def _coded(char: str) -> str:
    return f"\\u{ord(char):04x}" if ord(char) < 0x10000 else f"\\U{ord(char):08x}"
