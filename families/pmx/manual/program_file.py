"""Program files of the controller (`.prg`, `.asc`): A-SCRIPT, or compiled lines; and A-SCRIPT made of compiled lines.

A file holds one or the other. A compiled line shows its place in the memory (`SAn=TOKEN`), or the lines count from 0,
the form that the maker's program copies (manual 8.1.9). A remark begins with a semicolon.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from multidrop.base.files import SourceLine, split_lines, wrong_characters
from multidrop.dialects.program_files import (
    BLANKS,
    Problem,
    check_comment,
    check_enter,
    errors,
    in_order,
    numbered,
    refuse,
    respelled,
)
from multidrop.families.pmx.manual import script_checker, script_compiler, script_parser
from multidrop.families.pmx.manual.script_compiler import EMPTY, ERASED, MEMORY_LINES
from multidrop.families.pmx.manual.script_parser import AXES, WORDS, parse

_OPERATIONS = {code: op for op, code in script_compiler.OPERATION.items()}
_COMPARISONS = {code: op for op, code in script_compiler.COMPARISON.items()}


class Undecodable(Exception):
    """Lines of another compiler: the number of the first, and its content."""

    def __init__(self, number: int, token: str) -> None:
        super().__init__(f"line {number} holds {token!r}, which this compiler never writes there")
        self.number = number


def decompile(lines: Sequence[str]) -> list[str]:
    """Decompile a program to A-SCRIPT, indented by its blocks.

    Raises Undecodable unless the program compiles to exactly these lines: nothing is guessed.
    """
    end = len(lines)
    while end and lines[end - 1] in EMPTY:
        end -= 1
    text = _ProgramReader(lines[:end]).program()
    if text:
        code = script_compiler.compile_(parse("\n".join(text))[0])
        for at, token in enumerate(lines[:end]):
            if at >= len(code.lines) or token != code.lines[at]:
                raise Undecodable(at, token)
        if wrong := errors(script_checker.check("\n".join(text))):
            at = code.source.index(wrong[0].line)
            raise Undecodable(at, lines[at])
    return text


class _ProgramReader:
    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = lines
        self.stack: list[str] = []
        self.text: list[str] = []
        self.depth = 0
        self.ends: list[tuple[int, str]] = []  # the ends of open blocks, the innermost last
        self.loops: list[int] = []  # the JW of each open WHILE

    def say(self, text: str) -> None:
        self.text.append("    " * self.depth + text)

    def program(self) -> list[str]:
        at = 0
        while at < len(self.lines):
            at = self.one(at)
        if self.ends or self.stack:
            raise Undecodable(at, "")
        return self.text

    def one(self, at: int) -> int:
        """Decompile the line `at`; return the next one."""
        compiled = script_compiler.split(self.lines[at])
        if compiled is None:
            raise Undecodable(at, self.lines[at])
        word, argument = compiled
        if word in ("CV", "VR"):
            self.stack.append(argument if word == "CV" else f"V{argument}")
        elif word in ("JI", "JW"):
            return self.condition(at, word, argument)
        elif word in ("JO", "JM-", "EI"):
            return self.leave(at, word, int(argument))
        elif word in ("PS", "SS", "GS"):
            self.mark(at, {"PS": "PRG", "SS": "SUB", "GS": "GOSUB"}[word], argument)
        elif word in ("SE", "XX"):
            if self.ends:
                raise Undecodable(at, self.lines[at])
            self.depth = 0
            self.say("ENDSUB" if word == "SE" else "END")
        elif word[-1] == "=":
            self.take(at, 0)
            self.say(f"{word[1:]}{argument}")
        elif word[0] == "&":
            self.register(at, word[1:])
        else:
            self.plain(at, word, argument)
        return at + 1

    def mark(self, at: int, word: str, argument: str) -> None:
        if word != "GOSUB":
            if self.ends:
                raise Undecodable(at, self.lines[at])
            if self.text:
                self.text.append("")
            self.depth = 0
        self.say(f"{word} {argument}")
        self.depth += word != "GOSUB"

    def take(self, at: int, many: int) -> list[str]:
        """Take the values off the stack, which must have exactly this many."""
        if len(self.stack) != many:
            raise Undecodable(at, self.lines[at])
        values, self.stack = self.stack, []
        return values

    def register(self, at: int, name: str) -> None:
        if name in script_compiler.MOVES:
            self.say("".join(axis + value for axis, value in zip(name, self.take(at, len(name)), strict=True)))
        elif WORDS[name].command:
            self.take(at, 0)
            self.say(name)
        else:
            self.stack.append(name)

    def plain(self, at: int, word: str, argument: str) -> None:
        if word == "AM":
            source, target = self.take(at, 2)
            self.say(f"{target}={source}")
        elif word == "OX":
            op = _OPERATIONS[argument]
            *values, target = self.take(at, 2 if op == "~" else 3)
            self.say(f"{target}=~{values[0]}" if op == "~" else f"{target}={values[1]}{op}{values[0]}")
        elif word == "WX":
            self.say(f"WAIT{AXES[int(argument)]}")
        elif word in ("DD", "DV"):
            self.say(f"DELAY={'V' if word == 'DV' else ''}{argument}")
        else:
            raise Undecodable(at, self.lines[at])

    def jump(self, at: int, word: str) -> int:
        compiled = script_compiler.split(self.lines[at]) if at < len(self.lines) else None
        if compiled is None or compiled[0] != word or not at < at + int(compiled[1]) < len(self.lines):
            raise Undecodable(at, self.lines[at] if at < len(self.lines) else "")
        return at + int(compiled[1])

    def end_of_if(self, at: int) -> int:
        """Find the EI0 of the IF whose JR is line `at`, by that JR or by the JO before its target."""
        target = self.jump(at, "JR")
        before = script_compiler.split(self.lines[target - 1])
        if target - 1 > at and before is not None and before[0] == "JO":
            target = self.jump(target - 1, "JO")
        return target

    def condition(self, at: int, word: str, argument: str) -> int:
        left, right = self.take(at, 2)
        text = f"{left}{_COMPARISONS[argument]}{right}"
        if word == "JW":
            self.say(f"WHILE {text}")
            self.ends.append((self.jump(at + 1, "JR") - 1, "JM-"))
            self.loops.append(at)
        elif self.text and self.text[-1].strip() == "ELSE" and self.ends[-1:] == [(self.end_of_if(at + 1), "EI")]:
            self.text[-1] = "    " * (self.depth - 1) + f"ELSEIF {text}"
            return at + 2
        else:
            self.say(f"IF {text}")
            self.ends.append((self.end_of_if(at + 1), "EI"))
        self.depth += 1
        return at + 2

    def leave(self, at: int, word: str, argument: int) -> int:
        if not self.ends or self.stack:
            raise Undecodable(at, self.lines[at])
        end, kind = self.ends[-1]
        if word == "JO" and (kind, at + argument) == ("EI", end):
            self.depth -= 1
            self.say("ELSE")
            self.depth += 1
        elif (at, word) == (end, kind):
            self.depth -= 1
            self.say("ENDIF" if word == "EI" else "ENDWHILE")
            self.ends.pop()
            if word == "JM-" and at - argument != self.loops.pop():
                raise Undecodable(at, self.lines[at])
        else:
            raise Undecodable(at, self.lines[at])
        return at + 1


# The canonical spelling of a line of A-SCRIPT: no blanks but the one before a number or a condition.


_STORED = re.compile(r"SA\d+=", re.ASCII)


def canonical(text: str) -> str:
    """Return a line in canonical spelling, without its remark. The language has no names of the user's.

    A compiled line and a line with an error stay as they are.
    """
    bare = text.partition(";")[0].strip(" \t")
    if _STORED.match(bare) or script_compiler.looks_compiled(bare):
        return bare
    statements, problems = parse(text)
    if problems or len(statements) != 1:
        return bare
    return str(statements[0])


LONGEST_COMPILED_LINE = 40
"""Characters of a compiled line, far more than the ten seen from units."""
RAW = re.compile(r"SA(\d{1,4})=(\S*)", re.ASCII)
parts = script_parser.parts
entries = script_parser.entries


def read(text: str, name: str) -> list[SourceLine]:
    refuse(check(text), name)
    return _lines(text)


def measure(text: str) -> str:
    """Describe the share of the controller's memory that a program takes. Raises Diagnostic."""
    return f"{len(compiled(read(text, 'program')))} of {MEMORY_LINES} compiled lines"


