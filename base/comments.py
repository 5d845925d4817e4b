r"""Comments: where one begins, and marks that a person did not mean for one.

A comment is not sent. So a mark that divides a number in groups of digits (`MR 51'200`) would move a drive to 51, and
whoever wrote the line would see nothing of it. Files therefore refuse such a number, and typed lines have no comments.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

MARKS = "'`\\;#"
"""Every character that begins a comment in a language here; `//` does, too."""
_GROUPS = re.compile(rf"(?:[{re.escape(MARKS)}][0-9]{{3}})+(?![0-9])(?:\.[0-9]*)?")
_END = re.compile(r"[^ \t]|[ \t]*(?:\Z|[^ \tA-Za-z0-9])")
_SCRIPTED = re.compile(r"(?:^|(?<=[ \t]))#")
_SCRIPT = re.compile(r"""\"[^"]*(?:"|\Z)|(?<![^\s=])'[^']*'|(?P<comment>(?:^|(?<=[ \t]))\#.*)""", re.DOTALL)
"""A text in quotation marks, of which single ones begin a word of a verb's line; or a comment."""
ENTER = "stands for Enter; leave it out"
_ENTER = re.compile(r"\^[MJ](?=\s*(?:\^|\Z))")


def outside(line: str, found: re.Pattern[str]) -> Iterator[re.Match[str]]:
    """Yield the matches that begin outside double quotation marks. A mark that is not closed holds the rest."""
    opened = at = 0
    for match in found.finditer(line):
        opened += line.count('"', at, match.start())
        at = match.start()
        if not opened % 2:
            yield match


class Grouped(NamedTuple):
    """A number that a comment mark divides: its column from 0, as written, and what would be left of it."""

    start: int
    written: str
    left: str

    @property
    def why(self) -> str:
        return f"{self.written} would be read as {self.left}; write {re.sub(r'[^0-9.]', '', self.written)}"


def grouped_at(line: str, mark: int) -> Grouped | None:
    """Return the number that the comment mark at this index divides in groups of three digits; None for a comment.

    Groups of exactly three digits extend to the end of the line, to another comment, or to what goes on with the line:
    the next field, an operator, an axis (`MA 51'200,1`). Behind a blank a word or a number is a comment's.
    """
    start = _number(line, mark)
    groups = _GROUPS.match(line, mark)
    if start == mark or groups is None or _END.match(line, groups.end()) is None:
        return None
    return Grouped(start, line[start : groups.end()], line[start:mark])


def _number(line: str, end: int) -> int:
    """Return the index at which the number that ends there begins; `end` where a digit is not right before it."""
    start = end
    while start and line[start - 1] in "0123456789.":
        start -= 1
    return start if end and line[end - 1] in "0123456789" else end


def behind_number(line: str, mark: int) -> bool:
    """Whether a comment begins right behind a digit."""
    return 0 < mark < len(line) and line[mark - 1] in "0123456789"


def unsent(text: str) -> str:
    """Return why a typed line for a drive is refused: a comment of scripts, or Enter in words; empty for any other."""
    if next(outside(text, _SCRIPTED), None) is not None:
        return "# begins a comment in scripts and pipes only; leave it out"
    enter = enter_in(text)
    if enter is None:
        return ""
    blanks = f", or write ^ {enter[0][1]} for the variable {enter[0][1]}" if "=" in text[: enter.start()] else ""
    return f"{enter[0]} {ENTER}{blanks}"


def enter_in(line: str) -> re.Match[str] | None:
    """Find `^M` or `^J`, written as two characters, at the end of a line; None in a line without."""
    return next(outside(line, _ENTER), None)


def uncommented(line: str) -> str:
    """Return the line of a script without its comment: from a `#` at its head or after a blank, outside quotes."""
    match = next((comment for comment in _SCRIPT.finditer(line) if comment["comment"] is not None), None)
    return (line[: match.start()] if match else line).strip(" \t")
