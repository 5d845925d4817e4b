"""A program file under editing, for the screen and for other editors: one text, its problems, names and help.

Lines and columns count from 0, in characters. The functions take any place, also one beyond the text.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from os.path import commonprefix
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.base.text import counted
from multidrop.dialects.editing import Block, Offer, Span, UserName
from multidrop.dialects.families import program_language_of, program_languages
from multidrop.dialects.program_files import LinePart, Problem, ProgramEntry, errors

BYTE_ORDER_MARK = "\ufeff"


class ProgramGrammar:
    """The language of a program file. `language` is a family's name; empty: the name of the file gives it."""

    def __init__(self, file: str, language: str = "") -> None:
        by_name = program_language_of(file)
        self._file = file
        self._named = language if language != by_name else ""
        self.language = language or by_name
        self.files = program_languages()[self.language]
        self.title = self.files.title

    def parts(self, line: str) -> Sequence[LinePart]:
        return self.files.language.parts(line)

    def check(self, text: str, product: str) -> Sequence[Problem]:
        """Return the problems of `multidrop program check`; none for an empty text, which a person has just begun."""
        # A screen without an editor needs no simulator.
        from multidrop.shell.programs.checking import examine_text, personality_of

        if not text.strip():
            return ()
        return examine_text(text, self._file, personality_of(self.language, product), self._named).problems

    def entries(self, text: str) -> Sequence[ProgramEntry]:
        return self.files.language.entries(text)


class Help(NamedTuple):
    """Help on the word at a place."""

    place: Span
    lines: tuple[str, ...]


class Coloured(NamedTuple):
    """A part of a line with its kind: that of a `LinePart`, or of a `UserName`. `declares`: it declares its name."""

    place: Span
    kind: str
    declares: bool = False


class Fold(NamedTuple):
    """Lines that may be folded away, from the first to the last."""

    first: int
    last: int
    remarks: bool = False


class TextEdit(NamedTuple):
    """Another text at a place."""

    place: Span
    text: str


