"""Program files of the controller (`.prg`, `.asc`): A-SCRIPT, or the compiled lines of a unit as `SAn=TOKEN`.

A file holds one or the other. A remark begins with a semicolon in both.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dialects.base import SourceLine
from dialects.errors import Diagnostic
from dialects.files import text_of
from dialects.pmx import script_check, script_code
from dialects.problems import Problem

ENDINGS = (".prg", ".asc")
LINES = script_check.LINES
LONGEST = 40
"""Characters of a compiled line, far more than the ten that units have shown."""
RAW = re.compile(r"SA(\d{1,4})=(\S*)", re.ASCII)
_BREAK = re.compile(r"\r\n|\n|\r")


@dataclass(frozen=True)
class ProgramLine:
    """A line of a file, without its remark: its number from 1, and its text."""

    number: int
    text: str


def load(path: str | Path) -> list[ProgramLine]:
    """The lines of a file that is right. Raises Diagnostic with the first thing that is wrong, and where."""
    return read(text_of(path), str(path))


def read(text: str, name: str) -> list[ProgramLine]:
    """The lines of a program; `name` is what a Diagnostic calls the file."""
    if wrong := [each for each in check(text) if not each.warning]:
        more = f" ({len(wrong) - 1} more: multidrop program check)" if len(wrong) > 1 else ""
        raise Diagnostic(wrong[0].what + more, wrong[0].where(name), wrong[0].hint)
    return _lines(text)


def check(text: str) -> list[Problem]:
    """Everything that is wrong with it, by line."""
    lines = _lines(text)
    return _check_raw(lines) if is_raw(lines) else script_check.check(text)


def is_raw(lines: Iterable[SourceLine]) -> bool:
    """Whether these are compiled lines."""
    return any(RAW.fullmatch(line.text) for line in lines)


def compiled(lines: Sequence[SourceLine]) -> list[tuple[int, int, str]]:
    """The lines to store: the line of the file, the number of the line in memory, what it holds.

    Raises Diagnostic for a program that is wrong (`load` has found that out).
    """
    if is_raw(lines):
        found = [(line.number, RAW.fullmatch(line.text)) for line in lines]
        return [(number, int(match[1]), match[2]) for number, match in found if match]
    placed = [""] * max((line.number for line in lines), default=0)
    for line in lines:
        placed[line.number - 1] = line.text
    script = script_check.read("\n".join(placed), "program")
    return [(source, at, token) for at, (source, token) in enumerate(zip(script.source, script.code, strict=True))]


def memory(text: str, name: str) -> list[str]:
    """What a controller's memory holds with this program in it, up to its last line. Raises Diagnostic."""
    stored = {at: token for _, at, token in compiled(read(text, name))}
    return [stored.get(at, script_code.ERASED) for at in range(max(stored, default=-1) + 1)]


def readable(lines: Iterable[str]) -> list[str]:
    """A-SCRIPT from lines `SAn=TOKEN` as they were listed. Raises Undecodable where a unit's own compiler made them."""
    stored = {int(found[1]): found[2] for line in lines if (found := RAW.fullmatch(line.strip()))}
    held = [stored.get(at, script_code.ERASED) for at in range(max(stored, default=-1) + 1)]
    return script_code.decompile(held)


def _lines(text: str) -> list[ProgramLine]:
    bare = [line.partition(";")[0].strip() for line in _BREAK.split(text.rstrip("\x1a"))]
    return [ProgramLine(number, line) for number, line in enumerate(bare, 1) if line]


def _check_raw(lines: Sequence[ProgramLine]) -> list[Problem]:
    problems: list[Problem] = []
    seen: dict[int, int] = {}
    for line in lines:
        found = RAW.fullmatch(line.text)
        if found is None:
            what = f"{line.text!r} is no compiled line, and others are"
            problems.append(Problem(line.number, 1, what, "a file is A-SCRIPT, or lines SA0=TOKEN and so on"))
            continue
        at, token = int(found[1]), found[2]
        if at >= LINES:
            problems.append(Problem(line.number, 3, f"there is no line {at}", f"lines are 0 to {LINES - 1}"))
        elif at in seen:
            problems.append(Problem(line.number, 3, f"SA{at} stands in line {seen[at]} already"))
        if len(token) > LONGEST or not token.isascii() or not token.isprintable():
            column = found.start(2) + 1
            what = f"a compiled line has {LONGEST} printable characters at most"
            problems.append(Problem(line.number, column, what))
        seen.setdefault(at, line.number)
    return problems
