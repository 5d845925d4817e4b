"""The places of keys in the text of a macro's file, for messages: `m.toml:7`."""

from __future__ import annotations

import re
from collections.abc import Callable

from multidrop.dialects.files import split_lines

At = Callable[[str, int], str]
"""The place of a key: at the top, or in the step of that number. An empty key is the step itself."""
_STEP = re.compile(r"\s*\[\[\s*[\"']?step[\"']?\s*\]\]")
_KEY = re.compile(r"\s*[\"']?(?P<key>[A-Za-z_-]+)[\"']?\s*=")


def nowhere(where: str) -> At:
    """All keys in one place that has no lines."""
    return lambda key, step: where


def in_text(text: str, where: str) -> At:
    """The place of each key in a text, as far as its layout shows it; else the file."""
    lines: dict[tuple[str, int], int] = {}
    step = 0
    for number, line in enumerate(split_lines(text), 1):
        if _STEP.match(line):
            step += 1
            lines.setdefault(("", step), number)
        elif match := _KEY.match(line):
            lines.setdefault((match["key"], step), number)

    def at(key: str, step: int) -> str:
        number = lines.get((key, step)) or lines.get(("", step))
        return f"{where}:{number}" if where and number else where

    return at
