"""MCode program files in an editor: the `EditingLanguage` of the language."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence

from multidrop.dialects.errors import Diagnostic
from multidrop.dialects.files import split_lines
from multidrop.dialects.mcode.manual import help, program_names
from multidrop.dialects.mcode.manual.grammar import statement_tokens
from multidrop.dialects.mcode.manual.line_parts import MOVES
from multidrop.dialects.mcode.manual.mnemonic import Mnemonic
from multidrop.dialects.mcode.manual.name_places import LABEL, LABELS_AT, NEW, PRINTED, STATEMENT, expected
from multidrop.dialects.mcode.manual.program_file import ProgramLine, remark_at, scan
from multidrop.dialects.program_editing import Block, Offer, Span, UserName, Word

names = program_names.names
remark = program_names.remark
fixed = program_names.fixed
renamed = program_names.renamed
_ACCESS = {"RW", "RO", "RC"}
"""Of words that PR prints."""


def words(line: str, names: Container[str]) -> list[Word]:
    """Return the words of a line that may have help, operators included."""
    found = statement_tokens(line[: remark_at(line)], names)
    return [Word(each.start, each.stop, each.text.upper()) for each in found if each.kind in ("word", "op")]


def describe(word: str, product: str) -> list[str]:
    """Return the help on a mnemonic or operator; empty where there is none."""
    try:
        return help.describe(word, product)
    except Diagnostic:
        return []


def typing(before: str) -> str:
    """Return the word at the end of a begun line that may be completed; none in a text or a remark."""
    return help.typing(before) if remark_at(before) == len(before) else ""


def offers(before: str, names: Iterable[UserName], product: str) -> list[Offer]:
    """Return labels after a jump, what has a value after PR and in expressions, and all else at the head of a line."""
    if remark_at(before) < len(before) or before.count('"') % 2:
        return []
    word = typing(before)
    place = expected(before[: len(before) - len(word)])
    if place == NEW:
        return []
    folded = word.upper()
    own = [
        Offer(each.word, each.about, each.kind)
        for each in names
        if each.word.startswith(folded) and (each.kind == "label") in LABELS_AT[place]
    ]
    rows = [] if place == LABEL else [row for row in help.offered(word, product) if _fits(row, place)]
    return [*own, *(Offer(row.name, row.meaning, "starts" if row.name in MOVES else "word") for row in rows)]


def _fits(row: Mnemonic, place: str) -> bool:
    """Whether a word of the drive may be typed at a place."""
    if place == STATEMENT:
        return row.kind != "math" and (row.kind == "instruction" or row.access in ("RW", "WO"))
    if place == PRINTED:
        return row.access in _ACCESS
    return row.kind == "math" or (row.access in _ACCESS and row.kind != "keyword")


def outline(text: str) -> list[Block]:
    """Return programs with their labels and variables, and the variables declared outside of programs."""
    sources = split_lines(text)
    found: list[Block] = []
    opened: list[ProgramLine] = []
    for line in scan(text)[0]:
        if line.section != "program":
            found += _declared([line], sources, line.number - 1)
            continue
        if line.mark and opened:  # the PG before is never ended
            found.append(_program(opened, sources))
            opened = []
        opened.append(line)
        if line.mark == "" and len(opened) > 1:
            found.append(_program(opened, sources))
            opened = []
    return [*found, _program(opened, sources)] if opened else found


def _program(lines: Sequence[ProgramLine], sources: Sequence[str]) -> Block:
    """Return a program, from its PG to the last of its lines."""
    first, last = lines[0], lines[-1].number - 1
    end = last - 1 if lines[-1].mark == "" and len(lines) > 1 else last
    parts = tuple(_declared(lines, sources, end))
    return Block(
        "program", first.text.upper(), remark(sources[first.number - 1]), _place(first, len(first.text)), last, parts
    )


def _declared(lines: Sequence[ProgramLine], sources: Sequence[str], end: int) -> Iterator[Block]:
    """Yield the labels and variables of lines; a label reaches to the line before the next one."""
    labels = [line.number - 1 for line in lines if line.declares and _is_label(line)]
    for line in lines:
        if not line.declares:
            continue
        found = statement_tokens(line.text, (line.declares,))
        name = next((each for each in found[1:] if each.text.upper() == line.declares), None)
        if name is None:
            continue
        start = line.column - 1 + name.start
        place = Span(line.number - 1, start, start + len(name.text))
        about = remark(sources[line.number - 1])
        if _is_label(line):
            last = next((at - 1 for at in labels if at > line.number - 1), end)
            yield Block("label", line.declares, about, place, max(last, place.line))
        else:
            value = line.text[name.stop :].strip()
            yield Block("variable", line.declares, "  ".join(filter(None, (value, about))), place, place.line)


def _is_label(line: ProgramLine) -> bool:
    return line.text[:2].upper() == "LB"


def _place(line: ProgramLine, width: int) -> Span:
    return Span(line.number - 1, line.column - 1, line.column - 1 + width)