def formatted(text: str) -> str:
    """Return a program in canonical spelling. Remarks, blank lines, indents and the columns of remarks stay."""
    return respelled(text, lambda line: len(line.partition(";")[0]), canonical)


def check(text: str, product: str = "") -> list[Problem]:
    """Report every error of a program, by line; there is one product."""
    whole = split_lines(text)
    unreadable = [Problem(*place, "lines end at LF or CR LF") for place in wrong_characters(whole)]
    unreadable += check_enter(line.partition(";")[0] for line in whole)
    lines = _lines(text)
    problems = _check_raw(lines) if is_raw(lines) else script_checker.check(text)
    for number, line in enumerate(whole, 1):
        problems += check_comment(line, number, len(line.partition(";")[0]))
    wrong = {problem.line for problem in unreadable}
    return in_order([*unreadable, *(problem for problem in problems if problem.line not in wrong)])


def is_raw(lines: Sequence[SourceLine]) -> bool:
    """Whether these are compiled lines, with their places or without (then most lines, known or not)."""
    return _placed(lines) or 2 * sum(script_compiler.looks_compiled(line.text) for line in lines) > len(lines)


def _placed(lines: Sequence[SourceLine]) -> bool:
    return any(RAW.fullmatch(line.text) for line in lines)


def compiled(lines: Sequence[SourceLine]) -> list[tuple[int, int, str]]:
    """Return the lines to store: line of the file, number in memory, content.

    Raises Diagnostic for a program with errors, which `read` has reported.
    """
    if is_raw(lines):
        refuse(_check_raw(lines), "program")
        return _stored(lines)
    placed = [""] * max((line.number for line in lines), default=0)
    for line in lines:
        placed[line.number - 1] = line.text
    script = script_checker.read("\n".join(placed), "program")
    return [(source, at, token) for at, (source, token) in enumerate(zip(script.source, script.code, strict=True))]


