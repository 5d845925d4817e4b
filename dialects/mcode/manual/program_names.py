"""The labels and variables of an MCode program file: where each is, and the check of another name for one.

A rename keeps the program: every line has the tokens that it had, but for that name. A drive may divide a line
differently once a name exists or is gone: `H5` is `H 5` unless H5 is a variable. So the check compares all lines.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.files import split_lines
from multidrop.dialects.mcode.manual.grammar import NAME_FORM, Token, divided, is_name, tokens
from multidrop.dialects.mcode.manual.mnemonic import EVERY
from multidrop.dialects.mcode.manual.program_file import LONGEST, ProgramLine, bare, remark_at
from multidrop.dialects.mcode.manual.program_products import AT_POWER_UP
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.dialects.program_editing import Span, UserName, replaced


class _Line(NamedTuple):
    """A line of a file: its text without remark, the column of that from 0, the name that it declares, its tokens."""

    text: str
    column: int
    declares: str
    tokens: list[Token]


@lru_cache(maxsize=16384)
def _read(source: str) -> _Line:
    """Read a line; it is kept, as an editor asks for all lines again after every key."""
    text = bare(source)
    column = len(source) - len(source.lstrip(" \t"))
    return _Line(text, column, ProgramLine(0, text, "").declares, tokens(text))


def names(text: str) -> list[UserName]:
    """Return the labels and variables of a file."""
    sources = split_lines(text)
    lines = [_read(source) for source in sources]
    words = _declared(lines)
    labels = {line.declares for line in lines if line.text[:2].upper() == "LB"}
    places: dict[str, list[Span]] = {}
    declared: dict[str, list[Span]] = {}
    for at, line in enumerate(lines):
        for number, token in _uses(line, words):
            word, start = token.text.upper(), line.column + token.start
            place = Span(at, start, start + len(token.text))
            places.setdefault(word, []).append(place)
            if number <= 2 and word == line.declares:  # LB G1, LB=G1
                declared.setdefault(word, []).append(place)

    def named(word: str) -> UserName:
        kind, there = "label" if word in labels else "variable", declared.get(word, [])
        return UserName(word, kind, tuple(there), tuple(places[word]), remark(sources[there[0].line]) if there else "")

    return [named(word) for word in places]


def _declared(lines: Iterable[_Line]) -> frozenset[str]:
    return frozenset(line.declares for line in lines if line.declares)


def remark(line: str) -> str:
    """Return the text of the remark of a line; empty if it has none."""
    return line[remark_at(line) + 1 :].strip()


def _uses(line: _Line, words: Container[str]) -> Iterator[tuple[int, Token]]:
    """Yield the tokens of a line that are one of the words, each with its number; the letter after DN is none."""
    found = divided(line.tokens, words)
    names_device = bool(found) and found[0].text.upper() == "DN"
    for number, token in enumerate(found):
        if token.kind == "word" and token.text.upper() in words and not (names_device and number):
            yield number, token


def fixed(name: UserName) -> str:
    """Return why a name cannot be another one; empty if it can."""
    if name.word == AT_POWER_UP:
        return f"{AT_POWER_UP} is the label of the program that runs at power-up: by another name it would not run"
    return ""


def renamed(text: str, name: UserName, new: str, product: str) -> str:
    """Return the new name as given. Raises Diagnostic for one that is not a name, is in use, or changes the program."""
    if reason := fixed(name):
        raise Diagnostic(reason)
    word = new.upper()
    if not is_name(new):
        raise Diagnostic(f"{new!r} is not a name", "", NAME_FORM)
    if word == name.word:
        return new
    if lookup(word) is not None:
        raise Diagnostic(_taken(word, product), "", "choose another name")
    sources = split_lines(text)
    for number, source in enumerate(sources, 1):
        if any(_uses(_read(source), (word,))):
            raise Diagnostic(f"{word} is in use already, in line {number}", "", "choose another name")
    _compare(sources, replaced(sources, name.places, new), name.word, word)
    return new


def _taken(word: str, product: str) -> str:
    """Name the owner of a word in use: the drive, or the program."""
    row = lookup(word, product)
    if row is not None:
        return f"{word} is a word of the drive: {row.title}"
    return f"{word} is a word of {', '.join(sorted(each for each in EVERY if lookup(word, each)))}"


def _compare(before: Sequence[str], after: Sequence[str], old: str, new: str) -> None:
    """Raise Diagnostic for a line that a rename makes too long, or that the drive would divide differently."""
    lines = [_read(source) for source in before]
    words = _declared(lines)
    others = words - {old} | {new}
    for number, (line, other) in enumerate(zip(lines, map(_read, after), strict=True), 1):
        if len(other.text) > LONGEST >= len(line.text):
            what = f"line {number} would have {len(other.text)} characters; a drive takes {LONGEST}"
            raise Diagnostic(what, "", "choose a shorter name, or split the line")
        if _tokens(line, words, {old: new}) != _tokens(other, others, {}):
            raise Diagnostic(f"line {number} would mean something else with {new}", "", "choose another name")


def _tokens(line: _Line, words: frozenset[str], new: Mapping[str, str]) -> list[str]:
    """Return the tokens of a line, its names in capitals and renamed."""
    found = [token.text for token in divided(line.tokens, words)]
    for number, token in _uses(line, words):
        upper = token.text.upper()
        found[number] = new.get(upper, upper)
    return found
