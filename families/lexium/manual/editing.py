"""MCode program files in an editor: the `EditingLanguage` of the language."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.editing import Block, EditingLanguage, Offer, Span, Use, UserName, Word, collected, last_line
from multidrop.families.lexium.manual.grammar import NAME_FORM, Token, divided, is_name, statement_tokens, tokens
from multidrop.families.lexium.manual.groups import EVERY_PLACE, TURNING
from multidrop.families.lexium.manual.help import LANGUAGE, rows_offered
from multidrop.families.lexium.manual.mnemonic import EVERY, Mnemonic
from multidrop.families.lexium.manual.program_file import LONGEST_PROGRAM_LINE, ProgramLine, bare, remark_at, scan
from multidrop.families.lexium.manual.program_flow import AT_POWER_UP
from multidrop.families.lexium.manual.table import lookup

STATEMENT, NEW, LABEL, PRINTED, VALUE = "statement", "new", "label", "printed", "value"
"""A head; a name that is not there yet; the label of a place; an item of PR; any other argument."""
LABELS_AT: Mapping[str, tuple[bool, ...]] = {
    STATEMENT: (False,),
    NEW: (),
    LABEL: (True,),
    PRINTED: (False, True),
    VALUE: (False,),
}
"""The kinds of names at each place, in order: True for labels, False for variables."""


def expected(before: str) -> str:
    """Return what may follow `before`: a begun line without its last word."""
    before_tokens = tokens(before)
    if not before_tokens or before_tokens[-1].kind == "remark":
        return STATEMENT
    head, commas = before_tokens[0].text.upper(), sum(token.kind == "comma" for token in before_tokens)
    if head in ("LB", "VA"):
        return VALUE if head == "VA" and len(before_tokens) > 2 else NEW
    if commas == EVERY_PLACE.get(head) and before_tokens[-1].text in (before_tokens[0].text, "=", ","):
        return LABEL
    return PRINTED if head == "PR" else VALUE


_ACCESS = {"RW", "RO", "RC"}
"""Of words that PR prints."""


class MCodeEditing(EditingLanguage):
    """The language of MCode files: their labels and variables.

    A rename keeps the program: every line has the tokens that it had, but for that name. A drive may divide a line
    differently once a name exists or is gone: `H5` is `H 5` unless H5 is a variable. So the check compares all lines.
    """

    def remark_at(self, line: str) -> int:
        return remark_at(line)

    def names(self, text: str) -> list[UserName]:
        sources = split_lines(text)
        lines = [_read(source) for source in sources]
        words = _declared_names(lines)
        labels = {line.declares for line in lines if line.text[:2].upper() == "LB"}

        def uses() -> Iterator[Use]:
            for at, line in enumerate(lines):
                for number, token in _uses(line, words):
                    word, start = token.text.upper(), line.column + token.start
                    kind = "label" if word in labels else "variable"
                    declares = number <= 2 and word == line.declares  # LB G1, LB=G1
                    yield Use(word, kind, Span(at, start, start + len(token.text)), declares)

        return collected(uses(), lambda at: self.remark(sources[at]))

    def fixed(self, name: UserName) -> str:
        if name.word == AT_POWER_UP:
            return f"{AT_POWER_UP} is the label of the program that runs at power-up: by another name it would not run"
        return ""

    def spelled(self, name: UserName, new: str, product: str) -> tuple[str, str]:
        """Return the new name in capitals, and as it is given."""
        word = new.upper()
        if not is_name(new):
            raise Diagnostic(f"{new!r} is not a name", "", NAME_FORM)
        if word != name.word and lookup(word) is not None:
            raise Diagnostic(_taken(word, product), "", self.other)
        return word, new

    def used_in(self, text: str, name: UserName, word: str) -> int | None:
        """Return the line in which another name than this one is a word already, whether it declares one or not."""
        sources = enumerate(split_lines(text))
        return next((at for at, source in sources if any(_uses(_read(source), (word,)))), None)

    def changed(self, text: str, renamed: Sequence[str], name: UserName, word: str) -> str:
        """Return the first line that the drive would divide differently. Raises Diagnostic for one that is too long."""
        lines = [_read(source) for source in split_lines(text)]
        words = _declared_names(lines)
        others = words - {name.word} | {word}
        for number, (line, other) in enumerate(zip(lines, map(_read, renamed), strict=True), 1):
            if len(other.text) > LONGEST_PROGRAM_LINE >= len(line.text):
                what = f"line {number} would have {len(other.text)} characters; a drive takes {LONGEST_PROGRAM_LINE}"
                raise Diagnostic(what, "", "choose a shorter name, or split the line")
            if _tokens(line, words, {name.word: word}) != _tokens(other, others, {}):
                return f"line {number}"
        return ""

    def words(self, line: str, names: Container[str]) -> list[Word]:
        tokens_of_line = statement_tokens(line[: remark_at(line)], names)
        return [
            Word(token.start, token.stop, token.text.upper())
            for token in tokens_of_line
            if token.kind in ("word", "op")
        ]

    def describe(self, word: str, product: str) -> list[str]:
        try:
            return LANGUAGE.describe(word, product)
        except Diagnostic:
            return []

    def last_word(self, before: str) -> str:
        """Return the word at the end of a begun line that may be completed; none in a text."""
        return LANGUAGE.typing(before)

    def offered(self, begun: str, word: str, names: Iterable[UserName], product: str) -> Iterator[Offer]:
        """Yield labels after a jump, what has a value after PR and in expressions, all else at the head of a line."""
        place = expected(begun)
        if begun.count('"') % 2 or place == NEW:
            return
        yield from (name.offer for name in names if (name.kind == "label") in LABELS_AT[place])
        for row in rows_offered(product) if place != LABEL else ():
            if _fits(row, place):
                yield Offer(row.name, row.meaning, "starts" if row.name in TURNING else "word")

    def outline(self, text: str) -> list[Block]:
        """Return programs with their labels and variables, and the variables declared outside of programs."""
        sources = split_lines(text)
        blocks: list[Block] = []
        opened: list[ProgramLine] = []
        for line in scan(text)[0]:
            if line.section != "program":
                blocks += _declared([line], sources, line.number - 1)
                continue
            if line.mark and opened:  # the PG before is never ended
                blocks.append(_program(opened, sources))
                opened = []
            opened.append(line)
            if line.mark == "" and len(opened) > 1:
                blocks.append(_program(opened, sources))
                opened = []
        return [*blocks, _program(opened, sources)] if opened else blocks


EDITING = MCodeEditing()


class _FileLine(NamedTuple):
    """A line of a file: its text without remark, the column of that from 0, the name that it declares, its tokens."""

    text: str
    column: int
    declares: str
    tokens: list[Token]


@lru_cache(maxsize=16384)
def _read(source: str) -> _FileLine:
    """Read a line; it is kept, as an editor asks for all lines again after every key."""
    text = bare(source)
    column = len(source) - len(source.lstrip(" \t"))
    return _FileLine(text, column, ProgramLine(0, text, "").declares, tokens(text))


def _declared_names(lines: Iterable[_FileLine]) -> frozenset[str]:
    return frozenset(line.declares for line in lines if line.declares)


def _uses(line: _FileLine, words: Container[str]) -> Iterator[tuple[int, Token]]:
    """Yield the tokens of a line that are one of the words, each with its number; the letter after DN is none."""
    parts = divided(line.tokens, words)
    names_device = bool(parts) and parts[0].text.upper() == "DN"
    for number, token in enumerate(parts):
        if token.kind == "word" and token.text.upper() in words and not (names_device and number):
            yield number, token


def _taken(word: str, product: str) -> str:
    row = lookup(word, product)
    if row is not None:
        return f"{word} is a word of the drive: {row.title}"
    return f"{word} is a word of {', '.join(sorted(each for each in EVERY if lookup(word, each)))}"


def _tokens(line: _FileLine, words: frozenset[str], new: Mapping[str, str]) -> list[str]:
    """Return the tokens of a line, its names in capitals and renamed."""
    texts = [token.text for token in divided(line.tokens, words)]
    for number, token in _uses(line, words):
        upper = token.text.upper()
        texts[number] = new.get(upper, upper)
    return texts


def _fits(row: Mnemonic, place: str) -> bool:
    if place == STATEMENT:
        return row.kind != "math" and (row.kind == "instruction" or row.access in ("RW", "WO"))
    if place == PRINTED:
        return row.access in _ACCESS
    return row.kind == "math" or (row.access in _ACCESS and row.kind != "keyword")


def _program(lines: Sequence[ProgramLine], sources: Sequence[str]) -> Block:
    first, last = lines[0], lines[-1].number - 1
    end = last - 1 if lines[-1].mark == "" and len(lines) > 1 else last
    parts = tuple(_declared(lines, sources, end))
    return Block(
        "program",
        first.text.upper(),
        EDITING.remark(sources[first.number - 1]),
        Span(first.number - 1, first.column - 1, first.column - 1 + len(first.text)),
        last,
        parts,
    )


def _declared(lines: Sequence[ProgramLine], sources: Sequence[str], end: int) -> Iterator[Block]:
    """Yield the labels and variables of lines; a label reaches to the line before the next one."""
    labels = [line.number - 1 for line in lines if line.declares and _is_label(line)]
    for line in lines:
        if not line.declares:
            continue
        declared_tokens = statement_tokens(line.text, (line.declares,))
        name = next((token for token in declared_tokens[1:] if token.text.upper() == line.declares), None)
        if name is None:
            continue
        start = line.column - 1 + name.start
        place = Span(line.number - 1, start, start + len(name.text))
        about = EDITING.remark(sources[line.number - 1])
        if _is_label(line):
            yield Block("label", line.declares, about, place, last_line(place.line, labels, end))
        else:
            value = line.text[name.stop :].strip()
            yield Block("variable", line.declares, "  ".join(filter(None, (value, about))), place, place.line)


def _is_label(line: ProgramLine) -> bool:
    return line.text[:2].upper() == "LB"
