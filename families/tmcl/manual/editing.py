"""TMCL program files in an editor: the `EditingLanguage` of the language.

The names of a file are its labels and its constants.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.editing import Block, EditingLanguage, Offer, Span, Use, UserName, Word, collected, last_line
from multidrop.families.tmcl.manual import instructions
from multidrop.families.tmcl.manual.help import LANGUAGE
from multidrop.families.tmcl.manual.program_file import NAME, Divided, LinePiece, divided, negated, remark_at


class TmclEditing(EditingLanguage):
    """The language of TMCL files: names may be in capitals or not."""

    def remark_at(self, line: str) -> int:
        return remark_at(line)

    def remark(self, line: str) -> str:
        return line[remark_at(line) :].lstrip("/; ").rstrip()

    def names(self, text: str) -> list[UserName]:
        """Return the labels and constants of a file, in order of their first places."""
        lines = split_lines(text)
        known: dict[str, tuple[str, str]] = {}
        for _, halves in _divided(lines):
            for piece, kind in ((halves.label, "label"), (halves.name, "constant")):
                if piece is not None:
                    known.setdefault(piece.text.upper(), (piece.text, kind))

        def uses() -> Iterator[Use]:
            for number, halves in _divided(lines):
                for piece in (halves.label, halves.name, halves.value, *halves.fields):
                    named = piece and (negated(piece) or piece)
                    if named and named.text.upper() in known:
                        declares = piece in (halves.label, halves.name)
                        yield Use(*known[named.text.upper()], _span(number, named), declares)

        return collected(uses(), lambda at: self.remark(lines[at]))

    def spelled(self, name: UserName, new: str, product: str) -> tuple[str, str]:
        word = new.strip()
        if not NAME.fullmatch(word):
            raise Diagnostic(f"{new!r} is not a name", "", "letters, digits and _, and no digit first")
        if word.upper() in instructions.WORDS:
            raise Diagnostic(f"{word} is a command", "", self.other)
        return word, word

    def changed(self, text: str, renamed: Sequence[str], name: UserName, word: str) -> str:
        """Return whether a field would be another one, as with ABS."""
        places = [place.line for place in name.places]
        named = [each for each in self.names("\n".join(renamed)) if each.word == word]
        return "" if places == [place.line for user_name in named for place in user_name.places] else "a field"

    def words(self, line: str, names: Container[str]) -> list[Word]:
        """Return the words of a line that may have help: its command."""
        halves = divided(line)
        if halves is None or halves.word is None:
            return []
        start = halves.word.column - 1
        return [Word(start, start + len(halves.word.text), halves.word.text)]

    def describe(self, word: str, product: str) -> list[str]:
        return LANGUAGE.describe(word, product) if word.upper() in instructions.WORDS else []

    def offered(self, begun: str, word: str, names: Iterable[UserName], product: str) -> Iterator[Offer]:
        """Yield commands at the head of a line; in a field its words, labels where it is an address, constants else."""
        halves = divided(begun)
        if halves is None or halves.word is None:
            rows = instructions.WORDS.values() if halves is None or halves.name is None else ()
            yield from (Offer(row.word, row.title, "starts" if row.moves else "word") for row in rows)
            return
        row = instructions.fields_of(halves.word.text)
        at = max(len(halves.fields) - 1, 0)
        if row is None or at >= len(row[1]):
            return
        wanted = row[1][at]
        yield from (Offer(name, wanted.name, "word") for name in wanted.words)
        kind = "label" if wanted.label else "constant"
        yield from (name.offer for name in names if name.kind == kind)

    def outline(self, text: str) -> list[Block]:
        """Return each label, with the lines up to the next one, and the constants."""
        end = len(split_lines(text)) - 1
        declared = [(name, place) for name in self.names(text) for place in name.declared]
        labels = sorted(place.line for name, place in declared if name.kind == "label")
        blocks = []
        for name, place in sorted(declared, key=lambda each: each[1]):
            last = place.line if name.kind == "constant" else last_line(place.line, labels, end)
            blocks.append(Block(name.kind, name.word, name.remark, place, last))
        return blocks


EDITING = TmclEditing()


def _divided(lines: Iterable[str]) -> Iterator[tuple[int, Divided]]:
    """The lines that are not empty, with their numbers from 0."""
    for number, line in enumerate(lines):
        if (halves := divided(line)) is not None:
            yield number, halves


def _span(line: int, piece: LinePiece) -> Span:
    return Span(line, piece.column - 1, piece.column - 1 + len(piece.text))
