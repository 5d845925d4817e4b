"""Lines in columns, such as help, on a screen: broken between words, with their indent."""

from __future__ import annotations

import re
import textwrap

_COLUMN = re.compile(r" *(?:\S(?:.*?\S)? {2,}(?=\S))?")
"""A label and the blanks after it, up to the text beside it; else the indent."""
LEAST = 20
"""The smallest width beside an indent; below it the indent is dropped."""


def laid_out(line: str, width: int) -> list[str]:
    """Break a line into rows of at most `width` cells; each row continues in the column of its text."""
    if len(line) <= width:
        return [line]
    found = _COLUMN.match(line)
    at = found.end() if found else 0
    if width - at < LEAST:
        at = min(len(line) - len(line.lstrip()), max(0, width - LEAST))
        if not line[:at].isspace():
            at = 0
    rows = textwrap.wrap(line[at:].lstrip(), max(1, width - at), break_on_hyphens=False) or [""]
    return [line[:at] + rows[0], *(" " * at + row for row in rows[1:])]
