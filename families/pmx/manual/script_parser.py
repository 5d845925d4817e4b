"""The words and the parser of A-SCRIPT: each line as a statement, or its error with line and column (manual 10).

A line is one statement. A remark begins with a semicolon. Words are capitals, as everywhere on this controller. A value
is a number or a variable (V0 to V63). Where it is read into a variable or compared, it may be a register. A line holds
at most one operation between two values, and only into a variable (7.19.6). `script_checker` checks the structure
(blocks, subroutines, size). So a line with an error keeps its place as the statement that it resembles.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from multidrop.base.files import rows, split_lines
from multidrop.dialects.editing import Word
from multidrop.dialects.language import labelled
from multidrop.dialects.program_files import BLANKS, LinePart, Problem, ProgramEntry
from multidrop.families.pmx.manual.table import ELSEWHERE, PmxCommand, grouped, lookup

# The words (manual 10.1; the joystick's are in 7.15): access, ASCII command, help, their places in a line.
#
# `script_words.csv` has the registers and commands with the constants that each accepts, and the ASCII command where
# that has another name; `V0-63` is a row for each number. A constant of 0 for an axis: the global value applies to it.
# `script_keywords.csv` has the words of programs alone.
#
# A-SCRIPT and the ASCII commands are two languages: `HOMEX-` is `HX-` there, `ECLEARX` is `CLRX`. The axes are X and
# Y. Z, U, EO3 and programs 2 and 3, which the manual mentions in places, belong to a bigger controller.


AXES = "XY"
PROGRAMS = 2
SUBROUTINES = 32
VARIABLES = 64
KEPT_VARIABLES = range(32, VARIABLES)
"""The variables that STORE keeps; a start of a program sets the others to 0."""
HANDLER = 31
"""The subroutine that runs after a failure."""
INT32 = (-(2**31), 2**31 - 1)

OPERATORS = ("+", "-", "*", "/", "%", ">>", "<<", "&", "|")
"""Operations between two values; `~` precedes one."""
COMPARISONS = (">", "<", "=", ">=", "<=", "!=")
_NUMBERS = re.compile(r"([A-Z]+)(\d+)-(\d+)")
BLOCKS = ("PRG", "END", "SUB", "ENDSUB", "IF", "ELSEIF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "GOSUB", "DELAY")


@dataclass(frozen=True)
class ScriptRegister:
    """A register or a command: its ASCII command, access, and the constants it accepts."""

    ascii: str
    readable: bool = False
    settable: bool = False
    low: int = INT32[0]
    high: int = INT32[1]

    @property
    def command(self) -> bool:
        """Whether it is executed, neither read nor set."""
        return not (self.readable or self.settable)


def _words() -> dict[str, ScriptRegister]:
    registers: dict[str, ScriptRegister] = {}
    for row in rows(__file__, "script_words.csv"):
        names, access = [row["word"]], row["access"]
        if numbered := _NUMBERS.fullmatch(row["word"]):
            names = [f"{numbered[1]}{number}" for number in range(int(numbered[2]), int(numbered[3]) + 1)]
        low, high = int(row["low"] or INT32[0]), int(row["high"] or INT32[1])
        registers |= {
            name: ScriptRegister(row["command"] or name, "R" in access, "W" in access, low, high) for name in names
        }
    return registers


WORDS: Mapping[str, ScriptRegister] = _words()
KEYWORDS: Mapping[str, tuple[str, str]] = {
    row["word"]: (row["syntax"], row["meaning"]) for row in rows(__file__, "script_keywords.csv")
}
"""The words of programs alone: syntax and meaning."""


def _command_of(word: str) -> PmxCommand | None:
    """The row of the ASCII command that does what a word of a script does."""
    return lookup(ELSEWHERE.get(word, WORDS[word].ascii)) if word in WORDS else None


def meaning(word: str) -> str:
    """Return the meaning of a word in one line; empty for an unknown one."""
    if word in KEYWORDS:
        return KEYWORDS[word][1]
    register, row = WORDS.get(word), _command_of(word)
    return row.meaning if register is not None and row is not None else ""


def describe(word: str) -> list[str]:
    """Describe a word, line by line; empty for an unknown one."""
    if word in KEYWORDS:
        syntax, what = KEYWORDS[word]
        return [f"{word}: {what}", *labelled([("syntax", syntax)])]
    register, row = WORDS.get(word), _command_of(word)
    if register is None or row is None:
        return []
    facts = (
        ("value", row.takes),
        ("constants", f"{register.low} to {register.high}" if register.settable and register.high < INT32[1] else ""),
        ("in programs", use(word)),
        ("as command", command if (command := ELSEWHERE.get(word, register.ascii)) != word else ""),
        ("note", row.note),
        ("manual", f"PMX-2ED-SA {row.section}"),
    )
    return [f"{word}: {row.meaning}", *labelled(facts, 11)]


def find(word: str) -> str:
    """Return the word of a program that a person means: `HOME` is `HOMEX+`, `sub 31` is `SUB`; empty for none."""
    text = word.strip().upper()
    if text in KEYWORDS or text in WORDS:
        return text
    if numbered := _NUMBERED.fullmatch(text):
        return numbered[1]
    fitting = (name for name in (*KEYWORDS, *WORDS) if text and name.startswith(text))
    return next((name for name in fitting if _ENDING.fullmatch(name[len(text) :])), "")


def use(word: str) -> str:
    """Say how programs use a register or a command; empty for any other word."""
    register = WORDS.get(word)
    if register is None:
        return ""
    return (
        " and ".join(use for use, can in (("read", register.readable), ("set", register.settable)) if can) or "executed"
    )


def offered() -> list[tuple[str, ScriptRegister | None]]:
    """Return every word, but the numbered variables; None for those of programs alone."""
    registers = [(name, word) for name, word in WORDS.items() if name not in VARIABLE_NAMES]
    return [*((name, None) for name in KEYWORDS), *registers]


VARIABLE_NAMES = frozenset(f"V{number}" for number in range(VARIABLES))


_WORD = re.compile(r"[A-Za-z]\w*[+-]?", re.ASCII)
MOVE_WORD = re.compile(rf"([{AXES}](V?\d+)?)+", re.ASCII)
_PROGRAM = re.compile(r"PRG\s*(\d+)", re.ASCII)
_STARTS = re.compile(r"(HOME|HLHOME|LHOME|ZHOME|ZOME|JOG)[XY]|SR\d|JOYENA", re.ASCII)
_WITH_NUMBER = ("PRG", "SUB", "GOSUB")


def parts(line: str) -> list[LinePart]:
    code, semicolon, _ = line.partition(";")
    line_parts = [
        LinePart(word.start, word.stop, kind)
        for word in words(line)
        if (kind := kind_of(word.text, not code[: word.start].strip()))
    ]
    return [*line_parts, LinePart(len(code), len(line), "remark")] if semicolon else line_parts


def words(line: str) -> list[Word]:
    """Return the words of a line; a sign at the end belongs to the words that have one."""
    words_of_line = []
    for match in _WORD.finditer(line.partition(";")[0]):
        text = match[0] if match[0] in WORDS else match[0].rstrip("+-")
        words_of_line.append(Word(match.start(), match.start() + len(text), text))
    return words_of_line


def kind_of(word: str, first: bool) -> str:
    """Return the kind of a word; `first`: it begins its line. Empty for an unknown word."""
    if first and (_STARTS.match(word) or MOVE_WORD.fullmatch(word)):
        return "starts"
    if word in BLOCKS:
        return "label" if word in _WITH_NUMBER else "word"
    return "word" if word in WORDS or word[:4] == "WAIT" else ""


def entries(text: str) -> list[ProgramEntry]:
    """Return the numbers of the programs in a file, in order; lines without a PRG are program 0."""
    lines = [line.partition(";")[0].strip() for line in re.split(r"\r\n|\n|\r", text)]
    entries_of_file = [
        ProgramEntry(match[1], number, f"SR{match[1]}=1")
        for number, line in enumerate(lines, 1)
        if (match := _PROGRAM.fullmatch(line))
    ]
    first = next((number for number, line in enumerate(lines, 1) if line), 0)
    return entries_of_file or ([ProgramEntry("0", first, "SR0=1")] if first else [])


_VALUE = r"-?\d+|[A-Za-z]\w*"
_BLOCK = re.compile(r"(IF|ELSEIF|WHILE)(?![A-Za-z0-9])(.*)")
_NUMBERED = re.compile(r"(PRG|GOSUB|SUB)\s*(-?\d+)?\s*")
_ENDING = re.compile(r"[XY]?[+-]?|\d+", re.ASCII)
"""What may follow the stem of a word: an axis and a direction, or a number."""
_PLAIN = re.compile(r"(ELSEIF|ELSE|ENDIF|ENDWHILE|ENDSUB|END)\s*")
MOVE = re.compile(r"([XYZU])\s*(-?\d+|V\d+)(?:\s*([XYZU])\s*(-?\d+|V\d+))*\s*")
TARGET = re.compile(r"([XYZU])\s*(-?\d+|V\d+)")
_SET = re.compile(r"\s*([A-Za-z]\w*)\s*=(.*)")
_CONDITION = re.compile(rf"\s*({_VALUE})\s*(>=|<=|!=|=|>|<)\s*({_VALUE})\s*")
_HEAD = re.compile(r"\s*[A-Za-z]+")
_FOREIGN = re.compile(r"['`#]|//")
"""Characters that begin a remark in other languages."""
_SOURCE = re.compile(rf"\s*(~?)\s*({_VALUE})\s*(?:(>>|<<|[-+*/%&|])\s*({_VALUE})\s*)?")

KNOWN = [*WORDS, *BLOCKS, *(f"WAIT{axis}" for axis in AXES)]
"""Every word that may begin a line, except the axes of a move."""


@dataclass(frozen=True)
class ScriptValue:
    """A number, or a register by its name."""

    text: str
    column: int = field(default=0, compare=False)

    @property
    def constant(self) -> int | None:
        """The number; None for a register."""
        return int(self.text) if self.text.lstrip("-").isdigit() else None


@dataclass(frozen=True)
class ScriptStatement:
    """A line. `word` is the keyword, the register to set, the command, or the axes of a move (`X`, `Y`, `XY`).

    kind: block (a keyword of structure), set, delay, wait, move, command. `op` is a comparison or an operation.
    """

    kind: str
    word: str
    values: tuple[ScriptValue, ...] = ()
    op: str = ""
    line: int = field(default=0, compare=False)
    column: int = field(default=1, compare=False)
    wrong: bool = False
    """The line has a reported error. `word` is the block word that it resembles, if any; no values."""

    @property
    def number(self) -> int:
        return int(self.values[0].text)

    def __str__(self) -> str:
        values = [value.text for value in self.values]
        if self.word in ("IF", "ELSEIF", "WHILE"):
            return f"{self.word} {values[0]}{self.op}{values[1]}"
        if self.kind == "block":
            return " ".join([self.word, *values])
        if self.kind == "move":
            return "".join(axis + value for axis, value in zip(self.word, values, strict=True))
        if self.kind == "set":
            source = f"~{values[0]}" if self.op == "~" else self.op.join(values)
            return f"{self.word}={source}"
        return {"delay": f"DELAY={''.join(values)}", "wait": f"WAIT{self.word}"}.get(self.kind, self.word)


class _Wrong(Exception):
    def __init__(self, column: int, what: str, hint: str = "") -> None:
        super().__init__(what)
        self.column, self.what, self.hint = column, what, hint


def parse(text: str) -> tuple[list[ScriptStatement], list[Problem]]:
    """Parse every line, and report the errors. Never fails."""
    statements: list[ScriptStatement] = []
    problems: list[Problem] = []
    for number, line in enumerate(split_lines(text), 1):
        bare = line.partition(";")[0].rstrip(BLANKS)
        if not bare.strip(BLANKS):
            continue
        try:
            statements.append(_statement(bare, number))
        except _Wrong as wrong:
            problems.append(Problem(number, wrong.column, wrong.what, wrong.hint))
            # The block word at the head of a line with an error; empty if there is none.
            head = _HEAD.match(_FOREIGN.split(bare, 1)[0])
            word = _meant(head[0].strip()) if head else ""
            statements.append(
                ScriptStatement("wrong", (word if word in BLOCKS else ""), (), "", number, wrong.column, wrong=True)
            )
    return statements, problems


def _statement(bare: str, line: int) -> ScriptStatement:
    start = len(bare) - len(bare.lstrip())
    text, column = bare[start:], start + 1
    for at, character in enumerate(text):
        if not " " <= character <= "~" and character != "\t":
            raise _Wrong(column + at, f"A-SCRIPT has no character {character!r}", "remarks begin with ;")
    if match := _FOREIGN.search(text):
        raise _Wrong(column + match.start(), f"{match[0]} begins no remark in A-SCRIPT", "remarks begin with ;")
    if wrong := grouped(text):
        raise _Wrong(column, wrong)
    if match := _BLOCK.fullmatch(text):
        values, op = _condition(match[2], column + match.start(2), match[1])
        return ScriptStatement("block", match[1], values, op, line, column)
    if match := _NUMBERED.fullmatch(text):
        return ScriptStatement("block", match[1], (_number(match, column),), "", line, column)
    if (match := _PLAIN.fullmatch(text)) and match[1] != "ELSEIF":
        return ScriptStatement("block", match[1], (), "", line, column)
    if match := MOVE.fullmatch(text):
        return _move(text, line, column)
    if match := _SET.fullmatch(text):
        return _set(match, line, column)
    word = text.rstrip()
    if word[:4] == "WAIT" and word[4:] in tuple(AXES):
        return ScriptStatement("wait", word[4:], (), "", line, column)
    if word in WORDS and WORDS[word].command:
        return ScriptStatement("command", word, (), "", line, column)
    raise _unknown(word, column)


def _number(found: re.Match[str], column: int) -> ScriptValue:
    word, many = found[1], PROGRAMS if found[1] == "PRG" else SUBROUTINES
    what = "programs" if word == "PRG" else "subroutines"
    if found[2] is None:
        raise _Wrong(column + len(found[0].rstrip()), f"{word} needs a number", f"{what} are 0 to {many - 1}")
    if _long(found[2]) or not 0 <= int(found[2]) < many:
        raise _Wrong(column + found.start(2), f"no {word} {found[2]}", f"{what} are 0 to {many - 1}")
    return ScriptValue(str(int(found[2])), column + found.start(2))


def _condition(text: str, column: int, word: str) -> tuple[tuple[ScriptValue, ...], str]:
    match = _CONDITION.fullmatch(text)
    if match is None:
        hint = f"as in {word} V1<10, with one of {' '.join(COMPARISONS)}"
        raise _Wrong(column + len(text) - len(text.lstrip()), f"{word} needs a condition between two values", hint)
    return (_read(match, 1, column), _read(match, 3, column)), match[2]


def _read(found: re.Match[str], group: int, column: int, high: int = INT32[1]) -> ScriptValue:
    """A value to read: a number, or a readable register."""
    text, at = found[group], column + found.start(group)
    if text.lstrip("-").isdigit():
        return _constant(text, at, INT32[0], high)
    word = WORDS.get(text)
    if word is None:
        raise _unknown(text, at)
    if not word.readable:
        raise _Wrong(at, f"{text} cannot be read in a program")
    return ScriptValue(text, at)


def _constant(text: str, at: int, low: int, high: int) -> ScriptValue:
    if _long(text) or not low <= int(text) <= high:
        raise _Wrong(at, f"{text} is out of range", f"{low} to {high}")
    return ScriptValue(str(int(text)), at)


def _long(text: str) -> bool:
    return len(text.lstrip("-0")) > 10


def _move(text: str, line: int, column: int) -> ScriptStatement:
    axes, values = "", []
    for match in TARGET.finditer(text):
        axis, at = match[1], column + match.start()
        if axis not in AXES:
            raise _Wrong(at, f"no axis {axis}", "the axes are X and Y")
        if axis in axes or axes == "Y":
            raise _Wrong(at, "the targets of a move are X, Y, or X and then Y", "as in X1000Y2000")
        axes += axis
        if not match[2].startswith("V"):
            values.append(_constant(match[2], column + match.start(2), *INT32))
        else:
            values.append(_read(match, 2, column))
    return ScriptStatement("move", axes, tuple(values), "", line, column)


def _set(found: re.Match[str], line: int, column: int) -> ScriptStatement:
    target, at = found[1], column + found.start(1)
    word = WORDS.get(target)
    if word is None and target != "DELAY":
        raise _unknown(target, at)
    if word is not None and not word.settable:
        raise _Wrong(at, f"{target} cannot be set", "it can only be read" if word.readable else f"write {target} alone")
    source, base = _SOURCE.fullmatch(found[2]), column + found.start(2)
    if source is None:
        what = "needs a value" if not found[2].strip() else "takes a value, or one operation between two values"
        raise _Wrong(base, f"{target}= {what}", "longer sums go over several lines")
    op = source[1] or source[3] or ""
    if source[1] and source[3]:
        raise _Wrong(base + source.start(3), "one operation is the most a line holds", "~ is one of them")
    low, high = (0, 2**32 - 1) if word is None else (word.low, word.high)
    values = [_read(source, 2, base, max(high, INT32[1]))] + ([_read(source, 4, base)] if source[4] else [])
    if target[0] == "V":
        return ScriptStatement("set", target, tuple(values), op, line, column)
    if op:
        raise _Wrong(base + source.start(2), f"{target} takes no operation", f"V0={found[2].strip()}, {target}=V0")
    value = values[0]
    if value.constant is not None:
        value = _constant(value.text, value.column, low, high)
    elif value.text[0] != "V":
        hint = f"V0={value.text}, then {target}=V0"
        raise _Wrong(value.column, f"{target} takes a number or a variable; {value.text} is a register", hint)
    return ScriptStatement("delay" if word is None else "set", target, (value,), "", line, column)


def _unknown(text: str, column: int) -> _Wrong:
    first = text.split()[0] if text.split() else text
    if first.upper() != first and (first.upper() in KNOWN or first.upper()[:1] in AXES):
        return _Wrong(column, f"{first} is not all in capitals", f"write {first.upper()}")
    if (other := re.fullmatch(r"(\w+)([ZU])([+-]?)", first)) and f"{other[1]}X{other[3]}" in KNOWN:
        return _Wrong(column, f"{first}: no axis {other[2]}", "the axes are X and Y")
    if re.fullmatch(r"V\d+|SR\d+|EO\d+|D[IO]\d+|AI\d+", first):
        return _Wrong(column, f"no {first}", "V0 to V63, SR0 and SR1, EO1 and EO2, DI and DO 1 to 8, AI 1 and 2")
    if first in KNOWN and first != text:
        return _Wrong(column + len(first), f"{first} must be alone on its line", "one statement a line")
    meant = _meant(first)
    return _Wrong(column, f"unknown command {first}", f"is {meant} meant?" if meant else "")


def _meant(word: str) -> str:
    """The known word most similar to one, in capitals; empty if none is similar."""
    return next(iter(difflib.get_close_matches(word.upper(), KNOWN, 1, 0.7)), "")
