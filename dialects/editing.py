"""The text of a program under editing: names and where they are, what may be typed next, another name, the outline.

Lines and columns count from 0 here, in characters. `EditingLanguage` has what the languages of programs share; their
grammar is in the families' manuals.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Container, Iterable, Sequence
from typing import ClassVar, NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines


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


class Offer(NamedTuple):
    """A word that may be typed next, with its meaning. `kind`: word, starts, or that of a `UserName`."""

    text: str
    meaning: str
    kind: str


class UserName(NamedTuple):
    """A name that a program gives: `kind` is label, variable, constant, subroutine or program."""

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

    @property
    def offer(self) -> Offer:
        return Offer(self.word, self.about, self.kind)


class Use(NamedTuple):
    """A place of a `UserName`. `declares`: it declares the name."""

    word: str
    kind: str
    place: Span
    declares: bool


def collected(uses: Iterable[Use], remark: Callable[[int], str]) -> list[UserName]:
    """Make the names of a text from their places. `remark` gives that of a line."""
    kinds: dict[str, str] = {}
    places: dict[str, list[Span]] = {}
    declared: dict[str, list[Span]] = {}
    for word, kind, place, declares in uses:
        kinds.setdefault(word, kind)
        places.setdefault(word, []).append(place)
        if declares:
            declared.setdefault(word, []).append(place)

    def named(word: str) -> UserName:
        there = declared.get(word, [])
        return UserName(word, kinds[word], tuple(there), tuple(places[word]), remark(there[0].line) if there else "")

    return [named(word) for word in places]


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


def last_line(line: int, begins: Sequence[int], end: int) -> int:
    """Return the last line of a part: the one before the next part begins, else the end.

    `line`: where it begins. `begins`: where all parts begin, in order.
    """
    after = bisect_right(begins, line)
    return max(begins[after] - 1 if after < len(begins) else end, line)


class EditingLanguage(ABC):
    """A language as an editor uses it beyond the check. None of it fails for any text.

    `names` are the words of the text's names. What has a default need not be there: there is no help, any name can be
    another one, and there is no outline.
    """

    other: ClassVar[str] = "choose another name"
    """What to do about a new name that cannot be used."""
    last: ClassVar[re.Pattern[str]] = re.compile(r"[A-Za-z_]\w*\Z", re.ASCII)
    """The word at the end of a begun line."""

    # What a language must have

    @abstractmethod
    def names(self, text: str) -> Sequence[UserName]:
        """Return the names of a text, in order of their first places."""

    @abstractmethod
    def remark_at(self, line: str) -> int:
        """Return the index at which the remark of a line begins; the length of a line without one."""

    @abstractmethod
    def offered(self, begun: str, word: str, names: Iterable[UserName], product: str) -> Iterable[Offer]:
        """Return what may follow a begun line, whether it begins with the word at its end or not.

        `begun`: the line without that word; it is in no remark.
        """

    @abstractmethod
    def spelled(self, name: UserName, new: str, product: str) -> tuple[str, str]:
        """Return a new name as a message writes it, and as the text does. Raises Diagnostic for what is no name."""

    @abstractmethod
    def changed(self, text: str, renamed: Sequence[str], name: UserName, word: str) -> str:
        """Return what else changes in a text by another name, in words such as `line 3`; empty: nothing.

        `renamed`: its lines with the new name, `word`. Raises Diagnostic for a line that cannot be as it would be.
        """

    # What it may have

    def words(self, line: str, names: Container[str]) -> Sequence[Word]:
        """Return the words of a line that may have help."""
        return ()

    def describe(self, word: str, product: str) -> Sequence[str]:
        """Return the help on a word of the language, line by line; empty where there is none."""
        return ()

    def outline(self, text: str) -> Sequence[Block]:
        """Return programs, labels, subroutines, declared variables and blocks."""
        return ()

    def remark(self, line: str) -> str:
        """Return the text of the remark of a line; empty if it has none."""
        return line[self.remark_at(line) + 1 :].strip()

    def last_word(self, before: str) -> str:
        """Return the word at the end of a begun line that may be completed; the line is in no remark."""
        match = self.last.search(before)
        return match[0] if match else ""

    def fixed(self, name: UserName) -> str:
        """Return why a name cannot be another one; empty if it can."""
        return ""

    def used_in(self, text: str, name: UserName, word: str) -> int | None:
        """Return the line in which another name than this one is a word already; None: it is free."""
        folded = word.upper()
        taken = (each for each in self.names(text) if each.word.upper() == folded != name.word.upper())
        return next((each.places[0].line for each in taken), None)

    # What an editor asks

    def typing(self, before: str) -> str:
        """Return the word at the end of the begun line `before`, which may be completed; none in a remark."""
        return self.last_word(before) if self.remark_at(before) == len(before) else ""

    def offers(self, before: str, names: Iterable[UserName], product: str) -> Sequence[Offer]:
        """Return what may follow the begun line `before` in place of its last word; nothing in a remark."""
        if self.remark_at(before) < len(before):
            return []
        word = self.last_word(before)
        folded = word.upper()
        offers = self.offered(before[: len(before) - len(word)], word, names, product)
        return [offer for offer in offers if offer.text.upper().startswith(folded)]

    def renamed(self, text: str, name: UserName, new: str, product: str) -> str:
        """Return what to write at each place of a name to rename it.

        Raises Diagnostic for a name that cannot change, and for a new one that is none, is in use, or changes more.
        """
        if reason := self.fixed(name):
            raise Diagnostic(reason)
        word, written = self.spelled(name, new, product)
        if word == name.word:
            return written
        if (line := self.used_in(text, name, word)) is not None:
            raise Diagnostic(f"{word} is in use already, in line {line + 1}", "", self.other)
        if changed := self.changed(text, replaced(split_lines(text), name.places, written), name, word):
            raise Diagnostic(f"{changed} would mean something else with {word}", "", self.other)
        return written


def replaced(lines: Sequence[str], places: Iterable[Span], new: str) -> list[str]:
    changed = list(lines)
    for place in sorted(places, reverse=True):
        line = changed[place.line]
        changed[place.line] = line[: place.start] + new + line[place.stop :]
    return changed
