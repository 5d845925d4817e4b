"""The parts of a line of an MCode program for an editor, and the places at which a program can begin."""

from __future__ import annotations

from collections.abc import Iterator

from multidrop.dialects.mcode.manual.grammar import Token, tokens
from multidrop.dialects.mcode.manual.program_file import remark_at, scan
from multidrop.dialects.mcode.manual.table import lookup
from multidrop.dialects.mcode.manual.table_motion import MOTION
from multidrop.dialects.program_files import Entry, Part

_DECLARE = ("LB", "VA")
MOVES = frozenset(row.name for row in MOTION if row.starts and row.kind == "instruction")


def parts(line: str) -> list[Part]:
    """Return the parts of a line that differ from plain text. Never fails."""
    end = remark_at(line)
    found = list(_parts(tokens(line[:end])))
    return [*found, Part(end, len(line), "remark")] if end < len(line) else found


def _parts(found: list[Token]) -> Iterator[Part]:
    declares = bool(found) and found[0].text.upper() in _DECLARE
    for number, token in enumerate(found):
        if kind := _kind(token, number, declares):
            yield Part(token.start, token.stop, kind)


def _kind(token: Token, number: int, declares: bool) -> str:
    if token.kind == "text" or token.kind == "bad":
        return "wrong" if token.kind == "bad" or token.unclosed else "text"
    if token.kind != "word":
        return ""
    if declares and number == 1:
        return "label"
    row = lookup(token.text.upper())
    if row is None:
        return ""
    return "starts" if number == 0 and row.name in MOVES else "word"


def entries(text: str) -> list[Entry]:
    """Return the labels of the programs in a file, in order."""
    return [
        Entry(line.declares, line.number, f"EX {line.declares}")
        for line in scan(text)[0]
        if line.section == "program" and line.declares and line.text[:2].upper() == "LB"
    ]
