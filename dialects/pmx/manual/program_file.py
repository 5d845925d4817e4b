"""Program files of the controller (`.prg`, `.asc`): A-SCRIPT, or compiled lines.

A file holds one or the other. A compiled line shows its place in the memory (`SAn=TOKEN`), or the lines count from 0,
the form that the maker's program copies (manual 8.1.9). A remark begins with a semicolon.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from multidrop.dialects.files import SourceLine, program_text_of, split_lines, wrong_characters
from multidrop.dialects.layout import respelled
from multidrop.dialects.pmx.manual import line_parts, script_checker, script_decompiler
from multidrop.dialects.pmx.manual.script_compiler import EMPTY, ERASED, LINES, looks_compiled, split
from multidrop.dialects.pmx.manual.script_parser import parse
from multidrop.dialects.problems import Problem, refuse

# The canonical spelling of a line of A-SCRIPT: no blanks but the one before a number or a condition.


_STORED = re.compile(r"SA\d+=", re.ASCII)


def canonical(text: str, names: Container[str] = ()) -> str:  # noqa: ARG001
    """Return a line in canonical spelling, without its remark. The language has no names of the user's.

    A compiled line and a line with an error stay as they are.
    """
    bare = text.partition(";")[0].strip(" \t")
    if _STORED.match(bare) or looks_compiled(bare):
        return bare
    statements, problems = parse(text)
    if problems or len(statements) != 1:
        return bare
    return str(statements[0])


LONGEST = 40
"""Characters of a compiled line, far more than the ten seen from units."""
RAW = re.compile(r"SA(\d{1,4})=(\S*)", re.ASCII)
parts = line_parts.parts
entries = line_parts.entries


@dataclass(frozen=True)
class ProgramLine:
    """A line of a file, without its remark: its number from 1, and its text."""

    number: int
    text: str


def load(path: str | Path) -> list[ProgramLine]:
    """Read the lines of a correct file. Raises Diagnostic with the first error and its place."""
    return read(program_text_of(path), str(path))


def read(text: str, name: str) -> list[ProgramLine]:
    """Read the lines of a program; `name` is the file's name in a Diagnostic."""
    refuse(check(text), name)
    return _lines(text)


def measure(text: str) -> str:
    """Describe the share of the controller's memory that a program takes. Raises Diagnostic."""
    return f"{len(compiled(read(text, 'program')))} of {LINES} compiled lines"


def formatted(text: str) -> str:
    """Return a program in canonical spelling. Remarks, blank lines, indents and the columns of remarks stay."""
    return respelled(text, lambda line: len(line.partition(";")[0]), canonical)


def check(text: str, product: str = "") -> list[Problem]:  # noqa: ARG001
    """Report every error of a program, by line; there is one product."""
    if wrong := [Problem(*place, "lines end at LF or CR LF") for place in wrong_characters(split_lines(text))]:
        return wrong
    lines = _lines(text)
    return _check_raw(lines) if is_raw(lines) else script_checker.check(text)


def is_raw(lines: Sequence[SourceLine]) -> bool:
    """Whether these are compiled lines, with their places or without (then most lines, known or not)."""
    return _placed(lines) or 2 * sum(looks_compiled(line.text) for line in lines) > len(lines)


def _placed(lines: Sequence[SourceLine]) -> bool:
    """Whether lines show their places."""
    return any(RAW.fullmatch(line.text) for line in lines)


def compiled(lines: Sequence[SourceLine]) -> list[tuple[int, int, str]]:
    """Return the lines to store: line of the file, number in memory, content.

    Raises Diagnostic for a program with errors, which `load` has reported.
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
    stored = {int(found[1]): found[2] for line in lines if (found := RAW.fullmatch(line.strip()))}
    return script_decompiler.decompile(_held(stored))


def _held(stored: Mapping[int, str]) -> list[str]:
    """The memory up to its last line."""
    return [stored.get(at, ERASED) for at in range(max(stored, default=-1) + 1)]


def _lines(text: str) -> list[ProgramLine]:
    bare = [line.partition(";")[0].strip() for line in split_lines(text)]
    return [ProgramLine(number, line) for number, line in enumerate(bare, 1) if line]


def _stored(lines: Sequence[SourceLine]) -> list[tuple[int, int, str]]:
    """Correct compiled lines: line of the file, line in memory, content."""
    if not _placed(lines):
        return [(line.number, at, line.text) for at, line in enumerate(lines)]
    found = [(line.number, RAW.fullmatch(line.text)) for line in lines]
    return [(number, int(match[1]), match[2]) for number, match in found if match]


def _check_raw(lines: Sequence[SourceLine]) -> list[Problem]:
    problems = _check_places(lines) if _placed(lines) else _check_bare(lines)
    if any(not each.warning for each in problems):
        return problems
    stored = _stored(lines)
    for number, at, token in stored:
        if len(token) > LONGEST or not token.isascii() or not token.isprintable():
            what = f"a compiled line has {LONGEST} printable characters at most, and SA{at} has {len(token)}"
            problems.append(Problem(number, 1, what))
    unknown = [(number, token) for number, _, token in stored if token not in EMPTY and split(token) is None]
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
        found = RAW.fullmatch(line.text)
        if found is None:
            problems.append(_stray(line, "a file is A-SCRIPT, or lines SA0=TOKEN and so on"))
            continue
        at = int(found[1])
        if at >= LINES:
            problems.append(Problem(line.number, 3, f"no line {at}", f"lines are 0 to {LINES - 1}"))
        elif at in seen:
            problems.append(Problem(line.number, 3, f"SA{at} is already in line {seen[at]}"))
        seen.setdefault(at, line.number)
    return problems


def _check_bare(lines: Sequence[SourceLine]) -> list[Problem]:
    problems = [_stray(line, "a compiled line must be alone") for line in lines if not looks_compiled(line.text)]
    if len(lines) > LINES:
        what = f"there are {len(lines)} compiled lines, and the controller holds {LINES}"
        problems.append(Problem(lines[LINES].number, 1, what, "the memory ends at this line"))
    return problems


def _stray(line: SourceLine, hint: str) -> Problem:
    text = line.text if len(line.text) <= LONGEST else f"{line.text[:LONGEST]}..."
    return Problem(line.number, 1, f"{text!r} is not a compiled line, but others are", hint)
