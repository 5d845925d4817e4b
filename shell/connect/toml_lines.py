"""The line of a key in a TOML file, for messages: the parser that reads the values does not report it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from dialects.files import split_lines


def line_of(text: str, key: Sequence[str]) -> int:
    """The number of the line with a key, given with its tables (`screen`, `theme`), or with its table; 0: not found."""
    table: tuple[str, ...] = ()
    best = 0
    for number, line in enumerate(split_lines(text), 1):
        if header := re.match(r"\s*\[\[?([^\]]+)\]", line):
            table = _parts(header[1])
            found = table
        elif pair := re.match(r"\s*([^=#]+?)\s*=", line):
            found = (*table, *_parts(pair[1]))
        else:
            continue
        if found == tuple(key):
            return number
        if not best and found and found == tuple(key[: len(found)]):
            best = number
    return best


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))
