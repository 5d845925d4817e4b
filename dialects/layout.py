"""A program file in canonical spelling: its indents, its remarks and their columns stay."""

from __future__ import annotations

import re
from collections.abc import Callable

BLANKS = " \t"
TAB = 8
"""Columns from one tab stop to the next."""


_END_OF_FILE = "\x1a"


def respelled(text: str, remark_at: Callable[[str], int], spell: Callable[[str], str]) -> str:
    """Return a text with its statements in canonical spelling. `remark_at` finds where the remark of a line begins."""
    body = text.rstrip(_END_OF_FILE)
    parts = re.split("(\r?\n)" if "\n" in body else "(\r)", body)  # as `split_lines` divides it
    parts[::2] = [_line(part, remark_at(part), spell) for part in parts[::2]]
    return "".join(parts) + text[len(body) :]


def _line(line: str, end: int, spell: Callable[[str], str]) -> str:
    """Return a line with its statement in canonical spelling; its remark begins at `end`.

    A remark keeps its column where the new statement leaves room. Blanks at the end of a line without a remark go.
    """
    code = line[:end].rstrip(BLANKS)
    statement = code.lstrip(BLANKS)
    if not statement:
        return line
    indent, gap, remark = code[: len(code) - len(statement)], line[len(code) : end], line[end:]
    spelled = spell(statement)
    if not remark:
        return indent + spelled
    if spelled == statement or not gap:
        return indent + spelled + gap + remark
    return _filled(indent + spelled, _width(line[:end]), gap) + remark


def _filled(code: str, column: int, gap: str) -> str:
    """Fill up to a column with what the gap consists of, with one such character at least."""
    if gap.strip("\t"):
        return code + " " * max(column - _width(code), 1)
    code += "\t"
    while _width(code) < column:
        code += "\t"
    return code


def _width(text: str) -> int:
    return len(text.expandtabs(TAB))
