"""A-SCRIPT files in an editor: the `EditingLanguage` of the language."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence

from multidrop.dialects.files import split_lines
from multidrop.dialects.pmx.manual import line_parts, script_help, script_names
from multidrop.dialects.pmx.manual.line_parts import MOVE
from multidrop.dialects.pmx.manual.script_parser import Statement, parse
from multidrop.dialects.pmx.manual.script_words import AXES
from multidrop.dialects.pmx.manual.script_words import Word as Register
from multidrop.dialects.program_editing import Block, Offer, Span, UserName, Word

names = script_names.names
fixed = script_names.fixed
renamed = script_names.renamed
_LAST = re.compile(r"[A-Za-z]\w*[+-]?\Z", re.ASCII)
_CALL = re.compile(r"\s*GOSUB\s*(\d*)\Z", re.ASCII)
_NEW = re.compile(r"\s*(PRG|SUB)\s*\d*\Z", re.ASCII)
_ENDS = {"END": "PRG", "ENDSUB": "SUB", "ENDIF": "IF", "ENDWHILE": "WHILE"}
_KINDS = {"PRG": "program", "SUB": "subroutine", "IF": "block", "WHILE": "block"}


def words(line: str, names: Container[str]) -> list[Word]:  # noqa: ARG001
    """Return the words of a line; each axis of a move is one."""
    found = []
    for word in line_parts.words(line):
        if MOVE.fullmatch(word.text):
            found += [
                Word(word.start + at, word.start + at + 1, axis) for at, axis in enumerate(word.text) if axis in AXES
            ]
        else:
            found.append(word)
    return found


def describe(word: str, product: str) -> list[str]:  # noqa: ARG001
    """Return the help on a word; empty where there is none."""
    return script_help.describe(word)


def typing(before: str) -> str:
    """Return the word at the end of a begun line that may be completed: the number after GOSUB, too."""
    if ";" in before:
        return ""
    if found := _CALL.match(before):
        return found[1]
    last = _LAST.search(before)
    return last[0] if last else ""


def offers(before: str, names: Iterable[UserName], product: str) -> list[Offer]:  # noqa: ARG001
    """Return subroutines after GOSUB, what can be read in values, and all else at the head of a line."""
    if ";" in before or _NEW.match(before):
        return []
    word = typing(before).upper()
    if _CALL.match(before):
        numbers = [(each.word.removeprefix("SUB "), each) for each in names if each.kind == "subroutine"]
        return [Offer(text, each.about, each.kind) for text, each in numbers if text.startswith(word) and each.declared]
    first = not before[: len(before) - len(word)].strip()
    own = [Offer(each.word, each.about, each.kind) for each in names if each.kind == "variable"]
    known = [
        Offer(text, script_help.meaning(text), "starts" if line_parts.kind_of(text, first) == "starts" else "word")
        for text, register in script_help.offered()
        if _fits(register, first)
    ]
    return [each for each in (*own, *known) if each.text.startswith(word)]


def _fits(register: Register | None, first: bool) -> bool:
    """Whether a word may begin a line (`first`), or be a value; None: a word of programs alone."""
    if register is None:
        return first
    return register.command or register.settable if first else register.readable


def outline(text: str) -> list[Block]:
    """Return programs and subroutines with their blocks."""
    return _Outline(text).blocks


class _Outline:
    """The blocks of a file. A block that has no end ends before the program or subroutine that follows it."""

    def __init__(self, text: str) -> None:
        self.lines = split_lines(text)
        self.blocks: list[Block] = []
        self.open: list[tuple[Statement, list[Block]]] = []
        for number, statement in enumerate(parse(text)[0]):
            at = statement.line - 1
            if statement.word in ("PRG", "SUB"):
                self.close("", at - 1)
            if statement.wrong:
                continue
            if statement.word in _KINDS:
                self.open.append((statement, []))
            elif not number:
                self.open.append((Statement("block", "PRG", (), "", statement.line, statement.column), []))
            if statement.word in _ENDS:
                self.close(_ENDS[statement.word], at)
        self.close("", len(self.lines) - 1)

    def close(self, word: str, last: int) -> None:
        """End the innermost block of that word and those in it; without a word, all. One without a begin is left."""
        if word and word not in (each.word for each, _ in self.open):
            return
        while self.open:
            begin, parts = self.open.pop()
            (self.open[-1][1] if self.open else self.blocks).append(self.block(begin, last, parts))
            if begin.word == word:
                return

    def block(self, begin: Statement, last: int, parts: Sequence[Block]) -> Block:
        code, _, remark = self.lines[begin.line - 1].partition(";")
        name = str(begin) if begin.values else "PRG 0"
        place = Span(begin.line - 1, begin.column - 1, max(len(code.rstrip()), begin.column - 1))
        return Block(_KINDS[begin.word], name, remark.strip(), place, last, tuple(parts))