def memory(text: str, name: str) -> list[str]:
    """Return the content of a controller's memory with this program, up to its last line. Raises Diagnostic."""
    return _held({at: token for _, at, token in compiled(read(text, name))})


def readable(lines: Iterable[str]) -> list[str]:
    """Return A-SCRIPT for listed lines `SAn=TOKEN`. Raises Undecodable where a unit's own compiler made them."""
    stored = {int(match[1]): match[2] for line in lines if (match := RAW.fullmatch(line.strip()))}
    return decompile(_held(stored))


def _held(stored: Mapping[int, str]) -> list[str]:
    return [stored.get(at, ERASED) for at in range(max(stored, default=-1) + 1)]


def _lines(text: str) -> list[SourceLine]:
    return numbered([line.partition(";")[0].strip(BLANKS) for line in split_lines(text)])


def _stored(lines: Sequence[SourceLine]) -> list[tuple[int, int, str]]:
    """Correct compiled lines: line of the file, line in memory, content."""
    if not _placed(lines):
        return [(line.number, at, line.text) for at, line in enumerate(lines)]
    rows = [(line.number, RAW.fullmatch(line.text)) for line in lines]
    return [(number, int(match[1]), match[2]) for number, match in rows if match]


def _check_raw(lines: Sequence[SourceLine]) -> list[Problem]:
    if _placed(lines):
        problems = _check_places(lines)
    else:
        problems = [
            _stray(line, "a compiled line must be alone")
            for line in lines
            if not script_compiler.looks_compiled(line.text)
        ]
        if len(lines) > MEMORY_LINES:
            what = f"there are {len(lines)} compiled lines, and the controller holds {MEMORY_LINES}"
            problems.append(Problem(lines[MEMORY_LINES].number, 1, what, "the memory ends at this line"))
    if errors(problems):
        return problems
    stored = _stored(lines)
    for number, at, token in stored:
        if len(token) > LONGEST_COMPILED_LINE or not token.isascii() or not token.isprintable():
            what = (
                f"a compiled line has {LONGEST_COMPILED_LINE} printable characters at most, and SA{at} has {len(token)}"
            )
            problems.append(Problem(number, 1, what))
    unknown = [
        (number, token) for number, _, token in stored if token not in EMPTY and script_compiler.split(token) is None
    ]
    if unknown and not problems:
        number, token = unknown[0]
        more = f", and at {len(unknown) - 1} more" if len(unknown) > 1 else ""
        hint = "a unit may know it: its codes are not public"
        problems.append(Problem(number, 1, f"the simulated controller ends in an error at {token}{more}", hint, True))
    return problems


def _check_places(lines: Sequence[SourceLine]) -> list[Problem]:
    problems: list[Problem] = []
    seen: dict[int, int] = {}
    for line in lines:
        match = RAW.fullmatch(line.text)
        if match is None:
            problems.append(_stray(line, "a file is A-SCRIPT, or lines SA0=TOKEN and so on"))
            continue
        at = int(match[1])
        if at >= MEMORY_LINES:
            problems.append(Problem(line.number, 3, f"no line {at}", f"lines are 0 to {MEMORY_LINES - 1}"))
        elif at in seen:
            problems.append(Problem(line.number, 3, f"SA{at} is already in line {seen[at]}"))
        seen.setdefault(at, line.number)
    return problems


def _stray(line: SourceLine, hint: str) -> Problem:
    text = line.text if len(line.text) <= LONGEST_COMPILED_LINE else f"{line.text[:LONGEST_COMPILED_LINE]}..."
    return Problem(line.number, 1, f"{text!r} is not a compiled line, but others are", hint)
