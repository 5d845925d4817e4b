"""The text of a macro's file: TOML that a person can read and edit.

A changed value leaves all else of a hand-written file byte for byte, comments and line ends included.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from multidrop.base.errors import Diagnostic
from multidrop.base.files import toml_keys, toml_of
from multidrop.macros.model import FIRST_PAGE, At, Macro, MacroStep, check

_HEAD = "# a macro of multidrop: lines as typed, with the seconds after the line before\n"
_SHORT = {"\\": "\\\\", '"': '\\"', "\t": "\\t", "\n": "\\n", "\r": "\\r", "\b": "\\b", "\f": "\\f"}
_KEYS: Mapping[str, type | tuple[type, ...]] = {
    "name": str,
    "key": str,
    "page": (str, int),
    "note": str,
    "recorded": str,
    "roles": list,
    "on_early_end": list,
    "on_early_end_moves": bool,
    "step": list,
}
_STEP_KEYS: Mapping[str, type | tuple[type, ...]] = {"after": float, "line": str, "drive": str, "replies": list}
_OLD = {"on_early_end": "on_stop", "on_early_end_moves": "on_stop_moves"}
"""Keys by their names in files of version 0.1.0."""
_LARGEST = 10**15
"""Largest whole number; a float has no room for one of some hundred digits."""
_TYPE_NAMES = {
    "after": "a number",
    "on_early_end_moves": "true or false",
    "page": "a number or text in quotes",
    "step": "[[step]] tables",
}
_TEXTS = 'texts in brackets: ["...", "..."]'


def format_macro(macro: Macro) -> str:
    parts = [_HEAD, f"name = {quoted(macro.name)}\n", f"key = {quoted(macro.key)}\n"]
    if macro.page != FIRST_PAGE:
        parts.append(f"page = {quoted(macro.page)}\n")
    parts.append(f"note = {quoted(macro.note)}\n")
    if macro.recorded:
        parts.append(f"recorded = {quoted(macro.recorded)}\n")
    parts += [f"{key} = {_texts(values)}\n" for key in ("roles", "on_early_end") if (values := getattr(macro, key))]
    if macro.on_early_end_moves:
        parts.append("on_early_end_moves = true\n")
    for step in macro.steps:
        parts.append(f"\n[[step]]\nafter = {float(step.after)!r}\nline = {quoted(step.line)}\n")
        parts.append(f"drive = {quoted(step.drive)}\n" if step.drive else "")
        parts.append(f"replies = {_texts(step.replies)}\n" if step.replies else "")
    return "".join(parts)


def parse_macro(text: str, where: str = "") -> Macro:
    """Parse the text of a file. Raises Diagnostic with `where` for any text that is not a macro."""
    table = toml_of(text, where)
    place, old = in_text(text, where), {now: before for now, before in _OLD.items() if before in table}

    def at(key: str, number: int) -> str:
        return place(old.get(key, key), number)

    for now, before in old.items():
        if now in table:
            raise Diagnostic(f"{before} is the old name of {now}, which is there too", at(now, 0), "keep one of them")
        table[now] = table.pop(before)
    _check_table(table, _KEYS, 0, at)
    if "name" not in table:
        raise Diagnostic("no name", where, 'add name = "..."')
    macro = Macro(
        table["name"],
        tuple(_step(row, number, at) for number, row in enumerate(table.get("step", []), 1)),
        table.get("key", "").upper(),
        table.get("note", ""),
        str(table.get("page", FIRST_PAGE)),
        _list(table, "roles", 0, at),
        _list(table, "on_early_end", 0, at),
        table.get("on_early_end_moves", False),
        table.get("recorded", ""),
    )
    check(macro, where, at)
    return macro


def _step(table: Any, number: int, at: At) -> MacroStep:
    if not isinstance(table, dict):
        where = at("step", 0)
        raise Diagnostic(f"{_which(number)}must be a table", where, "write [[step]], then after = and line =")
    _check_table(table, _STEP_KEYS, number, at)
    if "line" not in table:
        raise Diagnostic(f"{_which(number)}no line", at("", number), 'add line = "..."')
    replies = _list(table, "replies", number, at)
    return MacroStep(float(table.get("after", 0.0)), table["line"], table.get("drive", ""), replies)


def _list(table: Mapping[str, Any], key: str, number: int, at: At) -> tuple[str, ...]:
    """The texts of a key; none without it."""
    values = table.get(key, [])
    if not all(isinstance(value, str) for value in values):
        raise Diagnostic(f"{_which(number)}{key} must be {_TEXTS}", at(key, number))
    return tuple(values)


def _check_table(table: dict[str, Any], keys: Mapping[str, type | tuple[type, ...]], number: int, at: At) -> None:
    for key, value in table.items():
        if key not in keys:
            hint = f"valid keys: {', '.join(keys)}"
            raise Diagnostic(f"{_which(number)}unknown key {key!r}", at(key, number), hint)
        if not _fits(value, keys[key]):
            default = _TEXTS if keys[key] is list else "text in quotes"
            raise Diagnostic(f"{_which(number)}{key} must be {_TYPE_NAMES.get(key, default)}", at(key, number))


def _which(number: int) -> str:
    return f"step {number}: " if number else ""


def _fits(value: object, kind: type | tuple[type, ...]) -> bool:
    """True if a TOML value has the type of a key; a whole number is a float, a boolean is neither."""
    if isinstance(value, bool):
        return kind is bool
    if isinstance(value, int) and kind is float:
        return abs(value) <= _LARGEST
    return isinstance(value, kind)


def _texts(values: Sequence[str]) -> str:
    """Format an array; one of several texts has a line for each."""
    if len(values) < 2:
        return f"[{''.join(map(quoted, values))}]"
    return "".join(["[\n", *(f"    {quoted(value)},\n" for value in values), "]"])


def quoted(text: str) -> str:
    """Format a TOML basic string; escape quotes, backslashes, and all that TOML or a terminal would act upon."""
    parts = []
    for char in text:
        coded = f"\\u{ord(char):04x}" if ord(char) < 0x10000 else f"\\U{ord(char):08x}"
        parts.append(_SHORT.get(char) or (char if char.isprintable() else coded))
    return f'"{"".join(parts)}"'


MARK = "\ufeff"
"""Byte order mark, which some editors write at the start."""


def with_values(text: str, values: Mapping[str, str], where: str) -> str:
    """Change top-level text values, or add them after the first one; return the new text.

    Raises Diagnostic if that would change anything else in the file.
    """
    body = text.removeprefix(MARK)
    mark = text[: len(text) - len(body)]
    for key, value in values.items():
        before, line = tomllib.loads(body), f"{key} = {quoted(value)}"
        if key in before:
            import tomlkit  # takes 30 ms to import, and only a change wants it

            document = tomlkit.parse(body)
            document[key] = value
            body = tomlkit.dumps(document)
        else:
            body = _added(body, line)
        try:
            same = tomllib.loads(body) == {**before, key: value}
        except tomllib.TOMLDecodeError:
            same = False
        if not same:
            raise Diagnostic(f"cannot set {key} in this file automatically", where, f"write {line} in it")
    return mark + body


def _added(text: str, line: str) -> str:
    """Insert a line after the first statement, or before it if it spans several lines or begins a table.

    tomlkit inserts a new key just before the next table, after the comment above that table.
    """
    lines = re.split(r"(?<=\n)", text)
    first = next((n for n, each in enumerate(lines) if each.strip() and not each.lstrip().startswith("#")), len(lines))
    whole = first < len(lines) and not lines[first].lstrip().startswith("[")
    if whole:
        try:
            tomllib.loads(lines[first])
        except tomllib.TOMLDecodeError:
            whole = False  # a statement of several lines
    end = "\r\n" if any(each.endswith("\r\n") for each in lines[: first + 1]) else "\n"
    if whole and not lines[first].endswith(("\n", "\r\n")):
        lines[first] += end
    lines.insert(first + whole, line + end)
    return "".join(lines)


def in_text(text: str, where: str) -> At:
    """The place of each key in a text, as far as its layout shows it; else the file."""
    lines: dict[tuple[str, int], int] = {}
    for (first, *rest), number, is_key in toml_keys(text):
        step = first[1] if first[0] == "step" else 0
        if is_key or step:
            lines.setdefault(([first, *rest][-1][0] if is_key else "", step), number)

    def at(key: str, step: int) -> str:
        number = lines.get((key, step)) or lines.get(("", step))
        return f"{where}:{number}" if where and number else where

    return at
