"""TMCL program files in an editor: the `EditingLanguage` of the language.

The names of a file are its labels and its constants.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Container, Iterable, Iterator, Sequence

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.program_files import Block, Offer, Span, UserName, Word, replaced
from multidrop.families.tmcl.manual import help, instructions
from multidrop.families.tmcl.manual.program_file import NAME, Divided, Piece, divided, negated, remark_at

_LAST = re.compile(r"[A-Za-z_]\w*\Z", re.ASCII)
_WORD = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def _divided(text: str) -> Iterator[tuple[int, str, Divided]]:
    """The lines of a text that are not empty, with their numbers from 0."""
    for number, line in enumerate(split_lines(text)):
        if (found := divided(line)) is not None:
            yield number, line, found


def names(text: str) -> list[UserName]:
    """Return the labels and constants of a file, in order of their first places."""
    kinds: dict[str, str] = {}
    written: dict[str, str] = {}
    remarks: dict[str, str] = {}
    declared: dict[str, list[Span]] = {}
    for number, line, found in _divided(text):
        for piece, kind in ((found.label, "label"), (found.name, "constant")):
            if piece is not None:
                word = piece.text.upper()
                kinds.setdefault(word, kind)
                written.setdefault(word, piece.text)
                remarks.setdefault(word, line[remark_at(line) :].lstrip("/; ").rstrip())
                declared.setdefault(word, []).append(_span(number, piece))
    places: dict[str, list[Span]] = {}
    for number, _, found in _divided(text):
        for piece in (found.label, found.name, found.value, *found.fields):
            named = piece if piece is None else negated(piece) or piece
            if named is not None and named.text.upper() in kinds:
                places.setdefault(named.text.upper(), []).append(_span(number, named))
    return [
        UserName(written[word], kinds[word], tuple(declared[word]), tuple(spans), remarks[word])
        for word, spans in places.items()
    ]


def _span(line: int, piece: Piece) -> Span:
    return Span(line, piece.column - 1, piece.column - 1 + len(piece.text))


def fixed(name: UserName) -> str:
    """Return why a name cannot be another one: each can."""
    return ""


def renamed(text: str, name: UserName, new: str, product: str) -> str:
    word = new.strip()
    if not NAME.fullmatch(word):
        raise Diagnostic(f"{new!r} is not a name", "", "letters, digits and _, and no digit first")
    if word.upper() in instructions.WORDS:
        raise Diagnostic(f"{word} is a command", "", "choose another name")
    taken = next((each for each in names(text) if each.word.upper() == word.upper() != name.word.upper()), None)
    if taken is not None:
        raise Diagnostic(f"{word} is in use already, in line {taken.places[0].line + 1}", "", "choose another name")
    after = "\n".join(replaced(split_lines(text), name.places, word))
    places = [place.line for place in name.places]
    if places != [place.line for each in names(after) if each.word == word for place in each.places]:
        raise Diagnostic(f"a field would mean something else with {word}", "", "choose another name")  # as with ABS
    return word


def words(line: str, names: Container[str]) -> list[Word]:
    """Return the words of a line that may have help: its command."""
    found = divided(line)
    if found is None or found.word is None:
        return []
    start = found.word.column - 1
    return [Word(start, start + len(found.word.text), found.word.text)]


def describe(word: str, product: str) -> list[str]:
    return help.describe(word, product) if word.upper() in instructions.WORDS else []


def typing(before: str) -> str:
    last = _LAST.search(before)
    return last[0] if last and remark_at(before) == len(before) else ""


def offers(before: str, names: Iterable[UserName], product: str) -> list[Offer]:
    """Return commands at the head of a line; in a field its words, labels where it is an address, constants else."""
    if remark_at(before) < len(before):
        return []
    word = typing(before)
    found = divided(before[: len(before) - len(word)])
    start = word.upper()
    if found is None or found.word is None:
        rows = instructions.WORDS.values() if found is None or found.name is None else ()
        return [
            Offer(row.word, row.title, "starts" if row.moves else "word") for row in rows if row.word.startswith(start)
        ]
    row = instructions.fields_of(found.word.text)
    at = max(len(found.fields) - 1, 0)
    if row is None or at >= len(row[1]):
        return []
    wanted = row[1][at]
    kind = "label" if wanted.label else "constant"
    own = [Offer(each.word, each.about, each.kind) for each in names if each.kind == kind]
    return [
        each
        for each in (*(Offer(name, wanted.name, "word") for name in wanted.words), *own)
        if each.text.upper().startswith(start)
    ]


def outline(text: str) -> Sequence[Block]:
    """Return each label, with the lines up to the next one, and the constants."""
    lines = split_lines(text)
    found = [(name, place) for name in names(text) for place in name.declared]
    labels = sorted(place.line for name, place in found if name.kind == "label")
    blocks = []
    for name, place in sorted(found, key=lambda each: each[1]):
        follows = [*labels[bisect_right(labels, place.line) :][:1], len(lines)][0]
        last = place.line if name.kind == "constant" else follows - 1
        blocks.append(Block(name.kind, name.word, name.remark, place, last))
    return blocks
