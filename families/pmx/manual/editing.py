"""A-SCRIPT files in an editor: the `EditingLanguage` of the language.

The names of a file are variables (V0 to V63), subroutines and programs.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace

from multidrop.base.errors import Diagnostic
from multidrop.base.files import split_lines
from multidrop.dialects.program_files import Block, Offer, Span, UserName, Word, replaced
from multidrop.families.pmx.manual import script_parser
from multidrop.families.pmx.manual.script_parser import Statement, Value, parse

_NUMBERED = re.compile(r"\s*(PRG|SUB|GOSUB)\s*(\d{1,4})\s*", re.ASCII)
_SETS = re.compile(r"\s*(V\d+)\s*=", re.ASCII)
_NUMBER = re.compile(r"(?:SUB)?\s*(\d{1,4})\s*", re.ASCII)
_NAME_KINDS = {"PRG": ("PRG", "program"), "SUB": ("SUB", "subroutine"), "GOSUB": ("SUB", "subroutine")}


def names(text: str) -> list[UserName]:
    """Return the names of a file. A variable has no declaration: the first line that sets it counts as one."""
    lines = split_lines(text)
    kinds: dict[str, str] = {}
    places: dict[str, list[Span]] = {}
    declared: dict[str, Span] = {}
    for number, line in enumerate(lines):
        code = line.partition(";")[0]
        for word, kind, start, stop in _found(code):
            place = Span(number, start, stop)
            kinds[word] = kind
            places.setdefault(word, []).append(place)
            sets = _SETS.match(code)
            if (sets is not None and sets.start(1) == start) if kind == "variable" else "GOSUB" not in code:
                declared.setdefault(word, place)

    def named(word: str) -> UserName:
        first = (declared[word],) if word in declared else ()
        remark = lines[first[0].line].partition(";")[2].strip() if first else ""
        return UserName(word, kinds[word], first, tuple(places[word]), remark)

    return [named(word) for word in places]


def _found(code: str) -> Iterator[tuple[str, str, int, int]]:
    if numbered := _NUMBERED.fullmatch(code):
        head, kind = _NAME_KINDS[numbered[1]]
        yield f"{head} {int(numbered[2])}", kind, *numbered.span(2)
        return
    indent = len(code) - len(code.lstrip())
    if script_parser.MOVE.fullmatch(code.strip()):
        found = [(each[2], indent + each.start(2)) for each in script_parser.TARGET.finditer(code.strip())]
    else:
        found = [(word.text, word.start) for word in script_parser.words(code)]
    yield from (
        (text, "variable", start, start + len(text)) for text, start in found if text in script_parser.VARIABLE_NAMES
    )


def fixed(name: UserName) -> str:
    if name.kind == "program":
        return f"the host starts {name.word} by its number (SR{name.word[4:]}=1)"
    if name.word == f"SUB {script_parser.HANDLER}":
        return f"{name.word} is the subroutine that runs after an error, by its number"
    return ""


def renamed(text: str, name: UserName, new: str, product: str) -> str:
    """Return the variable, or the number of the subroutine. Raises Diagnostic where that is none, or is in use."""
    if reason := fixed(name):
        raise Diagnostic(reason)
    word = _variable(name, new) if name.kind == "variable" else _subroutine(new)
    taken = next((each for each in names(text) if each.word == word and each.word != name.word), None)
    if taken is not None:
        raise Diagnostic(f"{word} is in use already, in line {taken.places[0].line + 1}", "", "choose another number")
    after = replaced(split_lines(text), name.places, word.removeprefix("SUB "))
    wanted = [_renamed(each, name.word, word) for each in parse(text)[0]]
    for one, other in zip(wanted, parse("\n".join(after))[0], strict=True):
        if one != other:  # more than that word would change
            raise Diagnostic(f"line {other.line} would mean something else with {word}", "", "choose another number")
    return word.removeprefix("SUB ")


def _renamed(statement: Statement, old: str, new: str) -> Statement:
    """Return a statement with another variable, or another number of a subroutine."""
    if old.startswith("SUB "):
        numbered = statement.word in ("SUB", "GOSUB") and statement.values == (Value(old[4:]),)
        return replace(statement, values=(Value(new[4:]),)) if numbered else statement
    values = tuple(Value(new) if each.text == old else each for each in statement.values)
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
    found = _NUMBER.fullmatch(new.strip())
    if found is None or int(found[1]) >= script_parser.SUBROUTINES:
        raise Diagnostic(f"{new!r} is not a subroutine", "", f"subroutines are 0 to {script_parser.SUBROUTINES - 1}")
    if int(found[1]) == script_parser.HANDLER:
        raise Diagnostic(
            f"SUB {script_parser.HANDLER} is the subroutine that runs after an error", "", "choose another number"
        )
    return f"SUB {int(found[1])}"


_LAST = re.compile(r"[A-Za-z]\w*[+-]?\Z", re.ASCII)
_CALL = re.compile(r"\s*GOSUB\s*(\d*)\Z", re.ASCII)
_NEW = re.compile(r"\s*(PRG|SUB)\s*\d*\Z", re.ASCII)
_ENDS = {"END": "PRG", "ENDSUB": "SUB", "ENDIF": "IF", "ENDWHILE": "WHILE"}
_KINDS = {"PRG": "program", "SUB": "subroutine", "IF": "block", "WHILE": "block"}


def words(line: str, names: Container[str]) -> list[Word]:
    """Return the words of a line; each axis of a move is one."""
    found = []
    for word in script_parser.words(line):
        if script_parser.MOVE_WORD.fullmatch(word.text):
            found += [
                Word(word.start + at, word.start + at + 1, axis)
                for at, axis in enumerate(word.text)
                if axis in script_parser.AXES
            ]
        else:
            found.append(word)
    return found


def describe(word: str, product: str) -> list[str]:
    return script_parser.describe(word)


def typing(before: str) -> str:
    """Return the word at the end of a begun line that may be completed: the number after GOSUB, too."""
    if ";" in before:
        return ""
    if found := _CALL.match(before):
        return found[1]
    last = _LAST.search(before)
    return last[0] if last else ""


def offers(before: str, names: Iterable[UserName], product: str) -> list[Offer]:
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
        Offer(text, script_parser.meaning(text), "starts" if script_parser.kind_of(text, first) == "starts" else "word")
        for text, register in script_parser.offered()
        if _fits(register, first)
    ]
    return [each for each in (*own, *known) if each.text.startswith(word)]


def _fits(register: script_parser.Register | None, first: bool) -> bool:
    """Whether a word may begin a line (`first`), or be a value; None: a word of programs alone."""
    if register is None:
        return first
    return register.command or register.settable if first else register.readable


def outline(text: str) -> list[Block]:
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