class ProgramText:
    """One state of a text. `product`: the personality for which it is checked."""

    def __init__(self, text: str, grammar: ProgramGrammar, product: str) -> None:
        self.text = " " + text[1:] if text.startswith(BYTE_ORDER_MARK) else text
        self.grammar, self._language = grammar, grammar.files.editing
        self._product = product

    @cached_property
    def lines(self) -> list[str]:
        return split_lines(self.text)

    @cached_property
    def problems(self) -> Sequence[Problem]:
        """The problems of the check. For a thread: a long text takes a second."""
        return self.grammar.check(self.text, self._product)

    @cached_property
    def names(self) -> Sequence[UserName]:
        return self._language.names(self.text)

    @cached_property
    def outline(self) -> Sequence[Block]:
        return self._language.outline(self.text)

    @cached_property
    def _places(self) -> Mapping[int, list[tuple[Span, UserName]]]:
        """The places of names, by line."""
        places: dict[int, list[tuple[Span, UserName]]] = {}
        for name in self.names:
            for place in name.places:
                places.setdefault(place.line, []).append((place, name))
        return {line: sorted(places, key=lambda each: each[0]) for line, places in places.items()}

    def line(self, number: int) -> str:
        """Return a line; an empty one beyond the text."""
        return self.lines[number] if 0 <= number < len(self.lines) else ""

    # At a place

    def name_at(self, line: int, column: int) -> tuple[UserName, Span] | None:
        """Return the name at a place, or that ends there, and its place."""
        here = [(name, place) for place, name in self._places.get(line, ()) if place.start <= column <= place.stop]
        return here[-1] if here else None

    def help_at(self, line: int, column: int) -> Help | None:
        """Return the help on the word at a place, or that ends there: the name of the user's, or the drive's word."""
        named = self.name_at(line, column)
        own = frozenset(name.word for name in self.names)
        words = [part for part in self._language.words(self.line(line), own) if part.start <= column]
        word = next((part for part in reversed(words) if column <= part.stop), None)
        lines = self._described(named[0]) if named is not None else []
        if word is not None:
            lines += self._language.describe(word.text, self._product)
        if not lines:
            return None
        place = named[1] if named is not None else Span(line, word.start, word.stop) if word is not None else None
        return Help(place, tuple(lines)) if place is not None else None

    def described(self, word: str) -> Sequence[str]:
        """Return the help on a name or a word of the language; empty where there is none."""
        name = next((user_name for user_name in self.names if user_name.word == word), None)
        return self._described(name) if name is not None else self._language.describe(word, self._product)

    def _described(self, name: UserName) -> list[str]:
        lines = [f"{name.word}: {name.about or name.kind}"]
        lines += [f"  {self.line(place.line).strip()}" for place in name.declared[:1]]
        count = len({place.line for place in name.places})
        return [*lines, f"  in {counted(count, 'line')}"]

    def offers_at(self, line: int, column: int) -> tuple[Span, Sequence[Offer]]:
        """Return what may be typed at a place, and the begun word that it replaces."""
        before = self.line(line)[:column]
        start = len(before) - len(self._language.typing(before))
        return Span(line, start, len(before)), self._language.offers(before, self.names, self._product)

    def renamable_at(self, line: int, column: int) -> tuple[UserName, Span]:
        """Return the name at a place. Raises Diagnostic where there is none, or it cannot be another one."""
        named = self.name_at(line, column)
        if named is None:
            raise Diagnostic("only a label, a variable or a subroutine of this file has a name to change")
        if reason := self._language.fixed(named[0]):
            raise Diagnostic(reason)
        return named

    def renamed_at(self, line: int, column: int, new: str) -> list[TextEdit]:
        """Return the edits that rename the name at a place. Raises Diagnostic where the new name is wrong."""
        name, _ = self.renamable_at(line, column)
        text = self._language.renamed(self.text, name, new, self._product)
        return [TextEdit(place, text) for place in name.places]

    # All of it

    def coloured(self, first: int, last: int) -> Iterator[Coloured]:
        """Yield the parts of lines, in order: names, and what else has a style."""
        for number in range(max(first, 0), min(last + 1, len(self.lines))):
            names = [(place, name.kind, place in name.declared) for place, name in self._places.get(number, ())]
            parts = [
                (Span(number, part.start, part.stop), part.kind, False)
                for part in self.grammar.parts(self.lines[number])
                if not any(place.start < part.stop and part.start < place.stop for place, _, _ in names)
            ]
            yield from (Coloured(*name) for name in sorted([*names, *parts]))

    def folds(self) -> Iterator[Fold]:
        """Yield what may be folded: blocks, and remarks in lines of their own."""
        waiting = [*reversed(self.outline)]  # they may be nested deeper than calls may
        while waiting:
            block = waiting.pop()
            waiting += reversed(block.parts)
            if block.last > block.place.line:
                yield Fold(block.place.line, block.last)
        first: int | None = None
        for number, line in enumerate([*self.lines, ""]):
            parts = self.grammar.parts(line) if line.strip() else ()
            if parts and parts[0].kind == "remark" and not line[: parts[0].start].strip():
                first = number if first is None else first
            else:
                if first is not None and first < number - 1:
                    yield Fold(first, number - 1, remarks=True)
                first = None

    def formatted(self, first: int, last: int) -> list[TextEdit]:
        """Return the edits that give lines their canonical spelling. Raises Diagnostic for a text with errors."""
        if wrong := errors(self.problems):
            count = f"{len(wrong)} errors, the first" if len(wrong) > 1 else "an error"
            raise Diagnostic(f"not formatted: {count} in line {wrong[0].line}: {wrong[0].what}", "", wrong[0].hint)
        edits, lines = [], zip(self.lines, split_lines(self.grammar.files.language.formatted(self.text)), strict=True)
        for number, (old, new) in enumerate(lines):
            if old != new and first <= number <= last:  # without what both spellings begin and end with
                start = len(commonprefix((old, new)))
                end = min(len(commonprefix((old[::-1], new[::-1]))), min(len(old), len(new)) - start)
                edits.append(TextEdit(Span(number, start, len(old) - end), new[start : len(new) - end]))
        return edits
