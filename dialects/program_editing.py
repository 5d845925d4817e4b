"""The text of a program under editing: names and where they are, what may be typed next, the outline.

Lines and columns count from 0 here, in characters.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from typing import NamedTuple, Protocol


class Span(NamedTuple):
    """A part of one line."""

    line: int
    start: int
    stop: int


class Word(NamedTuple):
    """A word of a line, as the language divides it."""

    start: int
    stop: int
    text: str


class UserName(NamedTuple):
    """A name that a program gives: `kind` is label, variable, subroutine or program."""

    word: str
    """As a message writes it: `G1`, `SUB 3`."""
    kind: str
    declared: tuple[Span, ...]
    """The places that declare it, or that set it where the language declares nothing."""
    places: tuple[Span, ...]
    """All its places, those that declare it included."""
    remark: str = ""
    """The remark of the line that declares it."""

    @property
    def about(self) -> str:
        line = f", line {self.declared[0].line + 1}" if self.declared else ""
        return f"{self.kind}{line}{': ' if self.remark else ''}{self.remark}"


class Offer(NamedTuple):
    """A word that may be typed next, with its meaning. `kind`: word, starts, or that of a `UserName`."""

    text: str
    meaning: str
    kind: str


class Block(NamedTuple):
    """A part of a program in its outline. `kind` is that of a `UserName`, or block (IF, WHILE)."""

    kind: str
    name: str
    detail: str
    place: Span
    """The place of its name."""
    last: int
    """Its last line."""
    parts: tuple[Block, ...] = ()


class EditingLanguage(Protocol):
    """A language as an editor uses it beyond the check: a module of a family's manual. None of it fails for any text.

    `names` are the words of the text's names.
    """

    def names(self, text: str) -> Sequence[UserName]:
        """Return the names of a text, in order of their first places."""

    def words(self, line: str, names: Container[str]) -> Sequence[Word]:
        """Return the words of a line that may have help."""

    def describe(self, word: str, product: str) -> Sequence[str]:
        """Return the help on a word of the language, line by line; empty where there is none."""

    def typing(self, before: str) -> str:
        """Return the word at the end of the begun line `before`, which may be completed."""

    def offers(self, before: str, names: Iterable[UserName], product: str) -> Sequence[Offer]:
        """Return what may follow the begun line `before` in place of its last word."""

    def fixed(self, name: UserName) -> str:
        """Return why a name cannot be another one; empty if it can."""

    def renamed(self, text: str, name: UserName, new: str, product: str) -> str:
        """Return what to write at each place of a name to rename it. Raises Diagnostic where that is wrong."""

    def outline(self, text: str) -> Sequence[Block]:
        """Return programs, labels, subroutines, declared variables and blocks."""


def replaced(lines: Sequence[str], places: Iterable[Span], new: str) -> list[str]:
    found = list(lines)
    for place in sorted(places, reverse=True):
        line = found[place.line]
        found[place.line] = line[: place.start] + new + line[place.stop :]
    return found
