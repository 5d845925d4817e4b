"""Program files as people write them, made ready to be sent (MCode reference 3.3, section 9).

A file holds declarations, which are sent as they stand, a program between `PG <address>` and `PG`, and what
follows it, often `S`. A remark begins with an apostrophe or a back-quote, or with the backslash that stands for one
in some copies, and runs to the end of its line; none begins inside quotation marks. Whether the language is right is
not looked at here, only what could not be sent, or would be executed or stored where that was not meant.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from dialects.errors import Diagnostic
from dialects.files import text_of

LONGEST = 64
"""Characters that a drive's receive buffer holds (5.1.102)."""

_BREAK = re.compile(r"\r\n|\n|\r")
_REMARKS = "'`\\"
_PROGRAM = re.compile(r"PG\s*=?\s*(\w*)\Z", re.IGNORECASE | re.ASCII)


@dataclass(frozen=True)
class ProgramLine:
    """A line to send: its number in the file from 1, its text without remark, and the part it is in."""

    number: int
    text: str
    section: str
    """`variables` before the program, `program` from PG to PG, `save` after it."""


def load(path: str | Path) -> list[ProgramLine]:
    """The lines of a file, UTF-8 or Latin-1. Raises Diagnostic, also where it is no readable text."""
    return read(text_of(path), str(path))


def read(text: str, name: str) -> list[ProgramLine]:
    """The lines to send, in order; `name` is what a Diagnostic calls the file (`name:line`)."""
    stripped = [(n, bare(line)) for n, line in enumerate(_BREAK.split(text.rstrip("\x1a")), 1)]
    lines = [(n, line) for n, line in stripped if line]
    if not lines:
        raise Diagnostic("nothing to send: no line but remarks and blanks", name)
    for n, line in lines:
        _check(line, f"{name}:{n}")
    return _sections(lines, name)


def bare(line: str) -> str:
    """A line without its remark, indent and trailing blanks; tabs between words become blanks."""
    quoted = False
    kept: list[str] = []
    for character in line:
        if character == '"':
            quoted = not quoted
        elif not quoted and character in _REMARKS:
            break
        kept.append(" " if character == "\t" and not quoted else character)
    return "".join(kept).strip(" ")


def _check(line: str, where: str) -> None:
    """Raises Diagnostic for a line that cannot be sent, or that a drive would refuse whatever it says."""
    for column, character in enumerate(line, 1):
        if character < " " or "\x7f" <= character <= "\x9f":
            raise Diagnostic(f"control character 0x{ord(character):02X} at character {column}", where)
        if character > "~":
            raise Diagnostic(f"{character!r} at character {column} cannot be sent", where, "MCode is plain ASCII")
    if len(line) > LONGEST:
        raise Diagnostic(
            f"{len(line)} characters without the remark, and a drive takes {LONGEST}", where, "split the line"
        )


def _sections(lines: list[tuple[int, str]], name: str) -> list[ProgramLine]:
    """Each line with its section. Raises Diagnostic where PG and PG do not pair."""
    opened: int | None = None
    ended = 0
    inside: list[bool] = []
    for n, line in lines:
        mark = _PROGRAM.match(line)
        inside.append(opened is not None or mark is not None)
        if mark is None:
            continue
        if opened is None and not mark[1]:
            raise Diagnostic("PG without an address, and no program to end", f"{name}:{n}", "begin with PG 1")
        if opened is not None and mark[1]:
            raise Diagnostic(f"{line} inside the program of line {opened}", f"{name}:{n}", "end that with PG first")
        opened = n if opened is None else None
        ended = n
    if opened is not None:
        raise Diagnostic("PG is never ended", f"{name}:{opened}", "the program's last line is PG alone")
    if not ended:
        raise Diagnostic("holds no program", name, "a program stands between PG <address> and PG")
    return [
        ProgramLine(n, line, "program" if within else "variables" if n < ended else "save")
        for (n, line), within in zip(lines, inside, strict=True)
    ]
