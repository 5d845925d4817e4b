"""Lines in columns, such as help, on a screen: broken between words, and indented as they were."""

from __future__ import annotations

import re
import textwrap

_COLUMN = re.compile(r" *(?:\S(?:.*?\S)? {2,}(?=\S))?")
"""A label and the blanks behind it, up to where the text beside it begins; else the indent."""
LEAST = 20
"""Cells that must be left beside an indent; else it is given up."""


def laid_out(line: str, width: int) -> list[str]:
    """A line as rows of at most `width` cells; what goes over stands under the column that it belongs to."""
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
