"""A-SCRIPT files in an editor: the `EditingLanguage` of the language.

The names of a file are variables (V0 to V63), subroutines and programs.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.editing import Block, EditingLanguage, Offer, Span, Use, UserName, Word, collected
from multidrop.families.pmx.manual import script_parser
from multidrop.families.pmx.manual.script_parser import ScriptStatement, ScriptValue, parse

_NUMBERED = re.compile(r"\s*(PRG|SUB|GOSUB)\s*(\d{1,4})\s*", re.ASCII)
_SETS = re.compile(r"\s*(V\d+)\s*=", re.ASCII)
_NUMBER = re.compile(r"(?:SUB)?\s*(\d{1,4})\s*", re.ASCII)
_NAME_KINDS = {"PRG": ("PRG", "program"), "SUB": ("SUB", "subroutine"), "GOSUB": ("SUB", "subroutine")}
_CALL = re.compile(r"\s*GOSUB\s*(\d*)\Z", re.ASCII)
_NEW = re.compile(r"\s*(PRG|SUB)\s*\d*\Z", re.ASCII)
_ENDS = {"END": "PRG", "ENDSUB": "SUB", "ENDIF": "IF", "ENDWHILE": "WHILE"}
_KINDS = {"PRG": "program", "SUB": "subroutine", "IF": "block", "WHILE": "block"}


class PmxEditing(EditingLanguage):
    """The language of A-SCRIPT files."""

    other = "choose another number"
    last = re.compile(r"[A-Za-z]\w*[+-]?\Z", re.ASCII)

    def remark_at(self, line: str) -> int:
        return len(line.partition(";")[0])

    def names(self, text: str) -> list[UserName]:
        """Return the names of a file. A variable has no declaration: the first line that sets it counts as one."""
        lines = split_lines(text)

        def uses() -> Iterator[Use]:
            for number, line in enumerate(lines):
                code = line.partition(";")[0]
                sets = _SETS.match(code)
                for word, kind, start, stop in _found(code):
                    first = sets is not None and sets.start(1) == start
                    yield Use(
                        word, kind, Span(number, start, stop), first if kind == "variable" else "GOSUB" not in code
                    )

        collected_names = collected(uses(), lambda at: self.remark(lines[at]))
        return [name._replace(declared=name.declared[:1]) for name in collected_names]

    def fixed(self, name: UserName) -> str:
        if name.kind == "program":
            return f"the host starts {name.word} by its number (SR{name.word[4:]}=1)"
        if name.word == f"SUB {script_parser.HANDLER}":
            return f"{name.word} is the subroutine that runs after an error, by its number"
        return ""

    def spelled(self, name: UserName, new: str, product: str) -> tuple[str, str]:
        """Return the variable, or the subroutine and its number."""
        word = _variable(name, new) if name.kind == "variable" else _subroutine(new)
        return word, word.removeprefix("SUB ")

    def changed(self, text: str, renamed: Sequence[str], name: UserName, word: str) -> str:
        wanted = [_renamed(statement, name.word, word) for statement in parse(text)[0]]
        pairs = zip(wanted, parse("\n".join(renamed))[0], strict=True)
        return next((f"line {other.line}" for one, other in pairs if one != other), "")

    def words(self, line: str, names: Container[str]) -> list[Word]:
        """Return the words of a line; each axis of a move is one."""
        words = []
        for word in script_parser.words(line):
            if script_parser.MOVE_WORD.fullmatch(word.text):
                words += [
                    Word(word.start + at, word.start + at + 1, axis)
                    for at, axis in enumerate(word.text)
                    if axis in script_parser.AXES
                ]
            else:
                words.append(word)
        return words

    def describe(self, word: str, product: str) -> list[str]:
        return script_parser.describe(word)

    def last_word(self, before: str) -> str:
        """Return the word at the end of a begun line that may be completed: the number after GOSUB, too."""
        match = _CALL.match(before)
        return match[1] if match else super().last_word(before)

    def offered(self, begun: str, word: str, names: Iterable[UserName], product: str) -> Iterator[Offer]:
        """Yield subroutines after GOSUB, what can be read in values, and all else at the head of a line."""
        before = begun + word
        if _NEW.match(before):
            return
        if _CALL.match(before):
            known = (name for name in names if name.kind == "subroutine" and name.declared)
            yield from (name.offer._replace(text=name.word.removeprefix("SUB ")) for name in known)
            return
        first = not begun.strip()
        yield from (name.offer for name in names if name.kind == "variable")
        for text, register in script_parser.offered():
            if _fits(register, first):
                kind = "starts" if script_parser.kind_of(text, first) == "starts" else "word"
                yield Offer(text, script_parser.meaning(text), kind)

    def outline(self, text: str) -> list[Block]:
        return _Outline(text).blocks


EDITING = PmxEditing()


def _found(code: str) -> Iterator[tuple[str, str, int, int]]:
    if numbered := _NUMBERED.fullmatch(code):
        head, kind = _NAME_KINDS[numbered[1]]
        yield f"{head} {int(numbered[2])}", kind, *numbered.span(2)
        return
    indent = len(code) - len(code.lstrip())
    if script_parser.MOVE.fullmatch(code.strip()):
        targets = [(match[2], indent + match.start(2)) for match in script_parser.TARGET.finditer(code.strip())]
    else:
        targets = [(word.text, word.start) for word in script_parser.words(code)]
    yield from (
        (text, "variable", start, start + len(text)) for text, start in targets if text in script_parser.VARIABLE_NAMES
    )


def _renamed(statement: ScriptStatement, old: str, new: str) -> ScriptStatement:
    """Return a statement with another variable, or another number of a subroutine."""
    if old.startswith("SUB "):
        numbered = statement.word in ("SUB", "GOSUB") and statement.values == (ScriptValue(old[4:]),)
        return replace(statement, values=(ScriptValue(new[4:]),)) if numbered else statement
    values = tuple(ScriptValue(new) if value.text == old else value for value in statement.values)
    return replace(statement, values=values, word=new if statement.word == old else statement.word)


def _variable(name: UserName, new: str) -> str:
    word = new.strip()
    if word not in script_parser.VARIABLE_NAMES:
        raise Diagnostic(f"{new!r} is not a variable", "", f"variables are V0 to V{script_parser.VARIABLES - 1}")
    old_kept, new_kept = (int(each[1:]) in script_parser.KEPT_VARIABLES for each in (name.word, word))
    if old_kept != new_kept:
        kept, other = (name.word, word) if old_kept else (word, name.word)
        first = script_parser.KEPT_VARIABLES.start
        hint = f"V0 to V{first - 1} are 0 at each start, V{first} to V{script_parser.VARIABLES - 1} are kept"
        raise Diagnostic(f"STORE keeps {kept} and does not keep {other}", "", hint)
    return word


def _subroutine(new: str) -> str:
    match = _NUMBER.fullmatch(new.strip())
    if match is None or int(match[1]) >= script_parser.SUBROUTINES:
        raise Diagnostic(f"{new!r} is not a subroutine", "", f"subroutines are 0 to {script_parser.SUBROUTINES - 1}")
    if int(match[1]) == script_parser.HANDLER:
        raise Diagnostic(
            f"SUB {script_parser.HANDLER} is the subroutine that runs after an error", "", "choose another number"
        )
    return f"SUB {int(match[1])}"


def _fits(register: script_parser.ScriptRegister | None, first: bool) -> bool:
    """Whether a word may begin a line (`first`), or be a value; None: a word of programs alone."""
    if register is None:
        return first
    return register.command or register.settable if first else register.readable


class _Outline:
    """The blocks of a file. A block that has no end ends before the program or subroutine that follows it."""

    def __init__(self, text: str) -> None:
        self.lines = split_lines(text)
        self.blocks: list[Block] = []
        self.open: list[tuple[ScriptStatement, list[Block]]] = []
        for number, statement in enumerate(parse(text)[0]):
            at = statement.line - 1
            if statement.word in ("PRG", "SUB"):
                self.close("", at - 1)
            if statement.wrong:
                continue
            if statement.word in _KINDS:
                self.open.append((statement, []))
            elif not number:
                self.open.append((ScriptStatement("block", "PRG", (), "", statement.line, statement.column), []))
            if statement.word in _ENDS:
                self.close(_ENDS[statement.word], at)
        self.close("", len(self.lines) - 1)

    def close(self, word: str, last: int) -> None:
        """End the innermost block of that word and those in it; without a word, all. One without a begin is left."""
        if word and word not in (statement.word for statement, _ in self.open):
            return
        while self.open:
            begin, parts = self.open.pop()
            (self.open[-1][1] if self.open else self.blocks).append(self.block(begin, last, parts))
            if begin.word == word:
                return

    def block(self, begin: ScriptStatement, last: int, parts: Sequence[Block]) -> Block:
        code, _, remark = self.lines[begin.line - 1].partition(";")
        name = str(begin) if begin.values else "PRG 0"
        place = Span(begin.line - 1, begin.column - 1, max(len(code.rstrip()), begin.column - 1))
        return Block(_KINDS[begin.word], name, remark.strip(), place, last, tuple(parts))
